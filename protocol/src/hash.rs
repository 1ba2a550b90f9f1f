//! BLAKE3 fingerprints of the stream's files, as the manifest writes them.
//!
//! A file is used only after its length and its fingerprint agree with the manifest's entry for it.

use crate::manifest::FileEntry;

/// Why a file is not the one that the manifest names.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HashError {
    /// The file is shorter or longer than the manifest says.
    #[error("{path} is {actual} bytes, the manifest says {expected}: fetch it again or rebuild the stream")]
    Length {
        /// Path from the manifest.
        path: String,
        /// Bytes that the manifest promises.
        expected: u64,
        /// Bytes at hand.
        actual: u64,
    },
    /// The length is right and the content is not.
    #[error("{path} has BLAKE3 {actual}, the manifest says {expected}: fetch it again or rebuild the stream")]
    Content {
        /// Path from the manifest.
        path: String,
        /// Fingerprint that the manifest promises.
        expected: String,
        /// Fingerprint of the bytes at hand.
        actual: String,
    },
}

/// The BLAKE3 of `bytes` as 64 lower-case hexadecimal digits.
#[must_use]
pub fn blake3_hex(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Describes `bytes` as the file at `path` (relative to the manifest).
#[must_use]
pub fn entry(path: impl Into<String>, bytes: &[u8]) -> FileEntry {
    FileEntry { path: path.into(), bytes: bytes.len() as u64, blake3: blake3_hex(bytes) }
}

/// Checks that `bytes` are the file that `entry` describes.
///
/// # Errors
/// [`HashError::Length`] before anything is hashed, then [`HashError::Content`].
pub fn verify(bytes: &[u8], entry: &FileEntry) -> Result<(), HashError> {
    let actual = bytes.len() as u64;
    if actual != entry.bytes {
        return Err(HashError::Length { path: entry.path.clone(), expected: entry.bytes, actual });
    }
    let actual = blake3_hex(bytes);
    if actual != entry.blake3 {
        return Err(HashError::Content { path: entry.path.clone(), expected: entry.blake3.clone(), actual });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fingerprint_is_blake3() {
        // The published value for the empty input.
        let empty = "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262";
        assert_eq!(blake3_hex(b""), empty);
    }

    #[test]
    fn a_changed_or_cut_file_is_refused() {
        let good = entry("high/00000.glb", b"geometry");
        assert_eq!(verify(b"geometry", &good), Ok(()));
        assert!(matches!(verify(b"geometrz", &good), Err(HashError::Content { .. })));
        assert!(matches!(verify(b"geometr", &good), Err(HashError::Length { expected: 8, actual: 7, .. })));
    }
}
