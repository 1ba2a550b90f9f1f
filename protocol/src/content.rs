//! A chunk of either profile, decoded: frames to ask for one at a time.

use std::borrow::Cow;

use crate::{
    chunk::{self, Chunk, ChunkError, ChunkFrame},
    compact::{CompactChunk, EXTENSION},
    glb::Glb,
    limits::Limits,
    playback::Content,
    time::Ticks,
};

/// A decoded chunk.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyChunk {
    /// A mesh per person and frame.
    Plain(Chunk),
    /// A mesh per person, and how it moves.
    Compact(CompactChunk),
}

impl AnyChunk {
    /// Reads a chunk of either profile; the file says which.
    ///
    /// # Errors
    /// When the file is neither, is corrupt, or exceeds `limits`.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, ChunkError> {
        ChunkError::check("bytes", bytes.len(), limits.chunk_bytes)?;
        // The name stands in the document of every compact chunk; to look for it costs less than to read a plain one's document twice.
        let document = Glb::parse(bytes)?.json;
        if document.windows(EXTENSION.len()).any(|piece| piece == EXTENSION.as_bytes()) {
            return CompactChunk::decode(bytes, limits).map(Self::Compact);
        }
        chunk::decode(bytes, limits).map(Self::Plain)
    }

    /// The frames; those of a compact chunk are without bodies and atlases here.
    #[must_use]
    pub fn frames(&self) -> &[ChunkFrame] {
        match self {
            Self::Plain(chunk) => &chunk.frames,
            Self::Compact(chunk) => chunk.frames(),
        }
    }

    /// Frame `index` with its bodies and its atlas; `None` when there is no such frame.
    #[must_use]
    pub fn frame(&self, index: usize) -> Option<Cow<'_, ChunkFrame>> {
        match self {
            Self::Plain(chunk) => chunk.frames.get(index).map(Cow::Borrowed),
            Self::Compact(chunk) => chunk.frame(index).map(Cow::Owned),
        }
    }

    /// All frames with their bodies and atlases.
    #[must_use]
    pub fn into_frames(self) -> Chunk {
        match self {
            Self::Plain(chunk) => chunk,
            Self::Compact(chunk) => {
                let frames = (0..chunk.frames().len()).filter_map(|index| chunk.frame(index));
                Chunk { frames: frames.collect() }
            }
        }
    }
}

impl Content for AnyChunk {
    fn span(&self) -> Option<(Ticks, Ticks)> {
        let (first, last) = (self.frames().first()?, self.frames().last()?);
        Some((first.start, last.start + last.duration))
    }

    fn frame_count(&self) -> usize {
        self.frames().len()
    }

    fn frame_span(&self, index: usize) -> Option<(Ticks, Ticks)> {
        self.frames().get(index).map(|frame| (frame.start, frame.start + frame.duration))
    }

    fn frame_at(&self, moment: Ticks) -> Option<usize> {
        let frames = self.frames();
        let after = frames.partition_point(|frame| frame.start <= moment);
        (!frames.is_empty()).then(|| after.saturating_sub(1))
    }
}
