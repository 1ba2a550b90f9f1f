//! Whatever the user, the server and the clock do.

use std::{sync::Arc, time::Duration};

use proptest::prelude::*;

use crate::{
    manifest::Live,
    playback::{
        simulation::{FakeContent, MadeUpMatch},
        *,
    },
    time::Ticks,
};

const CHUNKS: usize = 30;

/// One call from outside.
#[derive(Clone, Debug)]
enum Call {
    Play,
    Pause,
    Seek(i64),
    Step(i32),
    Speed(u16),
    GoLive,
    Quality(usize),
    /// Chunks that a new manifest adds; none: it fails. Whether it is still live.
    Update(Option<usize>, bool),
    Request,
    /// Answers the n-th request that was ever made, well or badly.
    Answer(usize, Option<FailureKind>),
    WrongContent(usize),
    Sleep(u64),
    /// Sleeps until it asked to be woken.
    SleepUntilWoken,
}

fn call() -> impl Strategy<Value = Call> {
    let failure = prop_oneof![
        4 => Just(None),
        1 => Just(Some(FailureKind::Unreachable)),
        1 => Just(Some(FailureKind::Corrupt)),
    ];
    prop_oneof![
        2 => Just(Call::Play),
        1 => Just(Call::Pause),
        2 => (-5_000..60_000_i64).prop_map(Call::Seek),
        1 => (-40..40).prop_map(Call::Step),
        1 => any::<u16>().prop_map(Call::Speed),
        1 => Just(Call::GoLive),
        1 => (0..5_usize).prop_map(Call::Quality),
        1 => (proptest::option::of(0..3_usize), any::<bool>()).prop_map(|(more, live)| Call::Update(more, live)),
        6 => Just(Call::Request),
        8 => (0..6_usize, failure).prop_map(|(back, failure)| Call::Answer(back, failure)),
        1 => (0..6_usize).prop_map(Call::WrongContent),
        6 => (0..3_000_u64).prop_map(Call::Sleep),
        6 => Just(Call::SleepUntilWoken),
    ]
}

fn config() -> impl Strategy<Value = PlaybackConfig> {
    let bounds = (0..12_000_u64, 0..3_usize, 0..20_000_000_u64, 0..4_usize);
    let waits = (0..3_000_u64, 0..4_000_u64, any::<bool>(), any::<bool>());
    (bounds, waits, 0..6_000_u64, 0..4_u32).prop_map(|(bounds, waits, patience, attempts)| {
        let (ahead, behind, buffer_bytes, in_flight) = bounds;
        let (start, resume, around, hold) = waits;
        let ms = Duration::from_millis;
        let retry = RetryConfig {
            patience: ms(patience),
            attempts,
            longest_patience: ms(patience * 2),
            ..Default::default()
        };
        PlaybackConfig {
            ahead: ms(ahead),
            behind,
            buffer_bytes,
            in_flight,
            start_after: ms(start),
            resume_after: ms(resume),
            at_end: if around { AtEnd::Loop } else { AtEnd::Hold },
            gaps: if hold { Gaps::Hold } else { Gaps::Jump },
            retry,
            ..PlaybackConfig::default()
        }
    })
}

struct Caller {
    world: MadeUpMatch,
    playback: Playback<FakeContent>,
    now: Duration,
    chunks: usize,
    requests: Vec<Request>,
}

impl Caller {
    fn new(config: PlaybackConfig, live: bool, gap: Option<(usize, i64)>) -> Self {
        let gaps = gap.map(|(chunk, ticks)| (chunk, Ticks(ticks))).into_iter().collect();
        let world = MadeUpMatch { chunks: CHUNKS, gaps, ..MadeUpMatch::default() };
        let live = live.then_some(Live { update_after: Ticks(1_000) });
        let playback = Playback::new(&world.manifest_of(CHUNKS, live), config).unwrap();
        Self { world, playback, now: Duration::from_secs(1), chunks: CHUNKS, requests: Vec::new() }
    }

    fn call(&mut self, call: &Call) {
        let (now, playback) = (self.now, &mut self.playback);
        match *call {
            Call::Play => playback.play(now),
            Call::Pause => playback.pause(now),
            Call::Seek(target) => playback.seek(now, Ticks(target)),
            Call::Step(frames) => playback.step(now, frames),
            Call::Speed(percent) => playback.set_speed(now, Speed::percent(percent)),
            Call::GoLive => playback.go_live(now),
            Call::Quality(0) => playback.set_quality(Quality::Auto).unwrap(),
            Call::Quality(index) => {
                let _ = playback.set_quality(Quality::Fixed(index - 1));
            }
            Call::Update(None, _) => playback.on_manifest_failure(now),
            Call::Update(Some(more), live) => {
                self.chunks += more;
                let live = live.then_some(Live { update_after: Ticks(1_000) });
                playback.update(now, &self.world.manifest_of(self.chunks, live)).unwrap();
            }
            Call::Request => self.requests.extend(playback.poll_request(now)),
            Call::Answer(back, failure) => {
                let Some(request) = self.nth_last(back) else { return };
                match failure {
                    None => self.deliver(request, request.chunk),
                    Some(kind) => {
                        self.playback.on_failure(now, request, kind, String::new());
                    }
                }
            }
            Call::WrongContent(back) => {
                let Some(request) = self.nth_last(back) else { return };
                self.deliver(request, request.chunk + 1);
            }
            Call::Sleep(milliseconds) => self.now += Duration::from_millis(milliseconds),
            Call::SleepUntilWoken => {
                if let Some(at) = playback.poll_timeout(now) {
                    self.now = at.max(now).min(now + Duration::from_secs(60));
                    playback.handle_timeout(self.now);
                }
            }
        }
    }

    fn nth_last(&self, back: usize) -> Option<Request> {
        self.requests.iter().rev().nth(back).copied()
    }

    fn deliver(&mut self, request: Request, chunk: usize) {
        let started = self.now.saturating_sub(Duration::from_millis(300));
        let transfer = Transfer { bytes: 400_000, started, finished: self.now };
        self.playback.on_chunk(self.now, request, Arc::new(self.world.content(chunk)), transfer);
    }
}

/// What must hold at every moment.
fn check(
    caller: &mut Caller,
    config: &PlaybackConfig,
    before: Ticks,
    call: &Call,
) -> Result<(), TestCaseError> {
    let now = caller.now;
    let view = caller.playback.frame(now);
    prop_assert!(view.position >= caller.playback.start() && view.position <= caller.playback.end());
    // Running time never passes what is missing: where it runs, the chunk is there or known to be unreadable.
    let head =
        (0..caller.chunks).rev().find(|chunk| caller.world.start_of(*chunk) <= view.position).unwrap_or(0);
    if view.state == PlaybackState::Playing {
        let corrupt = view.failure.as_ref().is_some_and(|failure| failure.kind == FailureKind::Corrupt);
        prop_assert!(caller.playback.content(head).is_some() || corrupt);
    }
    let moved_by_user =
        matches!(call, Call::Seek(_) | Call::Step(_) | Call::GoLive | Call::Play | Call::Update(..));
    if !moved_by_user && config.at_end == AtEnd::Hold {
        prop_assert!(view.position >= before, "time went back");
    }
    if !view.held {
        let shown = view.shown.as_ref().unwrap();
        prop_assert_eq!(shown.chunk_index, head);
        prop_assert_eq!(Some(shown.frame_index), caller.world.content(head).frame_at(view.position));
    }
    let stats = caller.playback.stats(now);
    let heaviest = 12_000_000 / 8 * 120 / 100;
    prop_assert!(stats.buffered_bytes <= config.buffer_bytes.max(heaviest), "{:?}", stats);
    let under_way = caller.requests.iter().filter(|request| caller.playback.awaits(**request)).count();
    prop_assert!(under_way <= config.in_flight.max(1));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    /// Nothing panics, the play head never passes what is missing, memory and requests stay within their bounds, and
    /// whoever sleeps until the time asked for does not spin.
    #[test]
    fn any_sequence_of_calls_keeps_the_promises(
        calls in proptest::collection::vec(call(), 1..120),
        config in config(),
        live in any::<bool>(),
        gap in proptest::option::of((1..CHUNKS, 1..20_000_i64)),
    ) {
        let mut caller = Caller::new(config, live, gap);
        for call in &calls {
            let before = caller.playback.position(caller.now);
            caller.call(call);
            check(&mut caller, &config, before, call)?;
        }
        // Nobody answers any more: whatever it asks for, it sleeps in between.
        let mut rounds_at_once = 0;
        for _ in 0..300 {
            let now = caller.now;
            while let Some(request) = caller.playback.poll_request(now) {
                caller.requests.push(request);
            }
            caller.playback.poll_manifest(now);
            let Some(next) = caller.playback.poll_timeout(now) else { break };
            rounds_at_once = if next > now { 0 } else { rounds_at_once + 1 };
            prop_assert!(rounds_at_once < 3, "it is due at {next:?} again and again");
            caller.now = next.max(now);
        }
    }

    /// A server that answers well, however slowly, gets the viewer to the end.
    #[test]
    fn with_answers_it_comes_to_the_end(
        config in config(),
        gap in proptest::option::of((1..CHUNKS, 1..20_000_i64)),
        latency in 1..1_500_u64,
    ) {
        let config = PlaybackConfig { at_end: AtEnd::Hold, retry: RetryConfig::default(), ..config };
        let mut caller = Caller::new(config, false, gap);
        caller.playback.play(caller.now);
        let mut answers: Vec<(Duration, Request)> = Vec::new();
        for _ in 0..20_000 {
            let now = caller.now;
            while let Some(request) = caller.playback.poll_request(now) {
                answers.push((now + Duration::from_millis(latency), request));
            }
            if caller.playback.frame(now).state == PlaybackState::Ended {
                break;
            }
            let wake = caller.playback.poll_timeout(now).into_iter().chain(answers.iter().map(|(at, _)| *at)).min();
            prop_assert!(wake.is_some(), "it waits for nothing at {:?}", caller.playback.position(now));
            caller.now = wake.unwrap_or(now).max(now);
            let (due, later) = answers.into_iter().partition(|(at, _)| *at <= caller.now);
            answers = later;
            let due: Vec<(Duration, Request)> = due;
            for (_, request) in due {
                caller.deliver(request, request.chunk);
            }
        }
        prop_assert_eq!(caller.playback.frame(caller.now).state, PlaybackState::Ended);
    }
}
