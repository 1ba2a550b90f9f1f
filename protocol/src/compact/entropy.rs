//! Whole numbers to bits: asymmetric numeral systems with one static table per context, from the `constriction` library.
//!
//! A chunk's tables are made from all its people, so that they cost little, and travel in its head.

use constriction::stream::{
    Decode, Encode,
    model::{SmallContiguousCategoricalEntropyModel, SmallContiguousLookupDecoderModel},
    stack::DefaultAnsCoder,
};

use crate::chunk::ChunkError;

/// Bits of a table's probabilities.
const PRECISION: u32 = 12;
/// The symbol that says: the value is this or larger, the rest follows in digits.
const ESCAPE: u32 = 32;
/// Symbols of a table at most.
pub(super) const SYMBOLS: usize = ESCAPE as usize + 1;
/// Digits of what an escape leaves, three bits and a mark each, at most: 30 bits.
const DIGITS: u32 = 10;
/// Contexts of geometry, of textures, and one for digits.
pub(super) const CONTEXTS: usize = 120;
/// The context of digits.
const DIGIT: u8 = (CONTEXTS - 1) as u8;

/// Numbers waiting for their tables.
#[derive(Clone, Debug, Default)]
pub(super) struct Recorder {
    symbols: Vec<(u8, u8)>,
}

impl Recorder {
    /// A number of at least 0.
    pub(super) fn push(&mut self, context: u8, value: u32) {
        self.symbols.push((context, value.min(ESCAPE) as u8));
        if value >= ESCAPE {
            let mut rest = value - ESCAPE;
            loop {
                let more = rest >> 3;
                self.symbols.push((DIGIT, ((rest & 7) | u32::from(more > 0) << 3) as u8));
                if more == 0 {
                    break;
                }
                rest = more;
            }
        }
    }

    /// A number of either sign.
    pub(super) fn push_signed(&mut self, context: u8, value: i32) {
        self.push(context, ((value << 1) ^ (value >> 31)) as u32);
    }

    /// The bits.
    pub(super) fn finish(&self, tables: &EncoderTables) -> Result<Vec<u8>, ChunkError> {
        let mut coder = DefaultAnsCoder::new();
        for &(context, symbol) in self.symbols.iter().rev() {
            let model = tables.models.get(usize::from(context)).and_then(Option::as_ref);
            let model = model.ok_or(ChunkError::Corrupt { what: "entropy table" })?;
            let coded = coder.encode_symbol(usize::from(symbol), model);
            coded.map_err(|_| ChunkError::Corrupt { what: "entropy table" })?;
        }
        let words = coder.into_compressed().unwrap_or_default();
        Ok(words.iter().flat_map(|word| word.to_le_bytes()).collect())
    }
}

/// How often each symbol of each context occurs, as shares of 4096; a context that does not occur has no shares.
pub(super) fn tables(recorders: &[&Recorder]) -> Vec<Vec<u16>> {
    let mut counts = vec![[0u64; SYMBOLS]; CONTEXTS];
    for &(context, symbol) in recorders.iter().flat_map(|recorder| &recorder.symbols) {
        counts[usize::from(context)][usize::from(symbol)] += 1;
    }
    let mut tables: Vec<Vec<u16>> = counts.iter().map(shares).collect();
    tables.truncate(tables.iter().rposition(|table| !table.is_empty()).map_or(0, |last| last + 1));
    tables
}

/// Shares of 4096 that no symbol up to the last goes without.
fn shares(counts: &[u64; SYMBOLS]) -> Vec<u16> {
    let Some(last) = counts.iter().rposition(|count| *count > 0) else { return Vec::new() };
    // A table of one symbol would have a share that does not fit.
    let used = &counts[..(last + 1).max(2)];
    let total: u64 = used.iter().sum();
    let whole = 1u64 << PRECISION;
    let free = whole - used.len() as u64;
    let mut shares: Vec<u64> = used.iter().map(|count| 1 + count * free / total).collect();
    let left = whole - shares.iter().sum::<u64>();
    if let Some(largest) = shares.iter_mut().max() {
        *largest += left;
    }
    shares.into_iter().map(|share| share as u16).collect()
}

/// Tables to write with.
pub(super) struct EncoderTables {
    models: Vec<Option<SmallContiguousCategoricalEntropyModel>>,
}

impl EncoderTables {
    pub(super) fn new(tables: &[Vec<u16>]) -> Result<Self, ChunkError> {
        let model = |table: &Vec<u16>| {
            let made =
                SmallContiguousCategoricalEntropyModel::from_nonzero_fixed_point_probabilities(table, false);
            made.map_err(|()| ChunkError::Corrupt { what: "entropy table" })
        };
        let each = tables.iter().map(|table| (!table.is_empty()).then(|| model(table)).transpose());
        Ok(Self { models: each.collect::<Result<_, _>>()? })
    }
}

/// Tables to read with.
#[derive(Debug)]
pub(super) struct DecoderTables {
    models: Vec<Option<SmallContiguousLookupDecoderModel>>,
}

impl DecoderTables {
    /// # Errors
    /// When the tables are not shares of 4096.
    pub(super) fn new(tables: &[Vec<u16>]) -> Result<Self, ChunkError> {
        let corrupt = || ChunkError::Corrupt { what: "entropy table" };
        if tables.len() > CONTEXTS {
            return Err(corrupt());
        }
        let model = |table: &Vec<u16>| {
            let sum: u64 = table.iter().map(|share| u64::from(*share)).sum();
            if table.len() < 2 || table.len() > SYMBOLS || table.contains(&0) || sum != 1 << PRECISION {
                return Err(corrupt());
            }
            SmallContiguousLookupDecoderModel::from_nonzero_fixed_point_probabilities(table, false)
                .map_err(|()| corrupt())
        };
        let each = tables.iter().map(|table| (!table.is_empty()).then(|| model(table)).transpose());
        Ok(Self { models: each.collect::<Result<_, _>>()? })
    }
}

/// Reads what a [`Recorder`] wrote.
pub(super) struct Reader<'a> {
    tables: &'a DecoderTables,
    coder: DefaultAnsCoder,
}

impl<'a> Reader<'a> {
    /// # Errors
    /// When the bytes are no whole words, or end as no coder ends them.
    pub(super) fn new(bytes: &[u8], tables: &'a DecoderTables) -> Result<Self, ChunkError> {
        let corrupt = |_| ChunkError::Corrupt { what: "entropy-coded data" };
        let (words, rest) = bytes.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(ChunkError::Corrupt { what: "entropy-coded data" });
        }
        let words = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
        Ok(Self { tables, coder: DefaultAnsCoder::from_compressed(words).map_err(corrupt)? })
    }

    fn symbol(&mut self, context: u8) -> Result<u32, ChunkError> {
        let model = self.tables.models.get(usize::from(context)).and_then(Option::as_ref);
        let model = model.ok_or(ChunkError::Corrupt { what: "entropy-coded data" })?;
        let symbol = self.coder.decode_symbol(model);
        symbol.map(|symbol| symbol as u32).map_err(|_| ChunkError::Corrupt { what: "entropy-coded data" })
    }

    /// # Errors
    /// When a table is missing or a number has too many digits.
    pub(super) fn number(&mut self, context: u8) -> Result<u32, ChunkError> {
        let symbol = self.symbol(context)?;
        if symbol < ESCAPE {
            return Ok(symbol);
        }
        let mut rest = 0;
        for digit in 0..DIGITS {
            let next = self.symbol(DIGIT)?;
            rest |= (next & 7) << (3 * digit);
            if next & 8 == 0 {
                return Ok(ESCAPE + rest);
            }
        }
        Err(ChunkError::Corrupt { what: "entropy-coded data" })
    }

    /// # Errors
    /// As [`Reader::number`].
    pub(super) fn signed(&mut self, context: u8) -> Result<i32, ChunkError> {
        let folded = self.number(context)?;
        Ok((folded >> 1) as i32 ^ -((folded & 1) as i32))
    }

    /// Whether everything was read, and nothing more.
    pub(super) fn is_done(&self) -> bool {
        self.coder.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn numbers_come_back(values in prop::collection::vec((0..DIGIT, -3_000_000..3_000_000i32), 0..300), small in prop::collection::vec((0..DIGIT, 0..40u32), 0..300)) {
            let mut recorder = Recorder::default();
            for &(context, value) in &values {
                recorder.push_signed(context, value);
            }
            for &(context, value) in &small {
                recorder.push(context, value);
            }
            let shares = tables(&[&recorder]);
            let bytes = recorder.finish(&EncoderTables::new(&shares).unwrap()).unwrap();
            let tables = DecoderTables::new(&shares).unwrap();
            let mut reader = Reader::new(&bytes, &tables).unwrap();
            for &(context, value) in &values {
                prop_assert_eq!(reader.signed(context), Ok(value));
            }
            for &(context, value) in &small {
                prop_assert_eq!(reader.number(context), Ok(value));
            }
            prop_assert!(reader.is_done());
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..80), contexts in prop::collection::vec(0..DIGIT, 0..200)) {
            let mut recorder = Recorder::default();
            (0..100).for_each(|value| recorder.push(3, value * value));
            let tables = DecoderTables::new(&tables(&[&recorder])).unwrap();
            if let Ok(mut reader) = Reader::new(&bytes, &tables) {
                for context in contexts {
                    let _ = reader.number(context);
                }
            }
        }

        #[test]
        fn any_table_is_taken_or_refused(table in prop::collection::vec(0..5000u16, 0..70)) {
            let _ = DecoderTables::new(&[table]);
        }
    }

    #[test]
    fn a_rare_symbol_costs_and_a_common_one_hardly_does() {
        let mut recorder = Recorder::default();
        (0..8000).for_each(|k| recorder.push(0, u32::from(k % 100 == 0)));
        let shares = tables(&[&recorder]);
        let bytes = recorder.finish(&EncoderTables::new(&shares).unwrap()).unwrap();
        // The entropy of one in a hundred is 0.081 bits.
        assert!((70..=100).contains(&bytes.len()), "{} bytes", bytes.len());
    }
}
