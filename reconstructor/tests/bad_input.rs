//! Bad input at the command: exit code 1, one line that says what, where and what to do; and work that goes on afterwards.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use protocol::{camera::Camera, pitch::Pitch};
use serde_json::{Value, json};
use tempfile::TempDir;

fn demo(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/demo").join(name)
}

fn required() -> bool {
    std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1")
}

/// A folder with `name` in it, made by the `ffmpeg` program; `None`, with a printed reason, when there is no such program.
fn made_by_ffmpeg(arguments: &[&str], name: &str) -> Option<(TempDir, PathBuf)> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let run = Command::new("ffmpeg").args(["-v", "error", "-y"]).args(arguments).arg(&path).output();
    match run {
        Ok(output) if output.status.success() => Some((folder, path)),
        problem => {
            assert!(!required(), "{problem:?}");
            println!("skipped: ffmpeg {arguments:?}: {problem:?}");
            None
        }
    }
}

/// Whether the networks can run here; says why when not.
fn ready() -> bool {
    let found = reconstructor::inference::initialize(None);
    if let Err(error) = &found {
        assert!(!required(), "{error}");
        println!("skipped: {error}");
    }
    found.is_ok()
}

fn reconstruct(clip: &Path, calibration: &Path, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_reconstructor"));
    command.arg("reconstruct").arg(clip).arg("--calibration").arg(calibration);
    command.arg("--out").arg(folder.join("stream")).arg("--work").arg(folder.join("work"));
    command.env("RUST_LOG", "error");
    command
}

/// The single line on standard error of a command that failed on its input.
fn complaint(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}");
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(lines.len(), 1, "{text}");
    lines[0].to_owned()
}

fn refused(clip: &Path, calibration: &Path) -> String {
    let folder = tempfile::tempdir().unwrap();
    let line = complaint(&reconstruct(clip, calibration, folder.path()).output().unwrap());
    assert!(!folder.path().join("stream/match.json").exists(), "a stream was left behind: {line}");
    line
}

fn has(line: &str, parts: &[&str]) {
    for part in parts {
        assert!(line.contains(part), "`{part}` is not in: {line}");
    }
}

#[test]
fn files_that_are_no_video() {
    let points = demo("correspondences.json");
    has(&refused(Path::new("nowhere.mp4"), &points), &["nowhere.mp4", "cannot be opened", "give"]);

    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("text.mp4");
    fs::write(&text, "not a film").unwrap();
    has(&refused(&text, &points), &["text.mp4", "not a video container", "give"]);

    if let Some((_folder, sound)) = made_by_ffmpeg(&["-f", "lavfi", "-i", "sine=duration=1"], "sound.m4a") {
        has(&refused(&sound, &points), &["sound.m4a", "no video stream", "give"]);
    }
}

#[test]
fn correspondences_that_fix_no_camera() {
    if !ready() {
        return;
    }
    let good: Value = serde_json::from_slice(&fs::read(demo("correspondences.json")).unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.json");
    let complain = |points: Value| {
        let mut file = good.clone();
        file["points"] = points;
        fs::write(&path, file.to_string()).unwrap();
        refused(&demo("clip.mp4"), &path)
    };

    let three: Vec<Value> = good["points"].as_array().unwrap().iter().take(3).cloned().collect();
    has(&complain(json!(three)), &["points.json", "4"]);

    let on_a_line: Vec<Value> = (0..5)
        .map(|i| {
            let (x, z) = (100.0 + 200.0 * f64::from(i), -20.0 + 10.0 * f64::from(i));
            json!({"name": format!("halfway line {i}"), "pixel": [x, 300.0], "world_m": [0.0, 0.0, z]})
        })
        .collect();
    has(&complain(json!(on_a_line)), &["points.json", "line"]);
}

#[test]
fn a_clip_without_a_pitch() {
    if !ready() {
        return;
    }
    let fractal = ["-f", "lavfi", "-i", "mandelbrot=size=1280x720", "-frames:v", "2", "-pix_fmt", "yuv420p"];
    if let Some((_folder, clip)) = made_by_ffmpeg(&fractal, "fractal.mp4") {
        has(&refused(&clip, &demo("correspondences.json")), &["frame 0", "no pitch in view"]);
    }
}

/// Grass and lines as `camera` sees them.
fn empty_pitch(camera: &Camera, pitch: &Pitch) -> RgbImage {
    let markings = pitch.markings();
    RgbImage::from_fn(camera.width_px, camera.height_px, |x, y| {
        let mut sum = DVec3::ZERO;
        for k in 0..16_u32 {
            let offset = (DVec2::new(f64::from(k % 4), f64::from(k / 4)) - 1.5) / 4.0;
            let ground = camera.ground_point(DVec2::new(f64::from(x), f64::from(y)) + offset);
            sum += match ground.map(|ground| DVec2::new(ground.x, ground.z)) {
                Some(place) if !pitch.contains(place, 4.0) => DVec3::new(110.0, 100.0, 120.0),
                Some(place) if markings.iter().any(|marking| marking.covers(place)) => {
                    DVec3::new(205.0, 220.0, 200.0)
                }
                Some(_) => DVec3::new(80.0, 130.0, 25.0),
                None => DVec3::new(110.0, 100.0, 120.0),
            };
        }
        Rgb((sum / 16.0).to_array().map(|v| v as u8))
    })
}

#[test]
fn a_pitch_with_nobody_on_it() {
    if !ready() {
        return;
    }
    let pitch = Pitch::default();
    let camera =
        Camera::looking_at((1280, 720), 1500.0, DVec3::new(0.0, 17.0, 70.0), DVec3::new(3.0, 0.0, -4.0));
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("pitch.png");
    empty_pitch(&camera, &pitch).save(&picture).unwrap();
    let points: Vec<Value> = [(0.0, -34.0), (0.0, -9.15), (0.0, 9.15), (-9.15, 0.0), (9.15, 0.0)]
        .iter()
        .map(|&(x, z)| {
            let world = DVec3::new(x, 0.0, z);
            json!({"name": format!("{x} {z}"), "pixel": camera.project(world).unwrap().to_array(), "world_m": world.to_array()})
        })
        .collect();
    let calibration = folder.path().join("points.json");
    let size = json!({"length_m": pitch.length_m, "width_m": pitch.width_m});
    fs::write(&calibration, json!({"frame": 0, "pitch": size, "points": points}).to_string()).unwrap();

    let loop_it = [
        "-loop",
        "1",
        "-i",
        picture.to_str().unwrap(),
        "-frames:v",
        "3",
        "-pix_fmt",
        "yuv420p",
        "-crf",
        "16",
    ];
    if let Some((_folder, clip)) = made_by_ffmpeg(&loop_it, "empty.mp4") {
        has(&refused(&clip, &calibration), &["empty.mp4", "nobody", "check"]);
    }
}

/// A limit on the size of files stands for the full disk: it needs no rights, and the write fails in the same place.
#[cfg(unix)]
#[test]
fn a_full_disk_and_what_it_leaves() {
    if !ready() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut command = reconstruct(&demo("clip.mp4"), &demo("correspondences.json"), folder.path());
    command.args(["--frames", "0..2"]);
    let mut limited = Command::new("bash");
    limited
        .args(["-c", "trap '' XFSZ; ulimit -f 60; exec \"$0\" \"$@\""])
        .arg(command.get_program())
        .args(command.get_args());
    limited.env("RUST_LOG", "error");
    let line = complaint(&limited.output().unwrap());
    has(&line, &["work", "free some space"]);
    assert!(!folder.path().join("stream/match.json").exists(), "an unfinished stream has a manifest");

    let report = folder.path().join("report.json");
    let output = command.arg("--report").arg(&report).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
    let resumed = |stage: &str| {
        let stages = report["stages"].as_array().unwrap();
        stages.iter().find(|entry| entry["stage"] == stage).unwrap()["resumed"].as_u64()
    };
    assert_eq!(
        (resumed("detection"), resumed("pose")),
        (Some(2), Some(2)),
        "what was done before is not done again"
    );
}
