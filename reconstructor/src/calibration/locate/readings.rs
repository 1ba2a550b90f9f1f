//! Other readings of what the network named. A line across the pitch with an arc on one side looks the same at the middle of
//! the pitch and before a goal; when the names do not fit together, the halfway line and its circle are read as the front of a
//! penalty area and its arc.

use super::evidence::Evidence;

/// Lines and points of the middle of the pitch, and what they are before the left and before the right goal (see
/// [`super::names`]): halfway line, circle, near touchline; halfway line at the near touchline, circle at the halfway line (far, near),
/// the circle's far end seen from that goal.
const LINES: [[usize; 3]; 3] = [[2, 6, 15], [3, 11, 20], [1, 7, 16]];
const LEFT_POINTS: [[usize; 2]; 4] = [[2, 17], [3, 12], [4, 20], [6, 24]];
const RIGHT_POINTS: [[usize; 2]; 4] = [[2, 35], [3, 30], [4, 38], [5, 42]];
/// Points of the middle of the pitch that have no counterpart before a goal.
const MIDDLE: std::ops::Range<usize> = 0..7;

/// Which goal the picture is read to be before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Left,
    Right,
}

/// The evidence with the middle of the pitch read as the penalty area of one end. Where a name is taken already, both stay
/// places of one line; of two places of a point the surer one stays.
pub(super) fn before_goal(evidence: &Evidence, end: End) -> Evidence {
    let (column, points) = match end {
        End::Left => (1, LEFT_POINTS),
        End::Right => (2, RIGHT_POINTS),
    };
    let line_name = |name: usize| {
        let row = LINES.iter().find(|row| row.first() == Some(&name));
        row.and_then(|row| row.get(column)).copied().unwrap_or(name)
    };
    let mut read = evidence.clone();
    for line in &mut read.lines {
        line.name = line_name(line.name);
    }
    read.lines.sort_by_key(|line| line.name);
    for row in LINES {
        if let (Some(&from), Some(&to)) = (row.first(), row.get(column)) {
            read.also_shown(from, to);
        }
    }
    for point in &mut read.points {
        if let Some([_, to]) = points.iter().find(|[from, _]| *from == point.name) {
            point.name = *to;
        }
    }
    read.points.retain(|point| !MIDDLE.contains(&point.name));
    read.points.sort_by(|a, b| a.name.cmp(&b.name).then(b.score.total_cmp(&a.score)));
    read.points.dedup_by_key(|point| point.name);
    read
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};
    use protocol::{camera::Camera, pitch::Pitch};

    use super::{
        super::{
            Terms,
            evidence::{FoundLine, FoundPoint},
            explain, names,
            refine::Named,
        },
        *,
    };

    #[test]
    fn every_counterpart_lies_where_the_middle_would_if_it_were_moved_to_the_goal() {
        let points = names::points(&Pitch::default());
        for (table, side) in [(LEFT_POINTS, -1.0), (RIGHT_POINTS, 1.0)] {
            for [from, to] in table {
                assert_eq!(points[to].x.signum(), side, "{to}");
                assert_eq!(points[to].z.signum(), points[from].z.signum(), "{from} read as {to}");
            }
        }
        let lines = names::lines(&Pitch::default());
        for [_, left, right] in LINES {
            assert!(lines[left].iter().all(|p| p.x < -30.0) && lines[right].iter().all(|p| p.x > 30.0));
        }
    }

    #[test]
    fn a_penalty_area_that_was_named_like_the_centre_circle_is_read_right() {
        let (pitch, named) = (Pitch::default(), Named::new(&Pitch::default()));
        let position = DVec3::new(0.0, 15.0, 55.0);
        let truth = Camera::looking_at((1280, 720), 1700.0, position, DVec3::new(40.0, 0.0, -4.0));
        let seen = |world: DVec3| truth.project(world).filter(|&pixel| truth.contains(pixel));
        let mut evidence = Evidence { size_px: (1280, 720), ..Evidence::default() };
        for (name, line) in named.lines.iter().enumerate().skip(13) {
            // Front, arc and near side go by the wrong names.
            let said = LINES.iter().find(|row| row[2] == name).map_or(name, |row| row[0]);
            let cells = line.iter().filter_map(|&world| seen(world));
            evidence.lines.extend(cells.map(|pixel| FoundLine { name: said, pixel, score: 0.8 }));
        }
        evidence.lines.sort_by_key(|line| line.name);
        for (name, &world) in named.points.iter().enumerate().skip(25) {
            let said = RIGHT_POINTS.iter().find(|[_, to]| *to == name).map_or(name, |[from, _]| *from);
            evidence.points.extend(seen(world).map(|pixel| FoundPoint { name: said, pixel, score: 0.6 }));
        }
        let read = before_goal(&evidence, End::Right);
        let (found, _) = explain(&read, &named, &pitch, Terms::default()).unwrap();
        let middle = DVec2::new(640.0, 400.0);
        let error = found.ground_point(middle).unwrap().distance(truth.ground_point(middle).unwrap());
        assert!(error < 0.5, "{error} m: {found:?}");
    }
}
