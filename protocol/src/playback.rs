//! The playback state machine: which chunk to fetch next, and which frame to show now.
//!
//! It owns no clock, no socket and no thread. The caller says what time it is (any [`Duration`] that only grows, for
//! example since the program started), carries out [`Request`]s and hands decoded chunks back; the machine never blanks:
//! while something is missing it holds the last good frame. Typical use, once per drawn picture:
//!
//! ```text
//! while let Some(request) = playback.poll_request(now) { start fetching and decoding it }
//! for each finished fetch { playback.on_chunk(request, chunk) or playback.on_failure(now, request, …) }
//! draw(playback.frame(now));
//! sleep until playback.poll_timeout(now), or until a fetch finishes, or until the user does something
//! ```

mod buffer;
mod clock;
#[cfg(test)]
mod tests;

use std::{sync::Arc, time::Duration};

use self::{
    buffer::{Buffer, Slot},
    clock::Clock,
};
pub use self::{
    buffer::{Delivery, Failure, FailureKind, Request},
    clock::Speed,
};
use crate::{
    chunk::{Chunk, ChunkFrame},
    manifest::Manifest,
    time::{Ticks, Timescale},
};

/// How much is fetched ahead, kept behind and tried again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaybackConfig {
    /// Chunks fetched after the one being shown.
    pub ahead: usize,
    /// Chunks kept before the one being shown.
    pub behind: usize,
    /// Fetches under way at the same time.
    pub in_flight: usize,
    /// Times that a chunk is asked for before it counts as failed; at least 1.
    pub attempts: u32,
    /// Wait before the second attempt; doubles with every further one.
    pub retry_after: Duration,
    /// What happens after the last frame.
    pub at_end: AtEnd,
}

impl Default for PlaybackConfig {
    fn default() -> Self {
        Self {
            ahead: 3,
            behind: 1,
            in_flight: 2,
            attempts: 4,
            retry_after: Duration::from_millis(250),
            at_end: AtEnd::Hold,
        }
    }
}

/// What happens after the last frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtEnd {
    /// The last frame stays until the user does something.
    Hold,
    /// From the start again.
    Loop,
}

/// What playback is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaybackState {
    /// Standing where the user left it.
    Paused,
    /// Time runs.
    Playing,
    /// Time would run, but the next frame has not arrived.
    Buffering,
    /// Standing on the last frame.
    Ended,
    /// Standing because a chunk could not be fetched; `play` or `seek` tries again.
    Failed,
}

/// A frame inside a decoded chunk, cheap to keep.
#[derive(Clone, Debug)]
pub struct ShownFrame {
    chunk: Arc<Chunk>,
    /// Which chunk of the representation.
    pub chunk_index: usize,
    /// Which frame of that chunk.
    pub frame_index: usize,
}

impl ShownFrame {
    /// The frame.
    #[must_use]
    pub fn frame(&self) -> Option<&ChunkFrame> {
        self.chunk.frames.get(self.frame_index)
    }

    /// The chunk that the frame belongs to.
    #[must_use]
    pub fn chunk(&self) -> &Arc<Chunk> {
        &self.chunk
    }
}

/// What to draw now.
#[derive(Clone, Debug)]
pub struct FrameView {
    /// The frame to show; `None` only until the first chunk has arrived.
    pub shown: Option<ShownFrame>,
    /// Where the playhead stands. Differs from the time of `shown` while that is held.
    pub position: Ticks,
    /// What playback is doing.
    pub state: PlaybackState,
    /// Whether `shown` is held because the frame at `position` has not arrived or cannot be read.
    pub held: bool,
    /// Why the frame at `position` cannot be shown, once no further attempt is made.
    pub failure: Option<Failure>,
}

/// Why playback cannot start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlaybackError {
    /// There is no such representation.
    #[error("the stream has no representation {index}")]
    NoRepresentation {
        /// Asked for.
        index: usize,
    },
    /// Nothing to show.
    #[error("the stream has no chunks yet: nothing to play")]
    Empty,
}

/// When a chunk is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Span {
    start: Ticks,
    end: Ticks,
}

/// Playback of one representation of one stream.
#[derive(Debug)]
pub struct Playback {
    timescale: Timescale,
    spans: Vec<Span>,
    config: PlaybackConfig,
    clock: Clock,
    /// Whether the user wants time to run.
    playing: bool,
    buffer: Buffer,
    shown: Option<ShownFrame>,
}

impl Playback {
    /// Playback of representation `representation` of a manifest that has been validated, paused at the start.
    ///
    /// # Errors
    /// When there is nothing to play.
    pub fn new(
        manifest: &Manifest,
        representation: usize,
        config: PlaybackConfig,
    ) -> Result<Self, PlaybackError> {
        let chunks = &manifest
            .representations
            .get(representation)
            .ok_or(PlaybackError::NoRepresentation { index: representation })?
            .chunks;
        let spans: Vec<Span> = chunks
            .iter()
            .map(|chunk| Span { start: chunk.start, end: chunk.start + chunk.duration })
            .collect();
        let start = spans.first().ok_or(PlaybackError::Empty)?.start;
        Ok(Self {
            timescale: manifest.timescale,
            clock: Clock::at(manifest.timescale.nanoseconds(start)),
            spans,
            config,
            playing: false,
            buffer: Buffer::default(),
            shown: None,
        })
    }

    /// Lets time run; from the start when playback stands at the end. Asks again for what had failed.
    pub fn play(&mut self, now: Duration) {
        self.advance(now);
        self.buffer.forgive();
        if self.position(now) >= self.end() {
            self.go_to(now, self.start());
        }
        self.playing = true;
        self.advance(now);
    }

    /// Stops time.
    pub fn pause(&mut self, now: Duration) {
        self.advance(now);
        self.playing = false;
        self.clock.stop(now);
    }

    /// Moves the playhead; playing or paused stays as it is.
    pub fn seek(&mut self, now: Duration, target: Ticks) {
        self.advance(now);
        self.buffer.forgive();
        self.go_to(now, target);
        self.advance(now);
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
        self.clock.set_speed(now, speed);
    }

    /// How fast time runs.
    #[must_use]
    pub fn speed(&self) -> Speed {
        self.clock.speed()
    }

    /// The next chunk to fetch, if there is a reason to fetch one now. Call until `None`.
    pub fn poll_request(&mut self, now: Duration) -> Option<Request> {
        self.advance(now);
        let wanted = self.wanted(now);
        self.buffer.next_request(now, &wanted, self.config.in_flight)
    }

    /// Takes a fetched and decoded chunk. Answers to requests from before a seek are ignored; a chunk with other times
    /// than the manifest gave it counts as corrupt.
    pub fn on_chunk(&mut self, now: Duration, request: Request, chunk: Arc<Chunk>) -> Delivery {
        let span = self.spans.get(request.chunk);
        if span.map(|span| (span.start, span.end)) != chunk.span() {
            let message = "its frames do not fill the time that the manifest gives it".to_owned();
            return self.on_failure(now, request, FailureKind::Corrupt, message);
        }
        let delivery = self.buffer.deliver(request, chunk);
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
        let delivery = self.buffer.fail(now, request, kind, message, &self.config);
        self.advance(now);
        delivery
    }

    /// When something changes by itself: the next frame is due, or a failed fetch is tried again.
    #[must_use]
    pub fn poll_timeout(&self, now: Duration) -> Option<Duration> {
        let due = self.clock.is_running().then(|| {
            let position = self.position(now);
            let shown = self.at_hand(position);
            let end = shown.as_ref().and_then(ShownFrame::frame).map(|frame| frame.start + frame.duration);
            let next = end.filter(|end| *end > position).unwrap_or_else(|| self.span_at(position).1.end);
            self.clock.reaches(now, self.timescale.nanoseconds(next))
        });
        self.buffer.next_retry().into_iter().chain(due).min()
    }

    /// Lets the time since the last call pass. [`Playback::frame`] does it too.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.advance(now);
    }

    /// What to draw now.
    pub fn frame(&mut self, now: Duration) -> FrameView {
        self.advance(now);
        let position = self.position(now);
        let (index, _) = self.span_at(position);
        let failure = match self.buffer.slot(index) {
            Some(Slot::Failed(failure)) => Some(failure.clone()),
            _ => None,
        };
        FrameView {
            shown: self.shown.clone(),
            position,
            state: self.state(position, failure.as_ref()),
            held: self.at_hand(position).is_none(),
            failure,
        }
    }

    /// Start of the first frame.
    #[must_use]
    pub fn start(&self) -> Ticks {
        self.spans.first().map(|span| span.start).unwrap_or_default()
    }

    /// End of the last frame.
    #[must_use]
    pub fn end(&self) -> Ticks {
        self.spans.last().map(|span| span.end).unwrap_or_default()
    }

    /// Where the playhead stands.
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

    fn state(&self, position: Ticks, failure: Option<&Failure>) -> PlaybackState {
        match failure {
            Some(failure) if self.playing && failure.kind == FailureKind::Unreachable => {
                PlaybackState::Failed
            }
            _ if !self.playing && position >= self.end() => PlaybackState::Ended,
            _ if !self.playing => PlaybackState::Paused,
            _ if self.clock.is_running() => PlaybackState::Playing,
            _ => PlaybackState::Buffering,
        }
    }

    /// Moves time up to `now`, but not past what is missing, and chooses the frame to show.
    fn advance(&mut self, now: Duration) {
        if self.clock.is_running() {
            self.run(now);
        }
        let position = self.position(now);
        let (index, _) = self.span_at(position);
        if self.playing && !self.clock.is_running() && self.passable(index) {
            self.clock.run(now);
        }
        self.buffer.keep(&self.window(index));
        if let Some(shown) = self.at_hand(position) {
            self.shown = Some(shown);
        }
    }

    /// Stops the running clock at the first chunk that is not there, and at the end.
    fn run(&mut self, now: Duration) {
        let (from, to) = (self.clock.settled(), self.clock.position(now));
        let first = self.span_at(self.timescale.ticks_in_nanoseconds(from)).0;
        let last = self.span_at(self.timescale.ticks_in_nanoseconds(to)).0;
        if let Some(missing) = (first..=last).find(|index| !self.passable(*index)) {
            let start = self.spans.get(missing).map(|span| span.start).unwrap_or_default();
            self.clock.stand(from.max(self.timescale.nanoseconds(start)));
            // It may have been given up long before it was due: one more round.
            self.buffer.forgive_unreachable(missing);
            return;
        }
        if to >= self.timescale.nanoseconds(self.end()) {
            match self.config.at_end {
                AtEnd::Hold => {
                    self.clock.stand(self.timescale.nanoseconds(self.end()));
                    self.playing = false;
                }
                AtEnd::Loop => self.go_to(now, self.start()),
            }
            return;
        }
        self.clock.settle(now);
    }

    /// Whether time may run through a chunk: it is at hand, or it will never be readable.
    fn passable(&self, index: usize) -> bool {
        match self.buffer.slot(index) {
            Some(Slot::Ready(_)) => true,
            Some(Slot::Failed(failure)) => failure.kind == FailureKind::Corrupt,
            _ => false,
        }
    }

    /// Puts the playhead at `target`, inside the match; time stands until [`Playback::advance`] finds the chunk there.
    fn go_to(&mut self, now: Duration, target: Ticks) {
        let target = target.clamp(self.start(), self.end());
        self.clock.stop(now);
        self.clock.stand(self.timescale.nanoseconds(target));
        let (index, _) = self.span_at(target);
        self.buffer.keep(&self.window(index));
        if !self.buffer.has_or_awaits(index) {
            self.buffer.next_generation();
        }
    }

    fn next_frame(&self, now: Duration) -> Ticks {
        let position = self.position(now);
        let here = self.at_hand(position);
        let next = here.as_ref().and_then(|here| here.chunk.frames.get(here.frame_index + 1));
        let (index, span) = self.span_at(position);
        match (next, self.spans.get(index + 1)) {
            (Some(next), _) => next.start,
            (None, Some(next)) => next.start,
            // On the last frame already: stay on it.
            (None, None) if here.is_some() => position,
            (None, None) => span.end,
        }
    }

    fn previous_frame(&self, now: Duration) -> Ticks {
        let position = self.position(now);
        if let Some(here) = self.at_hand(position)
            && let Some(previous) =
                here.frame_index.checked_sub(1).and_then(|frame| here.chunk.frames.get(frame))
        {
            return previous.start;
        }
        let (index, span) = self.span_at(position);
        let Some(before) = index.checked_sub(1).and_then(|index| self.spans.get(index)) else {
            return span.start;
        };
        // Inside the last frame of the chunk before; its start when that is known.
        let inside = before.end - Ticks(1);
        self.at_hand(inside).and_then(|last| Some(last.frame()?.start)).unwrap_or(inside)
    }

    /// The chunk shown at a moment: the last one that has started, or the first.
    fn span_at(&self, position: Ticks) -> (usize, Span) {
        let index = self.spans.partition_point(|span| span.start <= position).saturating_sub(1);
        let nothing = Span { start: Ticks(0), end: Ticks(0) };
        (index, self.spans.get(index).copied().unwrap_or(nothing))
    }

    /// The frame at a moment, when its chunk is at hand.
    fn at_hand(&self, position: Ticks) -> Option<ShownFrame> {
        let (chunk_index, _) = self.span_at(position);
        let Some(Slot::Ready(chunk)) = self.buffer.slot(chunk_index) else { return None };
        let frame_index = chunk.frame_at(position)?;
        Some(ShownFrame { chunk: Arc::clone(chunk), chunk_index, frame_index })
    }

    /// Chunks worth keeping when `index` is shown.
    fn window(&self, index: usize) -> Vec<usize> {
        let count = self.spans.len();
        let ahead = (1..=self.config.ahead).filter_map(|step| match self.config.at_end {
            AtEnd::Hold => Some(index + step).filter(|index| *index < count),
            AtEnd::Loop => Some((index + step) % count.max(1)),
        });
        let behind = (1..=self.config.behind).filter_map(|step| index.checked_sub(step));
        std::iter::once(index).chain(ahead).chain(behind).collect()
    }

    /// Chunks to ask for, most urgent first: those behind are kept but not asked for.
    fn wanted(&self, now: Duration) -> Vec<usize> {
        let (index, _) = self.span_at(self.position(now));
        let mut wanted = self.window(index);
        wanted.truncate(wanted.len() - index.min(self.config.behind));
        wanted
    }
}
