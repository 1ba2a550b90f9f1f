//! Section 4.2, first half: where people are in each frame, and what may be the ball.
//!
//! One pass of a network over the whole picture gives boxes with roles, and a map of the ball. It is tuned for recall: who
//! stands on the pitch is decided when the camera is known, which candidate is the ball when it is followed over time.

mod maps;
mod picture;

use glam::DVec2;
use image::RgbImage;
use serde::{Deserialize, Serialize};

use crate::{
    geometry::PixelBox,
    inference::{InferenceError, Model},
};

/// File name of the detector in `assets/models`.
pub const MODEL: &str = "people.onnx";

/// From this score on a ball candidate alone in its picture is more likely the ball than not.
pub const BALL_SURE: f32 = 0.5;

/// A person found by the detector, before anything is known of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// Where, pixels of the clip: the whole body, also where somebody stands before it.
    pub bounds: PixelBox,
    /// Confidence 0..1.
    pub score: f32,
    /// What the person looks to be.
    pub roles: RoleChances,
}

/// Chances of a person's roles, by looks alone; they sum to 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoleChances {
    /// Outfield player.
    pub player: f32,
    /// Goalkeeper.
    pub goalkeeper: f32,
    /// Referee or assistant.
    pub official: f32,
    /// Coach, substitute, steward, photographer: not in the match.
    pub bystander: f32,
}

impl RoleChances {
    /// Nothing is known: an outfield player, as most people are.
    pub const UNKNOWN: Self = Self { player: 1.0, goalkeeper: 0.0, official: 0.0, bystander: 0.0 };
}

/// Something that may be the ball: one of several in a picture, until the ball is followed over time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BallCandidate {
    /// Its middle, pixels of the clip.
    pub centre_px: DVec2,
    /// Its diameter across the direction of motion, pixels of the clip; coarse.
    pub diameter_px: f64,
    /// Confidence 0..1.
    pub score: f32,
}

/// What one picture shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Everybody, best first.
    pub people: Vec<Detection>,
    /// What may be the ball, best first.
    pub balls: Vec<BallCandidate>,
}

/// Why people could not be looked for.
#[derive(Debug, thiserror::Error)]
pub enum DetectionError {
    /// The network could not be loaded or run.
    #[error("detector: {0}")]
    Inference(#[from] InferenceError),
    /// The picture is empty or larger than any broadcast.
    #[error(
        "detector: a picture of {width_px}x{height_px} px cannot be searched (1 to {} px a side)",
        picture::SIDE_MAX_PX
    )]
    PictureSize {
        /// Width of the picture.
        width_px: u32,
        /// Height of the picture.
        height_px: u32,
    },
}

/// How the picture is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectorSettings {
    /// Larger pictures are scaled down to this many pixels: main cameras then show people 35 to 85 px tall, as the network
    /// learnt them, and the time is bounded.
    pub pixels_max: u32,
    /// People below this score are dropped.
    pub score_min: f32,
    /// Ball candidates below this score are dropped.
    pub ball_score_min: f32,
}

impl Default for DetectorSettings {
    fn default() -> Self {
        Self { pixels_max: 1920 * 1080, score_min: 0.2, ball_score_min: 0.1 }
    }
}

/// The detector; one per thread.
#[derive(Debug)]
pub struct Detector {
    model: Model,
    settings: DetectorSettings,
}

impl Detector {
    /// Loads the detector with the default settings.
    ///
    /// # Errors
    /// When ONNX Runtime or the model is missing or unusable.
    pub fn load() -> Result<Self, DetectionError> {
        Self::with_settings(DetectorSettings::default())
    }

    /// Loads the detector.
    ///
    /// # Errors
    /// When ONNX Runtime or the model is missing or unusable.
    pub fn with_settings(settings: DetectorSettings) -> Result<Self, DetectionError> {
        Ok(Self { model: Model::load_shipped(MODEL)?, settings })
    }

    /// Everybody in the picture and what may be the ball; pixels of `picture`.
    ///
    /// # Errors
    /// When the network fails or the picture has an impossible size.
    pub fn detect(&mut self, picture: &RgbImage) -> Result<Found, DetectionError> {
        let (width_px, height_px) = picture.dimensions();
        let Some(input) = picture::Input::of(picture, self.settings.pixels_max) else {
            return Err(DetectionError::PictureSize { width_px, height_px });
        };
        let outputs = self.model.run(&[(&[1, 3, input.rows, input.columns], &input.planes)])?;
        let find = |channels: usize, stride: usize| {
            let shape = [1, channels, input.rows / stride, input.columns / stride];
            outputs
                .iter()
                .find(|tensor| tensor.shape == shape && tensor.data.len() == shape.iter().product::<usize>())
                .ok_or_else(|| self.model.unexpected(&format!("a tensor {shape:?}"), &outputs))
        };
        let people = maps::people(find(maps::PEOPLE_CHANNELS, maps::PEOPLE_STRIDE)?, self.settings.score_min);
        let balls = maps::balls(find(maps::BALL_CHANNELS, maps::BALL_STRIDE)?, self.settings.ball_score_min);
        let people = people.into_iter().map(|person| Detection {
            bounds: PixelBox { min: input.to_clip(person.bounds.min), max: input.to_clip(person.bounds.max) },
            ..person
        });
        let balls = balls.into_iter().map(|ball| BallCandidate {
            centre_px: input.to_clip(ball.centre_px),
            diameter_px: ball.diameter_px / input.scale.y,
            ..ball
        });
        Ok(Found { people: people.collect(), balls: balls.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_picture_is_an_error_and_a_plain_one_has_nobody() {
        if !crate::inference::ready() {
            return;
        }
        let mut detector = Detector::load().unwrap();
        assert!(matches!(detector.detect(&RgbImage::new(0, 10)), Err(DetectionError::PictureSize { .. })));
        assert_eq!(detector.detect(&RgbImage::new(1, 1)).unwrap(), Found::default());
        let grass = RgbImage::from_pixel(641, 359, image::Rgb([40, 120, 30]));
        assert_eq!(detector.detect(&grass).unwrap(), Found::default());
    }
}
