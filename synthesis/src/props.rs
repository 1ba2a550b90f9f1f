//! Goals, corner flags and the ball as solid meshes in world metres.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};
use protocol::pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, Pitch};

use crate::{outfit::linear, render::Solid};

/// Radius of the ball, metres (Law 2).
pub const BALL_RADIUS_M: f32 = 0.11;

/// Height of a corner flag's post, metres (Law 1: at least 1.5).
pub const FLAG_POST_M: f64 = 1.5;

fn tube(solid: &mut Solid, from: Vec3, to: Vec3, radius: f32, colour: Vec3) {
    const SIDES: usize = 8;
    let axis = (to - from).normalize_or(Vec3::Y);
    let across = axis.any_orthonormal_vector();
    let other = axis.cross(across);
    let first = solid.positions.len() as u32;
    for end in [from, to] {
        for side in 0..SIDES {
            let angle = side as f32 / SIDES as f32 * TAU;
            let normal = across * angle.cos() + other * angle.sin();
            solid.positions.push(end + normal * radius);
            solid.normals.push(normal);
        }
    }
    let sides = SIDES as u32;
    for side in 0..sides {
        let next = (side + 1) % sides;
        let (a, b, c, d) = (first + side, first + next, first + sides + side, first + sides + next);
        solid.triangles.extend([[a, b, c], [b, d, c]]);
        solid.colours.extend([colour; 2]);
    }
}

/// Both goal frames and the four corner flags.
#[must_use]
pub fn goals(pitch: &Pitch) -> Solid {
    let mut solid = Solid::default();
    let white = linear([0.95, 0.95, 0.95]);
    let (half_x, half_z) = (pitch.length_m as f32 / 2.0, pitch.width_m as f32 / 2.0);
    let (half, high) = (GOAL_WIDTH_M as f32 / 2.0 + 0.06, GOAL_HEIGHT_M as f32 + 0.06);
    for side in [-1.0, 1.0] {
        let x = half_x * side;
        for z in [-half, half] {
            tube(&mut solid, Vec3::new(x, 0.0, z), Vec3::new(x, high, z), 0.06, white);
            let back = Vec3::new(x + 2.0 * side, 0.0, z);
            tube(&mut solid, back, back + Vec3::Y * high, 0.02, white * 0.4);
            tube(&mut solid, Vec3::new(x, high, z), back + Vec3::Y * high, 0.015, white * 0.5);
        }
        tube(&mut solid, Vec3::new(x, high, -half - 0.06), Vec3::new(x, high, half + 0.06), 0.06, white);
        for z in [-half_z, half_z] {
            let foot = Vec3::new(x, 0.0, z);
            tube(&mut solid, foot, foot + Vec3::Y * FLAG_POST_M as f32, 0.02, linear([0.9, 0.9, 0.2]));
            let first = solid.positions.len() as u32;
            for corner in
                [Vec3::new(0.0, 1.5, 0.0), Vec3::new(0.0, 1.2, 0.0), Vec3::new(-0.42 * side, 1.35, 0.05)]
            {
                solid.positions.push(foot + corner);
                solid.normals.push(Vec3::new(0.0, 0.5, 0.87));
            }
            solid.triangles.push([first, first + 1, first + 2]);
            solid.colours.push(linear([0.9, 0.15, 0.1]));
        }
    }
    solid
}

/// The ball, white with dark patches, rolled by `turn`.
#[must_use]
pub fn ball(centre: Vec3, turn: Quat) -> Solid {
    const RINGS: usize = 8;
    const SECTORS: usize = 14;
    let mut solid = Solid::default();
    for ring in 0..=RINGS {
        let polar = ring as f32 / RINGS as f32 * TAU / 2.0;
        for sector in 0..SECTORS {
            let angle = sector as f32 / SECTORS as f32 * TAU;
            let normal = turn * Vec3::new(polar.sin() * angle.cos(), polar.cos(), polar.sin() * angle.sin());
            solid.positions.push(centre + normal * BALL_RADIUS_M);
            solid.normals.push(normal);
        }
    }
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let next = (sector + 1) % SECTORS;
            let at = |r: usize, s: usize| (r * SECTORS + s) as u32;
            solid.triangles.push([at(ring, sector), at(ring, next), at(ring + 1, sector)]);
            solid.triangles.push([at(ring, next), at(ring + 1, next), at(ring + 1, sector)]);
            let dark = (ring * 5 + sector * 3) % 11 == 0;
            solid.colours.extend([if dark { Vec3::splat(0.04) } else { Vec3::splat(0.95) }; 2]);
        }
    }
    solid
}
