//! What the pitch network names, in the order of its output: 43 points, 22 kinds of lines, the area of the pitch.
//!
//! `training/pitch/points.py` has the same lists; a test of the shipped network holds the two together.

use glam::DVec3;
use protocol::pitch::{
    CIRCLE_RADIUS_M, CORNER_RADIUS_M, GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M, GOAL_HEIGHT_M, GOAL_WIDTH_M,
    Marking, PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M, PENALTY_MARK_M, Pitch,
};

/// Named points.
pub(super) const POINTS: usize = 43;
/// Kinds of lines.
pub(super) const LINES: usize = 22;
/// Maps of the network: points, kinds of lines, area of the pitch.
pub(super) const CHANNELS: usize = POINTS + LINES + 1;

/// Distance between the points along a line, metres.
const SPACING_M: f64 = 1.0;

/// Depth and width of the penalty area and of the goal area.
const AREAS: [(f64, f64); 2] =
    [(PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M), (GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M)];

/// The [`POINTS`] named points of a pitch, world metres: centre, ends of the halfway line, four of the circle; then for the left
/// and the right end, far side before near side, corner, penalty area, goal area, penalty arc and post, and at last the
/// penalty mark and the top of the arc.
pub(crate) fn points(pitch: &Pitch) -> Vec<DVec3> {
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
    all
}

/// The [`LINES`] kinds of lines as points at most a metre apart: touchlines, halfway line, circle; then for either end the goal
/// line, three sides of the penalty area, three of the goal area, the arc and the goal's frame. But for the frames they are the
/// pitch's markings in their order, without marks and corner arcs.
pub(super) fn lines(pitch: &Pitch) -> Vec<Vec<DVec3>> {
    let is_line = |marking: &Marking| match marking {
        Marking::Line { .. } => true,
        Marking::Arc { radius_m, .. } => *radius_m > CORNER_RADIUS_M,
        Marking::Spot { .. } => false,
    };
    let painted = pitch.markings().into_iter().filter(is_line).map(|marking| {
        marking.sample(SPACING_M).into_iter().map(|place| DVec3::new(place.x, 0.0, place.y)).collect()
    });
    let mut all: Vec<Vec<DVec3>> = painted.collect();
    // Each end's frame follows its arc.
    all.insert(END_LINES + SHARED_LINES, goal_frame(-pitch.length_m / 2.0));
    all.push(goal_frame(pitch.length_m / 2.0));
    all
}

/// Painted lines that belong to no end, and to each end.
const SHARED_LINES: usize = 4;
const END_LINES: usize = 8;

/// Posts and crossbar of the goal at `x`, from the foot of the far post to that of the near one.
fn goal_frame(x: f64) -> Vec<DVec3> {
    let post = GOAL_WIDTH_M / 2.0;
    let corners = [(0.0, -post), (GOAL_HEIGHT_M, -post), (GOAL_HEIGHT_M, post), (0.0, post)]
        .map(|(y, z)| DVec3::new(x, y, z));
    let mut points = vec![corners[0]];
    for pair in corners.windows(2) {
        let [a, b] = pair else { continue };
        let steps = (a.distance(*b) / SPACING_M).ceil() as usize;
        points.extend((1..=steps).map(|k| a.lerp(*b, k as f64 / steps as f64)));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_lines_are_as_many_as_the_network_has_and_lie_on_the_markings() {
        let pitch = Pitch { length_m: 102.0, width_m: 66.0 };
        let lines = lines(&pitch);
        assert_eq!((lines.len(), points(&pitch).len()), (LINES, POINTS));
        let frame = |line: &[DVec3]| line.iter().any(|point| point.y > 0.0);
        assert!(lines.iter().enumerate().all(|(k, line)| frame(line) == [12, 21].contains(&k)));
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
