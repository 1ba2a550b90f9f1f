//! Writes NumPy's `.npy` files (format 1.0, C order, little endian).

use std::path::Path;

use crate::SynthesisError;

/// Writes `bytes` as an array of NumPy type `kind` ("|u1", "<i2", …) and `shape`.
pub(crate) fn write(path: &Path, kind: &str, shape: &[usize], bytes: &[u8]) -> Result<(), SynthesisError> {
    let file = encode(kind, shape, bytes);
    std::fs::write(path, file).map_err(|source| SynthesisError::Io {
        path: path.to_owned(),
        doing: "write",
        source,
    })
}

fn encode(kind: &str, shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sides}), }}");
    // Magic (6), version (2), length (2), header and newline together fill whole blocks of 64 bytes.
    let padding = (64 - (10 + header.len() + 1) % 64) % 64;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.as_bytes());
    file.extend(bytes);
    file
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_data_starts_on_a_block_of_64_bytes() {
        for shape in [vec![3], vec![10, 256, 256, 3], vec![123_456, 1]] {
            let file = super::encode("|u1", &shape, &[1, 2, 3]);
            let header = u16::from_le_bytes([file[8], file[9]]) as usize;
            assert_eq!((10 + header) % 64, 0);
            assert_eq!(&file[10 + header..], &[1, 2, 3]);
        }
    }
}
