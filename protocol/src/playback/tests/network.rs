//! Whole evenings over links that do what links do; see `simulation`.

use std::time::Duration;

use crate::playback::{
    PlaybackConfig, PlaybackState, RetryConfig,
    simulation::{Action, Fault, FaultKind, Figures, Link, MadeUpMatch, Scenario, TraceEvent, Viewer},
};
use crate::time::Ticks;

fn s(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn link(megabits: u64) -> Link {
    Link::steady(megabits * 1_000_000, ms(40))
}

fn run(name: &str) -> Figures {
    let scenario = Scenario::all().into_iter().find(|scenario| scenario.name == name).unwrap();
    let figures = scenario.run().unwrap().figures;
    println!("{figures}");
    assert!(!figures.busy, "it asked to be woken without having anything to do");
    figures
}

fn open(link: Link) -> Viewer {
    Viewer::open(MadeUpMatch::default(), link, PlaybackConfig::default()).unwrap()
}

/// When playback began to do something, after a moment.
fn began(viewer: &Viewer, state: PlaybackState, after: Duration) -> Option<Duration> {
    let line = viewer.trace.iter().find(|line| line.at >= after && line.event == TraceEvent::State(state));
    line.map(|line| line.at)
}

#[test]
fn the_first_frame_is_there_within_a_second_at_20_megabits() {
    let figures = run("20 Mbit/s");
    // Connecting 80 ms, manifest 40 ms and 82 ms for its 204 kB, chunk 40 + 100 ms, decoding 20 ms.
    let first = figures.first_frame_ms.unwrap();
    assert!(first > 300.0 && first < 450.0, "{first}");
    assert_eq!((figures.stalls, figures.state.as_str()), (0, "Playing"));
    assert!(figures.shown_in[2] > 0.9 && figures.switches <= 3);
}

#[test]
fn five_minutes_at_6_megabits_do_not_stall_and_use_the_link() {
    let figures = run("6 Mbit/s");
    assert_eq!(figures.stalls, 0);
    assert!(figures.first_frame_ms.unwrap() < 1_000.0);
    assert!(figures.shown_in[1] > 0.9 && figures.switches <= 3, "5 of 6 Mbit/s");
}

#[test]
fn a_link_that_hardly_carries_the_lowest_quality_plays_it() {
    let figures = run("2.6 Mbit/s");
    assert_eq!((figures.stalls, figures.switches), (0, 0));
}

#[test]
fn bandwidth_that_swings_is_ridden_out_by_the_buffer() {
    let figures = run("15 and 3 Mbit/s by turns");
    assert_eq!(figures.stalls, 0);
    assert!(figures.switches <= 8, "{} switches in 30 swings", figures.switches);
    assert!(figures.shown_in[1] > 0.7, "medium most of the time");
}

#[test]
fn a_full_buffer_outlives_an_outage_of_five_seconds() {
    for name in ["outage of 5 s at 20 Mbit/s", "outage of 5 s at 6 Mbit/s", "server away for 5 s"] {
        assert_eq!(run(name).stalls, 0, "{name}");
    }
}

/// An outage that finds the buffer empty: right after a seek.
#[test]
fn after_an_outage_it_plays_again_within_two_seconds() {
    let outage = Link { outages: vec![(s(30), s(35))], ..link(6) };
    let fault = |kind| Fault { from: s(30), until: s(35), chance: 1.0, kind };
    let away = Link { faults: vec![fault(FaultKind::Error)], ..link(6) };
    let silent = Link { faults: vec![fault(FaultKind::Silence)], ..link(6) };
    // Requests that are lost are given up only after a while: whether they are lost or slow, nobody can tell.
    for (name, link, bound) in [("outage", outage, s(2)), ("errors", away, s(2)), ("silence", silent, s(4))] {
        let mut viewer = open(link);
        viewer.watch(s(30) - viewer.now);
        viewer.act(Action::Seek(Ticks(200_000)));
        viewer.watch(s(5));
        assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Buffering, "{name}");
        viewer.watch(s(15));
        let playing = began(&viewer, PlaybackState::Playing, s(31)).unwrap();
        println!("{name}: playing {} ms after the link is back", (playing - s(35)).as_millis());
        assert!(playing <= s(35) + bound, "{name}: {playing:?}");
        assert_eq!(viewer.playback.stats(viewer.now).stalls, 0, "after a seek it is no stall");
    }
}

#[test]
fn a_stall_ends_when_enough_is_at_hand_again_and_is_counted_with_its_time() {
    let mut viewer = open(Link { outages: vec![(s(30), s(50))], ..link(6) });
    viewer.watch(s(45) - viewer.now);
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Buffering);
    let during = viewer.playback.stats(viewer.now);
    viewer.watch(s(40));
    let (stalled, resumed) = (
        began(&viewer, PlaybackState::Buffering, s(20)).unwrap(),
        began(&viewer, PlaybackState::Playing, s(31)).unwrap(),
    );
    assert!(stalled > s(38) && stalled < s(42), "{stalled:?}");
    assert!(resumed > s(50) && resumed < s(52), "{resumed:?}");
    let stats = viewer.playback.stats(viewer.now);
    assert_eq!((during.stalls, stats.stalls), (1, 1));
    assert!(during.stalled > s(3) && during.stalled < stats.stalled);
    assert!(stats.stalled.abs_diff(resumed - stalled) < ms(1), "{:?}", stats.stalled);
}

#[test]
fn errors_lost_requests_and_corrupt_chunks_are_got_over() {
    let errors = run("every fifth request an error");
    assert_eq!((errors.stalls, errors.state.as_str()), (0, "Playing"));
    let lost = run("every twentieth request lost");
    assert_eq!((lost.stalls, lost.state.as_str()), (0, "Playing"));
    let corrupt = run("every tenth chunk corrupt");
    assert_eq!((corrupt.stalls, corrupt.state.as_str()), (0, "Playing"));
}

/// Every file of the best representation is broken: what is shown comes from the one below.
#[test]
fn a_corrupt_chunk_is_asked_for_again_in_a_lower_quality() {
    let fault = Fault { from: s(20), until: ms(20_500), chance: 1.0, kind: FaultKind::Corrupt };
    let mut viewer = open(Link { faults: vec![fault], ..link(20) });
    viewer.watch(s(40));
    let failed = viewer.trace.iter().find_map(|line| match line.event {
        TraceEvent::Failed { chunk, .. } => Some(chunk),
        _ => None,
    });
    let asked: Vec<usize> = viewer
        .trace
        .iter()
        .filter_map(|line| match line.event {
            TraceEvent::Asked { chunk, representation } if Some(chunk) == failed => Some(representation),
            _ => None,
        })
        .collect();
    assert_eq!(asked, [2, 1]);
    assert_eq!(viewer.playback.stats(viewer.now).stalls, 0);
}

#[test]
fn a_lost_request_is_given_up_and_asked_for_again_lower_at_once() {
    let fault = Fault { from: s(10), until: s(11), chance: 1.0, kind: FaultKind::Silence };
    let mut viewer = open(Link { faults: vec![fault], ..link(20) });
    viewer.watch(s(10) - viewer.now);
    viewer.act(Action::Seek(Ticks(100_000)));
    viewer.watch(s(10));
    let asked: Vec<(Duration, usize)> = viewer
        .trace
        .iter()
        .filter_map(|line| match line.event {
            TraceEvent::Asked { chunk: 100, representation } => Some((line.at, representation)),
            _ => None,
        })
        .collect();
    let patience = RetryConfig::default().patience;
    assert_eq!(asked, [(s(10), 1), (s(10) + patience, 0)]);
}

#[test]
fn an_answer_that_comes_after_its_attempt_was_given_up_is_stale() {
    // Fetches are not stopped, so all answers come when the link is back.
    let mut viewer = open(Link { outages: vec![(s(10), s(14))], ..link(20) });
    viewer.stops_fetches = false;
    viewer.watch(s(10) - viewer.now);
    viewer.act(Action::Seek(Ticks(100_000)));
    viewer.watch(s(10));
    let count =
        |matches: fn(TraceEvent) -> bool| viewer.trace.iter().filter(|line| matches(line.event)).count();
    let asked = count(|event| matches!(event, TraceEvent::Asked { chunk: 100, .. }));
    let came = count(|event| matches!(event, TraceEvent::Came { chunk: 100, .. }));
    assert!(asked >= 2 && came == asked, "asked {asked} times, came {came} times");
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Playing);
}

#[test]
fn seeks_during_transfers_show_their_frame_within_half_a_second() {
    let figures = run("seeks");
    assert!(figures.longest_seek_ms.unwrap() < 500.0, "{:?}", figures.longest_seek_ms);
    assert_eq!((figures.stalls, figures.state.as_str()), (0, "Playing"));
}

#[test]
fn the_buffer_keeps_to_its_time_and_its_bytes() {
    let mut scenario = Scenario::over("little memory", link(50));
    scenario.watched = s(60);
    scenario.config.buffer_bytes = 6_000_000;
    let figures = scenario.run().unwrap().figures;
    assert!(figures.most_buffered_bytes <= 6_000_000, "{}", figures.most_buffered_bytes);
    assert_eq!(figures.stalls, 0);
    scenario.config.buffer_bytes = 1;
    let figures = scenario.run().unwrap().figures;
    assert!(
        figures.most_buffered_bytes <= 1_800_000,
        "only the chunk on show, {}",
        figures.most_buffered_bytes
    );
    assert!(figures.stalls > 20 && !figures.busy, "it goes on all the same");
    scenario.config = PlaybackConfig { ahead: s(4), ..PlaybackConfig::default() };
    let figures = scenario.run().unwrap().figures;
    assert!(figures.ahead_ms <= 5_000.0, "what starts within four seconds, {}", figures.ahead_ms);
}

#[test]
fn the_same_evening_is_the_same_to_the_byte() {
    let scenario = Scenario::over("errors", {
        let fault = Fault { from: s(0), until: s(60), chance: 0.5, kind: FaultKind::Error };
        Link { faults: vec![fault], ..link(6) }
    });
    let scenario = Scenario { watched: s(60), ..scenario };
    assert_eq!(scenario.run().unwrap().trace, scenario.run().unwrap().trace);
    let mut other = scenario.clone();
    other.config.retry.seed = 1;
    assert_ne!(scenario.run().unwrap().trace, other.run().unwrap().trace, "other waits");
}
