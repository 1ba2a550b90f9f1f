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
    content::AnyChunk,
    hash,
    limits::Limits,
    manifest::{ChunkEntry, FILE_NAME, Manifest, Profile},
};

/// A stream that was opened: its manifest was read and makes sense.
pub struct Stream {
    location: Location,
    limits: Limits,
    /// What the stream holds.
    pub manifest: Manifest,
    /// Bytes of the manifest.
    pub manifest_bytes: usize,
}

/// A chunk, decoded, with what it cost.
#[derive(Clone, Debug)]
pub struct LoadedChunk {
    /// The content.
    pub chunk: AnyChunk,
    /// The file as it came.
    pub file: Vec<u8>,
    /// When it was asked for.
    pub started: Instant,
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
        let mut manifest = Manifest::from_json(&bytes, &limits).map_err(broken)?;
        // What a newer program wrote in a way of its own is no rung for this one.
        manifest.representations.retain(|representation| representation.profile != Profile::Other);
        if manifest.representations.iter().all(|item| item.chunks.is_empty()) {
            return Err(SourceError::Empty { file: location.name_of(FILE_NAME) });
        }
        Ok(Self { location, limits, manifest, manifest_bytes: bytes.len() })
    }

    /// Reads the manifest again, for a stream that grows.
    pub async fn read_again(&self) -> Result<Self, SourceError> {
        Self::open(self.location.clone(), self.limits).await
    }

    /// Index of the best representation.
    #[must_use]
    pub fn best(&self) -> usize {
        self.manifest.representations.len().saturating_sub(1)
    }

    /// The chunks of the best representation, in order of time.
    #[must_use]
    pub fn chunks(&self) -> &[ChunkEntry] {
        self.chunks_of(self.best())
    }

    /// The name of the best representation.
    #[must_use]
    pub fn representation(&self) -> &str {
        self.manifest.best().map_or("", |best| best.id.as_str())
    }

    fn chunks_of(&self, representation: usize) -> &[ChunkEntry] {
        self.manifest.representations.get(representation).map_or(&[], |item| item.chunks.as_slice())
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
    pub fn chunk_name(&self, representation: usize, index: usize) -> String {
        let entry = self.chunks_of(representation).get(index);
        self.location.name_of(entry.map_or("?", |entry| entry.file.path.as_str()))
    }

    /// Fetches, verifies and decodes a chunk of a representation.
    pub async fn chunk(&self, representation: usize, index: usize) -> Result<LoadedChunk, SourceError> {
        let chunks = self.chunks_of(representation);
        let Some(entry) = chunks.get(index) else {
            return Err(SourceError::NoSuchChunk { index, count: chunks.len() });
        };
        let limit = self.limits.chunk_bytes;
        let asked = Instant::now();
        let file = self.location.fetch(&entry.file.path, limit).await?;
        let fetched = Instant::now();
        let location = || self.location.name_of(&entry.file.path);
        hash::verify(&file, &entry.file)
            .map_err(|problem| SourceError::Hash { file: location(), problem })?;
        let verified = Instant::now();
        let chunk = AnyChunk::decode(&file, &self.limits)
            .map_err(|problem| SourceError::Chunk { file: location(), problem })?;
        if chunk.frames().is_empty() {
            return Err(SourceError::EmptyChunk { file: location() });
        }
        Ok(LoadedChunk {
            chunk,
            file,
            started: asked,
            fetch: fetched - asked,
            verify: verified - fetched,
            decode: verified.elapsed(),
        })
    }
}
