//! How far joints of healthy adults turn, to hold poses to it and to test every frame.
//!
//! Ranges: American Academy of Orthopaedic Surgeons, Joint Motion (1965), as tabled in Norkin & White, Measurement of
//! Joint Motion, 5th ed., appendix B: knee 0–150° (table: 135), elbow 0–150°, hip flexion 120° and extension 30° from the
//! pelvis, neck 45° each way with 60° of turn, trunk 80° of bend with 45° of turn. The rig has one joint where people
//! have a chain (trunk, neck) and none for the shoulder blade, so those two are held as one angle in any direction.

use glam::{Quat, Vec3};

use crate::motion::{Joint, Pose};

/// Knees and elbows: least and most bend, radians; a little over-extension is measurement, not injury.
pub const HINGE: [f32; 2] = [-0.06, 2.65];
/// The trunk against the pelvis, in any direction, radians (80°).
pub const TRUNK_MOST: f32 = 1.40;
/// The neck against the trunk, in any direction, radians: a turn and a bend together (75°).
pub const NECK_MOST: f32 = 1.31;
/// The thigh ahead of the pelvis and behind it, radians (130° and 40°: the spine lends what the joint lacks).
pub const THIGH: [f32; 2] = [-0.75, 2.27];
/// The foot against the shank, in any direction, radians (65°: 50° down, and the turn that a plant asks for).
pub const ANKLE_MOST: f32 = 1.13;

const HINGES: [Joint; 4] = [Joint::CalfL, Joint::CalfR, Joint::LowerArmL, Joint::LowerArmR];

/// The bend of a knee (positive backwards) or elbow (positive forwards), radians.
#[must_use]
pub fn bend(pose: &Pose, joint: Joint) -> f32 {
    let q = pose.rotations[joint as usize];
    let angle = 2.0 * q.x.atan2(q.w);
    let angle = (angle + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU) - std::f32::consts::PI;
    if matches!(joint, Joint::LowerArmL | Joint::LowerArmR) { -angle } else { angle }
}

/// How far a thigh points ahead of straight down, as the pelvis sees it, radians.
#[must_use]
pub fn flexion(pose: &Pose, thigh: Joint) -> f32 {
    let along = pose.rotations[thigh as usize] * Vec3::NEG_Y;
    along.z.atan2(-along.y)
}

/// Brings a turn back to `angle` at most.
pub(crate) fn most(rotation: &mut Quat, angle: f32) {
    let now = rotation.angle_between(Quat::IDENTITY);
    if now > angle {
        *rotation = Quat::IDENTITY.slerp(*rotation, angle / now);
    }
}

/// Brings trunk, neck, elbows and knees back into range.
pub fn keep(pose: &mut Pose) {
    most(pose.joint(Joint::Chest), TRUNK_MOST);
    most(pose.joint(Joint::Neck), NECK_MOST);
    for joint in HINGES {
        let bent = bend(pose, joint);
        let held = bent.clamp(0.0, HINGE[1]);
        if held != bent {
            let sign = if matches!(joint, Joint::LowerArmL | Joint::LowerArmR) { -1.0 } else { 1.0 };
            *pose.joint(joint) = Quat::from_rotation_x(sign * held);
        }
    }
}

/// Brings a thigh back into range; knee and foot go with it.
pub(crate) fn keep_thigh(pose: &mut Pose, thigh: Joint) {
    let now = flexion(pose, thigh);
    let missing = now.clamp(THIGH[0] + 0.03, THIGH[1] - 0.03) - now;
    if missing != 0.0 {
        let rotation = pose.joint(thigh);
        *rotation = Quat::from_rotation_x(-missing) * *rotation;
    }
}

/// The first joint out of range: its name and angle in degrees.
#[must_use]
pub fn broken(pose: &Pose) -> Option<(Joint, f32)> {
    let out = |value: f32, [low, high]: [f32; 2]| value < low || value > high;
    let size = |joint: Joint| pose.rotations[joint as usize].angle_between(Quat::IDENTITY);
    let hinges = HINGES.map(|joint| (joint, bend(pose, joint), HINGE));
    let thighs = [Joint::ThighL, Joint::ThighR].map(|joint| (joint, flexion(pose, joint), THIGH));
    let balls = [
        (Joint::Chest, TRUNK_MOST),
        (Joint::Neck, NECK_MOST),
        (Joint::FootL, ANKLE_MOST),
        (Joint::FootR, ANKLE_MOST),
    ];
    let balls = balls.map(|(joint, most)| (joint, size(joint), [0.0, most + 1e-3]));
    hinges
        .into_iter()
        .chain(thighs)
        .chain(balls)
        .find(|&(_, value, range)| out(value, range))
        .map(|(joint, value, _)| (joint, value.to_degrees()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_knee_bent_backwards_is_found_and_mended() {
        let mut pose = Pose::default();
        assert_eq!(broken(&pose), None);
        *pose.joint(Joint::CalfL) = Quat::from_rotation_x(-0.4);
        assert_eq!(broken(&pose).map(|(joint, _)| joint), Some(Joint::CalfL));
        keep(&mut pose);
        assert_eq!(broken(&pose), None);
        *pose.joint(Joint::Neck) = Quat::from_rotation_y(2.0);
        assert_eq!(broken(&pose).map(|(joint, _)| joint), Some(Joint::Neck));
        keep(&mut pose);
        assert_eq!(broken(&pose), None);
    }
}
