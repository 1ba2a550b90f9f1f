//! Reads one sample at a time out of NumPy's `.npy` arrays: C order, unsigned bytes or little-endian 16-bit integers.
//!
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>. The first axis counts samples, so an
//! array of any length needs the memory of one sample.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

const MAGIC: &[u8] = b"\x93NUMPY";
/// Headers are about 100 bytes; what is longer is no array of ours.
const MOST_HEADER_BYTES: usize = 4096;
/// Most bytes of one sample.
const MOST_SAMPLE_BYTES: u64 = 1 << 26;

/// Why an array cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum NpyError {
    /// The file system refused.
    #[error("{}: cannot read at byte {at}: {source}; make the data set again", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Where in it.
        at: u64,
        /// What the system said.
        source: std::io::Error,
    },
    /// The header is none, or one of a kind that is not read here.
    #[error("{}: {reason}; make the data set again", .path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// There is no such sample.
    #[error("{}: sample {index} asked for, {samples} there; make the data set again", .path.display())]
    OutOfRange {
        /// The file.
        path: PathBuf,
        /// Which was asked for.
        index: usize,
        /// How many there are.
        samples: usize,
    },
}

/// Type of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NpyType {
    /// Unsigned bytes, `|u1`.
    U8,
    /// Signed 16-bit integers, little-endian, `<i2`.
    I16,
}

impl NpyType {
    fn bytes(self) -> u64 {
        match self {
            Self::U8 => 1,
            Self::I16 => 2,
        }
    }
}

/// An array on disk whose samples are read one by one.
#[derive(Debug)]
pub struct NpyFile {
    path: PathBuf,
    file: File,
    data_start: u64,
    samples: usize,
    numbers: usize,
    kind: NpyType,
}

impl NpyFile {
    /// Opens an array of `kind` whose samples have the shape `sample_shape`.
    ///
    /// # Errors
    /// [`NpyError::Io`]; [`NpyError::Header`] when it is no array, or of another type or shape.
    pub fn open(path: &Path, kind: NpyType, sample_shape: &[usize]) -> Result<Self, NpyError> {
        let io = |source| NpyError::Io { path: path.to_path_buf(), at: 0, source };
        let refuse = |reason: String| NpyError::Header { path: path.to_path_buf(), reason };
        let mut file = File::open(path).map_err(io)?;
        let mut start = [0; 10];
        file.read_exact(&mut start).map_err(io)?;
        if !start.starts_with(MAGIC) || start[6] != 1 {
            return Err(refuse("not a NumPy array of format version 1".into()));
        }
        let length = usize::from(u16::from_le_bytes([start[8], start[9]]));
        if length > MOST_HEADER_BYTES {
            return Err(refuse(format!("a header of {length} bytes, {MOST_HEADER_BYTES} at most expected")));
        }
        let mut text = vec![0; length];
        file.read_exact(&mut text).map_err(io)?;
        let header = Header::parse(&String::from_utf8_lossy(&text)).map_err(refuse)?;
        let (samples, shape) =
            header.shape.split_first().ok_or_else(|| refuse("an array of no dimension".into()))?;
        if header.kind != kind || shape != sample_shape {
            return Err(refuse(format!(
                "{kind:?} of N × {sample_shape:?} expected, found {:?} of N × {shape:?}",
                header.kind
            )));
        }
        let numbers = shape.iter().try_fold(1usize, |n, &d| n.checked_mul(d)).unwrap_or(usize::MAX);
        let bytes = (numbers as u64).checked_mul(kind.bytes()).filter(|&b| b <= MOST_SAMPLE_BYTES);
        if bytes.is_none() {
            return Err(refuse(format!("samples of more than {MOST_SAMPLE_BYTES} bytes")));
        }
        Ok(Self {
            path: path.to_path_buf(),
            file,
            data_start: 10 + length as u64,
            samples: *samples,
            numbers,
            kind,
        })
    }

    /// How many samples the array says it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.samples
    }

    /// Whether it has none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples == 0
    }

    /// The bytes of one sample as they lie in the file.
    ///
    /// # Errors
    /// [`NpyError::OutOfRange`]; [`NpyError::Io`] when the file ends before its header says.
    pub fn sample(&mut self, index: usize) -> Result<Vec<u8>, NpyError> {
        if index >= self.samples {
            return Err(NpyError::OutOfRange { path: self.path.clone(), index, samples: self.samples });
        }
        let bytes = self.numbers as u64 * self.kind.bytes();
        let at = self.data_start.saturating_add(bytes.saturating_mul(index as u64));
        let mut data = vec![0; bytes as usize];
        self.file
            .seek(SeekFrom::Start(at))
            .and_then(|_| self.file.read_exact(&mut data))
            .map_err(|source| NpyError::Io { path: self.path.clone(), at, source })?;
        Ok(data)
    }
}

/// What the text of a header says.
struct Header {
    kind: NpyType,
    shape: Vec<usize>,
}

impl Header {
    /// `{'descr': '|u1', 'fortran_order': False, 'shape': (3, 4), }`
    fn parse(text: &str) -> Result<Self, String> {
        let after = |key: &str| {
            let (_, rest) = text.split_once(key)?;
            rest.split_once(':').map(|(_, value)| value.trim_start())
        };
        let missing = |key: &str| format!("no {key} in the header");
        let kind = match after("'descr'").ok_or_else(|| missing("descr"))? {
            value if value.starts_with("'|u1'") => NpyType::U8,
            value if value.starts_with("'<i2'") => NpyType::I16,
            value => {
                return Err(format!("type {} is not read here", value.chars().take(8).collect::<String>()));
            }
        };
        if !after("'fortran_order'").ok_or_else(|| missing("fortran_order"))?.starts_with("False") {
            return Err("columns come before rows".into());
        }
        let shape = after("'shape'").ok_or_else(|| missing("shape"))?;
        let inside =
            shape.strip_prefix('(').and_then(|s| s.split_once(')')).ok_or_else(|| missing("shape"))?.0;
        let shape = inside
            .split(',')
            .map(str::trim)
            .filter(|s| !s.is_empty())
            .map(|s| s.parse().map_err(|_| format!("{s} is no length")))
            .collect::<Result<_, _>>()?;
        Ok(Self { kind, shape })
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use proptest::prelude::*;

    use super::*;

    fn array(header: &str, data: &[u8]) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(b"\x93NUMPY\x01\x00").unwrap();
        file.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
        file.write_all(header.as_bytes()).unwrap();
        file.write_all(data).unwrap();
        file
    }

    #[test]
    fn samples_are_read_where_they_lie() {
        let file = array(
            "{'descr': '<i2', 'fortran_order': False, 'shape': (3, 2), }\n",
            &[1, 0, 2, 0, 3, 0, 4, 0, 5, 0, 6, 1],
        );
        let mut npy = NpyFile::open(file.path(), NpyType::I16, &[2]).unwrap();
        assert_eq!((npy.len(), npy.is_empty()), (3, false));
        assert_eq!(npy.sample(2).unwrap(), [5, 0, 6, 1]);
        assert_eq!(npy.sample(0).unwrap(), [1, 0, 2, 0]);
        assert!(matches!(npy.sample(3), Err(NpyError::OutOfRange { index: 3, samples: 3, .. })));
    }

    #[test]
    fn a_file_shorter_than_its_header_says_is_an_error() {
        let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (18446744073709551615, 4), }\n";
        let mut npy = NpyFile::open(array(header, &[1, 2, 3, 4]).path(), NpyType::U8, &[4]).unwrap();
        assert_eq!(npy.sample(0).unwrap(), [1, 2, 3, 4]);
        assert!(matches!(npy.sample(1), Err(NpyError::Io { .. })));
        assert!(matches!(npy.sample(usize::MAX - 1), Err(NpyError::Io { .. })));
    }

    #[test]
    fn other_types_orders_and_shapes_are_refused() {
        for header in [
            "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }",
            "{'descr': '|u1', 'fortran_order': True, 'shape': (3, 4), }",
            "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 5), }",
            "{'descr': '|u1', 'fortran_order': False, 'shape': (), }",
            "{'descr': '|u1', 'fortran_order': False, 'shape': (x, 4), }",
            "{}",
        ] {
            let refused = NpyFile::open(array(header, &[]).path(), NpyType::U8, &[4]);
            assert!(matches!(refused, Err(NpyError::Header { .. })), "{header}");
        }
    }

    proptest! {
        #[test]
        fn any_header_text_is_read_or_refused(text in ".{0,200}") {
            let _ = Header::parse(&text);
            let _ = Header::parse(&format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({text})"));
        }
    }
}
