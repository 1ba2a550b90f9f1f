//! Where the straight lines of a pitch meet when they are drawn on: further points for the two-point solver, of pictures in
//! which few of the named points lie.

use glam::{DVec2, DVec3};
use protocol::pitch::{
    GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M, PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M, Pitch,
};

use super::{
    evidence::{Evidence, FoundLine},
    hypotheses::Pair,
};

/// Cells from which a line has a direction, and the share of the picture's width that they must span.
const CELLS_MIN: usize = 4;
const SPAN_MIN: f64 = 0.07;
/// Lines that meet flatter than this (sine of the angle) do not say where.
const ANGLE_MIN: f64 = 0.08;
/// How far outside the picture two lines may meet, as a share of its size.
const OUTSIDE: f64 = 0.5;
/// A crossing counts this much of a named point: lens distortion bends what is drawn on.
const WEIGHT: f64 = 0.5;

/// A straight line of the pitch: the world coordinate that stays the same along it.
#[derive(Clone, Copy, Debug)]
enum Course {
    /// Along the touchline, at this z in metres.
    Along(f64),
    /// Across the pitch, at this x in metres.
    Across(f64),
}

/// The course of a line by its name (see [`super::names::lines`]); `None` for arcs and goals.
fn course(name: usize, pitch: &Pitch) -> Option<Course> {
    let (half_x, half_z) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    match name {
        0 => Some(Course::Along(-half_z)),
        1 => Some(Course::Along(half_z)),
        2 => Some(Course::Across(0.0)),
        4..22 => {
            let side = if name < 13 { -1.0 } else { 1.0 };
            let goal = side * half_x;
            match (name - 4) % 9 {
                0 => Some(Course::Across(goal)),
                1 => Some(Course::Along(-PENALTY_AREA_WIDTH_M / 2.0)),
                2 => Some(Course::Across(goal - side * PENALTY_AREA_DEPTH_M)),
                3 => Some(Course::Along(PENALTY_AREA_WIDTH_M / 2.0)),
                4 => Some(Course::Along(-GOAL_AREA_WIDTH_M / 2.0)),
                5 => Some(Course::Across(goal - side * GOAL_AREA_DEPTH_M)),
                6 => Some(Course::Along(GOAL_AREA_WIDTH_M / 2.0)),
                _ => None,
            }
        }
        _ => None,
    }
}

/// A line of the picture: a point on it, its direction, how sure it is.
struct Drawn {
    course: Course,
    middle: DVec2,
    along: DVec2,
    score: f64,
}

/// The crossings of all found straight lines in and about the picture.
pub(super) fn crossings(evidence: &Evidence, pitch: &Pitch) -> Vec<Pair> {
    let size = DVec2::new(f64::from(evidence.size_px.0), f64::from(evidence.size_px.1));
    let drawn: Vec<Drawn> = evidence
        .lines
        .chunk_by(|a, b| a.name == b.name)
        .filter_map(|cells| straight(cells, course(cells.first()?.name, pitch)?, SPAN_MIN * size.x))
        .collect();
    let mut pairs = Vec::new();
    for a in &drawn {
        for b in &drawn {
            let (Course::Along(z), Course::Across(x)) = (a.course, b.course) else { continue };
            let sine = a.along.perp_dot(b.along);
            if sine.abs() < ANGLE_MIN {
                continue;
            }
            let pixel = a.middle + a.along * (b.middle - a.middle).perp_dot(b.along) / sine;
            if pixel.cmpge(-size * OUTSIDE).all() && pixel.cmple(size * (1.0 + OUTSIDE)).all() {
                pairs.push(Pair {
                    world: DVec3::new(x, 0.0, z),
                    pixel,
                    weight: WEIGHT * a.score.min(b.score),
                });
            }
        }
    }
    pairs
}

/// The best straight line through cells (least squares across it).
fn straight(cells: &[FoundLine], course: Course, span_px: f64) -> Option<Drawn> {
    if cells.len() < CELLS_MIN {
        return None;
    }
    let n = cells.len() as f64;
    let middle = cells.iter().map(|cell| cell.pixel).sum::<DVec2>() / n;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for d in cells.iter().map(|cell| cell.pixel - middle) {
        xx += d.x * d.x;
        xy += d.x * d.y;
        yy += d.y * d.y;
    }
    let along = DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy));
    let reach = |cell: &FoundLine| (cell.pixel - middle).dot(along);
    let (low, high) = cells.iter().map(reach).fold((0.0, 0.0), |(a, b): (f64, f64), r| (a.min(r), b.max(r)));
    let score = cells.iter().map(|cell| cell.score).sum::<f64>() / n;
    (high - low >= span_px).then_some(Drawn { course, middle, along, score })
}

#[cfg(test)]
mod tests {
    use protocol::camera::Camera;

    use super::*;

    #[test]
    fn lines_that_do_not_meet_in_paint_give_the_point_where_they_would() {
        let pitch = Pitch::default();
        let camera = Camera::looking_at(
            (1280, 720),
            1600.0,
            DVec3::new(0.0, 16.0, 60.0),
            DVec3::new(34.0, 0.0, -18.0),
        );
        let all = super::super::names::lines(&pitch);
        let mut evidence = Evidence { size_px: (1280, 720), ..Evidence::default() };
        // Far touchline and the front of the right penalty area.
        for name in [0, 15] {
            let cells = all[name].iter().filter_map(|&point| camera.project(point));
            evidence.lines.extend(cells.filter(|&p| camera.contains(p)).map(|pixel| FoundLine {
                name,
                pixel,
                score: 0.8,
            }));
        }
        let pairs = crossings(&evidence, &pitch);
        assert_eq!(pairs.len(), 1);
        assert_eq!(pairs[0].world, DVec3::new(36.0, 0.0, -34.0));
        assert!(pairs[0].pixel.distance(camera.project(pairs[0].world).unwrap()) < 0.5);
    }

    #[test]
    fn every_straight_line_runs_as_its_points_do() {
        let pitch = Pitch { length_m: 100.0, width_m: 64.0 };
        for (name, line) in super::super::names::lines(&pitch).iter().enumerate() {
            match course(name, &pitch) {
                Some(Course::Along(z)) => assert!(line.iter().all(|p| (p.z - z).abs() < 1e-9), "line {name}"),
                Some(Course::Across(x)) => {
                    assert!(line.iter().all(|p| (p.x - x).abs() < 1e-9), "line {name}")
                }
                None => assert!([3, 11, 12, 20, 21].contains(&name), "line {name}"),
            }
        }
    }
}
