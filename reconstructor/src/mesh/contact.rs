//! The body stands on the pitch: a small vertical correction brings its lowest part to y = 0, or, of somebody who jumps, to
//! the height of the jump.

use glam::DVec3;

use super::VirtualPlane;
use crate::pose::Person;

/// The most that a body is moved up or down to stand on the pitch, metres. More means that the feet are hidden or that the
/// player jumps, and then the place on the pitch is trusted rather than the lowest pixel.
pub const MAX_CORRECTION_M: f64 = 0.15;

/// The share of points that may lie lower than the sole: stray pixels of grass.
const STRAY_SHARE: f64 = 0.003;
/// BlazePose: ankles, heels, toes.
const FOOT_JOINTS: std::ops::RangeInclusive<usize> = 27..=32;
/// Feet are missing from the mask when it ends this far above the lowest foot joint, metres.
const FOOT_MISSING_M: f64 = 0.12;

/// How far up (+) to move the body so that its lowest part is `above_ground_m` over the pitch, metres, at most
/// [`MAX_CORRECTION_M`] either way.
pub(super) fn correction(
    points_m: &[DVec3],
    person: &Person,
    plane: &VirtualPlane,
    footprint_m: f64,
    above_ground_m: f64,
) -> f64 {
    let mut heights: Vec<f64> = points_m.iter().map(|point| point.y).collect();
    heights.sort_by(f64::total_cmp);
    let Some(&sole_m) = heights.get((heights.len() as f64 * STRAY_SHARE) as usize) else { return 0.0 };
    let lowest_joint = person
        .joints
        .get(FOOT_JOINTS)
        .unwrap_or_default()
        .iter()
        .filter(|joint| joint.visibility >= 0.5 && joint.pixel.is_finite())
        .max_by(|a, b| a.pixel.y.total_cmp(&b.pixel.y));
    let joint_m = lowest_joint
        .and_then(|joint| plane.point(joint.pixel, f64::from(joint.depth_m).clamp(-0.5, 0.5)))
        .map(|point| point.y);
    let contact_m = match joint_m {
        Some(joint_m) if sole_m > joint_m + FOOT_MISSING_M.max(2.0 * footprint_m) => joint_m,
        _ => sole_m,
    };
    (above_ground_m - contact_m).clamp(-MAX_CORRECTION_M, MAX_CORRECTION_M)
}
