//! Section 4.2, first half: where people are in each frame.
//!
//! A small person detector runs over overlapping tiles of the picture, in which players have the size it was trained
//! on; boxes of all tiles are merged. It is tuned for recall: crowd and coaches go when the camera is known.

mod merge;
mod nanodet;
mod tiles;

use image::{RgbImage, imageops};
use serde::{Deserialize, Serialize};

use crate::{
    geometry::PixelBox,
    inference::{InferenceError, Model},
};

/// File name of the detector in `assets/models`.
pub const MODEL: &str = "nanodet_g_416.onnx";

/// A person found by the detector, before anything is known of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// Where, pixels of the clip.
    pub bounds: PixelBox,
    /// Confidence 0..1.
    pub score: f32,
}

/// Why people could not be looked for.
#[derive(Debug, thiserror::Error)]
pub enum DetectionError {
    /// The network could not be loaded or run.
    #[error("person detector: {0}")]
    Inference(#[from] InferenceError),
    /// The picture is empty or larger than any broadcast.
    #[error(
        "person detector: a picture of {width_px}x{height_px} px cannot be searched (1 to {} px a side)",
        tiles::SIDE_MAX_PX
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
    /// The picture is scaled to this height before it is cut in tiles: in a main-camera picture of 720 rows players are
    /// 35 to 85 px tall, which the network sees best. Larger finds no more (measured on 1080p: 0.96 of the players at
    /// 1080 rows, 0.94 at 702, for a third of the time) and costs more.
    pub picture_height_px: f64,
    /// Boxes below this score are dropped.
    pub score_min: f32,
}

impl Default for DetectorSettings {
    fn default() -> Self {
        Self { picture_height_px: 720.0, score_min: 0.2 }
    }
}

/// The person detector; one per thread.
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

    /// Everybody in the picture, best first; boxes in pixels of `picture`.
    ///
    /// # Errors
    /// When the network fails or the picture has an impossible size.
    pub fn detect(&mut self, picture: &RgbImage) -> Result<Vec<Detection>, DetectionError> {
        let (width_px, height_px) = picture.dimensions();
        let side = 1..=tiles::SIDE_MAX_PX;
        if !side.contains(&width_px) || !side.contains(&height_px) {
            return Err(DetectionError::PictureSize { width_px, height_px });
        }
        let scale = self.settings.picture_height_px / f64::from(height_px);
        let scaled;
        let searched = if (scale - 1.0).abs() < 0.05 {
            picture
        } else {
            let size = |side: u32| ((f64::from(side) * scale).round() as u32).clamp(1, tiles::SIDE_MAX_PX);
            scaled =
                imageops::resize(picture, size(width_px), size(height_px), imageops::FilterType::Triangle);
            &scaled
        };
        let mut found = Vec::new();
        for tile in tiles::layout(searched.width(), searched.height()) {
            let boxes = nanodet::detect(&mut self.model, searched, &tile, self.settings.score_min)?;
            found.extend(boxes);
        }
        let scale_x = f64::from(width_px) / f64::from(searched.width());
        let scale_y = f64::from(height_px) / f64::from(searched.height());
        Ok(merge::merge(found).into_iter().map(|d| scaled_detection(d, scale_x, scale_y)).collect())
    }
}

fn scaled_detection(detection: Detection, scale_x: f64, scale_y: f64) -> Detection {
    // Pixel centres are whole numbers, so the corner of the picture is (−½, −½) at every scale.
    let map = |p: glam::DVec2| (p + 0.5) * glam::DVec2::new(scale_x, scale_y) - 0.5;
    let bounds = PixelBox { min: map(detection.bounds.min), max: map(detection.bounds.max) };
    Detection { bounds, ..detection }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn scaling_keeps_the_corners_of_the_picture() {
        let whole = PixelBox { min: DVec2::splat(-0.5), max: DVec2::new(1279.5, 719.5) };
        let scaled = scaled_detection(Detection { bounds: whole, score: 1.0 }, 1.5, 1.5).bounds;
        assert_eq!(scaled, PixelBox { min: DVec2::splat(-0.5), max: DVec2::new(1919.5, 1079.5) });
    }

    #[test]
    fn an_empty_picture_is_an_error_and_a_tiny_one_has_nobody() {
        if !crate::inference::ready() {
            return;
        }
        let mut detector = Detector::load().unwrap();
        assert!(matches!(detector.detect(&RgbImage::new(0, 10)), Err(DetectionError::PictureSize { .. })));
        assert_eq!(detector.detect(&RgbImage::new(1, 1)).unwrap(), []);
        assert_eq!(detector.detect(&RgbImage::from_pixel(640, 360, image::Rgb([40, 120, 30]))).unwrap(), []);
    }
}
