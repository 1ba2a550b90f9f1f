//! The camera of a single picture, found by whoever can: the network in the product, anything in tests.
//!
//! Sessions of a network are costly to make and serve one picture at a time, so each worker borrows one from a pool.

use std::sync::{Mutex, PoisonError};

use image::RgbImage;
use protocol::pitch::Pitch;

use super::locate::{self, Located, Locator};
use crate::{geometry::PixelBox, inference::InferenceError};

/// File name of the network that finds cameras.
pub const MODEL: &str = locate::MODEL;

/// Finds the camera of one picture by itself.
pub trait FindCamera: Send {
    /// The camera of `picture`, in which `people` stand, on a pitch of known size; `Err` in the inside says in plain words
    /// why the picture shows no pitch from a camera that can be found.
    ///
    /// # Errors
    /// When the network cannot be run.
    fn find(
        &mut self,
        picture: &RgbImage,
        people: &[PixelBox],
        pitch: &Pitch,
    ) -> Result<Result<Located, String>, InferenceError>;
}

/// Makes one [`FindCamera`] per worker.
pub type LoadFinder<'a> = dyn Fn() -> Result<Box<dyn FindCamera>, InferenceError> + Sync + 'a;

/// A guess below this confidence is worse than none.
const LEAST_CONFIDENCE: f64 = 0.05;

impl FindCamera for Locator {
    /// Also cameras that it is not sure of alone: several frames of a shot that agree are sure together.
    fn find(
        &mut self,
        picture: &RgbImage,
        people: &[PixelBox],
        pitch: &Pitch,
    ) -> Result<Result<Located, String>, InferenceError> {
        let guess = self.guess(picture, people, pitch)?;
        Ok(guess.and_then(|found| {
            let unsure = || {
                format!("no pitch camera here: the best guess has a confidence of {:.2}", found.confidence)
            };
            (found.confidence >= LEAST_CONFIDENCE).then_some(found).ok_or_else(unsure)
        }))
    }
}

/// The network that comes with the program.
///
/// # Errors
/// When ONNX Runtime or the network is missing or unusable.
pub fn shipped() -> Result<Box<dyn FindCamera>, InferenceError> {
    Ok(Box::new(Locator::load()?))
}

/// Finders that are shared by workers.
pub struct Finders<'a> {
    load: &'a LoadFinder<'a>,
    idle: Mutex<Vec<Box<dyn FindCamera>>>,
}

impl<'a> Finders<'a> {
    /// Made by `load` when one is needed.
    #[must_use]
    pub fn new(load: &'a LoadFinder<'a>) -> Self {
        Self { load, idle: Mutex::new(Vec::new()) }
    }

    /// As [`FindCamera::find`], with a finder that nobody else uses now.
    pub(super) fn find(
        &self,
        picture: &RgbImage,
        people: &[PixelBox],
        pitch: &Pitch,
    ) -> Result<Result<Located, String>, InferenceError> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut finder = match idle {
            Some(finder) => finder,
            None => (self.load)()?,
        };
        let found = finder.find(picture, people, pitch)?;
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(finder);
        // A network gives any number; what comes after relies on these.
        Ok(found.and_then(|located| {
            let camera = &located.camera;
            let numbers = [camera.focal_px, camera.k1, located.confidence];
            let finite = numbers.iter().all(|v| v.is_finite()) && camera.position.is_finite();
            if finite && camera.rotation.is_finite() && camera.focal_px > 0.0 && camera.position.y > 0.0 {
                Ok(Located { confidence: located.confidence.clamp(0.0, 1.0), ..located })
            } else {
                Err("the camera found makes no sense".to_owned())
            }
        }))
    }
}
