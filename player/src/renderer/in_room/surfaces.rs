//! The known surfaces of the room as triangles: they hide what is behind them, and one of them catches the shadow.

use std::ops::Range;

use glam::DVec3;

use super::triangles::{thinned, triangles};
use crate::placement::{Plane, Surface, TabletopPose, fit::Chart};

/// What hides is drawn this far behind where the runtime sees it, metres: planes are estimates, and a match must not be
/// hidden by the table it stands on. The part of a depth sensor's error that does not depend on distance is as large.
const SLACK_M: f64 = 0.008;
/// Runtimes give one table two names, a little apart. A parallel surface this little above the foot of the match is
/// taken for the one it stands on, metres and radians.
const SAME_M: f64 = 0.04;
const SAME_TILT: f64 = 0.1;

/// Triangles of all surfaces, in room metres.
#[derive(Debug, Default)]
pub(super) struct Hiding {
    pub(super) vertices: Vec<[f32; 3]>,
    pub(super) indices: Vec<u32>,
    parts: Vec<(Range<u32>, Plane)>,
}

impl Hiding {
    pub(super) fn of<'a>(surfaces: impl Iterator<Item = &'a Surface>) -> Self {
        let mut hiding = Self::default();
        for surface in surfaces {
            let (outline_m, triangles) = cut(surface);
            let (base, from) = (hiding.vertices.len() as u32, hiding.indices.len() as u32);
            let behind = surface.plane.normal * SLACK_M;
            hiding
                .vertices
                .extend(outline_m.iter().map(|corner| <[f32; 3]>::from((*corner - behind).as_vec3())));
            hiding.indices.extend(triangles.into_iter().flatten().map(|index| base + index));
            hiding.parts.push((from..hiding.indices.len() as u32, surface.plane));
        }
        hiding
    }

    /// The indices of the surfaces that may hide a match.
    pub(super) fn parts(&self, standing: Option<&TabletopPose>) -> impl Iterator<Item = Range<u32>> {
        self.parts
            .iter()
            .filter(move |(_, plane)| !standing.is_some_and(|pose| is_under(plane, pose)))
            .map(|(range, _)| range.clone())
    }
}

/// Whether a surface seems to be another name of the one that a match stands on.
fn is_under(plane: &Plane, pose: &TabletopPose) -> bool {
    let above_m = -plane.distance_m(pose.foot_m());
    plane.normal.angle_between(pose.up()) < SAME_TILT && (SLACK_M / 2.0..SAME_M).contains(&above_m)
}

/// The surface that catches the shadow of a match, as triangles of the pitch's ground: (x, z) in metres of the pitch.
pub(super) fn catching(surface: &Surface, pose: &TabletopPose) -> (Vec<[f32; 2]>, Vec<u32>) {
    let (outline_m, triangles) = cut(surface);
    let on_ground = |corner: &DVec3| {
        let at = pose.to_pitch(*corner).as_vec3();
        [at.x, at.z]
    };
    (outline_m.iter().map(on_ground).collect(), triangles.into_iter().flatten().collect())
}

fn cut(surface: &Surface) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let outline_m = thinned(&surface.outline_m);
    let origin_m = outline_m.first().copied().unwrap_or_default();
    let chart = Chart::new(&surface.plane, origin_m, surface.plane.normal.any_orthonormal_vector());
    let triangles = triangles(&chart.flat_all(&outline_m));
    (outline_m, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::{SurfaceId, SurfaceKind};

    fn table(height_m: f64) -> Surface {
        let corner = |x: f64, z: f64| DVec3::new(x, height_m, z);
        Surface {
            id: SurfaceId(1),
            kind: SurfaceKind::Table,
            plane: Plane::through(DVec3::Y * height_m, DVec3::Y),
            outline_m: vec![corner(-0.6, 0.4), corner(0.6, 0.4), corner(0.6, -0.4), corner(-0.6, -0.4)],
            obstacles_m: Vec::new(),
            confidence: 1.0,
        }
    }

    #[test]
    fn a_second_name_of_the_table_does_not_hide_the_match_and_a_shelf_does() {
        let pose = TabletopPose::standing_on(DVec3::Y * 0.7, DVec3::Y, DVec3::X, 0.01);
        let room = [table(0.7), table(0.72), table(1.1)];
        let hiding = Hiding::of(room.iter());
        assert_eq!(hiding.parts(None).count(), 3);
        let kept: Vec<u32> = hiding.parts(Some(&pose)).map(|range| range.start / 6).collect();
        assert_eq!(kept, [0, 2]);
        assert!(hiding.vertices[0][1] < 0.7 && hiding.vertices[0][1] > 0.69);
    }

    #[test]
    fn the_catcher_is_the_table_seen_from_the_pitch() {
        let pose = TabletopPose::standing_on(DVec3::new(0.1, 0.7, 0.0), DVec3::Y, DVec3::X, 0.01);
        let (corners, indices) = catching(&table(0.7), &pose);
        assert_eq!(indices.len(), 6);
        let widest = corners.iter().map(|corner| corner[0]).fold(f32::MIN, f32::max);
        assert!((widest - 50.0).abs() < 1e-3, "{widest}");
    }
}
