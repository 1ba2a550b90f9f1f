//! Everything that a stream holds is valid glTF 2.0, by the word of Khronos' own validator.

// Tests may panic: that is how they fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use protocol::{chunk, compact, manifest::Profile, pitch::Pitch, sample};
use reconstructor::encode::{StreamHeader, StreamReader, StreamWriter};
use serde_json::Value;

/// Where `cargo xtask setup` puts npm packages.
fn node_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/setup/node")
}

/// The validator's report on every file; `None` when it is not installed and need not be.
fn validate(files: &[PathBuf]) -> Option<Vec<Value>> {
    let folder = node_folder();
    let node = Command::new("node").arg("--version").output().is_ok_and(|output| output.status.success());
    if !node || !folder.join("node_modules/gltf-validator").is_dir() {
        let reason = "no `node`, or no gltf-validator in target/setup/node: run `cargo xtask setup`";
        assert!(std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_none_or(|value| value != "1"), "{reason}");
        println!("skipped: {reason}");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/validate-gltf.mjs");
    let output = Command::new("node").arg(script).arg(folder).args(files).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(text.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

fn assert_valid(reports: &[Value]) {
    for report in reports {
        println!("{report}");
        assert_eq!(report["errors"], 0, "{report}");
    }
}

/// Writes a GLB file into `folder`.
fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn chunks_are_valid_gltf() {
    let folder = tempfile::tempdir().unwrap();
    let full = sample::chunk_of(0, 30, 5);
    let mut gaps = sample::chunk_of(30, 4, 3);
    gaps.frames[1].bodies.clear();
    gaps.frames[2].atlas = None;
    gaps.frames[3].bodies.remove(1);
    let single = sample::chunk_of(0, 1, 1);
    let empty = sample::chunk_of(0, 2, 0);
    let files: Vec<PathBuf> = [("full", full), ("gaps", gaps), ("single", single), ("empty", empty)]
        .into_iter()
        .map(|(name, content)| {
            let bytes = chunk::encode(&content, sample::TIMESCALE).unwrap();
            write(folder.path(), &format!("{name}.glb"), &bytes)
        })
        .collect();
    let Some(reports) = validate(&files) else { return };
    assert_valid(&reports);
    assert_eq!(reports.len(), 4);
    assert_eq!(reports[0]["animations"], 1);
    assert_eq!(reports[0]["triangles"], 30 * 5 * 72);
}

#[test]
fn compact_chunks_are_valid_gltf_with_a_mesh_at_rest_for_everybody() {
    let folder = tempfile::tempdir().unwrap();
    let sequence = sample::sequence_of(0, 10, 4);
    let bytes = compact::encode(&sequence, sample::TIMESCALE, &compact::Quality::HIGH).unwrap();
    let Some(reports) = validate(&[write(folder.path(), "compact.glb", &bytes)]) else { return };
    assert_valid(&reports);
    // Only what is known from outside: our extension is no error, and no warning either.
    assert_eq!(reports[0]["warnings"], 0);
    assert_eq!(reports[0]["triangles"], 4 * 72);
}

#[test]
fn the_pitch_of_a_stream_is_valid_gltf() {
    let folder = tempfile::tempdir().unwrap();
    let header = StreamHeader {
        timescale: sample::TIMESCALE,
        pitch: Pitch::default(),
        people: Vec::new(),
        segments: Vec::new(),
    };
    let mut writer = StreamWriter::create(folder.path(), &header, Profile::Plain).unwrap();
    let frame = sample::frame_of(0, 0);
    writer
        .push_frame(reconstructor::encode::StreamFrame {
            clip_frame: frame.clip_frame,
            start: frame.start,
            duration: frame.duration,
            camera: frame.camera,
            quality: frame.quality,
            ball: frame.ball,
            surfaces: Vec::new(),
        })
        .unwrap();
    writer.finish().unwrap();
    assert!(
        StreamReader::open(folder.path(), &Default::default()).unwrap().static_scene().unwrap().is_some()
    );
    let Some(reports) = validate(&[folder.path().join("static.glb")]) else { return };
    assert_valid(&reports);
    assert_eq!(reports[0]["warnings"], 0, "{}", reports[0]);
}

#[test]
fn the_validator_is_awake() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = chunk::encode(&sample::chunk_of(0, 2, 1), sample::TIMESCALE).unwrap();
    // The last accessor is a person's anchors: translations cannot have two components.
    let at = bytes.windows(6).rposition(|six| six == b"\"VEC3\"").unwrap();
    bytes[at + 4] = b'2';
    let path = write(folder.path(), "broken.glb", &bytes);
    let Some(reports) = validate(&[path]) else { return };
    println!("{}", reports[0]);
    assert_ne!(reports[0]["errors"], 0);
}
