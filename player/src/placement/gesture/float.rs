//! A place in the air before any table is known: in front of the viewer, below the eye, level.

use glam::DVec3;

use super::Ray;
use crate::placement::{Plane, TabletopPose};

/// In front of the eye and below it, metres: where a table top is for somebody who stands close or sits.
const AHEAD_M: f64 = 0.75;
const BELOW_M: f64 = 0.45;
/// Length of the turf there, metres.
const LENGTH_M: f64 = 0.6;

/// Where a match floats for a viewer who looks along a ray; across the line of sight, the main camera's side nearer.
/// `None` for somebody who looks straight up or down.
pub(super) fn comfortable(
    viewer: &Ray,
    up: DVec3,
    half_turf_m: [f64; 2],
    scale_limits: [f64; 2],
) -> Option<TabletopPose> {
    let level = viewer.direction.try_normalize()?.reject_from_normalized(up);
    if level.length() < 0.05 {
        return None;
    }
    let ahead = level.normalize();
    let foot = viewer.origin_m + ahead * AHEAD_M - up * BELOW_M;
    let scale = (LENGTH_M / (2.0 * half_turf_m[0])).clamp(scale_limits[0], scale_limits[1]);
    // z (towards the main camera) is back to the viewer; x is up × z.
    Some(TabletopPose::standing_on(foot, up, up.cross(-ahead), scale))
}

/// The level plane under a match in the air.
pub(super) fn level(pose: &TabletopPose, up: DVec3) -> Plane {
    Plane::through(pose.foot_m(), up)
}
