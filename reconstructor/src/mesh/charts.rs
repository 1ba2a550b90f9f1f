//! Which triangles the camera saw, and where in the texture each vertex finds its colour.

use glam::{DVec2, DVec3};

use super::{VirtualPlane, pieces::Surface, texture::CutOut};
use crate::depth::DepthMap;

/// The right half of a texture has the guessed colours.
pub(super) const GUESSED_FROM_U: f32 = 0.5;

/// What lies this far behind the first surface is hidden by it, metres.
const BEHIND_M: f64 = 0.09;

/// A surface whose seen and guessed parts share no vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Charts {
    /// Index of the surface's point that each vertex lies on.
    pub(super) points: Vec<u32>,
    /// Into the texture: the seen picture in its left half, the guessed one in its right.
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Splits a surface where what is seen ends. A triangle is seen that faces the camera and is not behind another part of the body.
/// `pixels` are where its points are seen in the clip.
pub(super) fn split(
    surface: &Surface,
    pixels: &[DVec2],
    depth: &DepthMap,
    plane: &VirtualPlane,
    seen: &CutOut,
) -> Charts {
    let mut vertices = vec![[u32::MAX; 2]; surface.points_m.len()];
    let mut charts = Charts::default();
    for triangle in &surface.triangles {
        let corners = triangle.map(|index| surface.points_m.get(index as usize).copied().unwrap_or_default());
        let guessed = usize::from(!is_seen(corners, depth, plane));
        let indices = triangle.map(|index| {
            let place = &mut vertices[index as usize][guessed];
            if *place == u32::MAX {
                *place = charts.points.len() as u32;
                charts.points.push(index);
                let [u, v] = seen.uv(pixels[index as usize]);
                charts.uvs.push([u / 2.0 + guessed as f32 * GUESSED_FROM_U, v]);
            }
            *place
        });
        charts.triangles.push(indices);
    }
    charts
}

fn is_seen([a, b, c]: [DVec3; 3], depth: &DepthMap, plane: &VirtualPlane) -> bool {
    let middle = (a + b + c) / 3.0;
    if (b - a).cross(c - a).dot(plane.camera.position - middle) <= 0.0 {
        return false;
    }
    let Some((pixel, offset_m)) = plane.offset(middle) else { return false };
    let cell = depth.place(pixel).round();
    let surfaces_m = depth.surfaces_m(cell.x as i64, cell.y as i64);
    // At the outline there may be no cell of the body under the middle: then nothing of it is before the triangle.
    surfaces_m.is_none_or(|[front_m, _]| offset_m <= front_m + BEHIND_M)
}
