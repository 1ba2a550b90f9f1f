//! The ball: a white sphere of the real size with dark patches, so that it does not pass for a penalty mark. One whose
//! place is not sure is grey, and a ring on the grass shows how far off it may be.

use glam::Vec3;
use protocol::chunk::Ball;

use super::SolidMesh;

/// Law 2: circumference 68–70 cm, radius 11 cm.
pub(super) const BALL_RADIUS_M: f32 = 0.11;

const WHITE: [f32; 3] = [0.9, 0.9, 0.9];
const PATCH: [f32; 3] = [0.03, 0.03, 0.035];

/// An unsure ball, and its ring.
const GREY: [f32; 3] = [0.42, 0.42, 0.44];
const RING: [f32; 3] = [0.75, 0.66, 0.30];
/// Standard deviation from which on a ball is not sure, metres: what one sees on a table of a metre's length.
const UNSURE_M: f32 = 0.6;
/// Smallest and largest ring, and how thick it is, metres.
const RING_M: std::ops::RangeInclusive<f32> = 0.5..=3.0;
const RING_RADIUS_M: f32 = 0.025;
const RING_SIDES: u32 = 24;

/// How far off the ball may be, metres; `None` when it is sure, or when the stream does not say.
fn doubt_m(ball: &Ball) -> Option<f32> {
    let spread = ball.spread?;
    let largest = spread.along_m.max(spread.across_m);
    (largest > UNSURE_M || !ball.height_known).then(|| largest.clamp(*RING_M.start(), *RING_M.end()))
}

/// The ball as the stream has it (world metres).
pub(super) fn build(ball: &Ball) -> SolidMesh {
    let centre = ball.position_m.as_vec3();
    let centre = centre.with_y(centre.y.max(BALL_RADIUS_M));
    let Some(doubt_m) = doubt_m(ball) else { return sure(centre) };
    let mut mesh = SolidMesh::default();
    mesh.add_sphere(centre, BALL_RADIUS_M, 20, |_| GREY);
    let rim = |side: u32| {
        let (sin, cos) = (std::f32::consts::TAU * side as f32 / RING_SIDES as f32).sin_cos();
        centre.with_y(RING_RADIUS_M) + Vec3::new(cos, 0.0, sin) * doubt_m
    };
    for side in 0..RING_SIDES {
        mesh.add_cylinder(rim(side), rim(side + 1), RING_RADIUS_M, 6, RING);
    }
    mesh
}

/// A ball of the real size around `centre` (world metres).
fn sure(centre: Vec3) -> SolidMesh {
    let golden = (1.0 + 5.0_f32.sqrt()) / 2.0;
    // The twelve patches sit at the corners of an icosahedron.
    let patches: Vec<Vec3> = [-1.0, 1.0]
        .into_iter()
        .flat_map(|a| [-golden, golden].map(|b| (a, b)))
        .flat_map(|(a, b)| [Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)])
        .map(Vec3::normalize)
        .collect();
    let mut mesh = SolidMesh::default();
    mesh.add_sphere(centre, BALL_RADIUS_M, 20, |direction| {
        if patches.iter().any(|patch| patch.dot(direction) > 0.93) { PATCH } else { WHITE }
    });
    mesh
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use protocol::chunk::BallSpread;

    use super::*;

    fn ball(along_m: Option<f32>, height_known: bool) -> Ball {
        let spread = along_m.map(|along_m| BallSpread { along_m, across_m: 0.05 });
        Ball { position_m: DVec3::new(4.0, 2.0, 1.0), height_known, spread }
    }

    fn reach_m(mesh: &SolidMesh) -> f32 {
        let from_ball =
            |position: [f32; 3]| (Vec3::from(position) - Vec3::new(4.0, 0.0, 1.0)).with_y(0.0).length();
        mesh.vertices.iter().map(|vertex| from_ball(vertex.position_m)).fold(0.0, f32::max)
    }

    #[test]
    fn a_sure_ball_has_no_ring_and_neither_has_one_of_which_nothing_is_told() {
        for sure in [ball(Some(0.2), true), ball(None, true), ball(None, false)] {
            assert!(reach_m(&build(&sure)) < BALL_RADIUS_M + 1e-4);
        }
    }

    #[test]
    fn the_ring_of_an_unsure_ball_is_as_wide_as_the_doubt() {
        assert!((reach_m(&build(&ball(Some(1.5), true))) - 1.5).abs() < 0.05);
        assert!((reach_m(&build(&ball(Some(900.0), true))) - 3.0).abs() < 0.05);
        assert!(reach_m(&build(&ball(Some(0.1), false))) > 0.4, "its height is not known");
    }
}
