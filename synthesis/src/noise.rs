//! Deterministic hashes and value noise for textures.

use glam::{Vec2, Vec3};

/// A hash of three integers.
#[must_use]
pub fn hash(x: i32, y: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1)
        ^ (y as u32).wrapping_mul(0x85EB_CA77)
        ^ seed.wrapping_mul(0xC2B2_AE3D);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297A_2D39);
    h ^ (h >> 15)
}

/// The hash as a share 0..1.
#[must_use]
pub fn unit(x: i32, y: i32, seed: u32) -> f32 {
    (hash(x, y, seed) >> 8) as f32 / (1u32 << 24) as f32
}

/// The whole number below; inlined, where `floor` is a call on processors without a rounding instruction.
#[inline]
fn whole(value: f32) -> i32 {
    let cut = value as i32;
    cut.wrapping_sub(i32::from(cut as f32 > value))
}

/// Smooth noise −1..1 with features of size 1.
#[must_use]
pub fn value(p: Vec2, seed: u32) -> f32 {
    let (x, y) = (whole(p.x), whole(p.y));
    let f = p - Vec2::new(x as f32, y as f32);
    let f = f * f * (Vec2::splat(3.0) - 2.0 * f);
    let at = |dx: i32, dy: i32| unit(x.wrapping_add(dx), y.wrapping_add(dy), seed);
    let top = at(0, 0) + (at(1, 0) - at(0, 0)) * f.x;
    let bottom = at(0, 1) + (at(1, 1) - at(0, 1)) * f.x;
    (top + (bottom - top) * f.y) * 2.0 - 1.0
}

/// A direction that changes smoothly over space: the slope of wrinkles in cloth.
#[must_use]
pub fn wrinkle(p: Vec3, seed: u32) -> Vec3 {
    let (s, c) = ((seed % 97) as f32, (seed % 61) as f32);
    let a = value(Vec2::new(p.x + p.z * 0.7 + s, p.y * 0.8 + c), seed);
    let b = value(Vec2::new(p.y * 1.3 + p.x * 0.4 + c, p.z - p.x * 0.5 + s), seed ^ 0x55);
    Vec3::new(a, b, 0.5 * (a - b))
}
