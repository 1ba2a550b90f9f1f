//! Reads the packed arrays that `training/bake_people.py` writes: magic, JSON header, little-endian arrays.
//! Every length is checked against the bytes at hand before anything is allocated.

use serde::{Deserialize, de::DeserializeOwned};
use std::collections::BTreeMap;

use crate::SynthesisError;

/// Where one array lies in the file.
#[derive(Clone, Debug, Deserialize)]
struct ArrayEntry {
    #[serde(rename = "type")]
    kind: String,
    shape: Vec<usize>,
    offset: usize,
}

#[derive(Deserialize)]
struct Header<H> {
    #[serde(flatten)]
    own: H,
    arrays: BTreeMap<String, ArrayEntry>,
}

/// A packed file: its own header and its arrays by name.
#[derive(Debug)]
pub(crate) struct Packed<'a, H> {
    /// What the file says about itself.
    pub header: H,
    arrays: BTreeMap<String, ArrayEntry>,
    data: &'a [u8],
}

impl<'a, H: DeserializeOwned> Packed<'a, H> {
    /// Reads the header of `bytes`; `what` names the file in messages.
    pub fn read(bytes: &'a [u8], magic: &[u8; 8], what: &str) -> Result<Self, SynthesisError> {
        let broken =
            |reason: &str| SynthesisError::Asset { what: what.to_owned(), reason: reason.to_owned() };
        if bytes.get(..8) != Some(magic.as_slice()) {
            return Err(broken("it does not start with the expected magic; bake it again"));
        }
        let length = bytes.get(8..12).and_then(|b| <[u8; 4]>::try_from(b).ok()).map(u32::from_le_bytes);
        let length = length.ok_or_else(|| broken("it ends inside the header length"))? as usize;
        let text = bytes.get(12..12 + length).ok_or_else(|| broken("it ends inside the header"))?;
        let data = bytes.get(12 + length..).unwrap_or_default();
        let header: Header<H> =
            serde_json::from_slice(text).map_err(|error| broken(&format!("its header: {error}")))?;
        Ok(Self { header: header.own, arrays: header.arrays, data })
    }

    /// The bytes of the array `name`, which must be of type `kind` with rows of `columns` values, and its row count.
    fn array(&self, name: &str, kind: &str, columns: usize, size: usize) -> Result<&'a [u8], SynthesisError> {
        let broken = |reason: String| SynthesisError::Asset { what: format!("array `{name}`"), reason };
        let entry = self.arrays.get(name).ok_or_else(|| broken("it is missing".to_owned()))?;
        let per_row = entry.shape.iter().skip(1).try_fold(1usize, |a, &b| a.checked_mul(b));
        if entry.kind != kind || per_row != Some(columns) {
            return Err(broken(format!(
                "it is {} {:?}, not rows of {columns} {kind}",
                entry.kind, entry.shape
            )));
        }
        let rows = entry.shape.first().copied().unwrap_or(0);
        rows.checked_mul(columns * size)
            .and_then(|bytes| entry.offset.checked_add(bytes))
            .and_then(|end| self.data.get(entry.offset..end))
            .ok_or_else(|| broken("it reaches past the end of the file".to_owned()))
    }

    /// Rows of `N` unsigned bytes.
    pub fn u8_rows<const N: usize>(&self, name: &str) -> Result<Vec<[u8; N]>, SynthesisError> {
        let bytes = self.array(name, "uint8", N, 1)?;
        Ok(bytes.as_chunks::<N>().0.to_vec())
    }

    /// Rows of `N` unsigned 16-bit numbers.
    pub fn u16_rows<const N: usize>(&self, name: &str) -> Result<Vec<[u16; N]>, SynthesisError> {
        let bytes = self.array(name, "uint16", N, 2)?;
        let values: Vec<u16> = bytes.as_chunks::<2>().0.iter().map(|&b| u16::from_le_bytes(b)).collect();
        Ok(values.as_chunks::<N>().0.to_vec())
    }

    /// Rows of `N` signed 16-bit numbers.
    pub fn i16_rows<const N: usize>(&self, name: &str) -> Result<Vec<[i16; N]>, SynthesisError> {
        let bytes = self.array(name, "int16", N, 2)?;
        let values: Vec<i16> = bytes.as_chunks::<2>().0.iter().map(|&b| i16::from_le_bytes(b)).collect();
        Ok(values.as_chunks::<N>().0.to_vec())
    }

    /// Rows of `N` 32-bit floats.
    pub fn f32_rows<const N: usize>(&self, name: &str) -> Result<Vec<[f32; N]>, SynthesisError> {
        let bytes = self.array(name, "float32", N, 4)?;
        let values: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
        Ok(values.as_chunks::<N>().0.to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Empty {}

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"HPTEST1\0".to_vec();
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn an_array_that_reaches_past_the_end_is_refused() {
        let header = r#"{"arrays":{"a":{"type":"uint8","shape":[3,2],"offset":0}}}"#;
        let good = file(header, &[1, 2, 3, 4, 5, 6]);
        let packed = Packed::<Empty>::read(&good, b"HPTEST1\0", "test").unwrap();
        assert_eq!(packed.u8_rows::<2>("a").unwrap(), vec![[1, 2], [3, 4], [5, 6]]);
        let short = file(header, &[1, 2, 3]);
        let packed = Packed::<Empty>::read(&short, b"HPTEST1\0", "test").unwrap();
        assert!(packed.u8_rows::<2>("a").is_err());
        assert!(packed.u8_rows::<3>("a").is_err());
        assert!(Packed::<Empty>::read(&good[..20], b"HPTEST1\0", "test").is_err());
    }
}
