//! Section 3.2: the depth map of each player, by a network trained on rendered players.
//!
//! The network sees a square around the player (picture and mask, [`window`]) and the painted pose ([`paint`]), and
//! gives the distances of the body's first and last surface from the upright plane through the player's anchor.

mod map;
mod paint;
mod surface;
mod window;

use image::RgbImage;
use protocol::camera::Camera;

use crate::{
    geometry::Mask,
    inference::{InferenceError, Model},
    pose::{JOINTS, Joint, Person},
};

pub use map::DepthMap;
pub use paint::View;
pub(crate) use paint::{LIMBS, with_middles};
pub use surface::WindowSurface;
pub use window::Window;

use paint::POSE_CHANNELS;
use window::{GRID, PICTURE_SIZE};

/// File name of the shipped network; its card is beside it.
pub const MODEL_NAME: &str = "depth.onnx";
/// Most pixels of a mask's rectangle: 8K pictures fit, a damaged mask does not fill the memory.
const MOST_PIXELS: u64 = 7680 * 4320;

/// Why a player got no depth.
#[derive(Debug, thiserror::Error)]
pub enum DepthError {
    /// The network could not be loaded or run.
    #[error(transparent)]
    Inference(#[from] InferenceError),
    /// No pixel of the mask is at least half covered.
    #[error("the player's mask is empty: drop the player in this frame")]
    EmptyMask,
    /// The mask's rectangle and its numbers do not fit together.
    #[error("the mask says {width}×{height} pixels but holds {found}: make it again from the segmentation")]
    BrokenMask {
        /// Columns it says.
        width: u32,
        /// Rows it says.
        height: u32,
        /// Numbers it holds.
        found: usize,
    },
    /// The pose is not one of [`JOINTS`] finite joints.
    #[error("the pose has {found} usable joints of {JOINTS}: drop the player in this frame")]
    BrokenPose {
        /// Finite joints found.
        found: usize,
    },
    /// The camera does not see the place the player stands on.
    #[error("the player stands behind the camera or nowhere: check the calibration of this frame")]
    OutOfView,
}

/// The depth network, ready to run on one thread.
#[derive(Debug)]
pub struct DepthEstimator {
    model: Model,
}

impl DepthEstimator {
    /// Loads the shipped network.
    ///
    /// # Errors
    /// [`DepthError::Inference`] when ONNX Runtime or the model file is missing or unusable.
    pub fn load() -> Result<Self, DepthError> {
        Ok(Self { model: Model::load_shipped(MODEL_NAME)? })
    }

    /// The depth of one player in one picture, where `mask` (the segmentation's) is or nearly so.
    ///
    /// `camera` is that of the picture, `person` gives the joints and the ground point.
    ///
    /// # Errors
    /// [`DepthError`]: every kind concerns this player in this frame only, except [`DepthError::Inference`].
    pub fn estimate(
        &mut self,
        image: &RgbImage,
        camera: &Camera,
        person: &Person,
        mask: &Mask,
    ) -> Result<DepthMap, DepthError> {
        let view = View::from_camera(camera, person.ground_m).ok_or(DepthError::OutOfView)?;
        let surface = self.surface(image, view, &person.joints, mask)?;
        Ok(surface.on_mask(mask))
    }

    /// What the network says over its whole window: [`DepthEstimator::estimate`] before it is cut to the mask.
    ///
    /// # Errors
    /// As [`DepthEstimator::estimate`].
    pub fn surface(
        &mut self,
        image: &RgbImage,
        view: View,
        joints: &[Joint],
        mask: &Mask,
    ) -> Result<WindowSurface, DepthError> {
        let pixels = u64::from(mask.width) * u64::from(mask.height);
        if pixels > MOST_PIXELS || pixels != mask.coverage.len() as u64 {
            return Err(DepthError::BrokenMask {
                width: mask.width,
                height: mask.height,
                found: mask.coverage.len(),
            });
        }
        let usable = joints.iter().filter(|j| j.pixel.is_finite() && j.depth_m.is_finite()).count();
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
        let pose = paint::paint(joints, &window, view).ok_or(broken_pose)?;
        let picture = window.picture(image, mask);
        let outputs = self.model.run(&[
            (&[1, 4, PICTURE_SIZE, PICTURE_SIZE], &picture),
            (&[1, POSE_CHANNELS, GRID, GRID], &pose),
        ])?;
        let cells = PICTURE_SIZE * PICTURE_SIZE;
        let planes: Option<Vec<Vec<f32>>> =
            outputs.iter().map(|plane| (plane.data.len() == cells).then(|| plane.data.clone())).collect();
        match planes.and_then(|planes| <[Vec<f32>; surface::PLANES]>::try_from(planes).ok()) {
            Some(planes) => Ok(WindowSurface::new(window, planes)),
            None => Err(self.model.unexpected("six planes of 1×128×128", &outputs).into()),
        }
    }
}

#[cfg(test)]
mod tests;
