//! A stream folder read back: lengths and hashes first, then decoding, all within limits.

use std::path::{Path, PathBuf};

use protocol::{
    chunk::Chunk,
    content::AnyChunk,
    hash,
    limits::Limits,
    manifest::{self, FileEntry, Manifest, Representation},
    playback::Content,
};

use super::{StreamError, files};

/// An opened stream folder; chunks are read when asked for.
#[derive(Clone, Debug)]
pub struct StreamReader {
    folder: PathBuf,
    limits: Limits,
    manifest: Manifest,
}

impl StreamReader {
    /// Reads and checks the manifest in `folder`.
    ///
    /// # Errors
    /// When there is none, or it cannot be used.
    pub fn open(folder: &Path, limits: &Limits) -> Result<Self, StreamError> {
        let path = folder.join(manifest::FILE_NAME);
        let bytes = files::read(&path, limits.manifest_bytes as u64)?;
        let manifest =
            Manifest::from_json(&bytes, limits).map_err(|source| StreamError::Manifest { path, source })?;
        Ok(Self { folder: folder.to_owned(), limits: *limits, manifest })
    }

    /// What the stream holds.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Number of chunks of the best representation.
    #[must_use]
    pub fn chunk_count(&self) -> usize {
        self.best().map_or(0, |best| best.chunks.len())
    }

    /// Chunk `index` of the best representation, with all its frames.
    ///
    /// # Errors
    /// When the file is missing, is not the one that the manifest names, or cannot be decoded.
    pub fn chunk(&self, index: usize) -> Result<Chunk, StreamError> {
        self.any_chunk(index).map(AnyChunk::into_frames)
    }

    /// Chunk `index` of the best representation, as it is stored.
    ///
    /// # Errors
    /// As [`StreamReader::chunk`].
    pub fn any_chunk(&self, index: usize) -> Result<AnyChunk, StreamError> {
        let entry = self.best().and_then(|best| best.chunks.get(index)).ok_or_else(|| {
            let path = self.folder.join(manifest::FILE_NAME);
            StreamError::NoChunk { path, index, count: self.chunk_count() }
        })?;
        let (path, bytes) = self.file(&entry.file)?;
        let chunk = AnyChunk::decode(&bytes, &self.limits)
            .map_err(|source| StreamError::Chunk { path: path.clone(), source })?;
        if chunk.span() != Some((entry.start, entry.start + entry.duration)) {
            return Err(StreamError::Times { path });
        }
        Ok(chunk)
    }

    /// Every chunk of the best representation in order of time.
    pub fn chunks(&self) -> impl Iterator<Item = Result<Chunk, StreamError>> + '_ {
        (0..self.chunk_count()).map(|index| self.chunk(index))
    }

    /// The GLB file of the pitch and goals, when the stream has one.
    ///
    /// # Errors
    /// When the file is missing or is not the one that the manifest names.
    pub fn static_scene(&self) -> Result<Option<Vec<u8>>, StreamError> {
        self.manifest.static_scene.as_ref().map(|entry| Ok(self.file(entry)?.1)).transpose()
    }

    fn best(&self) -> Option<&Representation> {
        self.manifest.best()
    }

    /// A file that is what its entry says.
    fn file(&self, entry: &FileEntry) -> Result<(PathBuf, Vec<u8>), StreamError> {
        let path = self.folder.join(&entry.path);
        let bytes = files::read(&path, entry.bytes)?;
        hash::verify(&bytes, entry).map_err(|source| StreamError::Hash { path: path.clone(), source })?;
        Ok((path, bytes))
    }
}

/// A whole stream at once; for short clips and for evaluation.
///
/// # Errors
/// As [`StreamReader`].
pub fn read_stream(folder: &Path, limits: &Limits) -> Result<(Manifest, Vec<Chunk>), StreamError> {
    let reader = StreamReader::open(folder, limits)?;
    let chunks = reader.chunks().collect::<Result<Vec<Chunk>, StreamError>>()?;
    Ok((reader.manifest, chunks))
}
