//! What playback needs to know of a decoded chunk, whatever it holds.

use std::sync::Arc;

use crate::{
    chunk::{Chunk, ChunkFrame},
    content::AnyChunk,
    time::Ticks,
};

/// A decoded chunk: frames that follow each other in time.
pub trait Content {
    /// When the first frame is shown and when the last one ends; `None` without frames.
    fn span(&self) -> Option<(Ticks, Ticks)>;

    /// How many frames it has.
    fn frame_count(&self) -> usize;

    /// When a frame is shown and when it ends; `None` when there is no such frame.
    fn frame_span(&self, index: usize) -> Option<(Ticks, Ticks)>;

    /// Index of the frame shown at `moment`: the last one that has started, or the first. `None` without frames.
    fn frame_at(&self, moment: Ticks) -> Option<usize>;
}

impl Content for Chunk {
    fn span(&self) -> Option<(Ticks, Ticks)> {
        Chunk::span(self)
    }

    fn frame_count(&self) -> usize {
        self.frames.len()
    }

    fn frame_span(&self, index: usize) -> Option<(Ticks, Ticks)> {
        self.frames.get(index).map(|frame| (frame.start, frame.start + frame.duration))
    }

    fn frame_at(&self, moment: Ticks) -> Option<usize> {
        Chunk::frame_at(self, moment)
    }
}

/// A frame inside a decoded chunk, cheap to keep.
#[derive(Debug)]
pub struct ShownFrame<C> {
    pub(super) content: Arc<C>,
    /// Which representation the chunk came in.
    pub representation: usize,
    /// Which chunk of the stream.
    pub chunk_index: usize,
    /// Which frame of that chunk.
    pub frame_index: usize,
}

// Derived, it would ask for `C: Clone`, which the shared pointer does not need.
impl<C> Clone for ShownFrame<C> {
    fn clone(&self) -> Self {
        Self { content: Arc::clone(&self.content), ..*self }
    }
}

impl<C> ShownFrame<C> {
    /// The chunk that the frame belongs to.
    #[must_use]
    pub fn content(&self) -> &Arc<C> {
        &self.content
    }
}

impl<C: Content> ShownFrame<C> {
    /// When the frame is shown and when it ends.
    #[must_use]
    pub fn span(&self) -> Option<(Ticks, Ticks)> {
        self.content.frame_span(self.frame_index)
    }
}

impl ShownFrame<Chunk> {
    /// The frame.
    #[must_use]
    pub fn frame(&self) -> Option<&ChunkFrame> {
        self.content.frames.get(self.frame_index)
    }
}

impl ShownFrame<AnyChunk> {
    /// The frame; of a compact chunk without its bodies and its atlas.
    #[must_use]
    pub fn frame(&self) -> Option<&ChunkFrame> {
        self.content.frames().get(self.frame_index)
    }
}
