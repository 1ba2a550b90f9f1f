//! Frames to the files of a stream, one chunk of about a second at a time.

use std::{collections::BTreeSet, path::Path};

use protocol::{
    chunk::{Atlas as FrameAtlas, Body, Chunk, ChunkFrame, Quantisation},
    compact::Sequence,
    manifest::{Manifest, PersonId, Profile, Segment},
    mesh::Mesh,
    time::Ticks,
};

use super::{
    EncodeError, StreamFrame, StreamHeader,
    atlas::Atlas,
    folder::{Content, StreamFolder},
    sequence::runs,
    static_scene,
};
use crate::{mesh::BodySurface, motion::FrameBody};

/// JPEG quality of the plain profile.
const JPEG_QUALITY: u8 = 85;
/// How long a chunk is at least, except the last one.
const CHUNK_NANOSECONDS: u64 = 1_000_000_000;

/// Writes a stream folder. Frames are pushed in order of time; only [`StreamWriter::finish`] makes it a stream.
#[derive(Debug)]
pub struct StreamWriter {
    folder: StreamFolder,
    profile: Profile,
    header: StreamHeader,
    people: BTreeSet<PersonId>,
    pending: Vec<StreamFrame>,
    end: Ticks,
}

impl StreamWriter {
    /// Prepares `folder`, which may hold an older stream: its manifest goes first, so that no reader ever sees a manifest
    /// with other chunks than its own. The compact profile has the whole ladder, the plain one its best quality.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn create(folder: &Path, header: &StreamHeader, profile: Profile) -> Result<Self, EncodeError> {
        let pitch = static_scene::glb(&header.pitch)?;
        Ok(Self {
            folder: StreamFolder::create(folder, header.timescale, profile, Some(&pitch))?,
            profile,
            header: header.clone(),
            people: header.people.iter().map(|person| person.id).collect(),
            pending: Vec::new(),
            end: Ticks(0),
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
        let new_shot = |last: &StreamFrame| {
            self.header
                .segments
                .iter()
                .any(|segment| segment.start > last.start && segment.start <= frame.start)
        };
        if self.pending.first().is_some_and(|first| frame.start >= first.start + second)
            || self.pending.last().is_some_and(new_shot)
        {
            self.flush()?;
        }
        self.end = frame.start + frame.duration;
        self.pending.push(without_empty(frame));
        Ok(())
    }

    /// Writes what is left and then the manifest; returns it.
    ///
    /// # Errors
    /// When nothing was pushed or a file cannot be written.
    pub fn finish(mut self) -> Result<Manifest, EncodeError> {
        if self.pending.is_empty() {
            return Err(EncodeError::NoFrames);
        }
        self.flush()?;
        let mut segments = self.header.segments;
        segments.retain(|segment| segment.start < self.end);
        for Segment { start, duration, .. } in &mut segments {
            *duration = (*duration).min(self.end - *start);
        }
        self.folder.finish(Manifest {
            format: String::new(),
            version: String::new(),
            timescale: self.header.timescale,
            duration: self.end,
            pitch: self.header.pitch,
            live: None,
            static_scene: None,
            people: self.header.people,
            segments,
            representations: Vec::new(),
        })
    }

    /// Writes the pending frames as a chunk of every representation.
    fn flush(&mut self) -> Result<(), EncodeError> {
        let frames = std::mem::take(&mut self.pending);
        let content = match self.profile {
            Profile::Compact => Content::Runs(sequence(&frames)),
            Profile::Plain | Profile::Other => Content::Frames(plain(frames)?, Quantisation::default()),
        };
        self.folder.put(&content)
    }
}

/// Leaves out surfaces that show nothing.
fn without_empty(mut frame: StreamFrame) -> StreamFrame {
    let clip_frame = frame.clip_frame;
    frame.surfaces.retain(|surface| {
        let shows = !surface.mesh.triangles.is_empty() && !surface.texture.as_raw().is_empty();
        if !shows {
            tracing::warn!(
                clip_frame,
                person = surface.person.0,
                "left out a body without triangles or texture"
            );
        }
        shows
    });
    frame
}

/// Frames to runs of people.
fn sequence(frames: &[StreamFrame]) -> Sequence {
    let bodies = frames.iter().enumerate().flat_map(|(frame, content)| {
        content.surfaces.iter().map(move |surface| {
            let body = FrameBody {
                frame,
                anchor_m: surface.anchor_m,
                mesh: &surface.mesh,
                texture: &surface.texture,
                guessed_from_u: Some(surface.guessed_from_u),
            };
            (surface.person, body)
        })
    });
    Sequence { frames: frames.iter().map(bare).collect(), runs: runs(bodies) }
}

/// A frame without bodies.
fn bare(frame: &StreamFrame) -> ChunkFrame {
    ChunkFrame {
        clip_frame: frame.clip_frame,
        start: frame.start,
        duration: frame.duration,
        camera: frame.camera,
        quality: frame.quality,
        ball: frame.ball,
        atlas: None,
        bodies: Vec::new(),
    }
}

fn plain(frames: Vec<StreamFrame>) -> Result<Chunk, EncodeError> {
    Ok(Chunk { frames: frames.into_iter().map(pack).collect::<Result<_, _>>()? })
}

/// Textures to one atlas, surfaces to bodies that refer to it.
fn pack(frame: StreamFrame) -> Result<ChunkFrame, EncodeError> {
    let clip_frame = frame.clip_frame;
    let mut packed = bare(&frame);
    if frame.surfaces.is_empty() {
        return Ok(packed);
    }
    let crops: Vec<_> = frame.surfaces.iter().map(|surface| &surface.texture).collect();
    let atlas = Atlas::pack(&crops, clip_frame);
    let jpeg = atlas
        .jpeg(JPEG_QUALITY)
        .map_err(|error| EncodeError::Texture { clip_frame, message: error.to_string() })?;
    packed.atlas = Some(FrameAtlas::Encoded(jpeg));
    let body = |(index, surface): (usize, BodySurface)| {
        let uvs = surface.mesh.uvs.iter().map(|uv| atlas.uv(index, *uv)).collect();
        Body {
            person: surface.person,
            anchor_m: surface.anchor_m.as_vec3(),
            mesh: Mesh { uvs, ..surface.mesh },
            guessed_from_u: Some(atlas.uv(index, [surface.guessed_from_u, 0.0])[0]),
        }
    };
    packed.bodies = frame.surfaces.into_iter().enumerate().map(body).collect();
    Ok(packed)
}

#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
