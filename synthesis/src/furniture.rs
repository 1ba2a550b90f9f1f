//! What stands between the lines and the stands: dug-outs with their seats.

use glam::Vec3;
use rand::{Rng, seq::IndexedRandom};

use crate::{
    outfit::{Srgb, linear},
    render::Solid,
    stadium::{Side, Stadium},
};

/// A place for a team's substitutes and staff.
#[derive(Clone, Debug)]
pub struct DugOut {
    /// Walls, roof and seats.
    pub solid: Solid,
    /// Feet of those who sit there, world metres.
    pub seats: Vec<Vec3>,
    /// The ground in front of it where coaches stand, world metres.
    pub area: [Vec3; 2],
    /// Heading of those who look at the pitch.
    pub yaw: f32,
}

/// Distance between seats, metres.
const SEAT_M: f32 = 0.62;

/// Adds a box with faces along `along`, up, and `out` (unit vectors); `low` and `high` are corners in that frame.
fn slab(solid: &mut Solid, frame: [Vec3; 2], low: Vec3, high: Vec3, colour: Vec3) {
    let axes = [frame[0], Vec3::Y, frame[1]];
    for axis in 0..3 {
        for side in [low, high] {
            let normal = axes[axis] * if side == low { -1.0 } else { 1.0 };
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let first = solid.positions.len() as u32;
            for (a, b) in [(low, low), (high, low), (high, high), (low, high)] {
                let mut corner = side;
                corner[u] = a[u];
                corner[v] = b[v];
                solid.positions.push(axes[0] * corner.x + axes[1] * corner.y + axes[2] * corner.z);
                solid.normals.push(normal);
            }
            solid.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            solid.colours.extend([colour; 2]);
        }
    }
}

/// The two dug-outs of a stadium, both on one side: mostly the one of the main camera.
pub fn dug_outs(rng: &mut impl Rng, stadium: &Stadium) -> Vec<DugOut> {
    let side = &stadium.around.sides[if rng.random_bool(0.65) { 3 } else { 0 }];
    let seats = rng.random_range(8..15);
    let apart = rng.random_range(7.0..14.0f32);
    let colours: [Srgb; 5] =
        [[0.75, 0.12, 0.12], [0.12, 0.16, 0.40], [0.20, 0.20, 0.22], [0.75, 0.76, 0.78], [0.10, 0.35, 0.25]];
    let roof = linear(*colours.choose(rng).unwrap_or(&colours[0]));
    let chairs = linear(*colours.choose(rng).unwrap_or(&colours[1]));
    let gap = side.boards.first().map_or(6.5, |row| row.gap_m);
    [-1.0f32, 1.0].map(|end| dug_out(side, end * apart, end, seats, gap, [roof, chairs])).into()
}

/// One dug-out that begins `from` metres from the halfway line and reaches away from it.
fn dug_out(side: &Side, from: f32, end: f32, seats: usize, gap: f32, [roof, chairs]: [Vec3; 2]) -> DugOut {
    let along = Vec3::X;
    let out = side.outward;
    let frame = [along, out];
    // Before the boards, or where boards would be.
    let back = side.line_m + gap - 0.2;
    let front = back - 1.7;
    let length = seats as f32 * SEAT_M + 0.4;
    let (left, right) = if end > 0.0 { (from, from + length) } else { (from - length, from) };
    let mut solid = Solid::default();
    let mut add = |low: [f32; 3], high: [f32; 3], colour: Vec3| {
        slab(&mut solid, frame, Vec3::from(low), Vec3::from(high), colour);
    };
    add([left, 0.0, back - 0.06], [right, 2.0, back], roof * 0.9);
    add([left, 2.0, front + 0.5], [right, 2.08, back], roof);
    for x in [left, right - 0.06] {
        add([x, 0.0, front + 0.7], [x + 0.06, 2.0, back], roof * 0.8);
    }
    let sitting = back - 0.75;
    for k in 0..seats {
        let x = left + 0.2 + k as f32 * SEAT_M;
        add([x + 0.04, 0.35, sitting], [x + SEAT_M - 0.04, 0.43, back - 0.2], chairs);
        add([x + 0.04, 0.43, back - 0.26], [x + SEAT_M - 0.04, 1.0, back - 0.18], chairs);
    }
    let place = |x: f32, away: f32| along * x + out * away;
    DugOut {
        solid,
        seats: (0..seats).map(|k| place(left + 0.2 + (k as f32 + 0.5) * SEAT_M, sitting + 0.1)).collect(),
        area: [place(left, side.line_m + 0.9), place(right, (front - 0.3).max(side.line_m + 1.0))],
        yaw: if out.z > 0.0 { std::f32::consts::PI } else { 0.0 },
    }
}
