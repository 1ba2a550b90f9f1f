//! What the manifest says of the chunks: when they are shown, what they weigh in every representation, where they lie.

use std::time::Duration;

use super::{Gaps, PlaybackError, UpdateError};
use crate::{
    manifest::{Live, Manifest, Representation},
    time::{Ticks, Timescale},
};

/// When a chunk is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) start: Ticks,
    pub(super) end: Ticks,
}

/// All chunks of all representations.
#[derive(Clone, Debug)]
pub(super) struct Ladder {
    timescale: Timescale,
    gaps: Gaps,
    representations: Vec<Representation>,
    live: Option<Live>,
    spans: Vec<Span>,
    /// Match time of all chunks before each one.
    played: Vec<Ticks>,
}

impl Ladder {
    pub(super) fn new(manifest: &Manifest, gaps: Gaps) -> Result<Self, PlaybackError> {
        let longest = manifest.representations.iter().max_by_key(|item| item.chunks.len());
        let chunks = longest.map(|item| item.chunks.as_slice()).unwrap_or_default();
        if chunks.is_empty() {
            return Err(PlaybackError::Empty);
        }
        let spans = chunks.iter().map(|chunk| Span { start: chunk.start, end: chunk.start + chunk.duration });
        let played = chunks.iter().scan(Ticks(0), |sum, chunk| {
            let before = *sum;
            *sum = before + chunk.duration;
            Some(before)
        });
        Ok(Self {
            timescale: manifest.timescale,
            gaps,
            spans: spans.collect(),
            played: played.collect(),
            representations: manifest.representations.clone(),
            live: manifest.live,
        })
    }

    /// The same stream with more chunks, and nothing else different; whether there are more.
    pub(super) fn update(&mut self, manifest: &Manifest) -> Result<bool, UpdateError> {
        if manifest.timescale != self.timescale {
            return Err(UpdateError::Timescale);
        }
        let ids = |items: &[Representation]| items.iter().map(|item| item.id.clone()).collect::<Vec<_>>();
        if ids(&manifest.representations) != ids(&self.representations) {
            return Err(UpdateError::Representations);
        }
        for (index, (old, new)) in self.representations.iter().zip(&manifest.representations).enumerate() {
            if new.chunks.len() < old.chunks.len() {
                return Err(UpdateError::Shrunk { representation: index });
            }
            if let Some(chunk) = old.chunks.iter().zip(&new.chunks).position(|(old, new)| old != new) {
                return Err(UpdateError::Changed { representation: index, chunk });
            }
        }
        let updated = Self::new(manifest, self.gaps).map_err(|_| UpdateError::Representations)?;
        let grown = updated.spans.len() > self.spans.len();
        *self = updated;
        Ok(grown)
    }

    pub(super) fn live(&self) -> Option<Live> {
        self.live
    }

    pub(super) fn rungs(&self) -> usize {
        self.representations.len()
    }

    pub(super) fn chunks(&self) -> usize {
        self.spans.len()
    }

    pub(super) fn span(&self, chunk: usize) -> Option<Span> {
        self.spans.get(chunk).copied()
    }

    pub(super) fn start(&self) -> Ticks {
        self.spans.first().map(|span| span.start).unwrap_or_default()
    }

    pub(super) fn end(&self) -> Ticks {
        self.spans.last().map(|span| span.end).unwrap_or_default()
    }

    /// The chunk shown at a moment: the last one that has started, or the first.
    pub(super) fn at(&self, position: Ticks) -> (usize, Span) {
        let index = self.spans.partition_point(|span| span.start <= position).saturating_sub(1);
        let nothing = Span { start: Ticks(0), end: Ticks(0) };
        (index, self.span(index).unwrap_or(nothing))
    }

    /// A moment inside the match; where gaps are jumped, not in one.
    pub(super) fn inside(&self, position: Ticks) -> Ticks {
        let position = position.clamp(self.start(), self.end());
        let (index, span) = self.at(position);
        match self.span(index + 1) {
            Some(next) if self.gaps == Gaps::Jump && position >= span.end => next.start,
            _ => position,
        }
    }

    /// Bytes of a chunk's file, when the representation has it.
    pub(super) fn bytes(&self, representation: usize, chunk: usize) -> Option<u64> {
        Some(self.representations.get(representation)?.chunks.get(chunk)?.file.bytes)
    }

    /// Bytes that a chunk takes at most.
    pub(super) fn most_bytes(&self, chunk: usize) -> u64 {
        (0..self.rungs()).filter_map(|rung| self.bytes(rung, chunk)).max().unwrap_or(0)
    }

    /// `wanted`, or the nearest representation that has the chunk already, rather a lower one.
    pub(super) fn available(&self, wanted: usize, chunk: usize) -> usize {
        let has = |rung: &usize| self.bytes(*rung, chunk).is_some();
        (0..=wanted).rev().find(has).or_else(|| (wanted..self.rungs()).find(has)).unwrap_or(0)
    }

    /// Bytes per second of match that a representation needs for `count` chunks from `chunk` on, or for its last ones.
    pub(super) fn rate(&self, representation: usize, chunk: usize, count: usize) -> f64 {
        let entries = self.representations.get(representation).map(|item| item.chunks.as_slice());
        let entries = entries.unwrap_or_default();
        let from = chunk.min(entries.len().saturating_sub(count));
        let entries = entries.get(from..).unwrap_or_default();
        let (mut bytes, mut ticks) = (0_u64, Ticks(0));
        for entry in entries.iter().take(count) {
            bytes = bytes.saturating_add(entry.file.bytes);
            ticks = ticks + entry.duration;
        }
        if ticks > Ticks(0) { bytes as f64 / self.timescale.seconds(ticks) } else { 0.0 }
    }

    /// How long a chunk is, seconds.
    pub(super) fn seconds(&self, chunk: usize) -> f64 {
        self.span(chunk).map_or(0.0, |span| self.timescale.seconds(span.end - span.start))
    }

    /// How long time runs from one moment to a later one, at normal speed; nothing when it is not later.
    pub(super) fn between(&self, from: Ticks, to: Ticks) -> Duration {
        Duration::from_nanos(self.timescale.nanoseconds(self.running(to) - self.running(from)))
    }

    /// The moment from which on time runs for `duration` to the end, or the start.
    pub(super) fn before_end(&self, duration: Duration) -> Ticks {
        let nanoseconds = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        let wanted = self.running(self.end()) - self.timescale.ticks_in_nanoseconds(nanoseconds);
        if self.gaps == Gaps::Hold {
            return self.inside(wanted);
        }
        let index = self.played.partition_point(|played| *played <= wanted).saturating_sub(1);
        let (span, played) = (self.at_index(index), self.played.get(index).copied().unwrap_or_default());
        self.inside(span.start + (wanted - played))
    }

    /// Match time of the last `count` chunks.
    pub(super) fn last(&self, count: usize) -> Duration {
        let spans = self.spans.iter().rev().take(count);
        let ticks = spans.fold(Ticks(0), |sum, span| sum + (span.end - span.start));
        Duration::from_nanos(self.timescale.nanoseconds(ticks))
    }

    /// How long time has run at a moment since the start.
    fn running(&self, position: Ticks) -> Ticks {
        let (index, span) = self.at(position);
        if self.gaps == Gaps::Hold {
            return position;
        }
        let played = self.played.get(index).copied().unwrap_or_default();
        played + (position - span.start).clamp(Ticks(0), span.end - span.start)
    }

    fn at_index(&self, chunk: usize) -> Span {
        self.span(chunk).unwrap_or(Span { start: Ticks(0), end: Ticks(0) })
    }
}
