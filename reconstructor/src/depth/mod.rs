//! Section 3.2: the depth map of each player, by a network trained on rendered players.
//!
//! Two networks see a square around the player (picture and mask, [`window`]) and the painted pose ([`paint`]). The first
//! ([`lifting`]) says where the joints are in space, which the pose network guesses badly in small pictures; with those painted, the
//! second gives the distances of the body's first and last surface from the upright plane through the player's anchor.

mod lifting;
mod map;
mod paint;
mod sight;
mod skeleton;
mod steady;
mod surface;
mod window;

use image::RgbImage;
use protocol::camera::Camera;

use crate::{
    geometry::Mask,
    inference::{InferenceError, Model},
    pose::{JOINTS, Joint, Person},
};

pub use lifting::{LIFTING_MODEL, PoseLifter};
pub use map::DepthMap;
pub use paint::View;
pub(crate) use paint::{LAST_TRUNK_LIMB, LIMBS};
pub(crate) use skeleton::{Place, Side, Skeleton};
pub use steady::{Moment, steady};
pub use surface::WindowSurface;
pub use window::Window;

use sight::Sight;
use window::PICTURE_SIZE;

/// File name of the shipped network; its card is beside it.
pub const MODEL_NAME: &str = "depth.onnx";
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
        let sight = Sight::of(image, view, joints, mask)?;
        let outputs = self.model.run(&sight.tensors())?;
        let cells = PICTURE_SIZE * PICTURE_SIZE;
        let planes: Option<Vec<Vec<f32>>> =
            outputs.iter().map(|plane| (plane.data.len() == cells).then(|| plane.data.clone())).collect();
        match planes.and_then(|planes| <[Vec<f32>; surface::PLANES]>::try_from(planes).ok()) {
            Some(planes) => Ok(WindowSurface::new(sight.window, planes)),
            None => Err(self.model.unexpected("six planes of 1×128×128", &outputs).into()),
        }
    }
}

#[cfg(test)]
mod tests;
