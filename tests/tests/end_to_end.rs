//! The shipped clip through every stage, held against its ground truth; and bad input at the front door.

// Tests may panic: that is how they fail.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};

use protocol::{chunk::ChunkFrame, limits::Limits, manifest::Profile};
use reconstructor::{
    encode::{StreamReader, read_stream},
    evaluate::matches,
    inference,
    mesh::MeshBudget,
    pipeline::{ObserveOptions, ReconstructOptions, reconstruct},
    report::{ReconstructReport, Reporter, Stage},
    tracking::TrackingLimits,
    trajectory::Smoothing,
};

/// Frames of the demo clip that are reconstructed here: two seconds, to keep the test short.
const FRAMES: std::ops::Range<u32> = 0..50;

fn demo(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/demo").join(name)
}

/// Whether the networks can run here; says why when not, and fails where everything is required.
fn ready() -> bool {
    match inference::initialize(None) {
        Ok(()) => true,
        Err(error) => {
            let required = std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            false
        }
    }
}

fn run(out: &Path, work: &Path) -> ReconstructReport {
    let options = ReconstructOptions {
        observe: ObserveOptions {
            clip: demo("clip.mp4"),
            calibration: None,
            pitch: None,
            frames: Some(FRAMES),
            work: Some(work.to_owned()),
            tracking: TrackingLimits::default(),
            threads: 2,
        },
        out: out.to_owned(),
        profile: Profile::Compact,
        budget: MeshBudget::default(),
        smoothing: Smoothing::default(),
        overlay: Some(out.with_extension("overlay")),
    };
    reconstruct(&options, &mut Reporter::quiet()).unwrap()
}

fn frames(stream: &Path) -> Vec<ChunkFrame> {
    let (_, chunks) = read_stream(stream, &Limits::default()).unwrap();
    chunks.into_iter().flat_map(|chunk| chunk.frames).collect()
}

#[test]
fn the_demo_clip_agrees_with_its_truth() {
    if !ready() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (stream, work) = (folder.path().join("stream"), folder.path().join("work"));
    let report = run(&stream, &work);
    assert_eq!(report.cameras_solved, FRAMES.len(), "every frame has a camera");
    assert!(report.line_residual_median_px.unwrap() <= 1.0, "{:?}", report.line_residual_median_px);

    let truth: Vec<ChunkFrame> =
        frames(&demo("truth")).into_iter().filter(|frame| FRAMES.contains(&frame.clip_frame)).collect();
    let figures = matches::compare(&truth, &frames(&stream));
    println!("{}", serde_json::to_string_pretty(&figures).unwrap());
    let overlays = std::fs::read_dir(stream.with_extension("overlay")).unwrap();
    assert_eq!(overlays.count(), FRAMES.len(), "a picture with what was seen for every frame");
    assert!(figures.coverage >= 0.85, "coverage {}", figures.coverage);
    assert!(figures.false_share <= 0.10, "false share {}", figures.false_share);
    assert!(figures.position_error_median_m.unwrap() <= 0.5, "{:?}", figures.position_error_median_m);
    assert!(figures.surface_distance_median_m.unwrap() <= 0.10, "{:?}", figures.surface_distance_median_m);

    // The broadcast camera that the stream carries is the true one.
    let ours = frames(&stream);
    for (truth, ours) in truth.iter().zip(&ours) {
        assert_eq!(truth.clip_frame, ours.clip_frame);
        let (truth, ours) = (truth.camera.unwrap(), ours.camera.unwrap());
        let centre = truth.ground_point(truth.centre_px()).unwrap();
        let off_px = truth.project(centre).unwrap().distance(ours.project(centre).unwrap());
        assert!(off_px <= 3.0, "the middle of the picture is {off_px} px off");
    }

    // Again from the work folder: nothing is computed twice, and the bytes are the same.
    let first = StreamReader::open(&stream, &Limits::default()).unwrap().manifest().clone();
    let again = folder.path().join("again");
    let resumed = run(&again, &work);
    assert_eq!(StreamReader::open(&again, &Limits::default()).unwrap().manifest(), &first);
    let pose = resumed.stages.iter().find(|stage| stage.stage == Stage::Pose).unwrap();
    assert_eq!(pose.resumed, FRAMES.len(), "poses come from the work folder");
}
