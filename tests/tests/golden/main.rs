//! Pictures of the player on a software adapter, held against the ones in `tests/goldens`.
//!
//! Needs a Vulkan driver that runs on the CPU (Debian: mesa-vulkan-drivers). Without one the tests say so and pass,
//! unless `HOLOPITCH_REQUIRE_TOOLS=1`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod eye;
mod room;

use holopitch_tests::{
    excerpt,
    snapshot::{Snapshot, compare},
};
use image::RgbaImage;
use player::{
    camera::{CameraFile, Preset, ViewCamera, turntable},
    offscreen::Offscreen,
    renderer::Guessed,
    scene::{FrameScene, Stage},
};
use protocol::{chunk::ChunkFrame, limits::Limits, pitch::Pitch, sample};

const SIZE_PX: (u32, u32) = (480, 270);
const ASPECT: f64 = 480.0 / 270.0;
const MEAN: f32 = 0.005;
const WORST_BLOCK: f32 = 0.1;

fn software_adapter() -> Option<Offscreen> {
    match Offscreen::open_software() {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            let required = std::env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
            assert!(!required, "{error}");
            println!("skipped: {error}");
            None
        }
    }
}

fn draw(gpu: &Offscreen, frame: &ChunkFrame, camera: &ViewCamera) -> RgbaImage {
    let scene = FrameScene::new(frame, &[], &Limits::default()).unwrap();
    gpu.picture(&Stage::new(Pitch::default()), &scene, camera, SIZE_PX).unwrap()
}

/// Frame 40 of the sample match.
fn frame() -> ChunkFrame {
    sample::frame_of(40, 22)
}

fn preset(preset: Preset) -> ViewCamera {
    preset.view(&Pitch::default(), frame().camera.as_ref(), ASPECT).unwrap()
}

#[test]
fn the_table_from_three_quarters() {
    let Some(gpu) = software_adapter() else { return };
    Snapshot::new("table", draw(&gpu, &frame(), &preset(Preset::Table))).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn the_broadcast_cameras_view() {
    let Some(gpu) = software_adapter() else { return };
    let drawn = draw(&gpu, &frame(), &preset(Preset::Broadcast));
    Snapshot::new("broadcast", drawn).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn behind_the_left_goal() {
    let Some(gpu) = software_adapter() else { return };
    let drawn = draw(&gpu, &frame(), &preset(Preset::GoalLeft));
    Snapshot::new("goal-left", drawn).matches_within(MEAN, WORST_BLOCK);
}

#[test]
fn two_people_and_the_ball_up_close() {
    let Some(gpu) = software_adapter() else { return };
    let ball = frame().ball.unwrap().position_m;
    let camera = CameraFile::LookAt {
        position_m: ball + glam::DVec3::new(3.0, 2.4, 7.0),
        target_m: ball + glam::DVec3::new(-0.6, 0.6, 0.0),
        vertical_fov_degrees: 26.0,
    };
    let drawn = draw(&gpu, &frame(), &camera.view(ASPECT));
    Snapshot::new("close", drawn).matches_within(MEAN, WORST_BLOCK);
}

/// What a viewer gets: players as the reconstructor made them from the demo clip, from beside the broadcast camera.
#[test]
fn reconstructed_players_up_close() {
    let Some(gpu) = software_adapter() else { return };
    let frame = excerpt::frame();
    let anchors = || frame.bodies.iter().map(|body| body.anchor_m.as_dvec3());
    let middle = anchors().sum::<glam::DVec3>() / frame.bodies.len() as f64;
    let central = anchors().min_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle))).unwrap();
    let camera = CameraFile::LookAt {
        position_m: central + glam::DVec3::new(9.0, 5.0, 14.0),
        target_m: central + glam::DVec3::Y,
        vertical_fov_degrees: 30.0,
    };
    let drawn = draw(&gpu, &frame, &camera.view(ASPECT));
    Snapshot::new("reconstructed", drawn).matches_within(MEAN, WORST_BLOCK);
}

/// A reconstructed player walked round: half of it no camera saw.
#[test]
fn a_reconstructed_player_on_a_turntable() {
    let Some(gpu) = software_adapter() else { return };
    Snapshot::new("turntable", round(&gpu, Guessed::Solid)).matches_within(MEAN, WORST_BLOCK);
    Snapshot::new("turntable-ghosted", round(&gpu, Guessed::Ghosted)).matches_within(MEAN, WORST_BLOCK);
}

fn round(gpu: &Offscreen, guessed: Guessed) -> RgbaImage {
    const VIEW_PX: (u32, u32) = (120, 160);
    let frame = excerpt::frame();
    let scene = FrameScene::new(&frame, &[], &Limits::default()).unwrap();
    let camera = frame.camera.unwrap();
    let nearest = frame
        .bodies
        .iter()
        .min_by(|a, b| camera.depth(a.anchor_m.as_dvec3()).total_cmp(&camera.depth(b.anchor_m.as_dvec3())));
    let views = turntable(nearest.unwrap().anchor_m.as_dvec3(), Some(&camera), 6, 0.75);
    let mut picture = RgbaImage::new(VIEW_PX.0 * 6, VIEW_PX.1);
    for (place, view) in views.iter().enumerate() {
        let drawn = gpu.picture_with(&Stage::new(Pitch::default()), &scene, view, guessed, VIEW_PX).unwrap();
        image::imageops::replace(&mut picture, &drawn, place as i64 * i64::from(VIEW_PX.0), 0);
    }
    picture
}

/// The bounds are worth something: a person who is missing, half a metre off, or drawn without their texture shows.
#[test]
fn the_bounds_notice_one_person_among_twenty_two() {
    let Some(gpu) = software_adapter() else { return };
    let camera = preset(Preset::Broadcast);
    let right = draw(&gpu, &frame(), &camera);
    let repeated = compare(&right, &draw(&gpu, &frame(), &camera));
    assert!(repeated.mean == 0.0, "the same picture twice differs: {repeated:?}");
    let in_view = frame().bodies.iter().position(|body| body.person.0 == 8).unwrap();
    let mut missing = frame();
    missing.bodies.remove(in_view);
    let mut moved = frame();
    moved.bodies[in_view].anchor_m.x += 0.5;
    let mut untextured = frame();
    untextured.atlas = None;
    for (what, wrong) in [("missing", missing), ("moved", moved), ("untextured", untextured)] {
        let difference = compare(&right, &draw(&gpu, &wrong, &camera));
        assert!(
            difference.mean > MEAN || difference.worst_block > WORST_BLOCK,
            "somebody {what} goes unnoticed: {difference:?}"
        );
    }
}
