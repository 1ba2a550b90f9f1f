//! What the networks of this stage see of one player.

use image::RgbImage;

use super::{
    DepthError, View,
    paint::{POSE_CHANNELS, paint},
    window::{GRID, PICTURE_SIZE, Window},
};
use crate::{geometry::Mask, inference::TensorView, pose::Joint};

/// Most pixels of a mask's rectangle: 8K pictures fit, a damaged mask does not fill the memory.
const MOST_PIXELS: u64 = 7680 * 4320;

/// Picture, mask and painted pose over a window.
#[derive(Debug)]
pub(super) struct Sight {
    pub(super) window: Window,
    picture: Vec<f32>,
    pose: Vec<f32>,
}

impl Sight {
    /// The window around `mask`; `joints` are painted into it.
    pub(super) fn of(
        image: &RgbImage,
        view: View,
        joints: &[Joint],
        mask: &Mask,
    ) -> Result<Self, DepthError> {
        let pixels = u64::from(mask.width) * u64::from(mask.height);
        if pixels > MOST_PIXELS || pixels != mask.coverage.len() as u64 {
            return Err(DepthError::BrokenMask {
                width: mask.width,
                height: mask.height,
                found: mask.coverage.len(),
            });
        }
        let finite = |j: &&Joint| j.pixel.is_finite() && j.depth_m.is_finite() && j.visibility.is_finite();
        let usable = joints.iter().filter(finite).count();
        let broken_pose = DepthError::BrokenPose { found: usable };
        if usable != joints.len() {
            return Err(broken_pose);
        }
        let scale = view.pixels_per_metre;
        let seen = scale.is_finite() && scale > 0.0 && view.descent.is_finite();
        if !seen || image.width() == 0 || image.height() == 0 {
            return Err(DepthError::OutOfView);
        }
        let window = Window::around(mask, view.pixels_per_metre).ok_or(DepthError::EmptyMask)?;
        let pose = paint(joints, &window, view).ok_or(broken_pose)?;
        Ok(Self { window, picture: window.picture(image, mask), pose })
    }

    /// The tensors of picture and pose.
    pub(super) fn tensors(&self) -> [TensorView<'_>; 2] {
        [(&[1, 4, PICTURE_SIZE, PICTURE_SIZE], &self.picture), (&[1, POSE_CHANNELS, GRID, GRID], &self.pose)]
    }
}
