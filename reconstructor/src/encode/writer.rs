//! Frames to the files of a stream, one chunk of about a second at a time.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use protocol::{
    chunk::{self, Body, Chunk, ChunkFrame},
    hash,
    limits::Limits,
    manifest::{self, ChunkEntry, FileEntry, Manifest, PersonId, Representation, Segment},
    mesh::Mesh,
    time::Ticks,
};

use super::{EncodeError, FileError, StreamFrame, StreamHeader, atlas::Atlas, files, static_scene};
use crate::mesh::BodySurface;

/// The one quality written so far, and its folder.
const REPRESENTATION: &str = "high";
/// The file of the pitch.
const STATIC_SCENE: &str = "static.glb";
/// How long a chunk is at least, except the last one.
const CHUNK_NANOSECONDS: u64 = 1_000_000_000;

/// Writes a stream folder. Frames are pushed in order of time; only [`StreamWriter::finish`] makes it a stream.
#[derive(Debug)]
pub struct StreamWriter {
    folder: PathBuf,
    header: StreamHeader,
    people: BTreeSet<PersonId>,
    static_scene: FileEntry,
    chunks: Vec<ChunkEntry>,
    pending: Chunk,
    end: Ticks,
    triangles: usize,
}

impl StreamWriter {
    /// Prepares `folder`, which may hold an older stream: its manifest goes first, so that no reader ever sees a manifest
    /// with other chunks than its own.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn create(folder: &Path, header: &StreamHeader) -> Result<Self, EncodeError> {
        let chunks = folder.join(REPRESENTATION);
        files::create_folder(&chunks)?;
        files::remove(&folder.join(manifest::FILE_NAME))?;
        remove_old_chunks(&chunks)?;
        let bytes = static_scene::glb(&header.pitch)?;
        files::write(&folder.join(STATIC_SCENE), &bytes)?;
        Ok(Self {
            folder: folder.to_owned(),
            header: header.clone(),
            people: header.people.iter().map(|person| person.id).collect(),
            static_scene: hash::entry(STATIC_SCENE, &bytes),
            chunks: Vec::new(),
            pending: Chunk::default(),
            end: Ticks(0),
            triangles: 0,
        })
    }

    /// Adds the next frame. Surfaces without triangles are left out with a warning.
    ///
    /// # Errors
    /// When the frame is out of order, shows somebody unknown, or a finished chunk cannot be written.
    pub fn push_frame(&mut self, frame: StreamFrame) -> Result<(), EncodeError> {
        let clip_frame = frame.clip_frame;
        if frame.start < self.end || frame.duration <= Ticks(0) {
            return Err(EncodeError::Order { clip_frame });
        }
        if let Some(stranger) = frame.surfaces.iter().find(|s| !self.people.contains(&s.person)) {
            return Err(EncodeError::UnknownPerson { clip_frame, person: stranger.person });
        }
        let second = self.header.timescale.ticks_in_nanoseconds(CHUNK_NANOSECONDS).max(Ticks(1));
        // Whoever jumps to a shot needs no frame of the one before.
        let new_shot = |last: &ChunkFrame| {
            self.header
                .segments
                .iter()
                .any(|segment| segment.start > last.start && segment.start <= frame.start)
        };
        if self.pending.frames.first().is_some_and(|first| frame.start >= first.start + second)
            || self.pending.frames.last().is_some_and(new_shot)
        {
            self.flush()?;
        }
        self.end = frame.start + frame.duration;
        let frame = self.pack(frame)?;
        self.pending.frames.push(frame);
        Ok(())
    }

    /// Writes what is left and then the manifest; returns it.
    ///
    /// # Errors
    /// When nothing was pushed or a file cannot be written.
    pub fn finish(mut self) -> Result<Manifest, EncodeError> {
        if self.pending.frames.is_empty() {
            return Err(EncodeError::NoFrames);
        }
        self.flush()?;
        let manifest = Manifest {
            format: manifest::FORMAT.to_owned(),
            version: manifest::VERSION.to_owned(),
            timescale: self.header.timescale,
            duration: self.end,
            pitch: self.header.pitch,
            static_scene: Some(self.static_scene),
            people: self.header.people,
            segments: self
                .header
                .segments
                .into_iter()
                .filter(|segment| segment.start < self.end)
                .map(|segment| Segment {
                    duration: segment.duration.min(self.end - segment.start),
                    ..segment
                })
                .collect(),
            representations: vec![Representation {
                id: REPRESENTATION.to_owned(),
                triangles_per_body: u32::try_from(self.triangles).unwrap_or(u32::MAX),
                chunks: self.chunks,
            }],
        };
        // What a reader would refuse is not worth writing.
        manifest.validate(&Limits::default())?;
        files::write(&self.folder.join(manifest::FILE_NAME), manifest.to_json()?.as_bytes())?;
        Ok(manifest)
    }

    /// Textures to one atlas, surfaces to bodies that refer to it.
    fn pack(&mut self, frame: StreamFrame) -> Result<ChunkFrame, EncodeError> {
        let clip_frame = frame.clip_frame;
        let (surfaces, empty): (Vec<BodySurface>, Vec<BodySurface>) = frame
            .surfaces
            .into_iter()
            .partition(|surface| !surface.mesh.triangles.is_empty() && !surface.texture.as_raw().is_empty());
        for surface in empty {
            tracing::warn!(
                clip_frame,
                person = surface.person.0,
                "left out a body without triangles or texture"
            );
        }
        let mut atlas = None;
        let mut bodies = Vec::with_capacity(surfaces.len());
        if !surfaces.is_empty() {
            let crops: Vec<_> = surfaces.iter().map(|surface| &surface.texture).collect();
            let packed = Atlas::pack(&crops, clip_frame);
            let jpeg = packed
                .jpeg()
                .map_err(|error| EncodeError::Texture { clip_frame, message: error.to_string() })?;
            for (index, surface) in surfaces.into_iter().enumerate() {
                self.triangles = self.triangles.max(surface.mesh.triangles.len());
                let uvs = surface.mesh.uvs.iter().map(|uv| packed.uv(index, *uv)).collect();
                bodies.push(Body {
                    person: surface.person,
                    anchor_m: surface.anchor_m.as_vec3(),
                    mesh: Mesh { uvs, ..surface.mesh },
                    guessed_from_u: Some(packed.uv(index, [surface.guessed_from_u, 0.0])[0]),
                });
            }
            atlas = Some(jpeg);
        }
        Ok(ChunkFrame {
            clip_frame,
            start: frame.start,
            duration: frame.duration,
            camera: frame.camera,
            quality: frame.quality,
            ball: frame.ball,
            atlas,
            bodies,
        })
    }

    /// Writes the pending frames as a chunk.
    fn flush(&mut self) -> Result<(), EncodeError> {
        let Some((start, end)) = self.pending.span() else { return Ok(()) };
        let name = format!("{REPRESENTATION}/{:05}.glb", self.chunks.len());
        let path = self.folder.join(&name);
        let bytes = chunk::encode(&self.pending, self.header.timescale)
            .map_err(|source| EncodeError::Chunk { path: path.clone(), source })?;
        files::write(&path, &bytes)?;
        self.chunks.push(ChunkEntry { file: hash::entry(name, &bytes), start, duration: end - start });
        self.pending.frames.clear();
        Ok(())
    }
}

/// Removes `00000.glb` and so on: an older stream may have had more of them.
fn remove_old_chunks(folder: &Path) -> Result<(), FileError> {
    for entry in fs::read_dir(folder).map_err(FileError::new("read", folder))? {
        let path = entry.map_err(FileError::new("read", folder))?.path();
        let number = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let is_chunk = path.extension().is_some_and(|extension| extension == "glb")
            && number.len() >= 5
            && number.bytes().all(|digit| digit.is_ascii_digit());
        if is_chunk {
            files::remove(&path)?;
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
