//! Which way is up, when the sensor does not say.
//!
//! People hold a camera upright and look down on a table: up lies near the plane of the view and the picture's columns.
//! Within that, the planes decide: rooms have many surfaces that are level or upright (Gupta, Arbeláez and Malik,
//! "Perceptual organization and recognition of indoor scenes from RGB-D images", CVPR 2013). Each plane that could be
//! level is a hypothesis; its votes are the points of all planes along it, and fewer for those across it.

use glam::DVec3;
use serde::Serialize;

/// How the direction against gravity became known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UpSource {
    /// The sensor or the user gave it.
    Given,
    /// From the level and upright planes.
    Planes,
    /// An axis of a cloud without order that the planes come close to: such clouds come from trackers and scanners whose
    /// frames are made level.
    Axis,
    /// Only from how the picture was held: no plane could be level.
    Picture,
}

/// The direction against gravity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Up {
    /// Unit length.
    pub direction: DVec3,
    /// How it became known.
    pub source: UpSource,
}

/// A plane's normal and the number of its points.
pub(super) type Vote = (DVec3, f64);

/// Planes within this angle are parallel, radians.
const PARALLEL: f64 = 0.105;

/// A camera does not look down steeper than this (sine of the angle between up and the picture's vertical): beyond,
/// a wall in front of the camera and a table under it look the same.
const LEAST_UPRIGHT: f64 = 0.2;

/// A camera does not lean sideways further than this (sine).
const MOST_ROLL: f64 = 0.5;

/// An estimate this close to an axis of a cloud without order is that axis, radians: chance comes as near to one of the six
/// in one cloud of 90.
const NEAR_AXIS: f64 = 0.087;

/// Estimates up from the picture's own vertical, the direction of view, and the planes in it.
pub(super) fn estimate(picture_up: DVec3, view: DVec3, votes: &[Vote]) -> Up {
    let vertical = picture_up.reject_from_normalized(view).try_normalize().unwrap_or(picture_up);
    let sideways = view.cross(vertical);
    let prior = |normal: DVec3| -> Option<f64> {
        let upright = normal.dot(vertical);
        let possible =
            upright > LEAST_UPRIGHT && normal.dot(sideways).abs() < MOST_ROLL && normal.dot(view) < 0.5;
        possible.then(|| (0.3 + upright).min(1.0))
    };
    let score = |normal: DVec3| -> f64 {
        votes
            .iter()
            .map(|(other, points)| {
                let along = normal.dot(*other).abs();
                if along > PARALLEL.cos() {
                    *points
                } else if along < PARALLEL {
                    0.4 * points
                } else {
                    0.0
                }
            })
            .sum()
    };
    let best = votes
        .iter()
        .filter_map(|(normal, _)| prior(*normal).map(|prior| (prior * score(*normal), *normal)))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, first)) = best else { return Up { direction: vertical, source: UpSource::Picture } };
    let mean: DVec3 = votes
        .iter()
        .filter(|(normal, _)| normal.dot(first).abs() > PARALLEL.cos())
        .map(|(normal, points)| *normal * points.copysign(normal.dot(first)))
        .sum();
    Up { direction: mean.try_normalize().unwrap_or(first), source: UpSource::Planes }
}

/// The picture's vertical for a sensor whose rows are not known, from the axis it looks along: the camera conventions
/// with z forward (y down) and z backward (y up), and the vehicle convention with x forward (z up).
pub(super) fn conventional_vertical(view: DVec3) -> DVec3 {
    let size = view.abs();
    if size.z >= size.x && size.z >= size.y {
        if view.z > 0.0 { DVec3::NEG_Y } else { DVec3::Y }
    } else if size.x >= size.y {
        DVec3::Z
    } else {
        DVec3::Y
    }
}

/// The axis that a direction is close to.
pub(super) fn near_axis(direction: DVec3) -> Option<DVec3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    axes.into_iter().flat_map(|axis| [axis, -axis]).find(|axis| axis.angle_between(direction) < NEAR_AXIS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_floor_wins_over_a_large_wall_ahead() {
        let floor = DVec3::new(0.0, -0.97, -0.24).normalize();
        let wall = DVec3::new(0.0, 0.24, -0.97).normalize();
        let side = DVec3::X;
        let votes = [(wall, 5000.0), (floor, 3000.0), (side, 2000.0)];
        let up = estimate(DVec3::NEG_Y, DVec3::Z, &votes);
        assert_eq!(up.source, UpSource::Planes);
        assert!(up.direction.distance(floor) < 1e-9, "{up:?}");
        let only_wall = estimate(DVec3::NEG_Y, DVec3::Z, &[(DVec3::NEG_Z, 5000.0)]);
        assert_eq!(only_wall, Up { direction: DVec3::NEG_Y, source: UpSource::Picture });
    }
}
