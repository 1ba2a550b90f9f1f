//! The chunks around the play head: at hand, on their way, to be tried again, or given up.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use super::{
    RetryConfig,
    backoff::{self, SplitMix64},
};

/// A chunk to fetch and decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Request {
    /// Answers to older generations are ignored.
    pub generation: u64,
    /// Index of the chunk in the stream.
    pub chunk: usize,
    /// Index of the representation to take it from.
    pub representation: usize,
    /// Counts the requests: no two are the same, so that the answer to an attempt that was given up is known as such.
    pub serial: u64,
}

/// What became of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// It was waited for.
    Taken,
    /// Nobody waits for it any more.
    Stale,
}

/// Why a chunk is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// It could not be fetched; playback stops at it.
    Unreachable,
    /// It was fetched and cannot be used; playback holds the last good frame over it.
    Corrupt,
}

/// A chunk that was given up.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("chunk {chunk} failed {attempts} times: {message}")]
pub struct Failure {
    /// Index of the chunk.
    pub chunk: usize,
    /// How.
    pub kind: FailureKind,
    /// How often it was asked for.
    pub attempts: u32,
    /// What the last attempt said.
    pub message: String,
}

/// A request that is not answered yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct UnderWay {
    pub(super) request: Request,
    pub(super) attempt: u32,
    pub(super) bytes: u64,
    pub(super) asked: Duration,
    /// When it is given up.
    pub(super) deadline: Duration,
}

/// What is known of one chunk.
#[derive(Debug)]
pub(super) enum Slot<C> {
    InFlight(UnderWay),
    Retry {
        /// Attempts made.
        attempt: u32,
        at: Duration,
        /// No better representation than this one.
        ceiling: usize,
    },
    Ready {
        content: Arc<C>,
        representation: usize,
        bytes: u64,
    },
    Failed(Failure),
}

/// A chunk that may be asked for now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Due {
    pub(super) chunk: usize,
    /// Which attempt it would be, from 1 on.
    pub(super) attempt: u32,
    pub(super) ceiling: usize,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Buffer<C> {
    slots: BTreeMap<usize, Slot<C>>,
    generation: u64,
    serial: u64,
    retry: RetryConfig,
    random: SplitMix64,
}

impl<C> Buffer<C> {
    pub(super) fn new(retry: RetryConfig) -> Self {
        let random = SplitMix64::new(retry.seed);
        Self { slots: BTreeMap::new(), generation: 0, serial: 0, retry, random }
    }

    pub(super) fn slot(&self, chunk: usize) -> Option<&Slot<C>> {
        self.slots.get(&chunk)
    }

    pub(super) fn generation(&self) -> u64 {
        self.generation
    }

    pub(super) fn ready(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots.iter().filter(|(_, slot)| matches!(slot, Slot::Ready { .. })).map(|(chunk, _)| *chunk)
    }

    /// Bytes at hand and on their way.
    pub(super) fn bytes(&self) -> u64 {
        let each = self.slots.keys().filter_map(|chunk| self.bytes_of(*chunk));
        each.fold(0, u64::saturating_add)
    }

    /// Bytes of one chunk, when it is at hand, on its way or given up.
    pub(super) fn bytes_of(&self, chunk: usize) -> Option<u64> {
        match self.slots.get(&chunk)? {
            Slot::InFlight(UnderWay { bytes, .. }) | Slot::Ready { bytes, .. } => Some(*bytes),
            Slot::Failed(_) => Some(0),
            Slot::Retry { .. } => None,
        }
    }

    /// Forgets chunks outside `window`.
    pub(super) fn keep(&mut self, window: &[usize]) {
        self.slots.retain(|chunk, _| window.contains(chunk));
    }

    pub(super) fn has_or_awaits(&self, chunk: usize) -> bool {
        matches!(self.slots.get(&chunk), Some(Slot::Ready { .. } | Slot::InFlight(_)))
    }

    /// From now on only answers to new requests count.
    pub(super) fn next_generation(&mut self) {
        self.generation += 1;
        self.slots.retain(|_, slot| matches!(slot, Slot::Ready { .. }));
    }

    /// Gives failed chunks another round of attempts.
    pub(super) fn forgive(&mut self) {
        self.slots.retain(|_, slot| !matches!(slot, Slot::Failed(_)));
    }

    /// Gives one chunk another round of attempts if it could not be fetched.
    pub(super) fn forgive_unreachable(&mut self, chunk: usize) {
        let unreachable =
            |failure: &Failure| failure.kind == FailureKind::Unreachable && failure.chunk == chunk;
        self.slots.retain(|_, slot| !matches!(slot, Slot::Failed(failure) if unreachable(failure)));
    }

    /// Whether one more fetch may start.
    pub(super) fn has_room(&self, in_flight: usize) -> bool {
        self.under_way().count() < in_flight.max(1)
    }

    pub(super) fn under_way(&self) -> impl Iterator<Item = &UnderWay> + '_ {
        self.slots.values().filter_map(|slot| match slot {
            Slot::InFlight(under_way) => Some(under_way),
            _ => None,
        })
    }

    /// The first of `wanted` that may be asked for now.
    pub(super) fn next_due(&self, now: Duration, wanted: &[usize]) -> Option<Due> {
        wanted.iter().find_map(|&chunk| match self.slots.get(&chunk) {
            None => Some(Due { chunk, attempt: 1, ceiling: usize::MAX }),
            Some(&Slot::Retry { attempt, at, ceiling }) if at <= now => {
                Some(Due { chunk, attempt: attempt + 1, ceiling })
            }
            _ => None,
        })
    }

    /// Notes that a chunk is asked for.
    pub(super) fn ask(
        &mut self,
        now: Duration,
        due: Due,
        representation: usize,
        bytes: u64,
        patience: Duration,
    ) -> Request {
        self.serial += 1;
        let request =
            Request { generation: self.generation, chunk: due.chunk, representation, serial: self.serial };
        // A deadline in the past would ask for ever without waiting.
        let deadline = now.saturating_add(patience.max(Duration::from_millis(1)));
        let under_way = UnderWay { request, attempt: due.attempt, bytes, asked: now, deadline };
        self.slots.insert(due.chunk, Slot::InFlight(under_way));
        request
    }

    /// What is known of a request whose answer is still waited for.
    pub(super) fn awaited(&self, request: Request) -> Option<UnderWay> {
        match self.slots.get(&request.chunk) {
            Some(Slot::InFlight(under_way)) if under_way.request == request => Some(*under_way),
            _ => None,
        }
    }

    pub(super) fn deliver(&mut self, request: Request, content: Arc<C>) -> Delivery {
        let Some(UnderWay { bytes, .. }) = self.awaited(request) else { return Delivery::Stale };
        let representation = request.representation;
        self.slots.insert(request.chunk, Slot::Ready { content, representation, bytes });
        Delivery::Taken
    }

    pub(super) fn fail(
        &mut self,
        now: Duration,
        request: Request,
        kind: FailureKind,
        message: String,
    ) -> Delivery {
        let Some(UnderWay { attempt, .. }) = self.awaited(request) else { return Delivery::Stale };
        let wait = backoff::wait(attempt, self.retry.wait, self.retry.longest_wait, &mut self.random);
        // Another file may be whole where this one is not.
        let ceiling = match kind {
            FailureKind::Corrupt => request.representation.saturating_sub(1),
            FailureKind::Unreachable => request.representation,
        };
        self.try_again(request.chunk, attempt, now.saturating_add(wait), ceiling, kind, message);
        Delivery::Taken
    }

    /// Gives up one request whose deadline has passed: it is asked for again at once, lower. Call until `None`.
    pub(super) fn expire(&mut self, now: Duration) -> Option<UnderWay> {
        let late = *self.under_way().find(|under_way| under_way.deadline <= now)?;
        let message = format!("no answer within {:.1} s", now.saturating_sub(late.asked).as_secs_f64());
        let lower = late.request.representation.saturating_sub(1);
        self.try_again(late.request.chunk, late.attempt, now, lower, FailureKind::Unreachable, message);
        Some(late)
    }

    /// When something happens by itself: a chunk is tried again, or given up.
    pub(super) fn next_event(&self, may_ask: bool) -> Option<Duration> {
        let times = self.slots.values().filter_map(|slot| match slot {
            // Without room it is the answer to another request that makes it go on.
            Slot::Retry { at, .. } if may_ask => Some(*at),
            Slot::InFlight(under_way) => Some(under_way.deadline),
            _ => None,
        });
        times.min()
    }

    fn try_again(
        &mut self,
        chunk: usize,
        attempt: u32,
        at: Duration,
        ceiling: usize,
        kind: FailureKind,
        message: String,
    ) {
        let most = match kind {
            FailureKind::Unreachable => self.retry.attempts,
            FailureKind::Corrupt => self.retry.corrupt_attempts,
        };
        let slot = if attempt >= most {
            Slot::Failed(Failure { chunk, kind, attempts: attempt, message })
        } else {
            Slot::Retry { attempt, at, ceiling }
        };
        self.slots.insert(chunk, slot);
    }
}
