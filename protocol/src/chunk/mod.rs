//! A chunk: about one second of the match that can be decoded alone, stored as an ordinary GLB 2.0 file.
//!
//! [`encode`] and [`decode`] are the only ways in and out; the layout of the file is in this crate's README.

mod decode;
pub(crate) mod draco;
mod encode;
mod error;
mod geometry;
mod index;
mod picture;

#[cfg(test)]
mod tests;

pub use self::{
    decode::{ByteSplit, byte_split, decode},
    encode::{Quantisation, encode, encode_with},
    error::ChunkError,
};

pub(crate) use self::{
    decode::{BodyError, Budget, body_mesh, check_times, reference},
    encode::{check_frames, is_finite},
    geometry::draco_mesh,
};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::{camera::Camera, manifest::PersonId, mesh::Mesh, time::Ticks};

/// One mesh as Draco stores it, and what a reader gets back: for measuring. `speed` is 0 (smallest) to 10 (fastest).
///
/// # Errors
/// When the mesh cannot be stored, in words.
pub fn geometry(mesh: &Mesh, quantisation: Quantisation, speed: u8) -> Result<(Vec<u8>, Mesh), String> {
    let bytes = draco::encode_at(mesh, quantisation, i32::from(speed))?;
    let stored = draco::decode_own(&bytes)?;
    Ok((bytes, stored))
}

/// One decoded chunk.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chunk {
    /// Frames in order of time; they follow each other without overlap.
    pub frames: Vec<ChunkFrame>,
}

impl Chunk {
    /// When the first frame is shown and when the last one ends; `None` without frames.
    #[must_use]
    pub fn span(&self) -> Option<(Ticks, Ticks)> {
        let (first, last) = (self.frames.first()?, self.frames.last()?);
        Some((first.start, last.start + last.duration))
    }

    /// Index of the frame shown at `moment`: the last one that has started, or the first.
    #[must_use]
    pub fn frame_at(&self, moment: Ticks) -> Option<usize> {
        if self.frames.is_empty() {
            return None;
        }
        Some(self.frames.partition_point(|frame| frame.start <= moment).saturating_sub(1))
    }
}

/// One frame of the clip as it stands on the table.
#[derive(Clone, Debug, PartialEq)]
pub struct ChunkFrame {
    /// Index of the frame in the clip it came from.
    pub clip_frame: u32,
    /// When it is shown, from the start of the stream.
    pub start: Ticks,
    /// How long it is shown.
    pub duration: Ticks,
    /// The broadcast camera of this frame, when it was found.
    pub camera: Option<Camera>,
    /// How far the reconstruction of this frame can be trusted.
    pub quality: FrameQuality,
    /// The ball, when it is known.
    pub ball: Option<Ball>,
    /// The texture of all bodies of this frame.
    pub atlas: Option<Atlas>,
    /// The people that have a mesh in this frame.
    pub bodies: Vec<Body>,
}

/// Figures of one frame that the player shows under the timeline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameQuality {
    /// Median distance between the drawn pitch lines and the lines seen, pixels of the clip.
    pub line_residual_px: Option<f32>,
    /// Mean confidence of the tracks seen in this frame, 0..1.
    pub track_confidence: Option<f32>,
}

/// The ball.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ball {
    /// Its middle, world metres.
    pub position_m: DVec3,
    /// Whether its height was measured; when not, it is taken to lie on the grass.
    pub height_known: bool,
    /// How far the position can be trusted; absent when nothing is told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spread: Option<BallSpread>,
}

/// Standard deviations of the ball's position. One camera sees a ball in the air exactly across its line of sight and
/// hardly along it, so there are two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BallSpread {
    /// Along the line of sight of the broadcast camera, metres.
    pub along_m: f32,
    /// Across it, metres.
    pub across_m: f32,
}

impl Ball {
    /// The position farthest from the centre mark that a stream may give a ball, and its largest spread, metres.
    pub const FARTHEST_M: f64 = 1_000.0;

    /// Whether all values are numbers within bounds.
    #[must_use]
    pub fn is_possible(&self) -> bool {
        let place = self.position_m.is_finite() && self.position_m.length() <= Self::FARTHEST_M;
        let spread = |m: f32| (0.0..=Self::FARTHEST_M as f32).contains(&m);
        place && self.spread.is_none_or(|s| spread(s.along_m) && spread(s.across_m))
    }
}

/// The texture of a frame's bodies.
#[derive(Clone, Debug, PartialEq)]
pub enum Atlas {
    /// As a file, as plain chunks hold it.
    Encoded(EncodedImage),
    /// As pixels, as compact chunks give it.
    Pixels(PixelImage),
}

/// A picture that needs no decoding.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PixelImage {
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Red, green, blue and 255 of each pixel, sRGB, row by row from the top.
    pub rgba: Vec<u8>,
}

/// An encoded picture in a format that glTF allows.
#[derive(Clone, Debug, PartialEq)]
pub struct EncodedImage {
    /// How it is encoded.
    pub format: ImageFormat,
    /// The file's bytes.
    pub bytes: Vec<u8>,
}

impl EncodedImage {
    /// Width and height in pixels as the file's header says, or `None` when it is not a file of its format.
    #[must_use]
    pub fn size_px(&self) -> Option<(u32, u32)> {
        picture::size_px(self.format, &self.bytes)
    }
}

/// Picture formats a chunk may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
}

impl ImageFormat {
    /// The media type that glTF names it by.
    #[must_use]
    pub fn mime_type(self) -> &'static str {
        match self {
            Self::Jpeg => "image/jpeg",
            Self::Png => "image/png",
        }
    }
}

/// One person in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Who it is.
    pub person: PersonId,
    /// Where the person stands: the point of the pitch under the body, world metres.
    pub anchor_m: Vec3,
    /// The surface; positions in metres relative to `anchor_m` in world axes, texture coordinates into the frame's atlas.
    pub mesh: Mesh,
    /// The texture coordinate u from which on the texture, and the surface that wears it, is guessed: no camera saw it. `None` when
    /// nothing is told.
    pub guessed_from_u: Option<f32>,
}

/// Whether a texture coordinate is one, when there is one.
pub(crate) fn guessed_is_possible(from_u: Option<f32>) -> bool {
    from_u.is_none_or(|u| (0.0..=1.0).contains(&u))
}

impl Body {
    /// Whether a triangle of the mesh is guessed; one that reaches into what was seen is not.
    #[must_use]
    pub fn is_guessed(&self, triangle: [u32; 3]) -> bool {
        let beyond =
            |index: u32, from: f32| self.mesh.uvs.get(index as usize).is_some_and(|uv| uv[0] >= from);
        self.guessed_from_u.is_some_and(|from| triangle.iter().all(|&index| beyond(index, from)))
    }
}
