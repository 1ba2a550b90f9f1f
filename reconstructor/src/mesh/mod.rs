//! Section 4.4: a textured mesh per player from its depth map.

use glam::DVec3;
use image::RgbImage;
use protocol::{manifest::PersonId, mesh::Mesh};

/// The surface of one player in one frame.
#[derive(Clone, Debug)]
pub struct BodySurface {
    /// Who.
    pub person: PersonId,
    /// Index in `ClipInfo::frames`.
    pub frame: usize,
    /// The point of the pitch it stands on, world metres.
    pub anchor_m: DVec3,
    /// Positions in metres relative to the anchor, world axes; texture coordinates 0..1 into `texture`.
    pub mesh: Mesh,
    /// The piece of the clip that the body is seen in.
    pub texture: RgbImage,
    /// 0..1.
    pub confidence: f32,
}
