//! The GLB 2.0 container: a JSON chunk and a binary chunk in one file.
//!
//! Reading borrows from the file and trusts none of its lengths.

/// `glTF`, little-endian.
const MAGIC: u32 = 0x4654_6C67;
/// The container version that glTF 2.0 defines.
const VERSION: u32 = 2;
/// Type of the JSON chunk: `JSON`.
const JSON: u32 = 0x4E4F_534A;
/// Type of the binary chunk: `BIN\0`.
const BIN: u32 = 0x004E_4942;
/// Bytes before the first chunk.
const HEADER_BYTES: usize = 12;

/// Why bytes are not a GLB file, or a GLB file cannot be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GlbError {
    /// Cut off.
    #[error("the GLB file ends at byte {at} inside {inside}: it was cut off, fetch it again")]
    Truncated {
        /// Length of the file.
        at: usize,
        /// What should have gone on.
        inside: &'static str,
    },
    /// Some other kind of file.
    #[error("the file does not begin as a GLB 2.0 file (magic {magic:#010x}, version {version})")]
    NotGlb {
        /// The first word.
        magic: u32,
        /// The second word.
        version: u32,
    },
    /// The length in the header differs from the length at hand.
    #[error("the GLB header says {declared} bytes and the file has {actual}")]
    Length {
        /// In the header.
        declared: usize,
        /// At hand.
        actual: usize,
    },
    /// The first chunk must be JSON, the second binary.
    #[error("the GLB file has a chunk of type {found:#010x} at byte {at} where {expected} belongs")]
    ChunkType {
        /// Type found.
        found: u32,
        /// Byte of the chunk header.
        at: usize,
        /// What belongs there.
        expected: &'static str,
    },
    /// The document cannot be written as JSON.
    #[error("the glTF document cannot be written as JSON: {message}")]
    Json {
        /// What the serialiser said.
        message: String,
    },
    /// More than the container can say.
    #[error("{bytes} bytes do not fit a GLB file (at most 4 GiB): use shorter chunks")]
    TooLarge {
        /// Bytes asked for.
        bytes: usize,
    },
}

/// The two parts of a GLB file, borrowed from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Glb<'a> {
    /// The glTF document.
    pub json: &'a [u8],
    /// Buffer 0; empty when the file has none. May end in up to three bytes of padding.
    pub bin: &'a [u8],
}

impl<'a> Glb<'a> {
    /// Splits a GLB file. Chunks of unknown type after the second are skipped, as glTF 2.0 asks.
    ///
    /// # Errors
    /// When the file is not GLB 2.0, its lengths disagree, or it is cut off.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, GlbError> {
        let magic = word(bytes, 0, "the header")?;
        let version = word(bytes, 4, "the header")?;
        if magic != MAGIC || version != VERSION {
            return Err(GlbError::NotGlb { magic, version });
        }
        let declared = word(bytes, 8, "the header")? as usize;
        if declared != bytes.len() {
            return Err(GlbError::Length { declared, actual: bytes.len() });
        }
        let (json, mut at) = chunk(bytes, HEADER_BYTES, JSON, "JSON")?;
        let mut bin: &[u8] = &[];
        if at < bytes.len() {
            (bin, at) = chunk(bytes, at, BIN, "BIN")?;
        }
        while at < bytes.len() {
            let length = word(bytes, at, "a chunk header")? as usize;
            word(bytes, at + 4, "a chunk header")?;
            at = body(bytes, at + 8, length, "an extra chunk")?.1;
        }
        Ok(Self { json, bin })
    }

    /// Writes a GLB file; the parts are padded to four bytes (JSON with spaces, binary with zeros).
    ///
    /// # Errors
    /// When the file would pass 4 GiB.
    pub fn write(&self) -> Result<Vec<u8>, GlbError> {
        let padded = |length: usize| length.next_multiple_of(4);
        let bin_bytes = if self.bin.is_empty() { 0 } else { 8 + padded(self.bin.len()) };
        let total = HEADER_BYTES + 8 + padded(self.json.len()) + bin_bytes;
        let total_word = u32::try_from(total).map_err(|_| GlbError::TooLarge { bytes: total })?;
        let mut out = Vec::with_capacity(total);
        for value in [MAGIC, VERSION, total_word] {
            out.extend_from_slice(&value.to_le_bytes());
        }
        let mut push = |kind: u32, data: &[u8], filler: u8| {
            // Fits: `total` fits in 32 bits and is larger.
            out.extend_from_slice(&(padded(data.len()) as u32).to_le_bytes());
            out.extend_from_slice(&kind.to_le_bytes());
            out.extend_from_slice(data);
            out.resize(out.len().next_multiple_of(4), filler);
        };
        push(JSON, self.json, b' ');
        if !self.bin.is_empty() {
            push(BIN, self.bin, 0);
        }
        Ok(out)
    }
}

/// The little-endian word at byte `at`.
fn word(bytes: &[u8], at: usize, inside: &'static str) -> Result<u32, GlbError> {
    let (four, _) = body(bytes, at, 4, inside)?;
    let mut word = [0; 4];
    word.copy_from_slice(four);
    Ok(u32::from_le_bytes(word))
}

/// The chunk whose header is at byte `at`, and where the next one starts.
fn chunk<'a>(
    bytes: &'a [u8],
    at: usize,
    kind: u32,
    name: &'static str,
) -> Result<(&'a [u8], usize), GlbError> {
    let length = word(bytes, at, "a chunk header")? as usize;
    let found = word(bytes, at + 4, "a chunk header")?;
    if found != kind {
        return Err(GlbError::ChunkType { found, at, expected: name });
    }
    body(bytes, at + 8, length, name)
}

/// `length` bytes from byte `at`, and where they end.
fn body<'a>(
    bytes: &'a [u8],
    at: usize,
    length: usize,
    inside: &'static str,
) -> Result<(&'a [u8], usize), GlbError> {
    let truncated = GlbError::Truncated { at: bytes.len(), inside };
    let Some(end) = at.checked_add(length) else { return Err(truncated) };
    bytes.get(at..end).map(|slice| (slice, end)).ok_or(truncated)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_cut_of_a_file_is_an_error() {
        let file = Glb { json: b"{\"asset\":{}}", bin: &[1, 2, 3, 4, 5] }.write().unwrap();
        assert!(Glb::parse(&file).is_ok());
        for end in 0..file.len() {
            assert!(Glb::parse(&file[..end]).is_err(), "a file cut at byte {end} was accepted");
        }
    }

    #[test]
    fn a_wrong_version_and_a_wrong_order_are_named() {
        let mut file = Glb { json: b"{}  ", bin: &[] }.write().unwrap();
        file[4] = 1;
        assert!(matches!(Glb::parse(&file), Err(GlbError::NotGlb { version: 1, .. })));
        file[4] = 2;
        file[16..20].copy_from_slice(&BIN.to_le_bytes());
        assert!(matches!(Glb::parse(&file), Err(GlbError::ChunkType { found: BIN, at: 12, .. })));
    }

    proptest! {
        #[test]
        fn parts_come_back(json in "[ -~]{1,40}", bin in proptest::collection::vec(any::<u8>(), 0..40)) {
            let file = Glb { json: json.as_bytes(), bin: &bin }.write().unwrap();
            prop_assert_eq!(file.len() % 4, 0);
            let back = Glb::parse(&file).unwrap();
            prop_assert_eq!(std::str::from_utf8(back.json).unwrap().trim_end(), json.trim_end());
            prop_assert_eq!(&back.bin[..bin.len()], &bin[..]);
            prop_assert!(back.bin[bin.len()..].iter().all(|&b| b == 0) && back.bin.len() < bin.len() + 4);
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = Glb::parse(&bytes);
        }
    }
}
