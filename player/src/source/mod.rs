//! Where streams come from: a folder or an HTTP server. Files are fetched, bounded, verified and decoded here.
//!
//! Everything that is read is checked against the manifest's hashes before it is used. The only module, with the
//! [`loader`], that touches files, sockets and threads.

mod error;
pub mod loader;
mod location;

pub use error::SourceError;
pub use location::Location;

use std::time::{Duration, Instant};

use protocol::{
    chunk::{self, Chunk},
    hash,
    limits::Limits,
    manifest::{ChunkEntry, FILE_NAME, Manifest, Representation},
};

/// A stream that was opened: its manifest was read and makes sense.
pub struct Stream {
    location: Location,
    limits: Limits,
    /// What the stream holds.
    pub manifest: Manifest,
    /// The representation that is played: the best.
    representation: Representation,
    /// Bytes of the manifest.
    pub manifest_bytes: usize,
}

/// A chunk, decoded, with what it cost.
#[derive(Clone, Debug)]
pub struct LoadedChunk {
    /// The content.
    pub chunk: Chunk,
    /// The file as it came.
    pub file: Vec<u8>,
    /// Reading or downloading it.
    pub fetch: Duration,
    /// Comparing its hash.
    pub verify: Duration,
    /// Decoding it.
    pub decode: Duration,
}

impl Stream {
    /// Reads the manifest at `location`.
    pub async fn open(location: Location, limits: Limits) -> Result<Self, SourceError> {
        let bytes = location.fetch(FILE_NAME, limits.manifest_bytes).await?;
        let broken = |problem| SourceError::Manifest { file: location.name_of(FILE_NAME), problem };
        let manifest = Manifest::from_json(&bytes, &limits).map_err(broken)?;
        let Some(representation) = manifest.representations.last().cloned() else {
            return Err(SourceError::Empty { file: location.name_of(FILE_NAME) });
        };
        if representation.chunks.is_empty() {
            return Err(SourceError::Empty { file: location.name_of(FILE_NAME) });
        }
        Ok(Self { location, limits, manifest, representation, manifest_bytes: bytes.len() })
    }

    /// The chunks of the representation that is played, in order of time.
    #[must_use]
    pub fn chunks(&self) -> &[ChunkEntry] {
        &self.representation.chunks
    }

    /// The name of the representation that is played.
    #[must_use]
    pub fn representation(&self) -> &str {
        &self.representation.id
    }

    /// Where the stream is.
    #[must_use]
    pub fn location(&self) -> &Location {
        &self.location
    }

    /// What this reader is willing to spend.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The full name of a chunk's file, for messages.
    #[must_use]
    pub fn chunk_name(&self, index: usize) -> String {
        let path = self.chunks().get(index).map_or("?", |entry| entry.file.path.as_str());
        self.location.name_of(path)
    }

    /// Fetches, verifies and decodes a chunk.
    pub async fn chunk(&self, index: usize) -> Result<LoadedChunk, SourceError> {
        let Some(entry) = self.chunks().get(index) else {
            return Err(SourceError::NoSuchChunk { index, count: self.chunks().len() });
        };
        let limit = self.limits.chunk_bytes;
        let asked = Instant::now();
        let file = self.location.fetch(&entry.file.path, limit).await?;
        let fetched = Instant::now();
        let location = || self.location.name_of(&entry.file.path);
        hash::verify(&file, &entry.file)
            .map_err(|problem| SourceError::Hash { file: location(), problem })?;
        let verified = Instant::now();
        let chunk = chunk::decode(&file, &self.limits)
            .map_err(|problem| SourceError::Chunk { file: location(), problem })?;
        if chunk.frames.is_empty() {
            return Err(SourceError::EmptyChunk { file: location() });
        }
        Ok(LoadedChunk {
            chunk,
            file,
            fetch: fetched - asked,
            verify: verified - fetched,
            decode: verified.elapsed(),
        })
    }
}
