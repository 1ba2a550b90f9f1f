//! The playback state machine: which chunk to fetch next, in which quality, and which frame to show now.
//!
//! It owns no clock, no socket and no thread. The caller says what time it is (any [`Duration`] that only grows, for
//! example since the program started), carries out [`Request`]s and hands decoded chunks back; the machine never blanks:
//! while something is missing it holds the last good frame. Typical use, once per drawn picture:
//!
//! ```text
//! if playback.poll_manifest(now) { start fetching the manifest }                       // live streams only
//! while let Some(request) = playback.poll_request(now) { start fetching and decoding it }
//! stop every fetch that playback.awaits() no more
//! for each finished fetch { playback.on_chunk(now, request, chunk, transfer) or playback.on_failure(now, request, …) }
//! for a manifest that came { playback.update(now, &manifest) or playback.on_manifest_failure(now) }
//! draw(playback.frame(now));
//! sleep until playback.poll_timeout(now), or until a fetch finishes, or until the user does something
//! ```
//!
//! One file per job: `ladder` (what the manifest says), `buffer` and `window` (what is at hand and what is wanted),
//! `estimate` and `quality` (what the link carries and what to ask for), `backoff`, `clock`, `progress` (time passes),
//! `live`, `stats`. `simulation` is a network for tests and benches.

mod backoff;
mod buffer;
mod clock;
mod config;
mod content;
mod error;
mod estimate;
mod ladder;
mod live;
mod progress;
mod quality;
#[cfg(any(test, feature = "sample"))]
pub mod simulation;
mod stats;
#[cfg(test)]
mod tests;
mod view;
mod window;

use std::{sync::Arc, time::Duration};

use self::{
    buffer::{Buffer, Slot},
    clock::Clock,
    estimate::Estimate,
    ladder::Ladder,
    live::Follower,
    quality::Chooser,
    stats::Counters,
};
pub use self::{
    buffer::{Delivery, Failure, FailureKind, Request},
    clock::Speed,
    config::{AtEnd, ChoiceConfig, Gaps, LiveConfig, PlaybackConfig, Quality, RetryConfig},
    content::{Content, ShownFrame},
    error::{PlaybackError, UpdateError},
    estimate::Transfer,
    stats::Stats,
    view::{FrameView, PlaybackState},
};
use crate::{
    manifest::Manifest,
    time::{Ticks, Timescale},
};

/// What must be at hand before standing time runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wait {
    /// After opening, a seek or a pause.
    ToStart,
    /// After a stall.
    ToResume,
}

/// Playback of one stream whose chunks are decoded to `C`.
#[derive(Debug)]
pub struct Playback<C> {
    timescale: Timescale,
    ladder: Ladder,
    config: PlaybackConfig,
    clock: Clock,
    /// As the user chose it; the clock may run a little faster to catch up.
    speed: Speed,
    /// Whether the user wants time to run.
    playing: bool,
    wait: Wait,
    buffer: Buffer<C>,
    estimate: Estimate,
    chooser: Chooser,
    follower: Follower,
    counters: Counters,
    shown: Option<ShownFrame<C>>,
}

impl<C: Content> Playback<C> {
    /// Playback of a manifest that has been validated, paused: at the start, or in a live stream as far behind its newest
    /// chunk as the configuration says.
    ///
    /// # Errors
    /// When there is nothing to play, or no representation as the one that is asked for.
    pub fn new(manifest: &Manifest, config: PlaybackConfig) -> Result<Self, PlaybackError> {
        let ladder = Ladder::new(manifest, config.gaps)?;
        let mut playback = Self {
            timescale: manifest.timescale,
            clock: Clock::at(manifest.timescale.nanoseconds(ladder.start())),
            ladder,
            speed: Speed::NORMAL,
            playing: false,
            wait: Wait::ToStart,
            buffer: Buffer::new(config.retry),
            estimate: Estimate::default(),
            chooser: Chooser::new(Quality::Auto, config.choice),
            follower: Follower::new(config.live, config.retry.seed),
            counters: Counters::default(),
            shown: None,
            config,
        };
        playback.set_quality(config.quality)?;
        if playback.is_live() {
            let position = playback.ladder.before_end(playback.target_latency());
            playback.clock = Clock::at(playback.timescale.nanoseconds(position));
        }
        Ok(playback)
    }

    /// Lets time run; from the start when playback stands at the end. Asks again for what had failed.
    pub fn play(&mut self, now: Duration) {
        self.advance(now);
        self.buffer.forgive();
        if self.position(now) >= self.end() && !self.is_live() {
            self.go_to(now, self.start());
        }
        self.playing = true;
        self.advance(now);
    }

    /// Stops time.
    pub fn pause(&mut self, now: Duration) {
        self.advance(now);
        self.playing = false;
        self.counters.stall_ends(now);
        self.clock.stop(now);
    }

    /// Moves the play head; playing or paused stays as it is.
    pub fn seek(&mut self, now: Duration, target: Ticks) {
        self.advance(now);
        self.buffer.forgive();
        self.go_to(now, target);
        self.advance(now);
    }

    /// Moves the play head of a live stream to where it would join now. In other streams it does nothing.
    pub fn go_live(&mut self, now: Duration) {
        if self.is_live() {
            self.seek(now, self.ladder.before_end(self.target_latency()));
        }
    }

    /// Pauses and moves by whole frames, forwards or (negative) backwards.
    pub fn step(&mut self, now: Duration, frames: i32) {
        self.pause(now);
        for _ in 0..frames.unsigned_abs().min(100_000) {
            let target = if frames > 0 { self.next_frame(now) } else { self.previous_frame(now) };
            if target == self.position(now) {
                break;
            }
            self.go_to(now, target);
        }
        self.advance(now);
    }

    /// Changes how fast time runs, from now on.
    pub fn set_speed(&mut self, now: Duration, speed: Speed) {
        self.advance(now);
        self.speed = speed;
        self.clock.set_speed(now, speed);
        self.advance(now);
    }

    /// How fast time runs, as it was chosen.
    #[must_use]
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// How fast time runs at the moment: in a live stream that is late, a little faster than was chosen.
    #[must_use]
    pub fn running_speed(&self) -> Speed {
        self.clock.speed()
    }

    /// Changes which representation is asked for, from the next request on. What is at hand stays.
    ///
    /// # Errors
    /// When there is no such representation; then nothing changes.
    pub fn set_quality(&mut self, quality: Quality) -> Result<(), PlaybackError> {
        match quality {
            Quality::Fixed(index) if index >= self.ladder.rungs() => {
                Err(PlaybackError::NoRepresentation { index })
            }
            _ => {
                self.chooser.quality = quality;
                Ok(())
            }
        }
    }

    /// Which representation is asked for.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.chooser.quality
    }

    /// The next chunk to fetch, if there is a reason to fetch one now. Call until `None`.
    pub fn poll_request(&mut self, now: Duration) -> Option<Request> {
        self.handle_timeout(now);
        self.next_request(now)
    }

    /// Whether the answer to a request is still waited for; if not, fetching it may be stopped.
    #[must_use]
    pub fn awaits(&self, request: Request) -> bool {
        self.buffer.awaited(request).is_some()
    }

    /// Takes a fetched and decoded chunk and how it came. Answers to requests that are not waited for any more are
    /// ignored; a chunk with other times than the manifest gave it counts as corrupt.
    pub fn on_chunk(
        &mut self,
        now: Duration,
        request: Request,
        content: Arc<C>,
        transfer: Transfer,
    ) -> Delivery {
        // It used the link, whether it is of use or not.
        self.estimate.add(transfer);
        self.counters.bytes = self.counters.bytes.saturating_add(transfer.bytes);
        let span = self.ladder.span(request.chunk);
        if span.map(|span| (span.start, span.end)) != content.span() {
            let message = "its frames do not fill the time that the manifest gives it".to_owned();
            return self.on_failure(now, request, FailureKind::Corrupt, message);
        }
        let delivery = self.buffer.deliver(request, content);
        self.advance(now);
        delivery
    }

    /// Takes the news that a chunk could not be fetched or decoded; it is asked for again a few times.
    pub fn on_failure(
        &mut self,
        now: Duration,
        request: Request,
        kind: FailureKind,
        message: String,
    ) -> Delivery {
        let delivery = self.buffer.fail(now, request, kind, message);
        self.advance(now);
        delivery
    }

    /// Whether the manifest of a live stream is to be read again now. Says so once; answer with [`Playback::update`] or
    /// [`Playback::on_manifest_failure`].
    pub fn poll_manifest(&mut self, now: Duration) -> bool {
        self.advance(now);
        self.follower.poll(now)
    }

    /// Takes a newer manifest of the same stream, validated; whether it has more chunks. What is buffered stays.
    ///
    /// # Errors
    /// When anything else differs than chunks at the end; then nothing changes, and the manifest is asked for again.
    pub fn update(&mut self, now: Duration, manifest: &Manifest) -> Result<bool, UpdateError> {
        self.advance(now);
        let grown = match self.ladder.update(manifest) {
            Ok(grown) => grown,
            Err(error) => {
                self.on_manifest_failure(now);
                return Err(error);
            }
        };
        self.follower.updated(now, self.update_after().unwrap_or_default(), grown);
        let (position, inside) = (self.position(now), self.ladder.inside(self.position(now)));
        // The play head waited at the edge, and what comes now starts after a gap.
        if inside != position && !self.clock.is_running() {
            self.clock.stand(self.timescale.nanoseconds(inside));
        }
        self.advance(now);
        Ok(grown)
    }

    /// Takes the news that the manifest could not be read; it is asked for again.
    pub fn on_manifest_failure(&mut self, now: Duration) {
        self.follower.failed(now, &self.config.retry);
        self.advance(now);
    }

    /// When something changes by itself: the next frame is due, a failed fetch is tried again, a slow one is given up, the
    /// manifest is to be read. Never later than that, sometimes sooner. When it is not after `now`, then
    /// [`Playback::poll_request`] and [`Playback::poll_manifest`] have something to do.
    #[must_use]
    pub fn poll_timeout(&self, now: Duration) -> Option<Duration> {
        let fetches = self.buffer.next_event(self.may_ask(self.position(now)));
        let manifest = self.follower.next_event();
        self.next_frame_due(now).into_iter().chain(fetches).chain(manifest).min()
    }

    /// Lets the time since the last call pass. [`Playback::frame`] and [`Playback::poll_request`] do it too.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.give_up_late(now);
        self.advance(now);
    }

    /// What to draw now.
    pub fn frame(&mut self, now: Duration) -> FrameView<C> {
        self.handle_timeout(now);
        let position = self.position(now);
        let (index, _) = self.ladder.at(position);
        let failure = match self.buffer.slot(index) {
            Some(Slot::Failed(failure)) => Some(failure.clone()),
            _ => None,
        };
        FrameView {
            shown: self.shown.clone(),
            position,
            state: self.state(position, failure.as_ref()),
            held: self.frame_at(position).is_none(),
            failure,
        }
    }

    /// Start of the first frame.
    #[must_use]
    pub fn start(&self) -> Ticks {
        self.ladder.start()
    }

    /// End of the last frame; of a live stream, so far.
    #[must_use]
    pub fn end(&self) -> Ticks {
        self.ladder.end()
    }

    /// Where the play head stands.
    #[must_use]
    pub fn position(&self, now: Duration) -> Ticks {
        self.timescale.ticks_in_nanoseconds(self.clock.position(now))
    }

    /// Changes with every seek that needs chunks that were not on their way; older answers are ignored.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.buffer.generation()
    }

    /// The chunks that are decoded and at hand, in order; for a buffer bar.
    pub fn buffered(&self) -> impl Iterator<Item = usize> + '_ {
        self.buffer.ready()
    }

    /// A chunk that is at hand, and the representation it came in.
    #[must_use]
    pub fn content(&self, chunk: usize) -> Option<(&Arc<C>, usize)> {
        match self.buffer.slot(chunk)? {
            Slot::Ready { content, representation, .. } => Some((content, *representation)),
            _ => None,
        }
    }

    /// Whether the stream is still being written.
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.ladder.live().is_some()
    }

    /// How well it plays.
    #[must_use]
    pub fn stats(&self, now: Duration) -> Stats {
        let position = self.position(now);
        let bits = self.estimate.bytes_per_second().map(|bytes| (bytes * 8.0) as u64);
        Stats {
            switches: self.chooser.switches(),
            representation: self.chooser.current(),
            bits_per_second: bits,
            ahead: self.at_hand(position).0,
            buffered_bytes: self.buffer.bytes(),
            latency: self.is_live().then(|| self.ladder.between(position, self.end())),
            ..self.counters.at(now)
        }
    }
}
