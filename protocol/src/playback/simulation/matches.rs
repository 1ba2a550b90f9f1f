//! A match that consists of nothing but times and sizes.

use std::time::Duration;

use crate::{
    manifest::{ChunkEntry, FORMAT, FileEntry, Live, Manifest, Profile, Representation, VERSION},
    pitch::Pitch,
    playback::Content,
    time::{Ticks, Timescale},
};

/// A tick is a millisecond.
pub const TIMESCALE: Timescale = Timescale { numerator: 1_000, denominator: 1 };
/// 25 frames per second.
pub const FRAME: Ticks = Ticks(40);
/// Every chunk lasts a second.
const CHUNK: Ticks = Ticks(1_000);
/// Names of the representations.
const NAMES: [&str; 4] = ["low", "medium", "high", "best"];

/// A decoded chunk with nothing in it but frames that last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FakeContent {
    /// When the first frame is shown.
    pub start: Ticks,
    /// How many frames there are.
    pub frames: usize,
}

impl Content for FakeContent {
    fn span(&self) -> Option<(Ticks, Ticks)> {
        Some((self.start, self.frame_span(self.frames.checked_sub(1)?)?.1))
    }

    fn frame_count(&self) -> usize {
        self.frames
    }

    fn frame_span(&self, index: usize) -> Option<(Ticks, Ticks)> {
        let start = self.start + Ticks(FRAME.0.checked_mul(i64::try_from(index).ok()?)?);
        (index < self.frames).then_some((start, start + FRAME))
    }

    fn frame_at(&self, moment: Ticks) -> Option<usize> {
        let frame = usize::try_from((moment - self.start).0.max(0) / FRAME.0).ok()?;
        Some(frame.min(self.frames.checked_sub(1)?))
    }
}

/// What the match is like.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeUpMatch {
    /// Chunks of one second.
    pub chunks: usize,
    /// Mean bits per second of the representations, best last; at most four. Chunks weigh up to a fifth more or less.
    pub bits_per_second: Vec<u64>,
    /// Before these chunks nothing is shown for so long.
    pub gaps: Vec<(usize, Ticks)>,
    /// Live: how many chunks there are when the viewer comes; every second there is one more. `None`: all.
    pub live_from: Option<usize>,
}

impl Default for MadeUpMatch {
    /// Five minutes in 2, 5 and 12 Mbit/s.
    fn default() -> Self {
        Self {
            chunks: 300,
            bits_per_second: vec![2_000_000, 5_000_000, 12_000_000],
            gaps: Vec::new(),
            live_from: None,
        }
    }
}

impl MadeUpMatch {
    /// When a chunk starts.
    #[must_use]
    pub fn start_of(&self, chunk: usize) -> Ticks {
        let before = Ticks(i64::try_from(chunk).unwrap_or(i64::MAX).saturating_mul(CHUNK.0));
        self.gaps.iter().filter(|(after, _)| *after <= chunk).fold(before, |sum, (_, gap)| sum + *gap)
    }

    /// What a chunk decodes to.
    #[must_use]
    pub fn content(&self, chunk: usize) -> FakeContent {
        FakeContent { start: self.start_of(chunk), frames: (CHUNK.0 / FRAME.0) as usize }
    }

    /// The manifest of the whole match.
    #[must_use]
    pub fn manifest(&self) -> Manifest {
        self.manifest_of(self.chunks, None)
    }

    /// The manifest when the viewer has been there for so long.
    #[must_use]
    pub fn manifest_at(&self, now: Duration) -> Manifest {
        let there = self.live_from.map_or(self.chunks, |from| from.saturating_add(now.as_secs() as usize));
        let live = (there < self.chunks).then_some(Live { update_after: CHUNK });
        self.manifest_of(there.min(self.chunks), live)
    }

    /// The manifest with its first `chunks` chunks.
    #[must_use]
    pub fn manifest_of(&self, chunks: usize, live: Option<Live>) -> Manifest {
        let representation = |(index, bits): (usize, &u64)| Representation {
            id: NAMES[index].to_owned(),
            profile: Profile::Compact,
            triangles_per_body: 1_000,
            chunks: (0..chunks).map(|chunk| self.entry(chunk, NAMES[index], bits / 8)).collect(),
        };
        let representations = self.bits_per_second.iter().take(NAMES.len()).enumerate();
        Manifest {
            format: FORMAT.to_owned(),
            version: VERSION.to_owned(),
            timescale: TIMESCALE,
            duration: chunks.checked_sub(1).map_or(Ticks(0), |last| self.start_of(last) + CHUNK),
            pitch: Pitch::default(),
            static_scene: None,
            people: Vec::new(),
            segments: Vec::new(),
            live,
            representations: representations.map(representation).collect(),
        }
    }

    fn entry(&self, chunk: usize, folder: &str, mean_bytes: u64) -> ChunkEntry {
        // Between 80 and 120 %, without a pattern: the golden ratio's multiples.
        let percent = 80 + (chunk * 618 + 309) % 1_000 / 25;
        let file = FileEntry {
            path: format!("{folder}/{chunk:05}.glb"),
            bytes: mean_bytes * percent as u64 / 100,
            blake3: "0".repeat(64),
        };
        ChunkEntry { file, start: self.start_of(chunk), duration: CHUNK }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;

    #[test]
    fn its_manifests_are_valid_and_its_sizes_are_the_mean() {
        let world = MadeUpMatch { gaps: vec![(10, Ticks(5_000))], ..MadeUpMatch::default() };
        world.manifest().validate(&Limits::default()).unwrap();
        let live = MadeUpMatch { live_from: Some(30), ..world.clone() };
        live.manifest_at(Duration::from_secs(9)).validate(&Limits::default()).unwrap();
        assert_eq!(live.manifest_at(Duration::from_secs(9)).representations[0].chunks.len(), 39);
        let bytes =
            world.manifest().representations[2].chunks.iter().map(|chunk| chunk.file.bytes).sum::<u64>();
        let mean = bytes as f64 * 8.0 / 300.0;
        assert!((mean / 12e6 - 1.0).abs() < 0.02, "{mean}");
        assert_eq!(world.content(10).span(), Some((Ticks(15_000), Ticks(16_000))));
    }
}
