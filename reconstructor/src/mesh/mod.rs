//! Section 4.4: a textured mesh per player from its depth map.
//!
//! Between its first and its last surface a body fills a [`volume`]; the mesh is the closed surface round it ([`nets`]). What the
//! camera saw takes its colours from the picture, the rest is guessed ([`behind`]).

mod behind;
mod charts;
mod contact;
mod decimate;
mod nets;
mod pieces;
mod skin;
mod texture;
mod volume;

use glam::{DVec2, DVec3};
use image::RgbImage;
use protocol::{camera::Camera, manifest::PersonId, mesh::Mesh};
use thiserror::Error;

use crate::{depth::DepthMap, pose::Person};

pub use contact::MAX_CORRECTION_M;
pub use skin::{Skin, SkinSample};

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
    /// Left the piece of the clip that the body is seen in, right the colours of what is not seen.
    pub texture: RgbImage,
    /// Texture coordinate u from which on the texture is guessed.
    pub guessed_from_u: f32,
    /// 0..1.
    pub confidence: f32,
    /// Whether it was so hard to simplify that it may not be closed any more.
    pub clustered: bool,
}

/// Whose surface is lifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Who.
    pub person: PersonId,
    /// Index in `ClipInfo::frames`.
    pub frame: usize,
    /// Height of the lowest point of the body over the pitch, metres; 0 of who stands.
    pub above_ground_m: f64,
}

impl Figure {
    /// Somebody who stands.
    #[must_use]
    pub fn standing(person: PersonId, frame: usize) -> Self {
        Self { person, frame, above_ground_m: 0.0 }
    }
}

/// How much a mesh may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshBudget {
    /// Triangles at most.
    pub triangles: usize,
}

impl Default for MeshBudget {
    fn default() -> Self {
        Self { triangles: 1_000 }
    }
}

/// Why a player has no mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum MeshError {
    /// The depth map's arrays do not fit its rectangle.
    #[error(
        "the depth map of {width}×{height} cells has {coverage} coverages and {offsets} depths; estimate it again"
    )]
    Sizes {
        /// Cells in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Coverages given.
        coverage: usize,
        /// Depth offsets given.
        offsets: usize,
    },
    /// The upright plane through the player cannot be built or not be seen.
    #[error("the camera stands above the player or behind it, so the player's upright plane is not seen")]
    NoPlane,
    /// Nothing left after cutting and cleaning.
    #[error(
        "only {triangles} triangles of the player are connected; it is too small or its mask is in pieces"
    )]
    TooSmall {
        /// Triangles in the largest piece.
        triangles: usize,
    },
}

/// The upright plane through a player's anchor that faces the camera: what depth maps are measured from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VirtualPlane {
    camera: Camera,
    forward: DVec3,
    anchor_m: DVec3,
    normal: DVec3,
}

impl VirtualPlane {
    /// The plane through `anchor_m`; `None` when the camera is straight above or the anchor is behind it.
    pub(crate) fn new(camera: &Camera, anchor_m: DVec3) -> Option<Self> {
        let towards = (camera.position - anchor_m).with_y(0.0);
        let normal = towards.try_normalize()?;
        (camera.depth(anchor_m) > 0.1).then(|| Self {
            camera: *camera,
            forward: camera.forward(),
            anchor_m,
            normal,
        })
    }

    /// Metres behind the plane along the optical axis, and the pixel, of a point of the world; `None` behind the camera.
    pub(crate) fn offset(&self, point_m: DVec3) -> Option<(DVec2, f64)> {
        let pixel = self.camera.project(point_m)?;
        let on_plane = self.point(pixel, 0.0)?;
        Some((pixel, (point_m - on_plane).dot(self.forward)))
    }

    /// The world point seen at `pixel` whose camera depth is the plane's plus `offset_m`.
    pub(crate) fn point(&self, pixel: DVec2, offset_m: f64) -> Option<DVec3> {
        let ray = self.camera.ray(pixel);
        let on_plane = ray.on_plane(self.anchor_m, self.normal)?;
        let along = ray.direction.dot(self.forward);
        let depth = (on_plane - ray.origin).dot(self.forward) + offset_m;
        let point = ray.origin + ray.direction * (depth / along);
        (along > 1e-6 && depth > 0.0 && point.is_finite()).then_some(point)
    }
}

/// What a frame shows of a person, for the [`Skin`] that [`lift`] takes; nothing when the pose does not tell where the person faces.
#[must_use]
pub fn skin_of(image: &RgbImage, camera: &Camera, person: &Person, depth: &DepthMap) -> Vec<SkinSample> {
    skin::Wearer::new(person, camera, depth).map(|wearer| wearer.samples(image)).unwrap_or_default()
}

/// Lifts a player to a closed textured mesh on the pitch.
///
/// `image` is the frame that `depth` was estimated on, `skin` what other frames show of the person. The mesh stands on the pitch,
/// or as high above it as `figure` says: see [`MAX_CORRECTION_M`].
/// Triangles are counter-clockwise seen from outside.
///
/// # Errors
/// [`MeshError`] when the depth map is inconsistent, the plane is not seen, or nothing connected remains.
pub fn lift(
    image: &RgbImage,
    camera: &Camera,
    figure: Figure,
    person: &Person,
    depth: &DepthMap,
    skin: Option<&Skin>,
    budget: &MeshBudget,
) -> Result<BodySurface, MeshError> {
    let anchor_m = person.ground_m.with_y(0.0);
    let plane = VirtualPlane::new(camera, anchor_m).ok_or(MeshError::NoPlane)?;
    let footprint_m = 1.0 / camera.pixels_per_metre(anchor_m);
    let volume = volume::Volume::fill(depth, person, &plane, footprint_m)?;
    let mut surface = pieces::lifted(&nets::around(&volume), &volume, depth, &plane);
    surface.keep_large()?;
    let correction_m =
        contact::correction(&surface.points_m, person, &plane, footprint_m, figure.above_ground_m);
    let clustered = surface.simplify(budget.triangles);
    if surface.triangles.is_empty() {
        // A budget that no body fits in.
        return Err(MeshError::TooSmall { triangles: 0 });
    }
    let mask = depth.mask();
    let pixels: Option<Vec<DVec2>> = surface.points_m.iter().map(|point| camera.project(*point)).collect();
    let pixels = pixels.ok_or(MeshError::NoPlane)?;
    let seen = texture::cut_out(image, &mask, &pixels);
    let mut guessed = behind::colours(&seen, &mask, person, 1.0 / footprint_m);
    if let (Some(skin), Some(wearer)) = (skin, skin::Wearer::new(person, camera, depth)) {
        behind::paint_seen(&mut guessed, &seen, skin, &wearer);
    }
    behind::blend(&mut guessed, &seen, &mask, 1.0 / footprint_m);
    let charts = charts::split(&surface, &pixels, depth, &plane, &seen);
    let positions_m = charts
        .points
        .iter()
        .filter_map(|&index| surface.points_m.get(index as usize))
        .map(|point| (*point - anchor_m + DVec3::Y * correction_m).as_vec3().to_array())
        .collect();
    Ok(BodySurface {
        person: figure.person,
        frame: figure.frame,
        anchor_m,
        mesh: Mesh { positions_m, uvs: charts.uvs, triangles: charts.triangles },
        texture: texture::side_by_side(&seen.image, &guessed),
        guessed_from_u: charts::GUESSED_FROM_U,
        confidence: person.pose_score.clamp(0.0, 1.0),
        clustered,
    })
}

#[cfg(test)]
mod tests;
