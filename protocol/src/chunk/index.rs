//! What rides in the `extras` of a chunk's default scene: everything about the frames that glTF has no word for.
//!
//! The index names people, accessors, meshes and images of the same document; it repeats no geometry.

use serde::{Deserialize, Serialize};

use super::{Ball, FrameQuality};
use crate::{
    camera::Camera,
    manifest::PersonId,
    time::{Ticks, Timescale},
};

/// Layout version written and read by this crate.
pub(super) const LAYOUT: u32 = 1;

/// `extras` of the default scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SceneExtras {
    pub(super) holopitch: ChunkIndex,
}

/// The index of a chunk.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ChunkIndex {
    /// [`LAYOUT`].
    pub(super) layout: u32,
    /// Ticks per second of the frames' times.
    pub(super) timescale: Timescale,
    /// Everybody with a body in the chunk.
    pub(super) people: Vec<PersonTrack>,
    /// In order of time.
    pub(super) frames: Vec<FrameIndex>,
}

/// One person of the chunk.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct PersonTrack {
    /// Who.
    pub(super) id: PersonId,
    /// Accessor (VEC3 of floats) of the anchor in every frame; also the output of the person's translation.
    pub(super) anchors: usize,
}

/// One frame of the chunk.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct FrameIndex {
    /// Frame of the clip.
    pub(super) clip_frame: u32,
    /// When it is shown.
    pub(super) start: Ticks,
    /// How long.
    pub(super) duration: Ticks,
    /// Image with the texture of this frame's bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) image: Option<usize>,
    /// `[index into people, mesh]` of every body.
    pub(super) bodies: Vec<[usize; 2]>,
    /// For every body, the texture coordinate u from which on its texture is guessed; empty when nothing is told of anybody.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) guessed_from_u: Vec<Option<f32>>,
    /// The broadcast camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) camera: Option<Box<Camera>>,
    /// Figures.
    #[serde(default)]
    pub(super) quality: FrameQuality,
    /// The ball.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) ball: Option<Ball>,
}
