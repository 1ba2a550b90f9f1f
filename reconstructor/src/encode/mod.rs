//! Surfaces to stream: the folder of immutable files that players read.
//!
//! [`StreamWriter`] packs every frame's textures into one atlas, writes chunks of about a second and, when everything
//! else is on disk, the manifest. [`StreamReader`] reads such a folder back and trusts none of it.

mod atlas;
mod convert;
mod files;
mod folder;
mod ladder;
mod reader;
mod sequence;
mod static_scene;
mod writer;

use std::path::PathBuf;

use protocol::{
    camera::Camera,
    chunk::{Ball, ChunkError, FrameQuality},
    glb::GlbError,
    hash::HashError,
    manifest::{ManifestError, Person, PersonId, Segment},
    pitch::Pitch,
    time::{Ticks, Timescale},
};

pub(crate) use self::atlas::Atlas;
pub use self::{
    convert::{ConvertError, convert},
    files::FileError,
    ladder::{LADDER, Rung},
    reader::{StreamReader, read_stream},
    sequence::sequence_of,
    writer::StreamWriter,
};
use crate::mesh::BodySurface;

/// What holds for a whole stream.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamHeader {
    /// Ticks per second of the frames' times.
    pub timescale: Timescale,
    /// The size of the pitch.
    pub pitch: Pitch,
    /// Everybody who appears in any frame.
    pub people: Vec<Person>,
    /// Shots and gaps, in order of time; what lies after the last frame is left out when the stream is finished.
    pub segments: Vec<Segment>,
}

/// One frame on its way into the stream.
#[derive(Clone, Debug)]
pub struct StreamFrame {
    /// Index of the frame in the whole clip.
    pub clip_frame: u32,
    /// When it is shown, from the start of the stream.
    pub start: Ticks,
    /// How long it is shown.
    pub duration: Ticks,
    /// The broadcast camera, when it was found.
    pub camera: Option<Camera>,
    /// How far the frame can be trusted.
    pub quality: FrameQuality,
    /// The ball, when it is known.
    pub ball: Option<Ball>,
    /// Everybody with a mesh in this frame.
    pub surfaces: Vec<BodySurface>,
}

/// Why a stream cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The disk says no.
    #[error(transparent)]
    File(#[from] FileError),
    /// A chunk cannot be stored.
    #[error("cannot write {}: {source}", path.display())]
    Chunk {
        /// The file that would have held it.
        path: PathBuf,
        /// Why not.
        source: ChunkError,
    },
    /// A body cannot be stored, or what was stored cannot be read.
    #[error("the codec failed: {0}")]
    Codec(ChunkError),
    /// The pitch cannot be stored.
    #[error("cannot write the pitch: {0}")]
    StaticScene(#[from] GlbError),
    /// The manifest would not be accepted by a reader.
    #[error("cannot finish the stream: {0}")]
    Manifest(#[from] ManifestError),
    /// An atlas cannot be compressed.
    #[error("cannot compress the texture of clip frame {clip_frame}: {message}")]
    Texture {
        /// Frame of the clip.
        clip_frame: u32,
        /// What the encoder said.
        message: String,
    },
    /// Frames must come in order of time.
    #[error("clip frame {clip_frame} starts before the one before it ends: push frames in order of time")]
    Order {
        /// Frame of the clip.
        clip_frame: u32,
    },
    /// Somebody who is not in the header.
    #[error("person {} of clip frame {clip_frame} is not among the people of the stream", person.0)]
    UnknownPerson {
        /// Frame of the clip.
        clip_frame: u32,
        /// Who.
        person: PersonId,
    },
    /// Nothing was pushed.
    #[error("the stream has no frames: nothing was reconstructed from the clip")]
    NoFrames,
}

/// Why a stream cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The disk says no.
    #[error(transparent)]
    File(#[from] FileError),
    /// The manifest cannot be used.
    #[error("{}: {source}", path.display())]
    Manifest {
        /// The manifest's file.
        path: PathBuf,
        /// Why not.
        source: ManifestError,
    },
    /// A file is not the one that the manifest names.
    #[error("{}: {source}", path.display())]
    Hash {
        /// The file.
        path: PathBuf,
        /// What differs.
        source: HashError,
    },
    /// A chunk cannot be decoded.
    #[error("{}: {source}", path.display())]
    Chunk {
        /// The chunk's file.
        path: PathBuf,
        /// Why not.
        source: ChunkError,
    },
    /// A chunk holds other times than the manifest says.
    #[error("{}: its frames do not fill the time that match.json gives it: rebuild the stream", path.display())]
    Times {
        /// The chunk's file.
        path: PathBuf,
    },
    /// There is no such chunk.
    #[error("{} has {count} chunks, there is no chunk {index}", path.display())]
    NoChunk {
        /// The manifest's file.
        path: PathBuf,
        /// Asked for.
        index: usize,
        /// Present.
        count: usize,
    },
}
