//! A headset through which the room is seen, with planes and anchors of XR_EXT_spatial_entity: what both eyes are given, how a
//! corrected anchor moves the match, and that nobody sees the frame of reference move.

use std::fs;

use glam::DVec3;
use holopitch_tests::{
    excerpt,
    over::over,
    snapshot::{Snapshot, compare},
};
use image::RgbaImage;

use crate::{
    ALONE,
    runtime::{Head, Planes, Runtime, figures, folder, succeeded},
};

/// The room is of one colour.
const LIGHT_ROOM: [u8; 3] = [196, 188, 176];
const SEEN: (&str, &str) = ("FAKEPLANES_BLEND_MODE", "alpha");

fn start(head: Head) -> Option<Runtime> {
    let runtime = Runtime::start(folder()?, head);
    excerpt::copy_to(&runtime.shared.path().join("stream"));
    Some(runtime)
}

/// Runs the player; returns its figures and both eyes over a light table, as the compositor would lay them over the room.
fn run(
    runtime: &Runtime,
    environment: &[(&str, &str)],
    arguments: &[&str],
) -> (serde_json::Value, [RgbaImage; 2], String) {
    let at = excerpt::FRAME.to_string();
    let script = ["--frame", &at, "--json", "/mnt/out/figures.json", "--capture", "/mnt/out/eyes"];
    let environment: Vec<_> = environment.iter().copied().chain([("RUST_LOG", "info")]).collect();
    let mut player =
        runtime.player_with(Planes::Tracked, &environment, "/mnt/stream", &[&script[..], arguments].concat());
    let output = player.output().unwrap();
    succeeded(&output);
    let eye = |name: &str| {
        let path = runtime.out().join("eyes").join(name);
        let front = image::open(&path).unwrap().into_rgba8();
        fs::remove_file(path).unwrap();
        over(|_, _| LIGHT_ROOM, &front)
    };
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    (figures(&runtime.out().join("figures.json")), [eye("left.png"), eye("right.png")], told)
}

#[test]
fn both_eyes_see_the_room_around_the_match_and_its_shadow() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Still) else { return };
    let arguments = ["--place", "--exit-after-frames", "20", "--resolution-scale", "1.5"];
    let (figures, [left, right], _) = run(&runtime, &[SEEN], &arguments);
    assert_eq!(figures["plane_source"], "XR_EXT_spatial_plane_tracking");
    assert_eq!(figures["anchor"], "XR_EXT_spatial_anchor");
    assert_eq!(figures["blend_mode"], "ALPHA_BLEND");
    assert_eq!((&figures["planes"], &figures["on_a_plane"]), (&2.into(), &true.into()), "{figures}");
    assert_eq!(figures["graphics_errors"], 0);
    assert!(compare(&left, &right).worst_block > 0.1, "both eyes see the same");
    Snapshot::new("headset-room-left", left).matches_within(0.005, 0.1);
    Snapshot::new("headset-room-right", right).matches_within(0.005, 0.1);
}

/// A controller points and does not select: the table is highlighted, and the match is previewed on it.
#[test]
fn both_eyes_see_the_preview_on_the_highlighted_table() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Pointing) else { return };
    let arguments = ["--exit-after-frames", "20", "--resolution-scale", "1.5"];
    let (figures, [left, right], _) = run(&runtime, &[SEEN], &arguments);
    assert_eq!(figures["on_a_plane"], false);
    Snapshot::new("headset-preview-left", left).matches_within(0.005, 0.1);
    Snapshot::new("headset-preview-right", right).matches_within(0.005, 0.1);
}

#[test]
fn light_added_to_the_room_throws_no_shadow_and_the_log_says_so() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Still) else { return };
    let arguments = ["--place", "--exit-after-frames", "5", "--resolution-scale", "0.5"];
    let (figures, _, told) = run(&runtime, &[("FAKEPLANES_BLEND_MODE", "additive")], &arguments);
    assert_eq!(figures["blend_mode"], "ADDITIVE");
    assert!(told.contains("no shadow falls on the real table"), "{told}");
}

/// Where the match was drawn frame by frame, with the time of display in seconds.
fn places(figures: &serde_json::Value) -> Vec<(f64, DVec3)> {
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let frames = figures["trace"].as_array().unwrap().iter();
    frames
        .map(|frame| {
            let [x, y, z] = [0, 1, 2].map(|axis| number(&frame["centre_m"][axis]));
            (number(&frame["predicted_display_ns"]) * 1e-9, DVec3::new(x, y, z))
        })
        .collect()
}

/// The runtime finds that its anchor is four centimetres further: the match goes there, and never faster than half a metre
/// a second.
#[test]
fn a_corrected_anchor_moves_the_match_without_a_jump() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Still) else { return };
    let arguments = ["--place", "--trace", "--exit-after-frames", "150", "--resolution-scale", "0.3"];
    let drift = ("FAKEPLANES_ANCHOR_DRIFT", "0.04");
    let (figures, _, _) = run(&runtime, &[SEEN, drift], &arguments);
    assert_eq!(figures["anchor_corrections"], 1);
    let places = places(&figures);
    let placed = places.iter().position(|(_, place)| place.z < -0.94).unwrap();
    let (first, last) = (places[placed].1, places.last().unwrap().1);
    assert!((last - first).distance(DVec3::X * 0.04) < 1e-3, "{first} to {last}");
    for pair in places[placed..].windows(2) {
        let ((before_s, before), (after_s, after)) = (pair[0], pair[1]);
        let moved = before.distance(after);
        assert!(moved <= 0.5 * (after_s - before_s) + 1e-6, "{moved} m in {} s", after_s - before_s);
    }
}

/// The user recentres: the room's frame moves by half a metre and turns, and the pictures stay the same.
#[test]
fn nobody_sees_the_frame_of_reference_move() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Still) else { return };
    let arguments = ["--place", "--trace", "--exit-after-frames", "80", "--resolution-scale", "0.6"];
    let (quiet, [before, _], _) = run(&runtime, &[SEEN], &arguments);
    let (moved, [after, _], told) = run(&runtime, &[SEEN, ("FAKEPLANES_RECENTRE_AFTER", "60")], &arguments);
    assert_eq!((&quiet["frame_moves"], &moved["frame_moves"]), (&0.into(), &1.into()), "{told}");
    let way = places(&moved).last().unwrap().1.distance(places(&quiet).last().unwrap().1);
    assert!(way > 0.1, "the frame did not move: {way} m");
    assert_eq!(moved["anchor_corrections"], 0);
    let difference = compare(&before, &after);
    println!("{difference:?}");
    assert!(difference.mean < 0.005 && difference.worst_block < 0.1, "{difference:?}");
}
