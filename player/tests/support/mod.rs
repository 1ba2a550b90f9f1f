//! A small match on disk for the tests.

use std::path::Path;

use protocol::{manifest::FILE_NAME, sample};

/// Writes a match of `frames` frames into `folder`.
pub fn write_match(folder: &Path, frames: u32) {
    let stream = sample::match_of(frames, 6).expect("the sample encodes");
    for (path, bytes) in &stream.files {
        let path = folder.join(path);
        std::fs::create_dir_all(path.parent().expect("chunks lie in folders")).expect("a folder");
        std::fs::write(path, bytes).expect("a chunk");
    }
    let manifest = stream.manifest.to_json().expect("the manifest is JSON");
    std::fs::write(folder.join(FILE_NAME), manifest).expect("the manifest");
}
