//! The pitch: its size and the lines painted on it (IFAB Laws of the Game, Law 1).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Width of a painted line, metres (the most that Law 1 allows).
pub const LINE_WIDTH_M: f64 = 0.12;
/// Inner width between the goal posts, metres.
pub const GOAL_WIDTH_M: f64 = 7.32;
/// Height of the lower edge of the crossbar, metres.
pub const GOAL_HEIGHT_M: f64 = 2.44;
/// Radius of the centre circle and of the penalty arcs, metres.
pub const CIRCLE_RADIUS_M: f64 = 9.15;
/// Distance of the penalty mark from the goal line, metres.
pub const PENALTY_MARK_M: f64 = 11.0;
/// Depth of the penalty area from the goal line, metres.
pub const PENALTY_AREA_DEPTH_M: f64 = 16.5;
/// Width of the penalty area, metres.
pub const PENALTY_AREA_WIDTH_M: f64 = 40.32;
/// Depth of the goal area from the goal line, metres.
pub const GOAL_AREA_DEPTH_M: f64 = 5.5;
/// Width of the goal area, metres.
pub const GOAL_AREA_WIDTH_M: f64 = 18.32;
/// Radius of the corner arcs, metres.
pub const CORNER_RADIUS_M: f64 = 1.0;

/// The size of a pitch. Length runs along world x, width along world z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Pitch {
    /// Goal line to goal line, metres.
    pub length_m: f64,
    /// Touchline to touchline, metres.
    pub width_m: f64,
}

impl Default for Pitch {
    fn default() -> Self {
        Self { length_m: 105.0, width_m: 68.0 }
    }
}

/// One painted marking, in pitch coordinates (world x, world z) in metres, along the middle of the paint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Marking {
    /// A straight line.
    Line {
        /// One end.
        from: DVec2,
        /// The other end.
        to: DVec2,
    },
    /// Part of a circle, from angle `start` over `sweep` (radians; 0 is +x, π/2 is +z).
    Arc {
        /// Middle of the circle.
        centre: DVec2,
        /// Radius in metres.
        radius_m: f64,
        /// Angle of the first end.
        start: f64,
        /// Angle covered; 2π for a full circle.
        sweep: f64,
    },
    /// A filled mark.
    Spot {
        /// Middle of the mark.
        centre: DVec2,
        /// Radius in metres.
        radius_m: f64,
    },
}

impl Marking {
    /// Points along the marking at most `spacing_m` apart, ends included.
    #[must_use]
    pub fn sample(&self, spacing_m: f64) -> Vec<DVec2> {
        let steps = |length: f64| ((length / spacing_m.max(1e-3)).ceil() as usize).clamp(1, 100_000);
        match *self {
            Self::Line { from, to } => {
                let n = steps(from.distance(to));
                (0..=n).map(|i| from.lerp(to, i as f64 / n as f64)).collect()
            }
            Self::Arc { centre, radius_m, start, sweep } => {
                let n = steps(radius_m * sweep.abs());
                (0..=n)
                    .map(|i| centre + radius_m * DVec2::from_angle(start + sweep * i as f64 / n as f64))
                    .collect()
            }
            Self::Spot { centre, .. } => vec![centre],
        }
    }

    /// Whether the paint, [`LINE_WIDTH_M`] wide, covers a place of the pitch.
    #[must_use]
    pub fn covers(&self, place: DVec2) -> bool {
        self.covers_painted(place, LINE_WIDTH_M)
    }

    /// As [`covers`](Self::covers), with lines of another width in metres; spots keep their radius.
    #[must_use]
    pub fn covers_painted(&self, place: DVec2, line_m: f64) -> bool {
        let half = line_m / 2.0;
        match *self {
            Self::Line { from, to } => {
                let along = (place - from).dot(to - from) / (to - from).length_squared();
                place.distance(from.lerp(to, along.clamp(0.0, 1.0))) < half
            }
            Self::Arc { centre, radius_m, start, sweep } => {
                let angle = (place - centre).to_angle() - start;
                (place.distance(centre) - radius_m).abs() < half && angle.rem_euclid(TAU) <= sweep
            }
            Self::Spot { centre, radius_m } => place.distance(centre) < radius_m,
        }
    }
}

impl Pitch {
    /// Every marking of the pitch.
    #[must_use]
    pub fn markings(&self) -> Vec<Marking> {
        let (half_length, half_width) = (self.length_m / 2.0, self.width_m / 2.0);
        let line = |x0: f64, z0: f64, x1: f64, z1: f64| Marking::Line {
            from: DVec2::new(x0, z0),
            to: DVec2::new(x1, z1),
        };
        let mut all = vec![
            line(-half_length, -half_width, half_length, -half_width),
            line(-half_length, half_width, half_length, half_width),
            line(0.0, -half_width, 0.0, half_width),
            Marking::Arc { centre: DVec2::ZERO, radius_m: CIRCLE_RADIUS_M, start: 0.0, sweep: TAU },
            Marking::Spot { centre: DVec2::ZERO, radius_m: LINE_WIDTH_M },
        ];
        for side in [-1.0, 1.0] {
            let goal_line = side * half_length;
            all.push(line(goal_line, -half_width, goal_line, half_width));
            for (depth, width) in
                [(PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M), (GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M)]
            {
                let (front, half) = (goal_line - side * depth, width / 2.0);
                all.push(line(goal_line, -half, front, -half));
                all.push(line(front, -half, front, half));
                all.push(line(front, half, goal_line, half));
            }
            let mark = DVec2::new(goal_line - side * PENALTY_MARK_M, 0.0);
            all.push(Marking::Spot { centre: mark, radius_m: LINE_WIDTH_M });
            // The arc is the part of the circle round the penalty mark outside the penalty area.
            let half_angle = ((PENALTY_AREA_DEPTH_M - PENALTY_MARK_M) / CIRCLE_RADIUS_M).acos();
            let facing_centre = if side > 0.0 { PI } else { 0.0 };
            all.push(Marking::Arc {
                centre: mark,
                radius_m: CIRCLE_RADIUS_M,
                start: facing_centre - half_angle,
                sweep: 2.0 * half_angle,
            });
            for touch in [-1.0, 1.0] {
                let start = match (side > 0.0, touch > 0.0) {
                    (false, false) => 0.0,
                    (true, false) => FRAC_PI_2,
                    (true, true) => PI,
                    (false, true) => -FRAC_PI_2,
                };
                all.push(Marking::Arc {
                    centre: DVec2::new(goal_line, touch * half_width),
                    radius_m: CORNER_RADIUS_M,
                    start,
                    sweep: FRAC_PI_2,
                });
            }
        }
        all
    }

    /// Whether a pitch position (world x, z) lies inside the lines widened by `margin_m`.
    #[must_use]
    pub fn contains(&self, position: DVec2, margin_m: f64) -> bool {
        position.x.abs() <= self.length_m / 2.0 + margin_m
            && position.y.abs() <= self.width_m / 2.0 + margin_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_marking_lies_on_the_pitch() {
        let pitch = Pitch::default();
        for marking in pitch.markings() {
            for point in marking.sample(0.25) {
                assert!(pitch.contains(point, 1e-9), "{marking:?} leaves the pitch at {point}");
            }
        }
    }

    #[test]
    fn paint_covers_its_own_middle_and_no_more_than_its_width() {
        for marking in Pitch::default().markings() {
            let points = marking.sample(0.25);
            let inner = if points.len() > 2 { &points[1..points.len() - 1] } else { &points[..] };
            assert!(inner.iter().all(|&point| marking.covers(point)), "{marking:?}");
        }
        let halfway = Marking::Line { from: DVec2::new(0.0, -34.0), to: DVec2::new(0.0, 34.0) };
        assert!(halfway.covers(DVec2::new(0.05, 3.0)) && !halfway.covers(DVec2::new(0.07, 3.0)));
        let quarter = Marking::Arc { centre: DVec2::ZERO, radius_m: 1.0, start: 0.0, sweep: FRAC_PI_2 };
        assert!(quarter.covers(DVec2::new(0.6, 0.8)) && !quarter.covers(DVec2::new(-0.6, 0.8)));
    }

    #[test]
    fn penalty_arcs_start_on_the_edge_of_the_area() {
        let pitch = Pitch::default();
        let front = pitch.length_m / 2.0 - PENALTY_AREA_DEPTH_M;
        let arcs: Vec<_> = pitch
            .markings()
            .into_iter()
            .filter_map(|marking| match marking {
                Marking::Arc { centre, radius_m, .. } if centre.x.abs() > 1.0 && radius_m > 5.0 => {
                    Some(marking.sample(0.5))
                }
                _ => None,
            })
            .collect();
        assert_eq!(arcs.len(), 2);
        for arc in arcs {
            assert!((arc[0].x.abs() - front).abs() < 1e-9);
            assert!(arc.iter().all(|p| p.x.abs() <= front + 1e-9));
        }
    }
}
