//! What the pitch network names, in the order of its output: 43 points, 22 kinds of lines, the area of the pitch.
//!
//! `training/pitch/points.py` has the same lists; a test of the shipped network holds the two together.

use glam::DVec3;
use protocol::pitch::{
    CIRCLE_RADIUS_M, GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M, GOAL_HEIGHT_M, GOAL_WIDTH_M, PENALTY_AREA_DEPTH_M,
    PENALTY_AREA_WIDTH_M, PENALTY_MARK_M, Pitch,
};

/// Named points.
pub(super) const POINTS: usize = 43;
/// Kinds of lines.
pub(super) const LINES: usize = 22;
/// Maps of the network: points, kinds of lines, area of the pitch.
pub(super) const CHANNELS: usize = POINTS + LINES + 1;

/// Distance between the points along a line, metres.
const SPACING_M: f64 = 1.0;

/// The named points of a pitch, world metres: centre, ends of the halfway line, four of the circle; then for the left and
/// the right end, far side before near side, corner, penalty area, goal area, penalty arc and post, and at last the
/// penalty mark and the top of the arc.
pub(super) fn points(pitch: &Pitch) -> [DVec3; POINTS] {
    let (half_x, half_z) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    let flat = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let mut all = vec![
        flat(0.0, 0.0),
        flat(0.0, -half_z),
        flat(0.0, half_z),
        flat(0.0, -CIRCLE_RADIUS_M),
        flat(0.0, CIRCLE_RADIUS_M),
        flat(-CIRCLE_RADIUS_M, 0.0),
        flat(CIRCLE_RADIUS_M, 0.0),
    ];
    let arc_z = (CIRCLE_RADIUS_M.powi(2) - (PENALTY_AREA_DEPTH_M - PENALTY_MARK_M).powi(2)).sqrt();
    for side in [-1.0, 1.0] {
        let goal = side * half_x;
        for far in [-1.0, 1.0] {
            all.push(flat(goal, far * half_z));
            for (depth, width) in AREAS {
                all.extend([flat(goal, far * width / 2.0), flat(goal - side * depth, far * width / 2.0)]);
            }
            all.push(flat(goal - side * PENALTY_AREA_DEPTH_M, far * arc_z));
            let post = far * GOAL_WIDTH_M / 2.0;
            all.extend([flat(goal, post), DVec3::new(goal, GOAL_HEIGHT_M, post)]);
        }
        all.push(flat(goal - side * PENALTY_MARK_M, 0.0));
        all.push(flat(goal - side * (PENALTY_MARK_M + CIRCLE_RADIUS_M), 0.0));
    }
    let mut points = [DVec3::ZERO; POINTS];
    for (place, point) in points.iter_mut().zip(all) {
        *place = point;
    }
    points
}

/// Depth and width of the penalty area and of the goal area.
const AREAS: [(f64, f64); 2] =
    [(PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M), (GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M)];

/// Every kind of line as points at most a metre apart: touchlines, halfway line, circle; then for either end the goal line,
/// three sides of the penalty area, three of the goal area, the arc and the goal's frame.
pub(super) fn lines(pitch: &Pitch) -> Vec<Vec<DVec3>> {
    let (half_x, half_z) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    let flat = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let mut all = vec![
        path(&[flat(-half_x, -half_z), flat(half_x, -half_z)]),
        path(&[flat(-half_x, half_z), flat(half_x, half_z)]),
        path(&[flat(0.0, -half_z), flat(0.0, half_z)]),
        arc(0.0, 0.0, std::f64::consts::TAU),
    ];
    let half_angle = ((PENALTY_AREA_DEPTH_M - PENALTY_MARK_M) / CIRCLE_RADIUS_M).acos();
    for side in [-1.0, 1.0] {
        let goal = side * half_x;
        all.push(path(&[flat(goal, -half_z), flat(goal, half_z)]));
        for (depth, width) in AREAS {
            let (front, half) = (goal - side * depth, width / 2.0);
            all.push(path(&[flat(goal, -half), flat(front, -half)]));
            all.push(path(&[flat(front, -half), flat(front, half)]));
            all.push(path(&[flat(goal, half), flat(front, half)]));
        }
        let facing = if side > 0.0 { std::f64::consts::PI } else { 0.0 };
        all.push(arc(goal - side * PENALTY_MARK_M, facing - half_angle, 2.0 * half_angle));
        let post = GOAL_WIDTH_M / 2.0;
        let (far, near) = (DVec3::new(goal, GOAL_HEIGHT_M, -post), DVec3::new(goal, GOAL_HEIGHT_M, post));
        all.push(path(&[flat(goal, -post), far, near, flat(goal, post)]));
    }
    all
}

/// Points along straight pieces, ends and corners included.
fn path(corners: &[DVec3]) -> Vec<DVec3> {
    let mut points: Vec<DVec3> = corners.first().copied().into_iter().collect();
    for pair in corners.windows(2) {
        let [a, b] = pair else { continue };
        let steps = (a.distance(*b) / SPACING_M).ceil().max(1.0) as usize;
        points.extend((1..=steps).map(|k| a.lerp(*b, k as f64 / steps as f64)));
    }
    points
}

/// Points along a circle round (`x`, 0) from the angle `start` over `sweep`, radians from +x towards +z.
fn arc(x: f64, start: f64, sweep: f64) -> Vec<DVec3> {
    let steps = (CIRCLE_RADIUS_M * sweep.abs() / SPACING_M).ceil().max(4.0) as usize;
    (0..=steps)
        .map(|k| {
            let (sin, cos) = (start + sweep * k as f64 / steps as f64).sin_cos();
            DVec3::new(x + CIRCLE_RADIUS_M * cos, 0.0, CIRCLE_RADIUS_M * sin)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_lines_are_as_many_as_the_network_has_and_lie_on_the_markings() {
        let pitch = Pitch { length_m: 102.0, width_m: 66.0 };
        let lines = lines(&pitch);
        assert_eq!(lines.len(), LINES);
        let marked: Vec<glam::DVec2> =
            pitch.markings().iter().flat_map(|marking| marking.sample(0.02)).collect();
        let on_pitch = |p: &DVec3| {
            let goal = (p.x.abs() - 51.0).abs() < 1e-9 && p.z.abs() <= GOAL_WIDTH_M / 2.0 + 1e-9;
            goal || marked.iter().any(|m| m.distance(glam::DVec2::new(p.x, p.z)) < 0.03)
        };
        // All but the top of each arc's circle are painted; that too, as the arc reaches it.
        for (k, point) in points(&pitch).iter().enumerate() {
            assert!(on_pitch(point), "point {k} at {point}");
        }
        for (k, line) in lines.iter().enumerate() {
            assert!(line.iter().all(on_pitch), "line {k}");
            assert!(line.windows(2).all(|pair| pair[0].distance(pair[1]) <= SPACING_M + 1e-9), "line {k}");
        }
    }
}
