//! Streams that anyone may have written: every way of breaking one ends in a typed error that names the file.

// Tests may panic: that is how they fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{fs, path::Path};

use player::scene::FrameScene;
use protocol::{
    chunk::ChunkError,
    compact,
    content::AnyChunk,
    hash::{self, HashError},
    limits::Limits,
    manifest::{FILE_NAME, Manifest, ManifestError},
    sample,
};
use reconstructor::encode::{StreamError, StreamReader, read_stream};
use serde_json::Value;

/// A good stream of two chunks on disk.
fn stream() -> (tempfile::TempDir, Manifest) {
    let folder = tempfile::tempdir().unwrap();
    let sample = sample::match_of(40, 2).unwrap();
    for (path, bytes) in &sample.files {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    fs::write(folder.path().join(FILE_NAME), sample.manifest.to_json().unwrap()).unwrap();
    (folder, sample.manifest)
}

fn failure(folder: &Path) -> StreamError {
    let error = read_stream(folder, &Limits::default()).unwrap_err();
    let message = error.to_string();
    assert!(message.contains(&folder.display().to_string()), "{message:?} does not name the file");
    assert!(!message.contains('\n'), "{message:?} is more than one line");
    error
}

/// Rewrites the manifest.
fn edit(folder: &Path, change: impl Fn(&mut Value)) {
    let path = folder.join(FILE_NAME);
    let mut document: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut document);
    fs::write(path, serde_json::to_vec(&document).unwrap()).unwrap();
}

/// Replaces chunk 1 and lets the manifest agree with it, as a hostile server would.
fn replace_chunk(folder: &Path, bytes: &[u8]) {
    fs::write(folder.join("high/00001.glb"), bytes).unwrap();
    edit(folder, |document| {
        let entry = &mut document["representations"][0]["chunks"][1];
        entry["bytes"] = bytes.len().into();
        entry["blake3"] = hash::blake3_hex(bytes).into();
    });
}

#[test]
fn the_stream_is_good_before_it_is_broken() {
    let (folder, manifest) = stream();
    let (read, chunks) = read_stream(folder.path(), &Limits::default()).unwrap();
    assert_eq!((read, chunks.len()), (manifest, 2));
}

#[test]
fn a_truncated_chunk() {
    let (folder, _) = stream();
    let path = folder.path().join("high/00001.glb");
    let bytes = fs::read(&path).unwrap();
    for keep in [0, 11, 100, bytes.len() - 1] {
        fs::write(&path, &bytes[..keep]).unwrap();
        let length =
            matches!(failure(folder.path()), StreamError::Hash { source: HashError::Length { .. }, .. });
        assert!(length, "kept {keep}");
        replace_chunk(folder.path(), &bytes[..keep]);
        assert!(matches!(failure(folder.path()), StreamError::Chunk { .. }), "kept {keep}");
        edit(folder.path(), |document| {
            document["representations"][0]["chunks"][1]["bytes"] = bytes.len().into();
        });
    }
}

#[test]
fn a_file_longer_than_promised_is_not_read_to_its_end() {
    let (folder, _) = stream();
    let path = folder.path().join("high/00001.glb");
    let file = fs::OpenOptions::new().write(true).open(&path).unwrap();
    file.set_len(1 << 36).unwrap(); // sparse
    assert!(matches!(failure(folder.path()), StreamError::Hash { source: HashError::Length { .. }, .. }));
}

#[test]
fn flipped_bits() {
    let (folder, _) = stream();
    let path = folder.path().join("high/00001.glb");
    let good = fs::read(&path).unwrap();
    for at in (0..good.len()).step_by(good.len() / 50) {
        let mut bytes = good.clone();
        bytes[at] ^= 0x10;
        fs::write(&path, &bytes).unwrap();
        assert!(matches!(
            failure(folder.path()),
            StreamError::Hash { source: HashError::Content { .. }, .. }
        ));
    }
}

#[test]
fn flipped_bits_with_a_hash_that_agrees_never_panic() {
    let (folder, _) = stream();
    let good = fs::read(folder.path().join("high/00001.glb")).unwrap();
    for at in (0..good.len()).step_by(good.len() / 200) {
        let mut bytes = good.clone();
        bytes[at] ^= 0x04;
        replace_chunk(folder.path(), &bytes);
        // A bit of a picture or of a vertex may change what is seen without breaking the form.
        if let Err(error) = read_stream(folder.path(), &Limits::default()) {
            assert!(matches!(error, StreamError::Chunk { .. } | StreamError::Times { .. }), "{error}");
        }
    }
}

#[test]
fn ten_thousand_changes_of_a_compact_chunk_reach_the_players_scene_or_an_error() {
    let good =
        compact::encode(&sample::sequence_of(0, 4, 2), sample::TIMESCALE, &compact::Quality::HIGH).unwrap();
    let limits = Limits::default();
    let mut read = 0;
    for change in 0..10_000_usize {
        let mut bytes = good.clone();
        // Strides that share no factor with the length visit every byte.
        let at = (change * 7_919) % bytes.len();
        bytes[at] = bytes[at].wrapping_add([1, 0x80, 0xFF, 0x55][change % 4]);
        let Ok(chunk) = AnyChunk::decode(&bytes, &limits) else { continue };
        read += 1;
        for index in 0..chunk.frames().len() {
            FrameScene::new(&chunk.frame(index).unwrap(), &[], &limits).unwrap();
        }
    }
    // Names and colours are not checked; nearly everything else is.
    assert!((100..5_000).contains(&read), "{read} of 10000 were read");
}

#[test]
fn lying_counts() {
    let (folder, _) = stream();
    let good = fs::read(folder.path().join("high/00001.glb")).unwrap();
    let text = String::from_utf8_lossy(&good);
    // 48 vertices per box person, as an accessor says; as many digits, so that the container stays whole.
    let at = text.find("\"count\":48,").unwrap();
    for lie in [b"47", b"49", b"99", b"00"] {
        let mut bytes = good.clone();
        bytes[at + 8..at + 10].copy_from_slice(lie);
        replace_chunk(folder.path(), &bytes);
        let error = failure(folder.path());
        assert!(matches!(error, StreamError::Chunk { .. }), "{error}");
    }
}

#[test]
fn a_chunk_of_another_time() {
    let (folder, _) = stream();
    let first = fs::read(folder.path().join("high/00000.glb")).unwrap();
    replace_chunk(folder.path(), &first);
    assert!(matches!(failure(folder.path()), StreamError::Times { .. }));
}

#[test]
fn a_missing_chunk_and_a_missing_manifest() {
    let (folder, _) = stream();
    fs::remove_file(folder.path().join("high/00001.glb")).unwrap();
    assert!(matches!(failure(folder.path()), StreamError::File(_)));
    let reader = StreamReader::open(folder.path(), &Limits::default()).unwrap();
    assert!(reader.chunk(0).is_ok(), "the rest stays readable");
    assert!(matches!(reader.chunk(2), Err(StreamError::NoChunk { index: 2, count: 2, .. })));
    fs::remove_file(folder.path().join(FILE_NAME)).unwrap();
    assert!(matches!(failure(folder.path()), StreamError::File(_)));
}

#[test]
fn a_manifest_that_reaches_outside_the_stream() {
    let (folder, _) = stream();
    for path in ["../../etc/passwd", "/etc/passwd", "high/../../x.glb"] {
        edit(folder.path(), |document| document["representations"][0]["chunks"][0]["path"] = path.into());
        let error = failure(folder.path());
        assert!(matches!(error, StreamError::Manifest { source: ManifestError::Path { .. }, .. }), "{error}");
    }
}

#[test]
fn a_manifest_from_the_future() {
    let (folder, _) = stream();
    edit(folder.path(), |document| document["version"] = "2.0".into());
    let error = failure(folder.path());
    assert!(matches!(error, StreamError::Manifest { source: ManifestError::Version { .. }, .. }), "{error}");
}

#[test]
fn a_manifest_cut_at_every_length() {
    let (folder, _) = stream();
    let path = folder.path().join(FILE_NAME);
    let bytes = fs::read(&path).unwrap();
    for keep in 0..bytes.len() - 2 {
        fs::write(&path, &bytes[..keep]).unwrap();
        assert!(matches!(failure(folder.path()), StreamError::Manifest { .. }), "kept {keep}");
    }
}

#[test]
fn limits_apply_to_folders() {
    let (folder, _) = stream();
    let tight = Limits { vertices_per_body: 10, ..Limits::default() };
    let error = read_stream(folder.path(), &tight).unwrap_err();
    assert!(matches!(error, StreamError::Chunk { source: ChunkError::Limit { .. }, .. }), "{error}");
    let tight = Limits { manifest_bytes: 50, ..Limits::default() };
    let error = read_stream(folder.path(), &tight).unwrap_err();
    assert!(matches!(error, StreamError::Manifest { source: ManifestError::Limit { .. }, .. }), "{error}");
}
