//! What the user sees of real chunks: frames, held frames, steps, seeks, failures.

use proptest::prelude::*;

use crate::{chunk::Chunk, playback::*, sample};

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// Nine chunks of 30 frames, a little over a second each.
const FRAMES: u32 = 270;

/// Three chunks ahead and one behind, four attempts each.
fn few_chunks() -> PlaybackConfig {
    let retry = RetryConfig { attempts: 4, corrupt_attempts: 4, ..RetryConfig::default() };
    PlaybackConfig { ahead: ms(3 * 1_001), retry, ..PlaybackConfig::default() }
}

/// Start of a frame of the sample match.
fn start_of(frame: u32) -> Ticks {
    Ticks(i64::from(frame) * sample::FRAME.0)
}

/// A playback, a network with latency and faults as plain fields, and the time.
struct World {
    playback: Playback<Chunk>,
    now: Duration,
    /// How long an answer takes.
    latency: Duration,
    /// Chunks whose requests fail, with how.
    broken: Vec<(usize, FailureKind)>,
    /// Answers under way: when they arrive, and to what.
    answers: Vec<(Duration, Transfer, Request)>,
    /// Every request ever made.
    log: Vec<Request>,
}

impl World {
    fn new(config: PlaybackConfig) -> Self {
        let sample = sample::match_of(FRAMES, 0).unwrap();
        Self {
            playback: Playback::new(&sample.manifest, config).unwrap(),
            now: ms(5_000),
            latency: ms(80),
            broken: Vec::new(),
            answers: Vec::new(),
            log: Vec::new(),
        }
    }

    fn chunk(index: usize) -> Arc<Chunk> {
        let first = index as u32 * sample::FRAMES_PER_CHUNK;
        Arc::new(sample::chunk_of(first, sample::FRAMES_PER_CHUNK, 0))
    }

    /// Sends what is asked for and delivers what has arrived by now.
    fn exchange(&mut self) {
        while let Some(request) = self.playback.poll_request(self.now) {
            self.log.push(request);
            let finished = self.now + self.latency;
            self.answers.push((finished, Transfer { bytes: 100_000, started: self.now, finished }, request));
        }
        let (arrived, under_way) = self.answers.drain(..).partition(|(at, ..)| *at <= self.now);
        self.answers = under_way;
        let arrived: Vec<(Duration, Transfer, Request)> = arrived;
        for (_, transfer, request) in arrived {
            match self.broken.iter().find(|(chunk, _)| *chunk == request.chunk) {
                Some((_, kind)) => {
                    self.playback.on_failure(self.now, request, *kind, "as arranged".to_owned())
                }
                None => self.playback.on_chunk(self.now, request, Self::chunk(request.chunk), transfer),
            };
        }
    }

    /// Lets time pass in steps of a drawn picture and returns the last view.
    fn pass(&mut self, duration: Duration) -> FrameView<Chunk> {
        let end = self.now + duration;
        loop {
            self.exchange();
            let view = self.playback.frame(self.now);
            if self.now >= end {
                return view;
            }
            self.now = (self.now + ms(5)).min(end);
        }
    }

    fn clip_frame(view: &FrameView<Chunk>) -> Option<u32> {
        Some(view.shown.as_ref()?.frame()?.clip_frame - sample::FIRST_CLIP_FRAME)
    }
}

#[test]
fn it_starts_paused_and_shows_the_first_frame_when_it_arrives() {
    let mut world = World::new(few_chunks());
    let view = world.pass(ms(70));
    assert!(view.shown.is_none() && view.held);
    let view = world.pass(ms(100));
    assert_eq!((World::clip_frame(&view), view.state, view.held), (Some(0), PlaybackState::Paused, false));
    assert_eq!(World::clip_frame(&world.pass(ms(3_000))), Some(0));
}

#[test]
fn it_plays_in_real_time_and_at_other_speeds() {
    let mut world = World::new(few_chunks());
    world.pass(ms(500));
    world.playback.play(world.now);
    // 30000/1001 frames per second.
    assert_eq!(World::clip_frame(&world.pass(ms(2_000))), Some(59));
    world.playback.set_speed(world.now, Speed::percent(50));
    assert_eq!(World::clip_frame(&world.pass(ms(2_000))), Some(89));
    world.playback.set_speed(world.now, Speed::percent(200));
    assert_eq!(World::clip_frame(&world.pass(ms(1_000))), Some(149));
}

#[test]
fn a_seek_shows_the_right_frame() {
    let mut world = World::new(few_chunks());
    world.pass(ms(300));
    for frame in [200, 3, 269, 150, 119, 120, 0] {
        world.playback.seek(world.now, start_of(frame));
        let view = world.pass(ms(400));
        assert_eq!((World::clip_frame(&view), view.held), (Some(frame), false));
        assert_eq!(view.position, start_of(frame));
    }
}

#[test]
fn the_last_good_frame_is_held_until_the_sought_one_arrives() {
    let mut world = World::new(few_chunks());
    world.playback.play(world.now);
    let before = world.pass(ms(500));
    let held_frame = World::clip_frame(&before).unwrap();
    assert_eq!(before.state, PlaybackState::Playing);
    world.playback.seek(world.now, start_of(245));
    let view = world.pass(ms(60));
    assert_eq!((World::clip_frame(&view), view.held), (Some(held_frame), true));
    assert_eq!((view.state, view.position), (PlaybackState::Buffering, start_of(245)));
    let view = world.pass(ms(40));
    assert_eq!((view.state, view.held), (PlaybackState::Playing, false));
    assert_eq!(World::clip_frame(&view), Some(245));
}

#[test]
fn an_answer_from_before_a_seek_is_ignored() {
    let mut world = World::new(few_chunks());
    let old = world.playback.poll_request(world.now).unwrap();
    assert_eq!((old.generation, old.chunk, old.representation), (0, 0, 0));
    world.playback.seek(world.now, start_of(200));
    world.playback.seek(world.now, start_of(0));
    let new = world.playback.poll_request(world.now).unwrap();
    assert_eq!((new.chunk, new.generation > old.generation), (0, true));
    let transfer = Transfer { bytes: 100_000, started: world.now, finished: world.now };
    assert!(world.playback.awaits(new) && !world.playback.awaits(old));
    assert_eq!(world.playback.on_chunk(world.now, old, World::chunk(0), transfer), Delivery::Stale);
    assert!(world.playback.frame(world.now).shown.is_none());
    assert_eq!(world.playback.on_chunk(world.now, new, World::chunk(0), transfer), Delivery::Taken);
    assert_eq!(World::clip_frame(&world.playback.frame(world.now)), Some(0));
    assert_eq!(world.playback.on_chunk(world.now, new, World::chunk(0), transfer), Delivery::Stale, "twice");
}

#[test]
fn scrubbing_inside_a_chunk_under_way_does_not_ask_again() {
    let mut world = World::new(few_chunks());
    world.pass(ms(300));
    for frame in 240..265 {
        world.playback.seek(world.now, start_of(frame));
        world.pass(ms(10));
    }
    assert_eq!(world.log.iter().filter(|request| request.chunk == 8).count(), 1);
    assert_eq!(World::clip_frame(&world.pass(ms(100))), Some(264));
}

#[test]
fn a_slow_network_stalls_time_and_skips_nothing() {
    let config = PlaybackConfig { ahead: ms(1_000), in_flight: 1, ..few_chunks() };
    let mut world = World::new(config);
    world.latency = ms(1_500);
    world.playback.play(world.now);
    let mut seen = Vec::new();
    let mut stalls = 0;
    let mut last_state = PlaybackState::Buffering;
    loop {
        let view = world.pass(ms(10));
        seen.extend(World::clip_frame(&view));
        if view.state == PlaybackState::Buffering && last_state == PlaybackState::Playing {
            stalls += 1;
        }
        last_state = view.state;
        if view.state == PlaybackState::Ended {
            break;
        }
    }
    seen.dedup();
    assert_eq!(seen, (0..FRAMES).collect::<Vec<_>>());
    assert!(stalls >= 5, "{stalls} stalls");
}

#[test]
fn the_last_frame_stays_and_play_starts_again() {
    let mut world = World::new(few_chunks());
    world.playback.seek(world.now, start_of(260));
    world.playback.play(world.now);
    let view = world.pass(ms(60_000));
    assert_eq!((World::clip_frame(&view), view.state, view.held), (Some(269), PlaybackState::Ended, false));
    world.playback.play(world.now);
    let view = world.pass(ms(250));
    assert_eq!(view.state, PlaybackState::Playing);
    assert!(World::clip_frame(&view).unwrap() < 10);
}

#[test]
fn a_loop_goes_on_at_the_start() {
    let mut world = World::new(PlaybackConfig { at_end: AtEnd::Loop, ..few_chunks() });
    world.playback.play(world.now);
    world.pass(ms(9_100 + 80));
    let view = world.pass(ms(500));
    assert_eq!(view.state, PlaybackState::Playing);
    assert!(World::clip_frame(&view).unwrap() < 30, "{view:?}");
}

#[test]
fn an_unreachable_chunk_is_tried_a_few_times_and_then_reported() {
    let mut world = World::new(few_chunks());
    world.broken = vec![(2, FailureKind::Unreachable)];
    world.playback.play(world.now);
    let view = world.pass(ms(20_000));
    assert_eq!((World::clip_frame(&view), view.state, view.held), (Some(59), PlaybackState::Failed, true));
    let failure = view.failure.unwrap();
    assert_eq!((failure.chunk, failure.attempts), (2, 4));
    assert!(failure.to_string().contains("as arranged"));
    let attempts = world.log.iter().filter(|request| request.chunk == 2).count();
    assert!((4..=8).contains(&attempts), "{attempts} attempts");
    world.pass(ms(60_000));
    assert_eq!(world.log.iter().filter(|request| request.chunk == 2).count(), attempts, "it gives up");
    // The server is back and the user presses play.
    world.broken.clear();
    world.playback.play(world.now);
    let view = world.pass(ms(1_000));
    assert_eq!((view.state, view.failure), (PlaybackState::Playing, None));
}

#[test]
fn a_corrupt_chunk_is_passed_over_with_the_last_good_frame() {
    let mut world = World::new(few_chunks());
    world.broken = vec![(1, FailureKind::Corrupt)];
    world.playback.play(world.now);
    // Chunk 0 plays meanwhile; after four attempts time goes on into chunk 1.
    let mut view = world.pass(ms(1_100));
    while view.failure.is_none() {
        view = world.pass(ms(10));
    }
    assert!(world.now < ms(5_000) + ms(2_700) && view.state == PlaybackState::Playing);
    assert_eq!((World::clip_frame(&view), view.held), (Some(29), true));
    assert_eq!(view.failure.as_ref().map(|failure| failure.kind), Some(FailureKind::Corrupt));
    let view = world.pass(ms(3_000));
    assert_eq!((view.held, &view.failure), (false, &None));
    assert!(World::clip_frame(&view).is_some_and(|frame| frame >= 60));
}

#[test]
fn a_chunk_with_other_times_counts_as_corrupt() {
    let retry = RetryConfig { corrupt_attempts: 1, ..RetryConfig::default() };
    let mut world = World::new(PlaybackConfig { retry, ..PlaybackConfig::default() });
    let request = world.playback.poll_request(world.now).unwrap();
    let transfer = Transfer { bytes: 100_000, started: world.now, finished: world.now };
    world.playback.on_chunk(world.now, request, World::chunk(3), transfer);
    let view = world.playback.frame(world.now);
    assert!(view.shown.is_none());
    assert_eq!(view.failure.unwrap().kind, FailureKind::Corrupt);
}

#[test]
fn steps_go_frame_by_frame_across_chunks_both_ways() {
    let mut world = World::new(few_chunks());
    world.playback.seek(world.now, start_of(27) + Ticks(400));
    world.pass(ms(300));
    for expected in 28..34 {
        world.playback.step(world.now, 1);
        assert_eq!(World::clip_frame(&world.pass(ms(200))), Some(expected));
    }
    for expected in (25..33).rev() {
        world.playback.step(world.now, -1);
        assert_eq!(World::clip_frame(&world.pass(ms(200))), Some(expected));
    }
    world.playback.seek(world.now, start_of(120));
    world.pass(ms(300));
    world.playback.step(world.now, -1);
    assert_eq!(World::clip_frame(&world.pass(ms(300))), Some(119), "into a chunk that was not there");
    world.playback.step(world.now, -1000);
    assert_eq!(World::clip_frame(&world.pass(ms(300))), Some(0));
    world.playback.seek(world.now, start_of(268));
    world.pass(ms(300));
    world.playback.step(world.now, 5);
    let view = world.pass(ms(300));
    assert_eq!((World::clip_frame(&view), view.position), (Some(269), start_of(269)));
}

#[test]
fn timeouts_wake_the_caller_for_every_frame() {
    let mut world = World::new(few_chunks());
    world.pass(ms(600));
    assert_eq!(world.playback.poll_timeout(world.now), None, "nothing changes while paused");
    world.playback.play(world.now);
    let mut shown = Vec::new();
    for _ in 0..20 {
        shown.extend(World::clip_frame(&world.playback.frame(world.now)));
        let next = world.playback.poll_timeout(world.now).unwrap();
        assert!(next > world.now && next <= world.now + ms(34));
        world.now = next;
        world.playback.handle_timeout(world.now);
    }
    assert_eq!(shown, (0..20).collect::<Vec<_>>());
}

#[test]
fn only_the_window_is_kept() {
    let mut world = World::new(few_chunks());
    world.playback.play(world.now);
    for _ in 0..60 {
        world.pass(ms(150));
        assert!(world.playback.buffered().count() <= 5);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever the user and the network do, the frame shown is the right one or a held one, and requests are bounded.
    #[test]
    fn any_use_shows_the_right_frame_or_says_that_it_holds(
        actions in proptest::collection::vec((0..6u8, 0..FRAMES, 1..700u64), 1..30),
        latency in 0..900u64,
        broken in proptest::option::of((0..9usize, any::<bool>())),
    ) {
        let mut world = World::new(few_chunks());
        world.latency = ms(latency);
        world.broken = broken
            .map(|(chunk, gone)| (chunk, if gone { FailureKind::Unreachable } else { FailureKind::Corrupt }))
            .into_iter()
            .collect();
        for (action, frame, wait) in actions {
            let now = world.now;
            match action {
                0 => world.playback.play(now),
                1 => world.playback.pause(now),
                2 => world.playback.seek(now, start_of(frame)),
                3 => world.playback.step(now, frame as i32 % 7 - 3),
                4 => world.playback.set_speed(now, Speed::percent(frame as u16)),
                _ => {}
            }
            let view = world.pass(ms(wait));
            let due = (view.position.0 / sample::FRAME.0).min(i64::from(FRAMES) - 1) as u32;
            if !view.held {
                prop_assert_eq!(World::clip_frame(&view), Some(due));
            }
            prop_assert!(world.answers.len() <= 2 + world.log.len());
            prop_assert!(world.playback.buffered().count() <= 5);
        }
        // Left alone and with the network mended, it always arrives where it stands.
        world.broken.clear();
        world.playback.pause(world.now);
        let position = world.playback.position(world.now);
        world.playback.seek(world.now, position);
        let view = world.pass(ms(6_000));
        prop_assert!(!view.held);
    }
}
