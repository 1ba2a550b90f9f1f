//! Section 4.2, first half: where people are in each frame.

use serde::{Deserialize, Serialize};

use crate::geometry::PixelBox;

/// A person found by the detector, before anything is known of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// Where, pixels of the clip.
    pub bounds: PixelBox,
    /// Confidence 0..1.
    pub score: f32,
}
