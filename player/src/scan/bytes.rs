//! Numbers and lines out of a byte slice, never past its end.

use super::error::Problem;

/// Order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Endian {
    Little,
    Big,
}

/// A scalar as PCD and PLY store it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes of one value.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The value at the start of `bytes`; `None` when they are too few.
    pub(super) fn read(self, bytes: &[u8], endian: Endian) -> Option<f64> {
        let mut raw = [0_u8; 8];
        let size = self.size();
        raw.get_mut(..size)?.copy_from_slice(bytes.get(..size)?);
        if endian == Endian::Big {
            raw.get_mut(..size)?.reverse();
        }
        let [a, b, c, d, ..] = raw;
        let wide = u64::from_le_bytes(raw);
        Some(match self {
            Self::I8 => f64::from(a.cast_signed()),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::I64 => wide.cast_signed() as f64,
            Self::U64 => wide as f64,
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(raw),
        })
    }
}

/// Reads a file from front to back.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 0 }
    }

    /// What has not been read yet.
    pub(super) fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Number of the byte that comes next.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// The next line without its end, as text; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Result<Option<&'a str>, Problem> {
        let rest = self.rest();
        if rest.is_empty() {
            return Ok(None);
        }
        let length = rest.iter().position(|&byte| byte == b'\n');
        let line = rest.get(..length.unwrap_or(rest.len())).unwrap_or_default();
        self.at += length.map_or(rest.len(), |length| length + 1);
        self.line += 1;
        std::str::from_utf8(line)
            .map(|line| Some(line.trim_end_matches('\r')))
            .map_err(|_| Problem::at(self.here(), "not text"))
    }

    /// "line 12", the one read last.
    pub(super) fn here(&self) -> String {
        format!("line {}", self.line)
    }

    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], Problem> {
        let rest = self.rest();
        let taken = rest.get(..count).ok_or_else(|| {
            Problem::at(
                format!("byte {}", self.at),
                format!("{count} bytes expected, {} left: the file is cut short", rest.len()),
            )
        })?;
        self.at += count;
        Ok(taken)
    }

    /// The next number.
    pub(super) fn scalar(&mut self, scalar: Scalar, endian: Endian) -> Result<f64, Problem> {
        let place = self.at;
        let bytes = self.take(scalar.size())?;
        scalar.read(bytes, endian).ok_or_else(|| Problem::at(format!("byte {place}"), "no number"))
    }
}
