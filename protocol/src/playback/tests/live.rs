//! Streams that grow while they are watched.

use std::time::Duration;

use crate::{
    manifest::Live,
    playback::{
        simulation::{Action, FakeContent, Link, MadeUpMatch, Viewer},
        *,
    },
    time::Ticks,
};

fn s(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

fn world() -> MadeUpMatch {
    MadeUpMatch { chunks: 600, live_from: Some(120), ..MadeUpMatch::default() }
}

fn link() -> Link {
    Link::steady(20_000_000, ms(40))
}

fn latency(viewer: &Viewer) -> Duration {
    viewer.playback.stats(viewer.now).latency.unwrap()
}

#[test]
fn it_joins_late_two_chunks_behind_the_edge_and_follows() {
    let mut viewer = Viewer::open(world(), link(), PlaybackConfig::default()).unwrap();
    assert_eq!(viewer.playback.position(viewer.now), Ticks(118_000));
    viewer.watch(s(1));
    for _ in 0..300 {
        viewer.watch(s(1));
        assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Playing);
        assert!(latency(&viewer) <= ms(2_100), "{:?}", latency(&viewer));
    }
    let figures = viewer.figures("");
    assert!(figures.stalls == 0 && !figures.busy && figures.first_frame_ms.unwrap() < 1_000.0, "{figures}");
}

#[test]
fn a_latency_that_the_user_chose_is_kept() {
    let live = LiveConfig { latency: Some(s(6)), ..LiveConfig::default() };
    let config = PlaybackConfig { live, ..PlaybackConfig::default() };
    let mut viewer = Viewer::open(world(), link(), config).unwrap();
    viewer.watch(s(60));
    assert!(latency(&viewer) > ms(4_900) && latency(&viewer) <= ms(6_100), "{:?}", latency(&viewer));
    assert!(viewer.figures("").shown_in[2] > 0.6, "{}", viewer.figures("with time to spare it is the best"));
}

#[test]
fn the_edge_is_no_end_until_the_stream_is_complete() {
    // The server has nothing new between 10 and 16 s.
    let mut viewer = Viewer::open(
        MadeUpMatch { chunks: 140, ..world() },
        Link { outages: vec![(s(10), s(16))], ..link() },
        PlaybackConfig::default(),
    )
    .unwrap();
    viewer.watch(s(15));
    let view = viewer.playback.frame(viewer.now);
    assert_eq!((view.state, view.position), (PlaybackState::Buffering, viewer.playback.end()));
    viewer.watch(s(4));
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Playing);
    viewer.watch(s(20));
    assert!(!viewer.playback.is_live());
    let view = viewer.playback.frame(viewer.now);
    assert_eq!((view.state, view.position), (PlaybackState::Ended, Ticks(140_000)));
    assert!(!viewer.playback.poll_manifest(viewer.now + s(100)));
    assert!(!viewer.figures("").busy);
}

#[test]
fn when_late_it_hurries_a_little_until_it_is_not() {
    let mut viewer =
        Viewer::open(world(), Link { outages: vec![(s(20), s(25))], ..link() }, PlaybackConfig::default())
            .unwrap();
    viewer.watch(s(30) - viewer.now);
    let late = latency(&viewer);
    assert!(late > s(4), "{late:?}");
    assert_eq!(viewer.playback.running_speed(), Speed::percent(110));
    assert_eq!(viewer.playback.speed(), Speed::NORMAL);
    let position = viewer.playback.position(viewer.now);
    viewer.watch(s(5));
    let moved = viewer.playback.position(viewer.now) - position;
    assert!((moved.0 - 5_500).abs() <= 20, "{moved:?}");
    viewer.watch(s(40));
    assert!(latency(&viewer) <= ms(2_100), "{:?}", latency(&viewer));
    assert_eq!(viewer.playback.running_speed(), Speed::NORMAL);
    assert_eq!(viewer.playback.stats(viewer.now).stalls, 1);
}

#[test]
fn far_behind_it_stays_unless_the_user_asks_for_the_edge() {
    let mut viewer = Viewer::open(world(), link(), PlaybackConfig::default()).unwrap();
    viewer.watch(s(5));
    viewer.act(Action::Seek(Ticks(20_000)));
    viewer.watch(s(20));
    let position = viewer.playback.position(viewer.now);
    assert!(position >= Ticks(39_000) && position <= Ticks(42_100), "{position:?}");
    assert!(latency(&viewer) > s(100));
    viewer.act(Action::Pause);
    viewer.watch(s(10));
    viewer.act(Action::Play);
    viewer.act(Action::GoLive);
    viewer.watch(s(2));
    assert!(latency(&viewer) <= ms(2_500), "with the tolerance, {:?}", latency(&viewer));
    assert_eq!(viewer.playback.frame(viewer.now).state, PlaybackState::Playing);
}

#[test]
fn a_newer_manifest_may_only_append() {
    let world = MadeUpMatch::default();
    let live = Some(Live { update_after: Ticks(1_000) });
    let mut playback: Playback<FakeContent> =
        Playback::new(&world.manifest_of(10, live), PlaybackConfig::default()).unwrap();
    assert_eq!((playback.end(), playback.is_live()), (Ticks(10_000), true));
    assert_eq!(playback.update(s(1), &world.manifest_of(10, live)), Ok(false));
    assert_eq!(playback.update(s(2), &world.manifest_of(12, live)), Ok(true));
    assert_eq!(playback.end(), Ticks(12_000));
    assert_eq!(
        playback.update(s(3), &world.manifest_of(11, live)),
        Err(UpdateError::Shrunk { representation: 0 })
    );
    let mut other = world.manifest_of(13, live);
    other.representations[1].chunks[3].file.bytes += 1;
    assert_eq!(playback.update(s(3), &other), Err(UpdateError::Changed { representation: 1, chunk: 3 }));
    let mut other = world.manifest_of(13, live);
    other.representations.remove(0);
    assert_eq!(playback.update(s(3), &other), Err(UpdateError::Representations));
    let mut other = world.manifest_of(13, live);
    other.timescale.numerator = 999;
    assert_eq!(playback.update(s(3), &other), Err(UpdateError::Timescale));
    assert_eq!((playback.end(), playback.is_live()), (Ticks(12_000), true), "nothing changed");
    // A representation may be behind; the others have it already.
    let mut partly = world.manifest_of(14, live);
    partly.representations[2].chunks.truncate(12);
    assert_eq!(playback.update(s(4), &partly), Ok(true));
    playback.set_quality(Quality::Fixed(2)).unwrap();
    playback.seek(s(4), Ticks(13_500));
    assert_eq!(playback.poll_request(s(4)).unwrap().representation, 1);
    assert_eq!(playback.update(s(5), &world.manifest_of(14, None)), Ok(false));
    assert!(!playback.is_live());
}

#[test]
fn the_buffer_stays_when_the_manifest_grows() {
    let world = MadeUpMatch::default();
    let live = Some(Live { update_after: Ticks(1_000) });
    let mut playback = Playback::new(&world.manifest_of(10, live), PlaybackConfig::default()).unwrap();
    let request = playback.poll_request(s(1)).unwrap();
    let transfer = Transfer { bytes: 250_000, started: s(1), finished: ms(1_100) };
    playback.on_chunk(ms(1_100), request, std::sync::Arc::new(world.content(request.chunk)), transfer);
    let next = playback.poll_request(ms(1_100)).unwrap();
    assert!(playback.poll_manifest(s(2)) && !playback.poll_manifest(s(2)));
    playback.update(ms(2_050), &world.manifest_of(11, live)).unwrap();
    assert_eq!(playback.buffered().collect::<Vec<_>>(), [8]);
    assert!(playback.awaits(next));
    assert_eq!(playback.generation(), 0);
}

#[test]
fn what_appears_behind_a_gap_at_the_edge_is_jumped_to() {
    let world = MadeUpMatch { gaps: vec![(10, Ticks(60_000))], ..MadeUpMatch::default() };
    let live = Some(Live { update_after: Ticks(1_000) });
    let mut playback: Playback<FakeContent> =
        Playback::new(&world.manifest_of(10, live), PlaybackConfig::default()).unwrap();
    playback.seek(s(1), Ticks(10_000));
    playback.play(s(1));
    assert_eq!(playback.frame(s(1)).state, PlaybackState::Buffering);
    playback.update(s(2), &world.manifest_of(11, live)).unwrap();
    assert_eq!(playback.position(s(2)), Ticks(70_000));
}

#[test]
fn after_waiting_at_the_edge_it_goes_on_with_its_distance_restored() {
    let world = MadeUpMatch::default();
    let live = Some(Live { update_after: Ticks(1_000) });
    let mut playback = Playback::new(&world.manifest_of(10, live), PlaybackConfig::default()).unwrap();
    let fetch = |playback: &mut Playback<FakeContent>, now: Duration| {
        while let Some(request) = playback.poll_request(now) {
            let transfer = Transfer { bytes: 250_000, started: now - ms(100), finished: now };
            playback.on_chunk(now, request, std::sync::Arc::new(world.content(request.chunk)), transfer);
        }
        playback.frame(now).state
    };
    playback.play(s(1));
    assert_eq!(fetch(&mut playback, s(1)), PlaybackState::Playing);
    assert_eq!(fetch(&mut playback, s(4)), PlaybackState::Buffering, "at the edge");
    playback.update(s(5), &world.manifest_of(11, live)).unwrap();
    assert_eq!(fetch(&mut playback, s(5)), PlaybackState::Buffering, "one chunk would be over in a second");
    playback.update(s(6), &world.manifest_of(12, live)).unwrap();
    assert_eq!(fetch(&mut playback, s(6)), PlaybackState::Playing);
    let stats = playback.stats(s(6));
    assert_eq!((stats.stalls, stats.latency), (1, Some(s(2))));
}

#[test]
fn paused_at_the_edge_is_not_the_end_and_play_does_not_go_back() {
    let world = MadeUpMatch::default();
    let live = Some(Live { update_after: Ticks(1_000) });
    let mut playback: Playback<FakeContent> =
        Playback::new(&world.manifest_of(10, live), PlaybackConfig::default()).unwrap();
    playback.seek(s(1), Ticks(10_000));
    assert_eq!(playback.frame(s(1)).state, PlaybackState::Paused);
    playback.play(s(1));
    assert_eq!(playback.frame(s(2)).state, PlaybackState::Buffering);
    assert_eq!(playback.position(s(2)), Ticks(10_000));
    // The last manifest says that this was all.
    playback.update(s(3), &world.manifest_of(10, None)).unwrap();
    assert_eq!(playback.frame(s(3)).state, PlaybackState::Ended);
}
