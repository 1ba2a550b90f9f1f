//! The compact profile of a chunk: one mesh per person for a while, and how its points and its colours move.
//!
//! A *run* is a person over some frames of the chunk with one mesh. Where its points are in each frame, and what its texture looks like, is a sum of
//! waves over the run's frames ([`klt`]): every point and every texel has a share of each wave, and shares are what is stored. So any frame can
//! be made from the run alone, without the frames before it. The file is a GLB whose scene shows each run's mesh at rest; viewers that do not know
//! the extension show that. The format is specified in this crate's `COMPACT.md`.

mod decode;
mod encode;
mod entropy;
mod klt;
mod motion;
mod run;
mod texture;
mod wire;

#[cfg(test)]
mod tests;

pub use self::{
    decode::{ByteParts, CompactChunk, byte_parts},
    encode::{Quality, encode},
};

use glam::Vec3;

use crate::{
    chunk::{ChunkFrame, PixelImage},
    manifest::PersonId,
    mesh::Mesh,
};

/// Name of the glTF extension.
pub const EXTENSION: &str = "HOLOPITCH_motion";

/// What a compact chunk is made from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sequence {
    /// Everything about the frames but their bodies and atlases, which are ignored here.
    pub frames: Vec<ChunkFrame>,
    /// The people; a person may have several runs, but only one in a frame.
    pub runs: Vec<Run>,
}

/// A person with one mesh for some frames of a chunk.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Who.
    pub person: PersonId,
    /// The frames of the chunk, by place, rising.
    pub frames: Vec<usize>,
    /// Where the person stands in each of them, world metres.
    pub anchors_m: Vec<Vec3>,
    /// The mesh at rest: positions relative to the anchor, metres, world axes; texture coordinates 0..1.
    pub mesh: Mesh,
    /// Where the mesh's vertices are in each frame, relative to the anchor, metres.
    pub positions_m: Vec<Vec<[f32; 3]>>,
    /// The texture in each frame; all of one size.
    pub textures: Vec<PixelImage>,
    /// Texture coordinate u from which on what is shown is guessed.
    pub guessed_from_u: Option<f32>,
    /// Colour for viewers that show the mesh at rest, sRGB.
    pub colour: [u8; 3],
}
