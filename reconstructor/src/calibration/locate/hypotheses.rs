//! Cameras that would explain the named points: from every place where broadcast cameras stand, the pan, tilt and focal
//! length that put two of the points where they were seen, judged by all the others.
//!
//! The two-point solver of pan-tilt-zoom cameras (Chen, Zhu and Little, "A Two-point Method for PTZ Camera Calibration in
//! Sports", 2018); the place is not known here, so a grid of places stands for it. Few enough that all pairs are tried: no
//! chance is involved.

use glam::{DMat3, DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};

/// Pairs are drawn from this many points, the surest first.
const POINTS_MAX: usize = 16;
/// Two points nearer to each other than this share of the picture's width fix no focal length.
const APART: f64 = 0.06;
/// A point counts less the farther it is from where it was seen, and nothing from this share of the width on: the place is
/// only as near as the grid has it.
const TOLERANCE: f64 = 0.04;
/// The horizon of a broadcast camera is level within this, sine of the angle.
const ROLL_MAX: f64 = 0.12;
/// Focal lengths of broadcast lenses on a pitch, in picture widths.
const FOCAL_WIDTHS: (f64, f64) = (0.5, 9.0);
/// Hypotheses that are handed on.
const KEPT: usize = 10;
/// Two of them differ when they see the middle of the picture this far apart on the ground, metres, or their focal lengths
/// differ by this factor.
const DIFFERENT_M: f64 = 4.0;
const DIFFERENT_ZOOM: f64 = 1.12;

/// A point of the pitch plane or the goals and where it was seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// World metres.
    pub(super) world: DVec3,
    /// Pixel.
    pub(super) pixel: DVec2,
    /// How sure, 0..1.
    pub(super) weight: f64,
}

/// Where broadcast cameras stand: main cameras and tactical ones beside the halfway line, and high behind the left goal
/// (the world is turned so that it is the left one).
fn places(pitch: &Pitch) -> Vec<DVec3> {
    let (half_x, half_z) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    let mut all = Vec::new();
    for beyond in [9.0, 17.0, 28.0, 45.0] {
        for slope in [0.225, 0.36, 0.5625] {
            let z = half_z + beyond;
            for x in [0.0, -14.0, 14.0] {
                all.push(DVec3::new(x, (slope * z).clamp(7.0, 40.0), z));
            }
        }
    }
    for beyond in [12.0, 24.0, 45.0] {
        for height in [8.0, 15.0, 26.0] {
            for z in [0.0, -9.0, 9.0] {
                all.push(DVec3::new(-half_x - beyond, height, z));
            }
        }
    }
    all
}

/// The best cameras, best first.
pub(super) fn hypotheses(pairs: &[Pair], (width, height): (u32, u32), pitch: &Pitch) -> Vec<Camera> {
    let mut sure: Vec<Pair> = pairs.to_vec();
    sure.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let chosen = sure.get(..POINTS_MAX.min(sure.len())).unwrap_or_default();
    let apart = APART * f64::from(width);
    let mut found: Vec<(Camera, f64)> = Vec::new();
    for position in places(pitch) {
        for (k, a) in chosen.iter().enumerate() {
            for b in chosen.iter().skip(k + 1).filter(|b| a.pixel.distance(b.pixel) >= apart) {
                for camera in through(position, [a, b], (width, height)) {
                    let score = support(&camera, pairs);
                    found.push((camera, score));
                }
            }
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<Camera> = Vec::new();
    for (camera, _) in found {
        if kept.len() == KEPT {
            break;
        }
        if !kept.iter().any(|other| alike(other, &camera)) {
            kept.push(camera);
        }
    }
    kept
}

/// How much of the points a camera explains: the sum of their weights, each less the farther it is off.
fn support(camera: &Camera, pairs: &[Pair]) -> f64 {
    let tolerance = TOLERANCE * f64::from(camera.width_px);
    let of = |pair: &Pair| {
        let off = camera.project(pair.world)?.distance(pair.pixel) / tolerance;
        Some(pair.weight * (1.0 - off * off).max(0.0))
    };
    pairs.iter().filter_map(of).sum()
}

fn alike(a: &Camera, b: &Camera) -> bool {
    let zoom = (a.focal_px / b.focal_px).max(b.focal_px / a.focal_px);
    let aim = |camera: &Camera| camera.ground_point(camera.centre_px());
    let near = match (aim(a), aim(b)) {
        (Some(p), Some(q)) => p.distance(q) < DIFFERENT_M,
        _ => a.forward().angle_between(b.forward()) < 0.05,
    };
    near && zoom < DIFFERENT_ZOOM && a.position.distance(b.position) < 30.0
}

/// The level cameras at `position` that see both points where they are; none or one, now and then two.
fn through(position: DVec3, pair: [&Pair; 2], size_px: (u32, u32)) -> Vec<Camera> {
    let template = Camera {
        width_px: size_px.0,
        height_px: size_px.1,
        focal_px: 1.0,
        k1: 0.0,
        rotation: DMat3::IDENTITY,
        position,
    };
    let [p, q] = pair.map(|point| point.pixel - template.centre_px());
    let [a, b] = pair.map(|point| (point.world - position).normalize_or(DVec3::Z));
    let limits = (FOCAL_WIDTHS.0 * f64::from(size_px.0), FOCAL_WIDTHS.1 * f64::from(size_px.0));
    focal_lengths(p, q, a.dot(b))
        .into_iter()
        .filter(|focal| (limits.0..=limits.1).contains(focal))
        .filter_map(|focal_px| {
            let rays = [p, q].map(|at| at.extend(focal_px).normalize_or(DVec3::Z));
            let rotation = turn_onto([a, b], rays)?;
            // The camera's x axis is level and its y axis points down.
            let upright = rotation.row(0).y.abs() <= ROLL_MAX && rotation.row(1).y < 0.0;
            upright.then_some(Camera { focal_px, rotation, ..template })
        })
        .collect()
}

/// Focal lengths at which the rays through two places, counted from the middle of the picture, have the angle with this
/// cosine between them: (p·q + f²)² = cos² (|p|² + f²)(|q|² + f²), a quadratic in f².
fn focal_lengths(p: DVec2, q: DVec2, cos: f64) -> Vec<f64> {
    let (dot, pp, qq, c2) = (p.dot(q), p.length_squared(), q.length_squared(), cos * cos);
    let (a, half_b, c) = (1.0 - c2, dot - c2 * (pp + qq) / 2.0, dot * dot - c2 * pp * qq);
    let root = half_b * half_b - a * c;
    if a < 1e-12 || root < 0.0 {
        return Vec::new();
    }
    [1.0, -1.0]
        .into_iter()
        .map(|sign| (sign * root.sqrt() - half_b) / a)
        // Squaring lost the sign of the cosine.
        .filter(|&f2| f2 > 0.0 && (dot + f2) * cos > 0.0)
        .map(f64::sqrt)
        .collect()
}

/// The rotation that takes two unit directions of the world to two of the camera with the same angle between them.
fn turn_onto(world: [DVec3; 2], camera: [DVec3; 2]) -> Option<DMat3> {
    let frame = |[a, b]: [DVec3; 2]| {
        let n = a.cross(b).try_normalize()?;
        Some(DMat3::from_cols(a, n, a.cross(n)))
    };
    Some(frame(camera)? * frame(world)?.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(position: DVec3, target: DVec3, focal_px: f64) -> Camera {
        Camera::looking_at((1280, 720), focal_px, position, target)
    }

    fn seen(camera: &Camera, world: DVec3) -> Pair {
        Pair { world, pixel: camera.project(world).unwrap(), weight: 1.0 }
    }

    #[test]
    fn two_points_from_a_known_place_give_the_camera() {
        let camera = truth(DVec3::new(3.0, 16.0, 60.0), DVec3::new(30.0, 0.0, -4.0), 1900.0);
        let pairs = [DVec3::new(36.0, 0.0, -20.16), DVec3::new(41.5, 0.0, 0.0)].map(|w| seen(&camera, w));
        let found = through(camera.position, [&pairs[0], &pairs[1]], (1280, 720));
        let best = found.iter().min_by(|a, b| {
            let off = |c: &Camera| (c.focal_px - 1900.0).abs();
            off(a).total_cmp(&off(b))
        });
        let best = best.unwrap();
        assert!((best.focal_px - 1900.0).abs() < 1e-6, "{}", best.focal_px);
        assert!((best.forward() - camera.forward()).length() < 1e-9);
    }

    #[test]
    fn a_place_that_is_not_on_the_grid_still_gives_a_near_hypothesis_in_spite_of_wrong_points() {
        let pitch = Pitch::default();
        for (camera, wrong) in [
            (truth(DVec3::new(-4.0, 13.0, 55.0), DVec3::new(-33.0, 0.0, -6.0), 1700.0), 3),
            (truth(DVec3::new(2.0, 22.0, 80.0), DVec3::new(4.0, 0.0, -3.0), 2300.0), 2),
            (truth(DVec3::new(-80.0, 20.0, 3.0), DVec3::new(-30.0, 0.0, 1.0), 1100.0), 3),
        ] {
            let all = super::super::names::points(&pitch);
            let mut pairs: Vec<Pair> = all
                .iter()
                .filter(|&&w| camera.project(w).is_some_and(|pixel| camera.contains(pixel)))
                .map(|&w| seen(&camera, w))
                .collect();
            let count = pairs.len();
            assert!(count >= 5, "{count} points");
            for (k, pair) in pairs.iter_mut().enumerate().take(wrong.min(count - 4)) {
                pair.pixel = DVec2::new(100.0 + 300.0 * k as f64, 650.0);
                pair.weight = 0.4;
            }
            let found = hypotheses(&pairs, (1280, 720), &pitch);
            let near = found.iter().any(|c| {
                let right = &pairs[wrong..];
                let close = |p: &&Pair| c.project(p.world).is_some_and(|at| at.distance(p.pixel) < 60.0);
                right.iter().filter(close).count() * 4 >= right.len() * 3
            });
            assert!(near, "none of {} hypotheses is near {camera:?}", found.len());
        }
    }
}
