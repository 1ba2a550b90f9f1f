//! Where on the pitch a person stands: the point under the hips, found from the feet, and whether that is possible.
//!
//! One picture gives a joint's line of sight only; a foot that stands has a known height, which fixes how far away the
//! body is. The height of the body in metres at that distance then tells people from everything else.

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};

use super::{Joint, index};
use crate::{detection::Detection, geometry::PixelBox};

/// People stand at most this far outside the lines (assistants, throw-ins), metres.
pub(super) const MARGIN_M: f64 = 3.0;
/// Nearer to the lines than this, or outside them, looks tell who is in the match, metres.
const LOOKS_MARGIN_M: f64 = 0.5;
/// Assistants run along the lines and throw-ins are taken behind them, at most this far outside, metres.
const BESIDE_MARGIN_M: f64 = 1.5;
/// Height of the lowest pixels of a foot above the grass, metres.
const FOOT_M: f64 = 0.03;
/// Height above the pitch at which the network sees ankle, heel and toe of the lower foot, metres. Larger than a standing
/// foot's (0.10, 0.07, 0.03 with boots): a runner's lower foot is in the air half of the time, and the network sets the
/// ankle high. Measured on rendered players (700 sightings); the anatomical heights put them 0.2 m too far away.
const FOOT_JOINTS: [[(usize, f64); 3]; 2] = [
    [(index::LEFT_ANKLE, 0.15), (index::LEFT_HEEL, 0.09), (index::LEFT_TOE, 0.06)],
    [(index::RIGHT_ANKLE, 0.15), (index::RIGHT_HEEL, 0.09), (index::RIGHT_TOE, 0.06)],
];
/// The network's depths are noisy and bring feet too near: between foot and hips, this share of what they differ from an
/// upright leg is believed.
const DEPTH_TRUST: f64 = 0.25;
/// Hips above the feet of somebody upright, metres.
const HIP_M: f64 = 0.9;
/// A foot whose line of sight meets the pitch this much farther than the other's is in the air, metres.
const BOTH_STAND_M: f64 = 0.25;
/// Top of the head above the pitch that a player can have: lying or tackling to jumping.
pub(super) const HEAD_M: std::ops::RangeInclusive<f64> = 0.7..=2.6;
/// Height of a box lifted on the pitch, before the pose is known; boxes are rough.
const BOX_M: std::ops::RangeInclusive<f64> = 0.6..=3.2;

/// The horizontal direction from `ground_m` to the camera: the normal of the upright plane there that faces it.
pub(crate) fn upright_normal(camera: &Camera, ground_m: DVec3) -> DVec3 {
    (camera.position - ground_m).with_y(0.0).normalize_or(DVec3::Z)
}

/// A pixel lifted on the upright plane through `ground_m`.
pub(crate) fn lift(camera: &Camera, pixel: DVec2, ground_m: DVec3) -> Option<DVec3> {
    camera.ray(pixel).on_plane(ground_m, upright_normal(camera, ground_m))
}

/// Whether a detection can be of somebody in the match: in a box that may stand on the pitch, and not somebody beside it.
pub(super) fn may_play(camera: &Camera, pitch: &Pitch, found: &Detection) -> bool {
    if !box_may_stand(camera, pitch, &found.bounds) {
        return false;
    }
    let Some(ground) = under_box(camera, &found.bounds) else { return false };
    let within = |margin_m: f64| pitch.contains(DVec2::new(ground.x, ground.z), margin_m);
    // Looks decide only near the lines: nobody but players and officials is farther in. Coaches look like officials or
    // players, but stand farther from the lines than assistants do.
    within(-LOOKS_MARGIN_M) || (within(BESIDE_MARGIN_M) && found.roles.bystander < 0.5)
}

/// The point of the pitch under the lower end of a box.
pub(super) fn under_box(camera: &Camera, bounds: &PixelBox) -> Option<DVec3> {
    let foot = DVec2::new(bounds.centre().x, bounds.max.y);
    let ground = camera.ray(foot).at_height(FOOT_M)?;
    ground.is_finite().then_some(DVec3::new(ground.x, 0.0, ground.z))
}

/// Whether a detector's box could hold somebody on the pitch; generous, for boxes are rough.
pub(super) fn box_may_stand(camera: &Camera, pitch: &Pitch, bounds: &PixelBox) -> bool {
    let middle = bounds.centre().x;
    // Half the box may be missing (cut by the picture), or it may hang over: try its lower end, then a little more.
    let stands = |y: f64| {
        let foot = DVec2::new(middle, y);
        let Some(ground) = camera.ground_point(foot) else { return false };
        let head = lift(camera, DVec2::new(middle, bounds.min.y), ground);
        pitch.contains(DVec2::new(ground.x, ground.z), MARGIN_M) && head.is_some_and(|p| BOX_M.contains(&p.y))
    };
    let height = bounds.size().y;
    [0.0, 0.15, -0.1].into_iter().any(|part| stands(bounds.max.y + part * height))
}

/// The point of the pitch under the middle of the hips, or `None` when the pose cannot be that of somebody on the pitch.
pub(crate) fn stand(camera: &Camera, pitch: &Pitch, joints: &[Joint]) -> Option<DVec3> {
    let hip = middle(joints, index::LEFT_HIP, index::RIGHT_HIP)?;
    let feet: Vec<(f64, f64)> =
        FOOT_JOINTS.iter().filter_map(|foot| hip_depth_from_foot(camera, joints, foot)).collect();
    let nearest = feet.iter().map(|&(depth, _)| depth).fold(f64::INFINITY, f64::min);
    let (sum, weights) = feet
        .iter()
        .filter(|(depth, _)| *depth <= nearest + BOTH_STAND_M)
        .fold((0.0, 0.0), |(sum, weights), (depth, weight)| (sum + depth * weight, weights + weight));
    if weights <= 0.0 {
        return None;
    }
    let hip = at_depth(camera, hip, sum / weights)?;
    let ground = DVec3::new(hip.x, 0.0, hip.z);
    let head = joints.get(index::NOSE).and_then(|nose| lift(camera, nose.pixel, ground))?;
    let possible = pitch.contains(DVec2::new(ground.x, ground.z), MARGIN_M)
        && HEAD_M.contains(&head.y)
        && hip.y > 0.0
        && ground.is_finite();
    possible.then_some(ground)
}

/// How far away along the optical axis the hips are if this foot stands, with the weight of the joints it rests on.
fn hip_depth_from_foot(camera: &Camera, joints: &[Joint], foot: &[(usize, f64)]) -> Option<(f64, f64)> {
    // Seen from above, the feet of an upright body are farther along the optical axis than its hips.
    let upright = -HIP_M * camera.forward().y;
    let (mut sum, mut weights) = (0.0, 0.0);
    for &(joint, height_m) in foot {
        let joint = joints.get(joint)?;
        let Some(point) = camera.ray(joint.pixel).at_height(height_m) else { continue };
        let weight = f64::from(joint.visibility).max(0.05);
        let from_hips = upright + DEPTH_TRUST * (f64::from(joint.depth_m) - upright);
        sum += weight * (camera.depth(point) - from_hips);
        weights += weight;
    }
    (weights > 0.0).then(|| (sum / weights, weights))
}

/// The point seen at a pixel at a distance along the optical axis.
fn at_depth(camera: &Camera, pixel: DVec2, depth_m: f64) -> Option<DVec3> {
    let ray = camera.ray(pixel);
    let distance = depth_m / ray.direction.dot(camera.forward());
    (distance.is_finite() && distance > 0.0).then(|| ray.origin + ray.direction * distance)
}

/// The pixel between two joints.
pub(super) fn middle(joints: &[Joint], a: usize, b: usize) -> Option<DVec2> {
    Some((joints.get(a)?.pixel + joints.get(b)?.pixel) / 2.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::pose::JOINTS;

    fn camera() -> Camera {
        Camera::looking_at((1280, 720), 1800.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(5.0, 0.0, 0.0))
    }

    /// A standing figure 1.75 m tall with its hips above `at`, one foot forward by `stride_m` along the view.
    fn figure(camera: &Camera, at: DVec3, stride_m: f64, lifted_m: f64) -> Vec<Joint> {
        let joint = |offset: DVec3| {
            let world = at + offset;
            let depth_m = (camera.depth(world) - camera.depth(at + DVec3::Y * 0.95)) as f32;
            Joint { pixel: camera.project(world).unwrap(), depth_m, visibility: 0.9 }
        };
        let mut joints = vec![joint(DVec3::Y * 1.4); JOINTS];
        joints[index::NOSE] = joint(DVec3::Y * 1.6);
        for (side, sign) in [(0, -1.0), (1, 1.0)] {
            joints[index::LEFT_HIP + side] = joint(DVec3::new(0.12 * sign, 0.95, 0.0));
            let foot = DVec3::new(0.12 * sign, if side == 1 { lifted_m } else { 0.0 }, stride_m * sign);
            for (foot_joint, height_m) in FOOT_JOINTS[side] {
                joints[foot_joint] = joint(foot + DVec3::Y * height_m);
            }
        }
        joints
    }

    #[test]
    fn the_spot_under_the_hips_is_found_beside_a_lifted_foot() {
        let camera = camera();
        let at = DVec3::new(12.0, 0.0, -8.0);
        for lifted in [0.0, 0.3, 0.6] {
            let found = stand(&camera, &Pitch::default(), &figure(&camera, at, 0.0, lifted)).unwrap();
            assert!((found - at).length() < 0.15, "lifted {lifted}: {found}");
        }
    }

    #[test]
    fn nobody_stands_in_the_crowd_or_is_four_metres_tall() {
        let camera = camera();
        let pitch = Pitch::default();
        assert!(stand(&camera, &pitch, &figure(&camera, DVec3::new(0.0, 0.0, -45.0), 0.0, 0.0)).is_none());
        let mut giant = figure(&camera, DVec3::ZERO, 0.0, 0.0);
        giant[index::NOSE].pixel = camera.project(DVec3::Y * 4.0).unwrap();
        assert!(stand(&camera, &pitch, &giant).is_none());
        assert!(stand(&camera, &pitch, &[]).is_none());
    }

    #[test]
    fn boxes_are_judged_by_their_height_on_the_pitch() {
        let camera = camera();
        let pitch = Pitch::default();
        let bounds = |foot: DVec3, height_m: f64| {
            let (low, high) =
                (camera.project(foot).unwrap(), camera.project(foot + DVec3::Y * height_m).unwrap());
            PixelBox { min: high - DVec2::X * 10.0, max: low + DVec2::X * 10.0 }
        };
        assert!(box_may_stand(&camera, &pitch, &bounds(DVec3::new(5.0, 0.0, 3.0), 1.8)));
        assert!(!box_may_stand(&camera, &pitch, &bounds(DVec3::new(5.0, 0.0, 3.0), 6.0)));
        assert!(!box_may_stand(&camera, &pitch, &bounds(DVec3::new(5.0, 0.0, -50.0), 1.8)));
    }

    proptest! {
        #[test]
        fn a_figure_is_found_where_it_stands(x in -20.0..30.0, z in -30.0..25.0, stride in -0.3..0.3) {
            let camera = camera();
            let at = DVec3::new(x, 0.0, z);
            let found = stand(&camera, &Pitch::default(), &figure(&camera, at, stride, 0.0)).unwrap();
            // A quarter of the depth between feet and hips is believed, so a stride along the view costs at most the rest.
            prop_assert!((found - at).length() < 0.05 + 0.8 * stride.abs(), "{} for {}", found, at);
        }

        #[test]
        fn lifting_keeps_the_pixel(x in -20.0..20.0f64, z in -30.0..20.0f64, y in 0.0..2.5f64) {
            let camera = camera();
            let ground = DVec3::new(x, 0.0, z);
            let pixel = camera.project(ground + DVec3::Y * y).unwrap();
            let lifted = lift(&camera, pixel, ground).unwrap();
            prop_assert!((lifted - ground - DVec3::Y * y).length() < 1e-6);
        }
    }
}
