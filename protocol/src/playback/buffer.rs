//! The chunks around the playhead: at hand, on their way, to be tried again, or given up.

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use super::PlaybackConfig;
use crate::chunk::Chunk;

/// A chunk to fetch and decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Request {
    /// Given back with the answer; answers to older generations are ignored.
    pub generation: u64,
    /// Index of the chunk in the representation.
    pub chunk: usize,
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

/// What is known of one chunk.
#[derive(Clone, Debug)]
pub(super) enum Slot {
    InFlight { generation: u64, attempt: u32 },
    Retry { attempt: u32, at: Duration },
    Ready(Arc<Chunk>),
    Failed(Failure),
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Buffer {
    slots: BTreeMap<usize, Slot>,
    generation: u64,
}

impl Buffer {
    pub(super) fn slot(&self, chunk: usize) -> Option<&Slot> {
        self.slots.get(&chunk)
    }

    pub(super) fn generation(&self) -> u64 {
        self.generation
    }

    pub(super) fn ready(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots.iter().filter(|(_, slot)| matches!(slot, Slot::Ready(_))).map(|(chunk, _)| *chunk)
    }

    /// Forgets chunks outside `window`.
    pub(super) fn keep(&mut self, window: &[usize]) {
        self.slots.retain(|chunk, _| window.contains(chunk));
    }

    pub(super) fn has_or_awaits(&self, chunk: usize) -> bool {
        matches!(self.slots.get(&chunk), Some(Slot::Ready(_) | Slot::InFlight { .. }))
    }

    /// From now on only answers to new requests count.
    pub(super) fn next_generation(&mut self) {
        self.generation += 1;
        self.slots.retain(|_, slot| matches!(slot, Slot::Ready(_)));
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

    /// The first of `wanted` that may be asked for now.
    pub(super) fn next_request(
        &mut self,
        now: Duration,
        wanted: &[usize],
        in_flight: usize,
    ) -> Option<Request> {
        let busy = self.slots.values().filter(|slot| matches!(slot, Slot::InFlight { .. })).count();
        if busy >= in_flight.max(1) {
            return None;
        }
        let generation = self.generation;
        let (chunk, attempt) = wanted.iter().find_map(|chunk| match self.slots.get(chunk) {
            None => Some((*chunk, 1)),
            Some(Slot::Retry { attempt, at }) if *at <= now => Some((*chunk, attempt + 1)),
            _ => None,
        })?;
        self.slots.insert(chunk, Slot::InFlight { generation, attempt });
        Some(Request { generation, chunk })
    }

    pub(super) fn deliver(&mut self, request: Request, chunk: Arc<Chunk>) -> Delivery {
        match self.awaited(request) {
            Some(_) => {
                self.slots.insert(request.chunk, Slot::Ready(chunk));
                Delivery::Taken
            }
            None => Delivery::Stale,
        }
    }

    pub(super) fn fail(
        &mut self,
        now: Duration,
        request: Request,
        kind: FailureKind,
        message: String,
        config: &PlaybackConfig,
    ) -> Delivery {
        let Some(attempt) = self.awaited(request) else { return Delivery::Stale };
        let slot = if attempt >= config.attempts {
            Slot::Failed(Failure { chunk: request.chunk, kind, attempts: attempt, message })
        } else {
            let wait = config.retry_after.saturating_mul(1 << (attempt - 1).min(10));
            Slot::Retry { attempt, at: now.saturating_add(wait) }
        };
        self.slots.insert(request.chunk, slot);
        Delivery::Taken
    }

    /// When the earliest chunk is to be tried again.
    pub(super) fn next_retry(&self) -> Option<Duration> {
        let times = self.slots.values().filter_map(|slot| match slot {
            Slot::Retry { at, .. } => Some(*at),
            _ => None,
        });
        times.min()
    }

    /// Which attempt a request is, when its answer is still waited for.
    fn awaited(&self, request: Request) -> Option<u32> {
        match self.slots.get(&request.chunk) {
            Some(Slot::InFlight { generation, attempt }) if *generation == request.generation => {
                Some(*attempt)
            }
            _ => None,
        }
    }
}
