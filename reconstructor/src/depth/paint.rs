//! The pose as the network sees it: every limb painted over the window as a capsule with its depth.
//!
//! The skeleton of the pose network tells front from back, which a small picture hardly does. `training/depth/window.py` paints
//! the same; a test of this folder compares the two.

use glam::{DVec2, DVec3};
use protocol::camera::Camera;

use super::window::{GRID, Window};
use crate::pose::{JOINTS, Joint};

/// Metres that are 1.0 in the painted channels.
const DEPTH_SCALE_M: f64 = 0.5;
/// Painted depths stay within ± this (in units of [`DEPTH_SCALE_M`]), whatever the pose network said.
const DEPTH_CLIP: f64 = 3.0;
/// Width of the ramp of presence beside a limb, metres.
const EDGE_M: f64 = 0.1;
/// Channels of the painted pose.
pub(super) const POSE_CHANNELS: usize = 4;

/// Middle of the shoulders and of the hips, numbered after the pose network's joints.
const NECK: usize = JOINTS;
const PELVIS: usize = JOINTS + 1;

/// Limbs: joint, joint, radius in metres of a man in kit.
pub(crate) const LIMBS: [(usize, usize, f64); 18] = [
    (0, NECK, 0.10),
    (11, 12, 0.09),
    (23, 24, 0.11),
    (11, 23, 0.10),
    (12, 24, 0.10),
    (NECK, PELVIS, 0.12),
    (11, 13, 0.05),
    (13, 15, 0.05),
    (12, 14, 0.05),
    (14, 16, 0.05),
    (23, 25, 0.08),
    (24, 26, 0.08),
    (25, 27, 0.06),
    (26, 28, 0.06),
    (27, 29, 0.05),
    (28, 30, 0.05),
    (29, 31, 0.05),
    (30, 32, 0.05),
];

/// Limbs up to this one are head and trunk.
pub(crate) const LAST_TRUNK_LIMB: usize = 5;

/// How the camera sees a player: what turns pixels of the clip into metres at the player.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Pixels of the clip that one metre across the line of sight takes up at the player.
    pub pixels_per_metre: f64,
    /// Tangent of the angle at which the camera looks down on the player's anchor.
    pub descent: f64,
}

impl View {
    /// How `camera` sees somebody who stands at `ground_m` (world metres); `None` behind the camera or straight below it.
    #[must_use]
    pub fn from_camera(camera: &Camera, ground_m: DVec3) -> Option<Self> {
        let sight = ground_m - camera.position;
        let pixels_per_metre = camera.focal_px / camera.depth(ground_m);
        let descent = -sight.y / DVec2::new(sight.x, sight.z).length();
        let usable = pixels_per_metre.is_finite() && pixels_per_metre > 0.0 && descent.is_finite();
        usable.then_some(Self { pixels_per_metre, descent })
    }
}

/// A joint in metres across the line of sight, and its depth in metres.
#[derive(Clone, Copy)]
struct Node {
    at_m: DVec2,
    depth_m: f64,
}

/// Four planes of [`GRID`]²: presence of a limb; depth of the nearest limb over a cell, or of the closest beside it,
/// relative to the hips; that limb's [`side`]; depth of the upright plane through the hips. Depths in units of
/// [`DEPTH_SCALE_M`].
///
/// `None` unless there are [`JOINTS`] joints.
pub(super) fn paint(joints: &[Joint], window: &Window, view: View) -> Option<Vec<f32>> {
    let nodes: Vec<Node> = with_middles(joints)?
        .iter()
        .map(|j| Node { at_m: j.pixel / view.pixels_per_metre, depth_m: f64::from(j.depth_m) })
        .collect();
    let pelvis_y_m = nodes.get(PELVIS)?.at_m.y;
    let limbs = LIMBS
        .iter()
        .map(|&(a, b, radius_m)| {
            Some(Limb { from: *nodes.get(a)?, to: *nodes.get(b)?, radius_m, side: side(a, b) })
        })
        .collect::<Option<Vec<_>>>()?;
    let scaled = |metres: f64| (metres / DEPTH_SCALE_M).clamp(-DEPTH_CLIP, DEPTH_CLIP) as f32;
    let (mut presence, mut depth, mut sides, mut plane) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for row in 0..GRID {
        for column in 0..GRID {
            let at_px = DVec2::new(window.cell(0, column, GRID), window.cell(1, row, GRID));
            let at_m = at_px / view.pixels_per_metre;
            let Painted { edge_m, depth_m, side } = nearest(&limbs, at_m);
            presence.push((1.0 - edge_m / EDGE_M).clamp(0.0, 1.0) as f32);
            depth.push(scaled(depth_m));
            sides.push(side);
            plane.push(scaled((at_m.y - pelvis_y_m) * view.descent));
        }
    }
    presence.extend(depth);
    presence.extend(sides);
    presence.extend(plane);
    Some(presence)
}

/// The joints and after them the middles of the shoulders and of the hips, which [`LIMBS`] names too. `None` unless there are
/// [`JOINTS`] joints.
pub(super) fn with_middles(joints: &[Joint]) -> Option<Vec<Joint>> {
    if joints.len() != JOINTS {
        return None;
    }
    let mut all = joints.to_vec();
    for (a, b) in [(11, 12), (23, 24)] {
        let (a, b): (&Joint, &Joint) = (joints.get(a)?, joints.get(b)?);
        all.push(Joint {
            pixel: (a.pixel + b.pixel) / 2.0,
            depth_m: (a.depth_m + b.depth_m) / 2.0,
            visibility: a.visibility.min(b.visibility),
        });
    }
    Some(all)
}

/// A limb over the window.
struct Limb {
    from: Node,
    to: Node,
    radius_m: f64,
    side: f32,
}

/// +1 for a limb of the person's left, −1 for one of the right, 0 for what joins both. The pose network's left joints have
/// odd numbers.
fn side(from: usize, to: usize) -> f32 {
    let middle = [from, to].iter().any(|&joint| joint == 0 || joint >= NECK);
    match (middle, from % 2, to % 2) {
        (false, 1, 1) => 1.0,
        (false, 0, 0) => -1.0,
        _ => 0.0,
    }
}

/// What is painted into a cell.
struct Painted {
    /// Distance to the closest limb's border, metres, negative inside.
    edge_m: f64,
    depth_m: f64,
    side: f32,
}

fn nearest(limbs: &[Limb], at_m: DVec2) -> Painted {
    let mut beside = Painted { edge_m: f64::INFINITY, depth_m: 0.0, side: 0.0 };
    let mut covering: Option<(f64, f32)> = None;
    for Limb { from, to, radius_m, side } in limbs {
        let along = to.at_m - from.at_m;
        let share = ((at_m - from.at_m).dot(along) / along.length_squared().max(1e-9)).clamp(0.0, 1.0);
        let edge_m = (at_m - from.at_m - along * share).length() - radius_m;
        let depth_m = from.depth_m + share * (to.depth_m - from.depth_m);
        if edge_m <= 0.0 && covering.is_none_or(|(nearer_m, _)| depth_m < nearer_m) {
            covering = Some((depth_m, *side));
        }
        if edge_m < beside.edge_m {
            beside = Painted { edge_m, depth_m, side: *side };
        }
    }
    match covering {
        Some((depth_m, side)) => Painted { depth_m, side, ..beside },
        None => beside,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything at the hips but one knee and ankle, which come 0.4 m to the front.
    fn kick() -> Vec<Joint> {
        let joint =
            |x: f64, y: f64, depth_m: f32| Joint { pixel: DVec2::new(x, y), depth_m, visibility: 1.0 };
        let mut joints = vec![joint(50.0, 50.0, 0.0); JOINTS];
        for i in [25, 27, 29, 31] {
            joints[i] = joint(50.0, 70.0, -0.4);
        }
        joints
    }

    #[test]
    fn a_limb_is_painted_where_it_is_with_its_depth() {
        let window = Window { centre_px: DVec2::new(50.0, 50.0), side_px: 64.0 };
        let view = View { pixels_per_metre: 32.0, descent: 0.25 };
        let painted = paint(&kick(), &window, view).unwrap();
        let at = |channel: usize, x: usize, y: usize| painted[(channel * GRID + y) * GRID + x];
        assert_eq!(painted.len(), POSE_CHANNELS * GRID * GRID);
        assert_eq!((at(0, 32, 52), at(0, 2, 2)), (1.0, 0.0));
        assert!((at(1, 31, 51) + 0.8).abs() < 0.03, "the ankle is 0.4 m in front: {}", at(1, 31, 51));
        assert!((at(1, 31, 41) + 0.4).abs() < 0.03, "halfway down the leg: {}", at(1, 31, 41));
        assert_eq!((at(2, 31, 51), at(2, 31, 31)), (1.0, 0.0), "the leg is the left one");
        let below = (16.5 / 32.0) * 0.25 / DEPTH_SCALE_M;
        assert!(
            (f64::from(at(3, 0, 48)) - below).abs() < 1e-6,
            "lower on the upright plane is further from a camera above"
        );
    }

    #[test]
    fn wild_depths_are_bounded_and_a_wrong_count_is_refused() {
        let window = Window { centre_px: DVec2::ZERO, side_px: 64.0 };
        let view = View { pixels_per_metre: 32.0, descent: 0.25 };
        let mut joints = kick();
        joints[27].depth_m = -1e30;
        let painted = paint(&joints, &window, view).unwrap();
        assert!(painted.iter().all(|v| v.abs() <= DEPTH_CLIP as f32));
        assert_eq!(paint(&joints[1..], &window, view), None);
    }
}
