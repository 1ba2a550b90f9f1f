//! What can be wrong with a chunk.

use crate::{glb::GlbError, manifest::PersonId};

/// Why a chunk cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChunkError {
    /// The container is broken.
    #[error(transparent)]
    Container(#[from] GlbError),
    /// The document is not JSON, or lacks what every Holopitch chunk has.
    #[error("the chunk's JSON is not a Holopitch chunk: {message}")]
    Json {
        /// What the parser said, with line and column.
        message: String,
    },
    /// The chunk is of a kind this reader does not know.
    #[error("the chunk has layout version {found}, this program reads version {known}: use a newer program")]
    Version {
        /// In the chunk.
        found: u32,
        /// Known here.
        known: u32,
    },
    /// Larger than the reader is willing to spend.
    #[error("the chunk has {found} {what}, the limit is {limit}: raise the limit if you trust the stream")]
    Limit {
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        found: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// An index or a byte range points at nothing.
    #[error("{what} {index} of the chunk does not exist or does not fit: the chunk is corrupt")]
    Reference {
        /// What was looked for.
        what: &'static str,
        /// Which one.
        index: usize,
    },
    /// Times, people or numbers of a frame make no sense.
    #[error("frame {frame} of the chunk: {problem}")]
    Frame {
        /// Position in the chunk.
        frame: usize,
        /// What is wrong.
        problem: &'static str,
    },
    /// A body cannot be stored or restored.
    #[error("body of person {} in frame {frame} of the chunk: {problem}", person.0)]
    Body {
        /// Position in the chunk.
        frame: usize,
        /// Whose body.
        person: PersonId,
        /// What is wrong.
        problem: String,
    },
    /// A part of a compact chunk is not what its name says.
    #[error("the chunk's {what} is corrupt: fetch it again or rebuild the stream")]
    Corrupt {
        /// Which part.
        what: &'static str,
    },
    /// There is nothing to store.
    #[error("a chunk needs at least one frame")]
    Empty,
}

impl ChunkError {
    /// Fails when `found` exceeds `limit`.
    pub(crate) fn check(what: &'static str, found: usize, limit: usize) -> Result<(), Self> {
        if found > limit {
            return Err(Self::Limit { what, found: found as u64, limit: limit as u64 });
        }
        Ok(())
    }
}
