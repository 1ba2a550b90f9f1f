//! Why a manifest cannot be played, or cannot follow the one before.

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

/// Why a manifest cannot take the place of the one that is played: it must be the same with more chunks at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UpdateError {
    /// Times would mean something else.
    #[error("the new match.json has another timescale: it is another stream, open it anew")]
    Timescale,
    /// Other ids, another order, or another number of them.
    #[error("the new match.json has other representations: it is another stream, open it anew")]
    Representations,
    /// Chunks are gone.
    #[error(
        "the new match.json has fewer chunks in representation {representation} than before: an older copy?"
    )]
    Shrunk {
        /// Index of the representation.
        representation: usize,
    },
    /// A chunk is another one than before.
    #[error(
        "the new match.json changes chunk {chunk} of representation {representation}: chunks may only be added"
    )]
    Changed {
        /// Index of the representation.
        representation: usize,
        /// Index of the chunk.
        chunk: usize,
    },
}
