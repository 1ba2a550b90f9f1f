//! Where a player's joints are in space: a network of our own sees the picture, the pose as it was read and smoothed, and mends both
//! places and depths.
//!
//! The pose network was made for people who fill the picture. On players of a few dozen pixels it takes left for right in one of
//! five and says little of which limb is nearer; those mistakes would all be in the surface. `training/depth/lifting.py` does the
//! same arithmetic as this file: change both or none.

use glam::DVec2;
use image::RgbImage;

use super::{DepthError, View, sight::Sight};
use crate::{
    geometry::Mask,
    inference::Model,
    pose::{JOINTS, Joint},
};

/// File name of the shipped network; its card is beside it.
pub const LIFTING_MODEL: &str = "lifting.onnx";
/// Numbers per joint that the network sees: place right and down, depth, visibility.
const NUMBERS: usize = 4;
/// What the network sees of a joint stays within ± this.
const CLIP: f64 = 3.0;
/// Joints that the network was taught: nose, arms without hands, legs. The others follow.
const TAUGHT: [usize; 17] = [0, 11, 12, 13, 14, 15, 16, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32];

/// The lifting network, ready to run on one thread.
#[derive(Debug)]
pub struct PoseLifter {
    model: Model,
}

impl PoseLifter {
    /// Loads the shipped network.
    ///
    /// # Errors
    /// [`DepthError::Inference`] when ONNX Runtime or the model file is missing or unusable.
    pub fn load() -> Result<Self, DepthError> {
        Ok(Self { model: Model::load_shipped(LIFTING_MODEL)? })
    }

    /// The joints of one player as the picture shows them: pixels of the clip, and metres behind the hips. What the pose network
    /// says of eyes, ears, mouth and fingers is moved with the nose and the wrists.
    ///
    /// # Errors
    /// As [`super::DepthEstimator::estimate`].
    pub fn lift(
        &mut self,
        image: &RgbImage,
        view: View,
        joints: &[Joint],
        mask: &Mask,
    ) -> Result<Vec<Joint>, DepthError> {
        let sight = Sight::of(image, view, joints, mask)?;
        let [picture, pose] = sight.tensors();
        let known = known(joints, sight.window.centre_px, view.pixels_per_metre);
        let outputs = self.model.run(&[picture, pose, (&[1, NUMBERS * JOINTS], &known)])?;
        match outputs.as_slice() {
            [told] if told.data.len() == 3 * JOINTS && told.data.iter().all(|v| v.is_finite()) => {
                Ok(placed(joints, &told.data, sight.window.centre_px, view.pixels_per_metre))
            }
            _ => Err(self
                .model
                .unexpected(&format!("one list of {} finite numbers", 3 * JOINTS), &outputs)
                .into()),
        }
    }
}

/// What the network sees of the pose: metres right of and below the middle of the window, metres behind the hips, visibilities −1..1.
fn known(joints: &[Joint], centre_px: DVec2, pixels_per_metre: f64) -> Vec<f32> {
    let places = joints.iter().flat_map(|joint| ((joint.pixel - centre_px) / pixels_per_metre).to_array());
    let depths = joints.iter().map(|joint| f64::from(joint.depth_m));
    let visible = joints.iter().map(|joint| 2.0 * f64::from(joint.visibility) - 1.0);
    places.chain(depths).chain(visible).map(|value| value.clamp(-CLIP, CLIP) as f32).collect()
}

/// The joint that a joint the network was not taught moves with.
fn leader(joint: usize) -> usize {
    match joint {
        0..=10 => 0,
        17..=22 => 15 + (joint + 1) % 2,
        taught => taught,
    }
}

/// The joints where the network says: `told` holds metres right, below and behind the hips of each.
fn placed(joints: &[Joint], told: &[f32], centre_px: DVec2, pixels_per_metre: f64) -> Vec<Joint> {
    let lifted = |index: usize, own: &Joint| match told.get(3 * index..3 * index + 3) {
        Some(&[x, y, z]) => (centre_px + DVec2::new(f64::from(x), f64::from(y)) * pixels_per_metre, z),
        _ => (own.pixel, own.depth_m),
    };
    let all = joints.iter().enumerate().map(|(index, joint)| {
        let lead = leader(index);
        let before = joints.get(lead).unwrap_or(joint);
        let (pixel, depth_m) = lifted(lead, before);
        let (pixel, depth_m) = if TAUGHT.contains(&index) {
            (pixel, depth_m)
        } else {
            (joint.pixel + pixel - before.pixel, joint.depth_m + depth_m - before.depth_m)
        };
        Joint { pixel, depth_m, visibility: joint.visibility }
    });
    all.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Vec<Joint> {
        let joint = |i: usize| Joint {
            pixel: DVec2::new(100.0 + i as f64, 200.0 - i as f64),
            depth_m: 0.01 * i as f32,
            visibility: 0.5,
        };
        (0..JOINTS).map(joint).collect()
    }

    #[test]
    fn the_input_is_the_one_of_the_training() {
        let mut joints = pose();
        joints[32].depth_m = 9.0;
        let known = known(&joints, DVec2::new(100.0, 200.0), 50.0);
        assert_eq!(known.len(), NUMBERS * JOINTS);
        assert!((known[2 * 11] - 0.22).abs() < 1e-6 && (known[2 * 11 + 1] + 0.22).abs() < 1e-6);
        assert!((known[2 * JOINTS + 11] - 0.11).abs() < 1e-6);
        assert_eq!((known[3 * JOINTS - 1], known[3 * JOINTS]), (3.0, 0.0));
    }

    #[test]
    fn joints_go_where_the_network_says_and_fingers_go_with_the_wrist() {
        let joints = pose();
        let mut told = vec![0.0; 3 * JOINTS];
        told[3 * 15..3 * 15 + 3].copy_from_slice(&[0.5, -0.25, 0.3]);
        let lifted = placed(&joints, &told, DVec2::new(100.0, 200.0), 40.0);
        assert_eq!(lifted[15].pixel, DVec2::new(120.0, 190.0));
        assert_eq!(lifted[15].depth_m, 0.3);
        for finger in [17, 19, 21] {
            assert!(
                (lifted[finger].pixel - lifted[15].pixel - (joints[finger].pixel - joints[15].pixel))
                    .length()
                    < 1e-9
            );
            assert!((lifted[finger].depth_m - 0.3 - 0.01 * (finger as f32 - 15.0)).abs() < 1e-6);
        }
        assert_eq!(lifted[16].pixel, DVec2::new(100.0, 200.0));
        assert_eq!((leader(18), leader(7), leader(27)), (16, 0, 27));
    }
}
