//! Time passes: the play head moves over what is at hand, jumps over gaps, stops at what is missing.

use std::{sync::Arc, time::Duration};

use super::{
    AtEnd, Content, Failure, FailureKind, Gaps, Playback, PlaybackState, ShownFrame, Wait, buffer::Slot,
};
use crate::time::Ticks;

/// While time runs, playback looks at what it wants at least this often.
const LOOK_EVERY: Duration = Duration::from_millis(500);

impl<C: Content> Playback<C> {
    /// Moves time up to `now`, but not past what is missing, and chooses the frame to show.
    pub(super) fn advance(&mut self, now: Duration) {
        self.follower.advance(now, self.update_after());
        if self.clock.is_running() {
            self.run(now);
        }
        self.keep_up(now);
        if self.playing && !self.clock.is_running() {
            // A live stream that is complete now has an end.
            if self.position(now) >= self.end() && !self.is_live() {
                self.arrive(now);
            }
            if self.playing && self.enough_at_hand(self.position(now)) {
                self.counters.stall_ends(now);
                self.clock.run(now);
            }
        }
        let position = self.position(now);
        let window = self.window(position);
        self.buffer.keep(&window.chunks());
        if let Some(shown) = self.frame_at(position) {
            self.shown = Some(shown);
            self.counters.first_frame_at.get_or_insert(now);
        }
    }

    /// Gives up requests that take too long. Not whenever time passes: after a pause of the whole program the answers
    /// that are there must be taken first.
    pub(super) fn give_up_late(&mut self, now: Duration) {
        while let Some(late) = self.buffer.expire(now) {
            self.estimate.gave_up(late.bytes, late.asked, late.deadline);
        }
    }

    /// Moves the running clock on: to the first chunk that is not there, and at most to the end.
    fn run(&mut self, now: Duration) {
        let nanoseconds = |ticks| self.timescale.nanoseconds(ticks);
        let (mut at, mut to) = (self.clock.settled(), self.clock.position(now));
        loop {
            let (index, span) = self.ladder.at(self.timescale.ticks_in_nanoseconds(at));
            if !self.passable(index) {
                self.clock.stand(at.max(nanoseconds(span.start)));
                self.stall(now);
                // It may have been given up long before it was due: one more round.
                self.buffer.forgive_unreachable(index);
                return;
            }
            let end = nanoseconds(span.end);
            let Some(next) = self.ladder.span(index + 1) else {
                if to < end {
                    break;
                }
                self.clock.stand(end);
                self.arrive(now);
                return;
            };
            let start = nanoseconds(next.start);
            if self.config.gaps == Gaps::Jump && to >= end {
                // Time goes on behind the gap as if there were none.
                to = to.saturating_add(start.saturating_sub(end.max(at)));
            } else if to < start {
                break;
            }
            at = start;
        }
        self.clock.jump(now, to);
    }

    /// The play head stands at the end.
    fn arrive(&mut self, now: Duration) {
        if self.is_live() {
            self.stall(now);
            return;
        }
        match self.config.at_end {
            AtEnd::Hold => {
                self.playing = false;
                self.counters.stall_ends(now);
            }
            AtEnd::Loop => self.go_to(now, self.start()),
        }
    }

    fn stall(&mut self, now: Duration) {
        self.counters.stall_begins(now);
        self.wait = Wait::ToResume;
    }

    /// Hurries when a live stream is late, and stops hurrying when it is not.
    fn keep_up(&mut self, now: Duration) {
        if !self.is_live() {
            if self.clock.speed() != self.speed {
                self.clock.set_speed(now, self.speed);
            }
            return;
        }
        let position = self.position(now);
        let latency = self.ladder.between(position, self.end());
        let enough = self.at_hand(position).0 >= self.config.start_after;
        let speed = self.follower.speed(self.speed, latency, self.target_latency(), enough);
        if self.clock.speed() != speed {
            self.clock.set_speed(now, speed);
        }
    }

    /// Puts the play head at `target`, inside the match; time stands until enough is at hand there.
    pub(super) fn go_to(&mut self, now: Duration, target: Ticks) {
        let target = self.ladder.inside(target);
        self.clock.stop(now);
        self.clock.stand(self.timescale.nanoseconds(target));
        self.counters.stall_ends(now);
        self.wait = Wait::ToStart;
        let window = self.window(target);
        self.buffer.keep(&window.chunks());
        if !self.buffer.has_or_awaits(self.ladder.at(target).0) {
            self.buffer.next_generation();
        }
    }

    /// When the frame after the one at the running play head is to be shown.
    pub(super) fn next_frame_due(&self, now: Duration) -> Option<Duration> {
        if !self.clock.is_running() {
            return None;
        }
        let position = self.position(now);
        let after = |end: &Ticks| *end > position;
        let shown = self.frame_at(position).and_then(|shown| shown.span()).map(|(_, end)| end);
        let next = shown.filter(after).or_else(|| self.next_start_after_gap(position)).filter(after);
        let next = next.unwrap_or_else(|| self.ladder.at(position).1.end);
        let due = self.clock.reaches(now, self.timescale.nanoseconds(next));
        // Less than a nanosecond away is a nanosecond away: it must not be now for ever.
        Some(due.max(now.saturating_add(Duration::from_nanos(1))).min(now.saturating_add(LOOK_EVERY)))
    }

    pub(super) fn next_frame(&self, now: Duration) -> Ticks {
        let position = self.position(now);
        let here = self.frame_at(position);
        let next = here.as_ref().and_then(|here| here.content.frame_span(here.frame_index + 1));
        let (index, span) = self.ladder.at(position);
        match (next, self.ladder.span(index + 1)) {
            (Some((start, _)), _) => start,
            (None, Some(next)) => next.start,
            // On the last frame already: stay on it.
            (None, None) if here.is_some() => position,
            (None, None) => span.end,
        }
    }

    pub(super) fn previous_frame(&self, now: Duration) -> Ticks {
        let position = self.position(now);
        if let Some(here) = self.frame_at(position)
            && let Some(before) = here.frame_index.checked_sub(1)
            && let Some((start, _)) = here.content.frame_span(before)
        {
            return start;
        }
        let (index, span) = self.ladder.at(position);
        let Some(before) = index.checked_sub(1).and_then(|index| self.ladder.span(index)) else {
            return span.start;
        };
        // Inside the last frame of the chunk before; its start when that is known.
        let inside = before.end - Ticks(1);
        self.frame_at(inside).and_then(|last| Some(last.span()?.0)).unwrap_or(inside)
    }

    /// The frame at a moment, when its chunk is at hand.
    pub(super) fn frame_at(&self, position: Ticks) -> Option<ShownFrame<C>> {
        let (chunk_index, _) = self.ladder.at(position);
        let Some(Slot::Ready { content, representation, .. }) = self.buffer.slot(chunk_index) else {
            return None;
        };
        let frame_index = content.frame_at(position)?;
        Some(ShownFrame {
            content: Arc::clone(content),
            representation: *representation,
            chunk_index,
            frame_index,
        })
    }

    pub(super) fn state(&self, position: Ticks, failure: Option<&Failure>) -> PlaybackState {
        match failure {
            Some(failure) if self.playing && failure.kind == FailureKind::Unreachable => {
                PlaybackState::Failed
            }
            _ if !self.playing && position >= self.end() && !self.is_live() => PlaybackState::Ended,
            _ if !self.playing => PlaybackState::Paused,
            _ if self.clock.is_running() => PlaybackState::Playing,
            _ => PlaybackState::Buffering,
        }
    }

    /// How long a live stream's manifest is good for, as it says itself.
    pub(super) fn update_after(&self) -> Option<Duration> {
        let live = self.ladder.live()?;
        Some(Duration::from_nanos(self.timescale.nanoseconds(live.update_after)))
    }
}
