//! Six frames of the demo clip as the reconstructor made them: players with the faults that reconstruction leaves, in a
//! few hundred kilobytes. `cargo xtask goldens --stream` makes them anew.

use std::{
    fs,
    path::{Path, PathBuf},
};

use protocol::{
    chunk::{self, ChunkFrame},
    hash,
    limits::Limits,
    manifest::{FILE_NAME, Manifest},
};

/// The frame that pictures show.
pub const FRAME: u32 = 3;

/// The folder of the stream.
#[must_use]
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/demo/excerpt")
}

/// Its frame [`FRAME`], with hashes verified.
///
/// # Panics
/// When the stream is missing or broken.
#[must_use]
pub fn frame() -> ChunkFrame {
    let read = |path: &str| {
        let path = folder().join(path);
        fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let limits = Limits::default();
    let manifest = Manifest::from_json(&read(FILE_NAME), &limits).unwrap();
    let entry = &manifest.best().expect("the excerpt has a representation").chunks[0].file;
    let bytes = read(&entry.path);
    hash::verify(&bytes, entry).unwrap();
    let frames = chunk::decode(&bytes, &limits).unwrap().frames;
    frames.into_iter().find(|frame| frame.clip_frame == FRAME).expect("the excerpt has the frame")
}

/// Copies the stream to `target`, which is made.
///
/// # Panics
/// When a file cannot be copied.
pub fn copy_to(target: &Path) {
    let manifest =
        Manifest::from_json(&fs::read(folder().join(FILE_NAME)).unwrap(), &Limits::default()).unwrap();
    let chunks = manifest.representations.iter().flat_map(|r| r.chunks.iter().map(|c| c.file.path.clone()));
    let fixed = manifest.static_scene.iter().map(|entry| entry.path.clone());
    for path in chunks.chain(fixed).chain([FILE_NAME.to_owned()]) {
        let (from, to) = (folder().join(&path), target.join(&path));
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(&from, &to)
            .unwrap_or_else(|error| panic!("{} to {}: {error}", from.display(), to.display()));
    }
}
