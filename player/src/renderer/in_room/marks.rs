//! What is drawn on real surfaces to place the match: the outline of the one that is pointed at, and the handles.
//!
//! Geometry only. Everything lies a little above its surface, so that the surface's own depth does not hide it.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::triangles::{thinned, triangles};
use crate::placement::{Surface, TabletopPose, fit::Chart};

/// Above the surface, metres.
const LIFT_M: f64 = 0.003;
/// Width of the band along an outline, metres; at corners it may be wider by this factor.
const BAND_M: f64 = 0.022;
const MOST_MITRE: f64 = 2.0;
/// Radius of a handle, metres, and the corners of its circle.
const HANDLE_M: f64 = 0.014;
const HANDLE_CORNERS: u32 = 24;
/// Linear light: the surface that takes the match, and the one that does not.
const TAKES: [u8; 4] = [48, 183, 90, 255];
const REFUSES: [u8; 4] = [224, 110, 20, 255];

/// What there is to mark.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// The surface that is pointed at, and whether the match can stand there.
    pub highlighted: Option<(Surface, bool)>,
    /// Where the handles are, and the match they belong to.
    pub handles: Option<([DVec3; 4], TabletopPose)>,
}

/// A vertex of `mark.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct MarkVertex {
    /// Room metres.
    position_m: [f32; 3],
    /// 0 at the edge of what is marked, 1 inside.
    inside: f32,
    /// Linear light.
    colour: [u8; 4],
}

/// Triangles of marks.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MarkMesh {
    pub(super) vertices: Vec<MarkVertex>,
    pub(super) indices: Vec<u32>,
}

impl MarkMesh {
    pub(super) fn of(marks: &Marks) -> Self {
        let mut mesh = Self::default();
        if let Some((surface, takes)) = &marks.highlighted {
            mesh.add_surface(surface, if *takes { TAKES } else { REFUSES });
        }
        if let Some((places_m, pose)) = &marks.handles {
            places_m.iter().for_each(|place| mesh.add_handle(*place, pose));
        }
        mesh
    }

    fn add(&mut self, position_m: DVec3, inside: f32, colour: [u8; 4]) -> u32 {
        let index = self.vertices.len() as u32;
        self.vertices.push(MarkVertex { position_m: position_m.as_vec3().into(), inside, colour });
        index
    }

    /// A faint area with a bright outline.
    fn add_surface(&mut self, surface: &Surface, colour: [u8; 4]) {
        let outline_m = thinned(&surface.outline_m);
        let normal = surface.plane.normal;
        let Some(first) = outline_m.first() else { return };
        let chart = Chart::new(&surface.plane, *first, normal.any_orthonormal_vector());
        let lift = normal * LIFT_M;
        let base = self.vertices.len() as u32;
        for corner in &outline_m {
            self.add(*corner + lift, 1.0, colour);
        }
        for triangle in triangles(&chart.flat_all(&outline_m)) {
            self.indices.extend(triangle.map(|index| base + index));
        }
        let count = outline_m.len();
        let band: Vec<[u32; 2]> = (0..count)
            .map(|at| {
                let (before, here, after) =
                    (outline_m[(at + count - 1) % count], outline_m[at], outline_m[(at + 1) % count]);
                let inward = mitre(here - before, after - here, normal);
                // Above the area, as it is drawn over it.
                let outer = self.add(here + lift * 1.1, 0.0, colour);
                [outer, self.add(here + inward * BAND_M + lift * 1.1, 1.0, colour)]
            })
            .collect();
        for at in 0..count {
            let ([a, b], [c, d]) = (band[at], band[(at + 1) % count]);
            self.indices.extend([a, c, b, b, c, d]);
        }
    }

    fn add_handle(&mut self, place_m: DVec3, pose: &TabletopPose) {
        let centre_m = place_m + pose.up() * LIFT_M;
        let middle = self.add(centre_m, 1.0, TAKES);
        for corner in 0..HANDLE_CORNERS {
            let (sine, cosine) =
                (f64::from(corner) * std::f64::consts::TAU / f64::from(HANDLE_CORNERS)).sin_cos();
            let rim = pose.orientation * DVec3::new(cosine, 0.0, sine) * HANDLE_M;
            self.add(centre_m + rim, 0.0, TAKES);
            let next = (corner + 1) % HANDLE_CORNERS;
            self.indices.extend([middle, middle + 1 + corner, middle + 1 + next]);
        }
    }
}

/// From a corner of a counter-clockwise outline to where two bands of width 1 inside it meet.
fn mitre(arriving: DVec3, leaving: DVec3, normal: DVec3) -> DVec3 {
    let inward = |side: DVec3| normal.cross(side).try_normalize();
    match (inward(arriving), inward(leaving)) {
        (Some(a), Some(b)) => {
            let sum = a + b;
            let longer = 2.0 / sum.length_squared().max(1e-9);
            (sum * longer).clamp_length_max(MOST_MITRE)
        }
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => DVec3::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::{Plane, SurfaceId, SurfaceKind};

    #[test]
    fn the_band_lies_inside_the_outline_and_everything_above_the_surface() {
        let corner = |x: f64, z: f64| DVec3::new(x, 0.7, z);
        let surface = Surface {
            id: SurfaceId(1),
            kind: SurfaceKind::Table,
            plane: Plane::through(DVec3::Y * 0.7, DVec3::Y),
            outline_m: vec![corner(-0.6, 0.4), corner(0.6, 0.4), corner(0.6, -0.4), corner(-0.6, -0.4)],
            obstacles_m: Vec::new(),
            confidence: 1.0,
        };
        let pose = TabletopPose::upright(DVec3::Y * 0.7, DVec3::Y, DVec3::X, 0.01);
        let handles = Some(([DVec3::new(0.5, 0.7, 0.3); 4], pose));
        let mesh = MarkMesh::of(&Marks { highlighted: Some((surface, true)), handles });
        for vertex in &mesh.vertices {
            let [x, y, z] = vertex.position_m;
            assert!(y > 0.7 && y < 0.71 && x.abs() <= 0.6001 && z.abs() <= 0.4001, "{vertex:?}");
        }
        let inner =
            mesh.vertices.iter().filter(|vertex| vertex.inside == 1.0).map(|vertex| vertex.position_m[0]);
        let band = inner.filter(|x| (x.abs() - (0.6 - BAND_M as f32)).abs() < 1e-5).count();
        assert_eq!(band, 4);
        assert!(mesh.indices.iter().all(|index| (*index as usize) < mesh.vertices.len()));
        assert_eq!(mesh.indices.len(), 3 * (2 + 8 + 4 * HANDLE_CORNERS as usize));
        assert_eq!(MarkMesh::of(&Marks::default()), MarkMesh::default());
    }

    #[test]
    fn a_sharp_corner_has_no_endless_spike() {
        let sharp = mitre(DVec3::X, -DVec3::X + DVec3::Z * 0.01, DVec3::Y);
        assert!(sharp.is_finite() && sharp.length() <= MOST_MITRE + 1e-9);
        assert!(mitre(DVec3::ZERO, DVec3::ZERO, DVec3::Y) == DVec3::ZERO);
    }
}
