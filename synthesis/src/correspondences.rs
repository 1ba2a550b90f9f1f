//! Points of the pitch that a person could click in the first frame, in the form that `--calibration` reads.

use glam::{DVec2, DVec3};
use protocol::{
    camera::Camera,
    pitch::{
        CIRCLE_RADIUS_M, GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M, GOAL_HEIGHT_M, GOAL_WIDTH_M, LINE_WIDTH_M,
        PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M, PENALTY_MARK_M, Pitch,
    },
};
use rand::Rng;
use serde::Serialize;

use crate::props::FLAG_POST_M;

/// The file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Correspondences {
    /// Frame of the clip.
    pub frame: usize,
    /// Size of the pitch.
    pub pitch: Pitch,
    /// The points.
    pub points: Vec<Point>,
}

/// One point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// What it is.
    pub name: String,
    /// Where it was clicked, pixels.
    pub pixel: [f64; 2],
    /// Where it is, world metres.
    pub world_m: [f64; 3],
}

/// Every point that is easy to recognise.
pub(crate) fn candidates(pitch: &Pitch) -> Vec<(String, DVec3)> {
    let (half_x, half_z) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    let mut all: Vec<(String, DVec3)> = Vec::new();
    let mut add = |name: &str, x: f64, y: f64, z: f64| all.push((name.to_owned(), DVec3::new(x, y, z)));
    add("centre mark", 0.0, 0.0, 0.0);
    for (side, far) in [("far", -1.0), ("near", 1.0)] {
        add(&format!("halfway line, {side} touchline"), 0.0, 0.0, far * half_z);
        add(&format!("centre circle, {side} end on the halfway line"), 0.0, 0.0, far * CIRCLE_RADIUS_M);
        for (end, sign) in [("left", -1.0), ("right", 1.0)] {
            let goal = sign * half_x;
            let front = |depth: f64| goal - sign * depth;
            add(&format!("{end} {side} corner"), goal, 0.0, far * half_z);
            let half = PENALTY_AREA_WIDTH_M / 2.0;
            add(
                &format!("{end} penalty area, {side} front corner"),
                front(PENALTY_AREA_DEPTH_M),
                0.0,
                far * half,
            );
            add(&format!("{end} penalty area, {side} corner on the goal line"), goal, 0.0, far * half);
            let half = GOAL_AREA_WIDTH_M / 2.0;
            add(&format!("{end} goal area, {side} front corner"), front(GOAL_AREA_DEPTH_M), 0.0, far * half);
            add(&format!("{end} goal area, {side} corner on the goal line"), goal, 0.0, far * half);
            let post = far * (GOAL_WIDTH_M / 2.0 + LINE_WIDTH_M / 2.0);
            add(
                &format!("{end} goal, top of the {side} post"),
                goal,
                GOAL_HEIGHT_M + LINE_WIDTH_M / 2.0,
                post,
            );
            let chord = (CIRCLE_RADIUS_M.powi(2) - (PENALTY_AREA_DEPTH_M - PENALTY_MARK_M).powi(2)).sqrt();
            add(&format!("{end} penalty arc, {side} end"), front(PENALTY_AREA_DEPTH_M), 0.0, far * chord);
        }
    }
    for (end, sign) in [("left", -1.0), ("right", 1.0)] {
        add(&format!("{end} penalty mark"), sign * (half_x - PENALTY_MARK_M), 0.0, 0.0);
        add(&format!("centre circle, {end}most point"), sign * CIRCLE_RADIUS_M, 0.0, 0.0);
        let arc = half_x - PENALTY_MARK_M - CIRCLE_RADIUS_M;
        add(&format!("{end} penalty arc, point nearest to the halfway line"), sign * arc, 0.0, 0.0);
        for (side, far) in [("far", -1.0), ("near", 1.0)] {
            add(
                &format!("{end} {side} corner flag, top of the post"),
                sign * half_x,
                FLAG_POST_M,
                far * half_z,
            );
        }
    }
    all
}

/// Up to `most` points spread well over the picture, each clicked about a pixel off as a careful hand does.
pub fn clicked(
    camera: &Camera,
    pitch: &Pitch,
    frame: usize,
    most: usize,
    rng: &mut impl Rng,
) -> Correspondences {
    let margin = f64::from(camera.width_px) / 80.0;
    let limit =
        DVec2::new(f64::from(camera.width_px) - 1.0 - margin, f64::from(camera.height_px) - 1.0 - margin);
    let mut open: Vec<(String, DVec3, DVec2)> = candidates(pitch)
        .into_iter()
        .filter_map(|(name, world)| camera.project(world).map(|pixel| (name, world, pixel)))
        .filter(|(_, _, p)| p.cmpge(DVec2::splat(margin)).all() && p.cmple(limit).all())
        .collect();
    // Furthest-point choice, starting from the one nearest to a corner of the picture.
    let mut chosen: Vec<(String, DVec3, DVec2)> = Vec::new();
    while chosen.len() < most && !open.is_empty() {
        let apart = |p: DVec2| {
            let nearest = chosen.iter().map(|c| c.2.distance(p)).fold(f64::MAX, f64::min);
            if chosen.is_empty() { -p.length() } else { nearest }
        };
        let best =
            (0..open.len()).max_by(|&a, &b| apart(open[a].2).total_cmp(&apart(open[b].2))).unwrap_or(0);
        chosen.push(open.swap_remove(best));
    }
    let points = chosen
        .into_iter()
        .map(|(name, world, pixel)| {
            let slip = DVec2::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
            let pixel = ((pixel + slip) * 10.0).round() / 10.0;
            Point {
                name,
                pixel: pixel.to_array(),
                world_m: world.to_array().map(|v| (v * 1e4).round() / 1e4),
            }
        })
        .collect();
    Correspondences { frame, pitch: *pitch, points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_usual_view_offers_enough_points_near_the_truth() {
        let pitch = Pitch::default();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        for x in [-42.0, -20.0, 0.0, 15.0, 40.0] {
            let camera = Camera::looking_at(
                (1280, 720),
                1900.0,
                DVec3::new(0.0, 17.0, 62.0),
                DVec3::new(x, 0.6, -3.0),
            );
            let file = clicked(&camera, &pitch, 0, 10, &mut rng);
            assert!(file.points.len() >= 4, "{} points at {x}", file.points.len());
            for point in &file.points {
                let true_pixel = camera.project(point.world_m.into()).unwrap();
                assert!(true_pixel.distance(point.pixel.into()) < 1.6, "{}", point.name);
            }
            let pixels: Vec<DVec2> = file.points.iter().map(|p| p.pixel.into()).collect();
            let widest = pixels
                .iter()
                .flat_map(|a| pixels.iter().map(|b| (*b - *a).perp_dot(pixels[0] - *a).abs()))
                .fold(0.0, f64::max);
            assert!(widest > 5_000.0, "the points at {x} lie on one line");
        }
    }
}
