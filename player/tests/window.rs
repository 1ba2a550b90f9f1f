//! The window, used by the names of its controls, as a person with a screen reader would.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::time::{Duration, Instant};

use egui_kittest::{Harness, kittest::Queryable};
use glam::DVec3;
use player::{
    app::{PlayerApp, Room},
    ar::synthetic::SyntheticRoom,
    placement::TabletopPose,
    renderer::Guessed,
    session::Session,
    source::{Location, loader::Loader},
};
use protocol::{limits::Limits, sample::FIRST_CLIP_FRAME};

/// Frames of the sample match: two chunks, the second one short.
const FRAMES: u32 = 45;

fn open(address: &str) -> Harness<'static, PlayerApp> {
    let location = Location::parse(address).unwrap();
    Harness::builder().with_size([900.0, 500.0]).build_eframe(move |context| {
        let wake = context.egui_ctx.clone();
        let loader =
            Loader::start(location.clone(), Limits::default(), move || wake.request_repaint()).unwrap();
        PlayerApp::new(context, &location, Session::new(loader))
    })
}

/// Lets the window run until `condition` holds; the threads behind it need a moment.
fn wait_for(
    harness: &mut Harness<'static, PlayerApp>,
    what: &str,
    condition: impl Fn(&Harness<'static, PlayerApp>) -> bool,
) {
    let until = Instant::now() + Duration::from_secs(30);
    loop {
        harness.step();
        if condition(harness) {
            return;
        }
        let problem = harness.state().session().problem();
        assert!(Instant::now() < until, "waited in vain for {what}; problem: {problem:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn wait_for_frame(harness: &mut Harness<'static, PlayerApp>, frame: u32) {
    let label = format!("frame {frame} of {FRAMES} · clip frame {}", FIRST_CLIP_FRAME + frame);
    wait_for(harness, &label, |harness| harness.query_by_label_contains(&label).is_some());
    let shown = harness.state().session().shown().unwrap();
    assert_eq!(shown.scene.clip_frame, FIRST_CLIP_FRAME + frame);
}

fn sample_window() -> (tempfile::TempDir, Harness<'static, PlayerApp>) {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), FRAMES);
    let mut harness = open(folder.path().to_str().unwrap());
    wait_for_frame(&mut harness, 0);
    (folder, harness)
}

#[test]
fn scrubbing_shows_the_frame_under_the_slider() {
    let (_folder, mut harness) = sample_window();
    for frame in [17, 44, 3, 31] {
        harness.get_by_label("Timeline").set_value_accesskit(f64::from(frame));
        wait_for_frame(&mut harness, frame);
    }
}

#[test]
fn steps_cross_from_chunk_to_chunk_and_stop_at_the_ends() {
    let (_folder, mut harness) = sample_window();
    harness.get_by_label("Step back").click();
    wait_for_frame(&mut harness, 0);
    harness.get_by_label("Timeline").set_value_accesskit(29.0);
    wait_for_frame(&mut harness, 29);
    harness.get_by_label("Step forward").click();
    wait_for_frame(&mut harness, 30);
    harness.get_by_label("Step back").click();
    wait_for_frame(&mut harness, 29);
    harness.get_by_label("Last frame").click();
    wait_for_frame(&mut harness, 44);
    harness.get_by_label("First frame").click();
    wait_for_frame(&mut harness, 0);
}

#[test]
fn play_turns_into_pause_and_the_match_moves() {
    let (_folder, mut harness) = sample_window();
    harness.get_by_label("Play").click();
    wait_for(&mut harness, "Pause", |harness| harness.query_by_label("Pause").is_some());
    wait_for(&mut harness, "a later frame", |harness| {
        harness.state().session().shown().is_some_and(|shown| shown.frame > 3)
    });
    // At the end it stands on the last frame and offers to play again.
    wait_for_frame(&mut harness, FRAMES - 1);
    wait_for(&mut harness, "Play", |harness| harness.query_by_label("Play").is_some());
}

#[test]
fn the_keyboard_plays_steps_and_jumps() {
    let (_folder, mut harness) = sample_window();
    harness.key_press(egui::Key::ArrowRight);
    wait_for_frame(&mut harness, 1);
    harness.key_press(egui::Key::End);
    wait_for_frame(&mut harness, FRAMES - 1);
    harness.key_press(egui::Key::ArrowLeft);
    wait_for_frame(&mut harness, FRAMES - 2);
    harness.key_press(egui::Key::Home);
    wait_for_frame(&mut harness, 0);
    harness.key_press(egui::Key::Space);
    wait_for(&mut harness, "Pause", |harness| harness.query_by_label("Pause").is_some());
}

#[test]
fn guessed_surfaces_are_chosen_by_menu_and_by_key() {
    let (_folder, mut harness) = sample_window();
    let chosen = |harness: &Harness<'static, PlayerApp>| harness.state().guessed();
    assert_eq!(chosen(&harness), Guessed::Solid);
    harness.get_by_label("Guessed surfaces").click();
    harness.run_steps(3);
    harness.get_by_label("Guessed: hidden").click();
    harness.run_steps(3);
    assert_eq!(chosen(&harness), Guessed::Hidden);
    for next in [Guessed::Solid, Guessed::Ghosted] {
        harness.key_press(egui::Key::G);
        harness.run_steps(2);
        assert_eq!(chosen(&harness), next);
    }
}

#[test]
fn a_stream_that_is_not_there_is_said_in_words() {
    let mut harness = open("no-such-stream");
    wait_for(&mut harness, "a message", |harness| {
        harness.query_by_label_contains("no-such-stream/match.json").is_some()
    });
    assert!(harness.query_by_label_contains("give the folder that holds match.json").is_some());
}

#[test]
fn a_broken_chunk_leaves_the_last_good_frame_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    support::write_match(folder.path(), FRAMES);
    let chunk = folder.path().join("high/00001.glb");
    let mut bytes = std::fs::read(&chunk).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x40;
    std::fs::write(&chunk, bytes).unwrap();
    let mut harness = open(folder.path().to_str().unwrap());
    wait_for_frame(&mut harness, 0);
    harness.get_by_label("Timeline").set_value_accesskit(40.0);
    wait_for(&mut harness, "the broken file's name", |harness| {
        harness.query_by_label_contains("00001.glb").is_some()
    });
    let shown = harness.state().session().shown().unwrap().scene.clip_frame;
    assert_eq!(shown, FIRST_CLIP_FRAME, "the last good frame stays");
    harness.get_by_label("Timeline").set_value_accesskit(12.0);
    wait_for_frame(&mut harness, 12);
    assert!(harness.query_by_label_contains("00001.glb").is_none(), "the message stays too long");
}

/// The window with a recorded room, and where a point of that room is in it.
fn room_window(
    folder: &std::path::Path,
) -> (Harness<'static, PlayerApp>, impl Fn(&Harness<'static, PlayerApp>, DVec3) -> egui::Pos2) {
    support::write_match(folder, FRAMES);
    let location = Location::parse(folder.to_str().unwrap()).unwrap();
    let drawn = SyntheticRoom::default();
    let camera = drawn.cameras()[0];
    let room = Room { picture: drawn.picture(&camera), surfaces: vec![drawn.table()], up: DVec3::Y };
    let mut harness = Harness::builder().with_size([900.0, 700.0]).build_eframe(move |context| {
        let wake = context.egui_ctx.clone();
        let loader =
            Loader::start(location.clone(), Limits::default(), move || wake.request_repaint()).unwrap();
        PlayerApp::new(context, &location, Session::new(loader)).in_room(context, room.clone())
    });
    wait_for_frame(&mut harness, 0);
    let at = move |harness: &Harness<'static, PlayerApp>, point: DVec3| {
        let rect = harness.get_by_label("Room").rect();
        let (pixel, _) = camera.project(point).unwrap();
        rect.min + egui::vec2(pixel.x as f32 / 640.0, pixel.y as f32 / 480.0) * rect.size()
    };
    (harness, at)
}

fn standing(harness: &Harness<'static, PlayerApp>) -> Option<TabletopPose> {
    harness.state().placement().unwrap().standing().map(|(pose, _)| pose)
}

#[test]
fn the_mouse_places_the_match_on_the_table_of_a_recorded_room() {
    let folder = tempfile::tempdir().unwrap();
    let (mut harness, at) = room_window(folder.path());
    assert!(harness.query_by_label("Point at a table").is_some());
    let middle = DVec3::new(-0.2, 0.74, 0.0);
    let move_to = |harness: &mut Harness<'static, PlayerApp>, point: DVec3| {
        let place = at(harness, point);
        harness.hover_at(place);
        harness.step();
        harness.step();
    };
    let button = |harness: &mut Harness<'static, PlayerApp>, point: DVec3, pressed: bool| {
        let pos = at(harness, point);
        let modifiers = egui::Modifiers::NONE;
        harness.event(egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers,
        });
        harness.step();
        harness.step();
    };
    // Pointing shows where it would stand; a click puts it there.
    move_to(&mut harness, middle);
    assert!(harness.query_by_label("Click to place the match here").is_some());
    assert!(harness.state().placement().unwrap().shown().highlighted.is_some());
    button(&mut harness, middle, true);
    button(&mut harness, middle, false);
    let placed = standing(&harness).expect("the match stands");
    assert!(placed.foot_m().distance(middle) < 0.4 && (placed.foot_m().y - 0.74).abs() < 1e-9);
    // Dragged by ten centimetres.
    button(&mut harness, middle, true);
    for step in 1..=5 {
        move_to(&mut harness, middle + DVec3::X * 0.02 * f64::from(step));
    }
    button(&mut harness, middle + DVec3::X * 0.1, false);
    let moved = standing(&harness).unwrap().foot_m() - placed.foot_m();
    assert!(moved.distance(DVec3::X * 0.1) < 0.005, "moved by {moved}");
    // Turned and scaled by the buttons and the wheel.
    harness.get_by_label("Turn left").click();
    harness.step();
    harness.step();
    assert!(standing(&harness).unwrap().orientation.angle_between(placed.orientation) > 0.2);
    move_to(&mut harness, middle);
    harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, -50.0),
        modifiers: egui::Modifiers::NONE,
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Wheel,
    });
    for _ in 0..20 {
        harness.step();
    }
    assert!(standing(&harness).unwrap().scale < placed.scale * 0.99, "the wheel scales");
    // Escape lifts it off again.
    harness.key_press(egui::Key::Escape);
    harness.step();
    harness.step();
    assert!(standing(&harness).is_none());
    assert!(harness.query_by_label("Click to place the match here").is_some());
}
