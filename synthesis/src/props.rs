//! Goals, corner flags and the ball as solid meshes in world metres.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};
use protocol::pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, Pitch};

use crate::{nets::NetLook, outfit::linear, render::Solid};

/// Radius of the ball, metres (Law 2).
pub const BALL_RADIUS_M: f32 = 0.11;

/// Height of a corner flag's post, metres (Law 1: at least 1.5).
pub const FLAG_POST_M: f64 = 1.5;

pub(crate) fn tube(solid: &mut Solid, from: Vec3, to: Vec3, radius: f32, colour: Vec3) {
    const SIDES: usize = 8;
    let axis = (to - from).normalize_or(Vec3::Y);
    let across = axis.any_orthonormal_vector();
    let other = axis.cross(across);
    let first = solid.positions.len() as u32;
    // Short pieces, so that the lens can bend a long bar.
    let pieces = (from.distance(to) / 0.6).ceil().max(1.0) as u32;
    for ring in 0..=pieces {
        let middle = from.lerp(to, ring as f32 / pieces as f32);
        for side in 0..SIDES {
            let angle = side as f32 / SIDES as f32 * TAU;
            let normal = across * angle.cos() + other * angle.sin();
            solid.positions.push(middle + normal * radius);
            solid.normals.push(normal);
        }
    }
    let sides = SIDES as u32;
    for ring in 0..pieces {
        for side in 0..sides {
            let next = (side + 1) % sides;
            let (low, high) = (first + ring * sides, first + (ring + 1) * sides);
            solid
                .triangles
                .extend([[low + side, low + next, high + side], [low + next, high + next, high + side]]);
            solid.colours.extend([colour; 2]);
        }
    }
}

/// Both goal frames with what holds their nets, and the corner flags, each a thing of its own.
#[must_use]
pub fn goals(pitch: &Pitch, net: &NetLook) -> Vec<Solid> {
    let white = linear([0.95, 0.95, 0.95]);
    let (half_x, half_z) = (pitch.length_m as f32 / 2.0, pitch.width_m as f32 / 2.0);
    let (half, high) = (GOAL_WIDTH_M as f32 / 2.0 + 0.06, GOAL_HEIGHT_M as f32 + 0.06);
    let [top, bottom] = net.deep_m;
    let mut things = Vec::new();
    for side in [-1.0, 1.0] {
        let x = half_x * side;
        let mut goal = Solid::default();
        for z in [-half, half] {
            let post = Vec3::new(x, high, z);
            tube(&mut goal, post.with_y(0.0), post, 0.06, white);
            // A box net hangs on masts behind the goal; a leaning one on the frame's own stays.
            let hold = Vec3::new(x + top * side, high, z);
            let foot = Vec3::new(x + bottom * side, 0.0, z);
            if top == bottom {
                tube(&mut goal, foot, hold, 0.025, white * 0.3);
            } else {
                tube(&mut goal, foot, hold, 0.02, white * 0.8);
                tube(&mut goal, post.with_y(0.04), foot.with_y(0.04), 0.02, white * 0.8);
            }
            tube(&mut goal, post, hold, 0.015, white * 0.5);
        }
        tube(&mut goal, Vec3::new(x, high, -half - 0.06), Vec3::new(x, high, half + 0.06), 0.06, white);
        things.push(goal);
        for z in [-half_z, half_z] {
            let foot = Vec3::new(x, 0.0, z);
            let mut flag = Solid::default();
            tube(&mut flag, foot, foot + Vec3::Y * FLAG_POST_M as f32, 0.02, linear([0.9, 0.9, 0.2]));
            for corner in
                [Vec3::new(0.0, 1.5, 0.0), Vec3::new(0.0, 1.2, 0.0), Vec3::new(-0.42 * side, 1.35, 0.05)]
            {
                flag.positions.push(foot + corner);
                flag.normals.push(Vec3::new(0.0, 0.5, 0.87));
            }
            let first = flag.positions.len() as u32 - 3;
            flag.triangles.push([first, first + 1, first + 2]);
            flag.colours.push(linear([0.9, 0.15, 0.1]));
            things.push(flag);
        }
    }
    things
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
