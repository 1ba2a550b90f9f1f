//! The player on an OpenXR runtime without a headset: both eyes' pictures, the cost of a frame, a table from the runtime's
//! planes, a lost session, a stalled server.
//!
//! Needs the folder that `cargo xtask setup` makes as root; without it the tests say so and pass.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod real_room;
mod runtime;
mod stalling_server;

use std::{fs, path::Path, sync::Mutex, thread, time::Duration};

use holopitch_tests::{
    excerpt,
    snapshot::{self, Snapshot},
};
use protocol::{manifest::FILE_NAME, sample};
use runtime::{Head, Planes, Runtime, figures, folder, succeeded, wait_for};

/// One runtime at a time: the machine has few processors, and times are measured.
static ALONE: Mutex<()> = Mutex::new(());

fn write_match(folder: &Path, frames: u32) {
    let stream = sample::match_of(frames, 22).unwrap();
    for (path, bytes) in &stream.files {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    fs::write(folder.join(FILE_NAME), stream.manifest.to_json().unwrap()).unwrap();
}

fn start(head: Head, frames: u32) -> Option<Runtime> {
    let runtime = Runtime::start(folder()?, head);
    write_match(&runtime.shared.path().join("stream"), frames);
    Some(runtime)
}

/// The same head and the same frame of the demo stream give the same pictures, on the table that the layer invents.
#[test]
fn both_eyes_see_the_match_on_the_runtimes_table() {
    let _alone = ALONE.lock();
    let Some(runtime) = folder().map(|root| Runtime::start(root, Head::Still)) else { return };
    excerpt::copy_to(&runtime.shared.path().join("stream"));
    let at = excerpt::FRAME.to_string();
    let arguments = ["--frame", &at, "--place", "--exit-after-frames", "20", "--resolution-scale", "1.5"];
    let script = ["--capture", "/mnt/out/eyes", "--json", "/mnt/out/figures.json"];
    succeeded(&runtime.player("/mnt/stream", &[&arguments[..], &script].concat()).output().unwrap());
    let figures = figures(&runtime.out().join("figures.json"));
    assert_eq!(figures["plane_source"], "XR_EXT_plane_detection");
    assert_eq!(figures["anchor"], "STAGE");
    assert_eq!((&figures["planes"], &figures["on_a_plane"]), (&2.into(), &true.into()), "{figures}");
    let eye = |name: &str| image::open(runtime.out().join("eyes").join(name)).unwrap().into_rgba8();
    let (left, right) = (eye("left.png"), eye("right.png"));
    let apart = snapshot::compare(&left, &right);
    assert!(apart.worst_block > 0.1, "both eyes see the same: {apart:?}");
    Snapshot::new("headset-left", left).matches_within(0.005, 0.1);
    Snapshot::new("headset-right", right).matches_within(0.005, 0.1);
}

/// No `--place`: the trigger of a controller that points at the table puts the match there.
#[test]
fn a_controllers_trigger_puts_the_match_on_the_table() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Selecting, 60) else { return };
    let script = ["--exit-after-frames", "60", "--json", "/mnt/out/figures.json"];
    succeeded(&runtime.player("/mnt/stream", &script).output().unwrap());
    let figures = figures(&runtime.out().join("figures.json"));
    assert_eq!((&figures["planes"], &figures["on_a_plane"]), (&2.into(), &true.into()), "{figures}");
}

#[test]
fn a_played_match_costs_little_and_makes_no_mistake() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Wobbling, 150) else { return };
    let script = ["--exit-after-frames", "60", "--json", "/mnt/out/figures.json"];
    let output = runtime.player("/mnt/stream", &script).output().unwrap();
    succeeded(&output);
    println!("{}", String::from_utf8_lossy(&output.stdout));
    let figures = figures(&runtime.out().join("figures.json"));
    assert_eq!(figures["frames"], 60);
    assert_eq!(figures["graphics_errors"], 0, "{figures}");
    assert_eq!(figures["multiview"], true);
    assert_eq!((&figures["sessions"], &figures["losses"]), (&1.into(), &0.into()));
    let ratio = figures["cost"]["stereo_over_mono"].as_f64().unwrap();
    assert!(ratio < 1.4, "the second eye costs {ratio} times the first");
}

#[test]
fn a_lost_session_and_a_lost_runtime_are_made_anew_and_the_match_goes_on() {
    let _alone = ALONE.lock();
    let Some(mut runtime) = start(Head::Wobbling, 300) else { return };
    // Enough frames that the fastest machine still draws when the runtime goes.
    let script = ["--exit-after-frames", "600", "--json", "/mnt/out/figures.json"];
    let log = runtime.out().join("player.log");
    let mut player = runtime.player_with(Planes::Detected, &[("RUST_LOG", "info")], "/mnt/stream", &script);
    let player = player.stderr(fs::File::create(&log).unwrap()).spawn().unwrap();
    wait_for(&log, "session: FOCUSED", 1);
    fs::write(runtime.out().join("lose"), "").unwrap();
    wait_for(&log, "session: FOCUSED", 2);
    thread::sleep(Duration::from_secs(1));
    runtime.kill();
    wait_for(&log, "waiting for the headset to come back", 2);
    runtime.begin();
    let output = player.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", fs::read_to_string(&log).unwrap());
    let figures = figures(&runtime.out().join("figures.json"));
    assert_eq!((&figures["sessions"], &figures["losses"]), (&3.into(), &2.into()), "{figures}");
    assert_eq!((&figures["frames"], &figures["graphics_errors"]), (&600.into(), &0.into()));
}

/// Vulkan's validation layer has nothing to say of a run, and is heard when there is something.
#[test]
fn the_validation_layer_is_heard_and_finds_nothing() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Still, 60) else { return };
    let script =
        ["--exit-after-frames", "10", "--json", "/mnt/out/figures.json", "--capture", "/mnt/out/eyes"];
    let said = |log: &str, planted: bool| {
        succeeded(&runtime.validated_player("/mnt/stream", &script, log, planted).output().unwrap());
        let text = fs::read_to_string(runtime.out().join(log)).expect("the layer opened its log");
        text.lines()
            .filter(|line| line.starts_with("Validation Error"))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let planted = said("planted.log", true);
    assert!(planted.iter().any(|line| line.contains("VUID-VkBufferCreateInfo-size-00912")), "{planted:?}");
    let clean = said("clean.log", false);
    assert!(clean.is_empty(), "{clean:#?}");
}

/// A server that answers for the first chunk and then holds its tongue: the match stands, the frames go on.
#[test]
fn no_frame_waits_for_a_stalled_server() {
    let _alone = ALONE.lock();
    let Some(runtime) = start(Head::Wobbling, 120) else { return };
    let address = stalling_server::start(runtime.shared.path().join("stream"));
    let script = ["--exit-after-frames", "90", "--json", "/mnt/out/figures.json", "--trace"];
    succeeded(&runtime.player(&address, &script).output().unwrap());
    let figures = figures(&runtime.out().join("figures.json"));
    let trace = figures["trace"].as_array().unwrap();
    let stalled: Vec<f64> = trace
        .iter()
        .filter(|frame| frame["stalled"] == true)
        .map(|frame| frame["own_ms"].as_f64().unwrap())
        .collect();
    let own = |name: &str| figures["frame_own"][name].as_f64().unwrap();
    println!("{} of {} frames stalled, own time p95 {} ms", stalled.len(), trace.len(), own("p95_ms"));
    assert!(stalled.len() > 20, "only {} frames met the stalled server", stalled.len());
    // The server never answers: a frame that waited for it would take seconds.
    let slowest = stalled.iter().copied().fold(0.0, f64::max);
    assert!(slowest < 500.0, "a frame took {slowest} ms of its own while the server was silent");
    assert!(
        trace.iter().filter(|frame| frame["stalled"] == true).all(|frame| frame["match_frame"].is_number())
    );
}
