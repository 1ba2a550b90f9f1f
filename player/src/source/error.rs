//! What can go wrong between a stream's address and its frames; every message says where and what to do.

use protocol::{chunk::ChunkError, hash::HashError, manifest::ManifestError};
use thiserror::Error;

use crate::scene::AtlasError;

/// Why a stream, or a part of it, cannot be shown.
#[derive(Debug, Error)]
pub enum SourceError {
    /// Not an address.
    #[error("{url}: not a valid address ({reason}): give a folder or http://host/path/")]
    Address {
        /// What was given.
        url: String,
        /// What is wrong.
        reason: String,
    },
    /// A file could not be read.
    #[error("{file}: cannot be read ({problem}): {advice}")]
    Read {
        /// The file.
        file: String,
        /// What the system says.
        problem: std::io::Error,
        /// What to do.
        advice: &'static str,
    },
    /// The server does not answer.
    #[error("{url}: the server does not answer ({reason}): check that it runs and can be reached")]
    Unreachable {
        /// What was asked for.
        url: String,
        /// What went wrong.
        reason: String,
    },
    /// The server answers, but not with the file.
    #[error("{url}: the server answers {status}: check that the stream is there")]
    Status {
        /// What was asked for.
        url: String,
        /// HTTP status.
        status: u16,
    },
    /// More bytes than the reader is willing to take.
    #[error("{file}: more than {limit} bytes: not a stream made for this player")]
    TooLarge {
        /// The file.
        file: String,
        /// The limit.
        limit: usize,
    },
    /// The manifest is wrong.
    #[error("{file}: {problem}")]
    Manifest {
        /// The file.
        file: String,
        /// What is wrong.
        problem: ManifestError,
    },
    /// Nothing to play.
    #[error("{file}: the stream has no chunks yet: reconstruct a clip into it first")]
    Empty {
        /// The manifest.
        file: String,
    },
    /// The file is not the one that the manifest promises.
    #[error("{file}: {problem}")]
    Hash {
        /// The file.
        file: String,
        /// How it differs.
        problem: HashError,
    },
    /// A chunk cannot be decoded.
    #[error("{file}: {problem}")]
    Chunk {
        /// The file.
        file: String,
        /// What is wrong.
        problem: ChunkError,
    },
    /// A chunk without frames.
    #[error("{file}: the chunk has no frames: rebuild the stream")]
    EmptyChunk {
        /// The file.
        file: String,
    },
    /// A frame's texture cannot be decoded.
    #[error("{file}, clip frame {clip_frame}: {problem}: rebuild the stream")]
    Atlas {
        /// The chunk's file.
        file: String,
        /// Which frame.
        clip_frame: u32,
        /// What is wrong.
        problem: AtlasError,
    },
    /// Asked for a chunk beyond the end.
    #[error("the stream has {count} chunks, there is no chunk {index}")]
    NoSuchChunk {
        /// Asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A thread could not be started.
    #[error("cannot start loading: {0}")]
    Start(std::io::Error),
}

impl SourceError {
    /// Whether asking again later may help: the network is down, not the stream broken.
    #[must_use]
    pub fn is_temporary(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::Status { status: 500..=599, .. })
    }
}
