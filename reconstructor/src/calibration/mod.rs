//! Section 4.1: the camera of every frame from the lines of the pitch.

use glam::{DVec2, DVec3};
use protocol::camera::Camera;
use serde::{Deserialize, Serialize};

/// A point of the pitch or the goals that was found in a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correspondence {
    /// For messages; free text.
    #[serde(default)]
    pub name: String,
    /// Where it is in the picture, pixels.
    pub pixel: DVec2,
    /// Where it is in the world, metres.
    pub world_m: DVec3,
}

/// The camera of one frame, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraEstimate {
    /// The camera; `None` when it could not be solved.
    pub camera: Option<Camera>,
    /// Median distance between projected line points and the nearest line pixel, pixels; over projected points in the
    /// picture that are not hidden by people.
    pub line_residual_median_px: Option<f64>,
    /// Projected line points that the residual is measured on.
    pub line_points: usize,
    /// Why there is no camera, in plain words.
    pub reason: Option<String>,
}
