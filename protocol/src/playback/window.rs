//! Which chunks around the play head are wanted, how much is at hand, and the next request.

use std::time::Duration;

use super::{
    AtEnd, Content, Gaps, Playback, Request, Wait,
    buffer::{FailureKind, Slot},
    quality::Situation,
};
use crate::time::Ticks;

/// Chunks looked at ahead of the play head, however short a hostile manifest makes them.
const MOST_CHUNKS: usize = 100;

/// Chunks worth keeping.
#[derive(Debug)]
pub(super) struct Window {
    /// From the one being shown on, in the order in which they are shown.
    ahead: Vec<Step>,
    /// Before it.
    behind: Vec<usize>,
}

impl Window {
    pub(super) fn chunks(&self) -> Vec<usize> {
        self.ahead.iter().map(|step| step.chunk).chain(self.behind.iter().copied()).collect()
    }
}

/// A chunk on the way of the play head.
#[derive(Clone, Copy, Debug)]
struct Step {
    chunk: usize,
    /// Match time from the play head to the chunk's start and to its end.
    from: Duration,
    to: Duration,
}

/// What comes after everything that is at hand without a hole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Beyond {
    /// The end of the match.
    End,
    /// A chunk that is on its way, or will be asked for.
    Missing,
    /// Nothing that is wanted now, or a chunk that was given up.
    Nothing,
}

impl<C: Content> Playback<C> {
    /// The window when the play head stands at a position. What is missing counts with the most that it can weigh, so that
    /// whatever representation is chosen for it, there is room.
    pub(super) fn window(&self, position: Ticks) -> Window {
        let mut room = self.config.buffer_bytes;
        let mut ahead = Vec::new();
        for step in self.steps(position) {
            let bytes = self.buffer.bytes_of(step.chunk);
            let bytes = bytes.unwrap_or_else(|| self.ladder.most_bytes(step.chunk));
            if bytes > room && !ahead.is_empty() {
                break;
            }
            room = room.saturating_sub(bytes);
            ahead.push(step);
        }
        let (index, _) = self.ladder.at(position);
        let mut behind = Vec::new();
        for chunk in (1..=self.config.behind).map_while(|step| index.checked_sub(step)) {
            let bytes = match self.buffer.slot(chunk) {
                Some(Slot::Ready { bytes, .. }) => *bytes,
                _ => continue,
            };
            if bytes <= room && ahead.iter().all(|step| step.chunk != chunk) {
                room -= bytes;
                behind.push(chunk);
            }
        }
        Window { ahead, behind }
    }

    /// The chunks that start within the time that is fetched ahead.
    fn steps(&self, position: Ticks) -> impl Iterator<Item = Step> + '_ {
        let (first, _) = self.ladder.at(position);
        let to_end = self.ladder.between(position, self.end());
        let around = self.config.at_end == AtEnd::Loop && !self.is_live();
        let straight = (first..self.ladder.chunks())
            .take(MOST_CHUNKS)
            .map(move |chunk| (chunk, Duration::ZERO, position));
        let again = if around { 0..first.min(MOST_CHUNKS) } else { 0..0 };
        let again = again.map(move |chunk| (chunk, to_end, self.start()));
        let steps = straight.chain(again).filter_map(move |(chunk, before, position)| {
            let span = self.ladder.span(chunk)?;
            let from = before + self.ladder.between(position, span.start);
            Some(Step { chunk, from, to: before + self.ladder.between(position, span.end) })
        });
        steps.take_while(move |step| step.chunk == first || step.from < self.config.ahead)
    }

    /// Match time at hand without a hole, from the play head on, and what comes after it.
    pub(super) fn at_hand(&self, position: Ticks) -> (Duration, Beyond) {
        let window = self.window(position);
        let mut at_hand = Duration::ZERO;
        for step in &window.ahead {
            if !self.passable(step.chunk) {
                let given_up = matches!(self.buffer.slot(step.chunk), Some(Slot::Failed(_)));
                return (at_hand, if given_up { Beyond::Nothing } else { Beyond::Missing });
            }
            at_hand = step.to;
        }
        let last = window.ahead.last().is_some_and(|step| step.chunk + 1 == self.ladder.chunks());
        (at_hand, if last { Beyond::End } else { Beyond::Nothing })
    }

    /// Whether enough is at hand for standing time to run.
    pub(super) fn enough_at_hand(&self, position: Ticks) -> bool {
        let (index, _) = self.ladder.at(position);
        if !self.passable(index) || self.is_live() && position >= self.end() {
            return false;
        }
        let wanted = match self.wait {
            Wait::ToStart => self.config.start_after,
            Wait::ToResume => self.config.resume_after,
        };
        // More than its distance from the edge can a live stream not have at hand.
        let wanted = if self.is_live() { wanted.min(self.target_latency()) } else { wanted };
        match self.at_hand(position) {
            (_, Beyond::Nothing) => true,
            (_, Beyond::End) if !self.is_live() => true,
            (at_hand, _) => at_hand >= wanted,
        }
    }

    /// Whether time may run through a chunk: it is at hand, or it will never be readable.
    pub(super) fn passable(&self, chunk: usize) -> bool {
        match self.buffer.slot(chunk) {
            Some(Slot::Ready { .. }) => true,
            Some(Slot::Failed(failure)) => failure.kind == FailureKind::Corrupt,
            _ => false,
        }
    }

    /// Whether one more fetch may start. While little is at hand, the chunk that comes next has the link for itself.
    pub(super) fn may_ask(&self, position: Ticks) -> bool {
        let (index, _) = self.ladder.at(position);
        let head_is_coming = matches!(self.buffer.slot(index), Some(Slot::InFlight(_)));
        let little = || self.at_hand(position).0 < self.config.resume_after;
        let alone = head_is_coming || self.buffer.under_way().next().is_some() && little();
        !alone && self.buffer.has_room(self.config.in_flight)
    }

    /// See [`Playback::poll_request`].
    pub(super) fn next_request(&mut self, now: Duration) -> Option<Request> {
        let position = self.position(now);
        if !self.may_ask(position) {
            return None;
        }
        let steps = self.window(position).ahead;
        let wanted: Vec<usize> = steps.iter().map(|step| step.chunk).collect();
        let due = self.buffer.next_due(now, &wanted)?;
        let until_shown = steps.iter().find(|step| step.chunk == due.chunk).map(|step| step.from)?;
        let measured = self.estimate.bytes_per_second();
        let to_end = self.ladder.between(position, self.end());
        let endless = self.config.at_end == AtEnd::Loop && !self.is_live();
        let situation = Situation {
            now,
            at_hand: self.at_hand(position).0,
            at_most: if endless { self.config.ahead } else { self.config.ahead.min(to_end) },
            bytes_per_second: measured,
            speed: f64::from(self.speed.as_percent()) / 100.0,
        };
        let representation = self.chooser.choose(&self.ladder, due.chunk, due.ceiling, &situation);
        let bytes = self.ladder.bytes(representation, due.chunk)?;
        let expected_s = bytes as f64 / self.chooser.reckoned(measured);
        let expected = Duration::try_from_secs_f64(expected_s).unwrap_or(Duration::MAX);
        let retry = &self.config.retry;
        let patience = (retry.patience.saturating_mul(due.attempt.saturating_sub(2).max(1)))
            .max(expected.saturating_mul(4))
            // What is not shown soon may as well take its time: giving it up wastes what has come of it.
            .max(until_shown.mul_f64(0.6 / situation.speed))
            .min(retry.longest_patience);
        Some(self.buffer.ask(now, due, representation, bytes, patience))
    }

    /// How far behind the newest chunk a live stream is played.
    pub(super) fn target_latency(&self) -> Duration {
        self.follower.target(self.ladder.last(2))
    }

    /// Whether a moment lies in a gap through which time runs.
    pub(super) fn next_start_after_gap(&self, position: Ticks) -> Option<Ticks> {
        let (index, span) = self.ladder.at(position);
        let next = self.ladder.span(index + 1)?;
        (self.config.gaps == Gaps::Hold && position >= span.end).then_some(next.start)
    }
}
