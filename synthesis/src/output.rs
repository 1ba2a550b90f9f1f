//! Folders and whole files: what everything that writes here shares.

use std::{fs, io::Write, path::Path};

use crate::SynthesisError;

/// Makes a folder with all above it.
pub fn make_folder(path: &Path) -> Result<(), SynthesisError> {
    fs::create_dir_all(path).map_err(|source| SynthesisError::Io {
        path: path.to_owned(),
        doing: "create",
        source,
    })
}

/// Writes a file as a whole or not at all.
pub fn put(path: &Path, bytes: &[u8]) -> Result<(), SynthesisError> {
    let temporary = path.with_extension("partial");
    let written = fs::File::create(&temporary)
        .and_then(|mut file| file.write_all(bytes))
        .and_then(|()| fs::rename(&temporary, path));
    written.map_err(|source| SynthesisError::Io { path: path.to_owned(), doing: "write", source })
}
