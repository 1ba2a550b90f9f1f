//! When time runs, when it waits, and what it does in gaps.

use std::time::Duration;

use crate::{
    playback::{
        simulation::{Action, Link, MadeUpMatch, TraceEvent, Viewer},
        *,
    },
    time::Ticks,
};

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn s(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn with_gaps(gaps: Gaps) -> Viewer {
    let world = MadeUpMatch {
        chunks: 20,
        gaps: vec![(5, Ticks(30_000)), (10, Ticks(3_000))],
        ..MadeUpMatch::default()
    };
    let config = PlaybackConfig { gaps, ..PlaybackConfig::default() };
    Viewer::open(world, Link::steady(20_000_000, ms(40)), config).unwrap()
}

/// Lets time pass until the play head has come to a moment; when that was.
fn comes_to(viewer: &mut Viewer, position: Ticks) -> Duration {
    for _ in 0..10_000 {
        if viewer.playback.position(viewer.now) >= position {
            return viewer.now;
        }
        viewer.watch(ms(10));
    }
    panic!("it never came to {position:?}");
}

#[test]
fn gaps_are_jumped_at_once() {
    let mut viewer = with_gaps(Gaps::Jump);
    let before = comes_to(&mut viewer, Ticks(4_500));
    let after = comes_to(&mut viewer, Ticks(35_500));
    assert!((after - before).abs_diff(s(1)) <= ms(20), "a second of match, {:?}", after - before);
    viewer.watch(s(30));
    let view = viewer.playback.frame(viewer.now);
    assert_eq!((view.state, view.position), (PlaybackState::Ended, Ticks(53_000)));
    assert_eq!(viewer.playback.stats(viewer.now).stalls, 0, "what comes after a gap is fetched before");
    // Into a gap: to the chunk behind it, playing or not.
    viewer.act(Action::Seek(Ticks(20_000)));
    assert_eq!(viewer.playback.position(viewer.now), Ticks(35_000));
    viewer.watch(s(1));
    assert_eq!(viewer.playback.frame(viewer.now).shown.unwrap().chunk_index, 5);
    viewer.playback.step(viewer.now, -1);
    viewer.watch(s(1));
    assert_eq!(viewer.playback.frame(viewer.now).shown.unwrap().chunk_index, 4, "back over the gap");
    viewer.playback.step(viewer.now, 1);
    assert_eq!(viewer.playback.position(viewer.now), Ticks(35_000));
}

#[test]
fn time_runs_through_gaps_that_are_held() {
    let mut viewer = with_gaps(Gaps::Hold);
    let before = comes_to(&mut viewer, Ticks(4_500));
    viewer.watch(s(10));
    let view = viewer.playback.frame(viewer.now);
    assert_eq!((view.state, view.shown.unwrap().chunk_index), (PlaybackState::Playing, 4));
    let after = comes_to(&mut viewer, Ticks(35_500));
    assert!((after - before).abs_diff(s(31)) <= ms(20), "{:?}", after - before);
    assert!(!viewer.figures("").busy, "it slept through the gap");
    assert_eq!(viewer.playback.stats(viewer.now).stalls, 0);
}

#[test]
fn it_starts_with_little_and_resumes_with_more() {
    // A second of the lowest quality takes a little more than a second.
    let config = PlaybackConfig { start_after: s(3), resume_after: s(5), ..PlaybackConfig::default() };
    let mut viewer = Viewer::open(MadeUpMatch::default(), Link::steady(1_800_000, ms(40)), config).unwrap();
    let mut changes = Vec::new();
    for _ in 0..6_000 {
        viewer.watch(ms(10));
        let state = viewer.playback.frame(viewer.now).state;
        if changes.last().is_none_or(|(last, _)| *last != state) {
            changes.push((state, viewer.playback.stats(viewer.now).ahead));
        }
    }
    let [(PlaybackState::Buffering, _), (PlaybackState::Playing, started), rest @ ..] = &changes[..] else {
        panic!("{changes:?}");
    };
    assert!(*started >= ms(2_980) && *started < s(4), "{started:?}");
    let resumed: Vec<_> = rest.iter().filter(|(state, _)| *state == PlaybackState::Playing).collect();
    assert!(!resumed.is_empty());
    assert!(resumed.iter().all(|(_, ahead)| *ahead >= ms(4_980) && *ahead < s(6)), "{resumed:?}");
}

#[test]
fn at_the_end_what_is_there_is_enough() {
    let world = MadeUpMatch { chunks: 20, ..MadeUpMatch::default() };
    let config = PlaybackConfig { start_after: s(8), ..PlaybackConfig::default() };
    let mut viewer = Viewer::open(world, Link::steady(20_000_000, ms(40)), config).unwrap();
    viewer.act(Action::Seek(Ticks(18_500)));
    viewer.watch(s(1));
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Playing);
    viewer.watch(s(2));
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Ended);
}

#[test]
fn a_threshold_beyond_what_is_fetched_ahead_does_not_wait_for_ever() {
    let config = PlaybackConfig { ahead: s(2), start_after: s(60), ..PlaybackConfig::default() };
    let mut viewer = Viewer::open(MadeUpMatch::default(), Link::steady(20_000_000, ms(40)), config).unwrap();
    viewer.watch(s(5));
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Playing);
}

#[test]
fn what_is_due_next_does_not_share_the_link() {
    let mut viewer =
        Viewer::open(MadeUpMatch::default(), Link::steady(20_000_000, ms(40)), PlaybackConfig::default())
            .unwrap();
    viewer.watch(s(20));
    viewer.act(Action::Seek(Ticks(100_000)));
    let from = viewer.trace.len();
    viewer.watch(s(2));
    let asked_or_came = viewer.trace[from..].iter().filter_map(|line| match line.event {
        TraceEvent::Asked { chunk, .. } => Some((true, chunk)),
        TraceEvent::Came { chunk, .. } => Some((false, chunk)),
        _ => None,
    });
    let first: Vec<_> = asked_or_came.take(4).collect();
    assert_eq!(first, [(true, 100), (false, 100), (true, 101), (false, 101)]);
}

#[test]
fn after_a_sleep_of_the_whole_program_answers_that_are_there_are_taken_first() {
    let world = MadeUpMatch::default();
    let mut playback = Playback::new(&world.manifest(), PlaybackConfig::default()).unwrap();
    let request = playback.poll_request(s(0)).unwrap();
    let transfer = Transfer { bytes: 250_000, started: s(0), finished: s(1) };
    let content = std::sync::Arc::new(world.content(0));
    assert_eq!(playback.on_chunk(s(3_600), request, content, transfer), Delivery::Taken);
}
