//! A camera in a JSON file: either a look-at view or the pinhole camera of the stream format.

use glam::DVec3;
use protocol::camera::Camera;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::ViewCamera;

/// What `--camera FILE` may hold; world metres, y up, z towards the main camera.
///
/// `{"position_m": [0, 25, 80], "target_m": [10, 0, 0], "vertical_fov_degrees": 30}`, or a camera as the stream
/// has it: `{"width_px": …, "height_px": …, "focal_px": …, "k1": 0, "rotation": […9], "position": [x, y, z]}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum CameraFile {
    /// From here to there.
    LookAt {
        /// Where the camera stands.
        position_m: DVec3,
        /// What it looks at.
        target_m: DVec3,
        /// Angle between the top and the bottom of the picture.
        vertical_fov_degrees: f64,
    },
    /// A broadcast camera.
    Pinhole(Camera),
}

/// What is wrong with a camera file's content.
#[derive(Debug, Error)]
pub enum CameraFileError {
    /// Not JSON, or not one of the two forms.
    #[error(
        "not a camera: expected position_m, target_m and vertical_fov_degrees, or width_px, height_px, focal_px, k1, \
         rotation and position (line {line}, column {column})"
    )]
    NotACamera {
        /// Line of the file.
        line: usize,
        /// Column of the line.
        column: usize,
    },
    /// A number that no camera has.
    #[error("{field} is out of range: {wanted}")]
    OutOfRange {
        /// Name in the file.
        field: &'static str,
        /// What it has to be.
        wanted: &'static str,
    },
}

impl CameraFile {
    /// Reads a camera from JSON.
    pub fn from_json(text: &str) -> Result<Self, CameraFileError> {
        let file: Self = serde_json::from_str(text)
            .map_err(|error| CameraFileError::NotACamera { line: error.line(), column: error.column() })?;
        let check = |holds: bool, field, wanted| {
            if holds { Ok(()) } else { Err(CameraFileError::OutOfRange { field, wanted }) }
        };
        match file {
            Self::LookAt { position_m, target_m, vertical_fov_degrees } => {
                check(
                    position_m.abs().max_element() < 1e5,
                    "position_m",
                    "metres within 100 km of the pitch",
                )?;
                check(target_m.abs().max_element() < 1e5, "target_m", "metres within 100 km of the pitch")?;
                check(position_m.distance(target_m) > 1e-3, "target_m", "somewhere else than position_m")?;
                check(
                    vertical_fov_degrees > 0.1 && vertical_fov_degrees < 170.0,
                    "vertical_fov_degrees",
                    "between 0.1 and 170",
                )?;
            }
            Self::Pinhole(camera) => {
                check(
                    camera.width_px > 0 && camera.height_px > 0,
                    "width_px",
                    "a picture of at least 1 × 1 px",
                )?;
                check(camera.focal_px > 0.0 && camera.focal_px.is_finite(), "focal_px", "positive")?;
                check(
                    camera.position.abs().max_element() < 1e5,
                    "position",
                    "metres within 100 km of the pitch",
                )?;
                let skew = camera.rotation * camera.rotation.transpose() - glam::DMat3::IDENTITY;
                let straight =
                    skew.abs_diff_eq(glam::DMat3::ZERO, 1e-3) && camera.rotation.determinant() > 0.0;
                check(straight, "rotation", "a rotation matrix")?;
            }
        }
        Ok(file)
    }

    /// The view in a picture of width over height `aspect`.
    #[must_use]
    pub fn view(&self, aspect: f64) -> ViewCamera {
        match self {
            Self::LookAt { position_m, target_m, vertical_fov_degrees } => {
                ViewCamera::looking_at(*position_m, *target_m, vertical_fov_degrees.to_radians(), aspect)
            }
            Self::Pinhole(camera) => ViewCamera::from_broadcast(camera, aspect),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read() {
        let look_at = r#"{"position_m": [0, 25, 80], "target_m": [10, 0, 0], "vertical_fov_degrees": 30}"#;
        let view = CameraFile::from_json(look_at).unwrap().view(1.5);
        assert_eq!(view.position_m, DVec3::new(0.0, 25.0, 80.0));
        let camera = Camera::looking_at((960, 540), 1200.0, DVec3::new(0.0, 20.0, 70.0), DVec3::ZERO);
        let json = serde_json::to_string(&CameraFile::Pinhole(camera)).unwrap();
        let read = CameraFile::from_json(&json).unwrap().view(1.5);
        assert!((read.forward() - camera.forward()).length() < 1e-9, "{read:?}");
    }

    #[test]
    fn nonsense_is_named() {
        let error = CameraFile::from_json("{\"position_m\": [0, 1]}").unwrap_err();
        assert!(error.to_string().contains("vertical_fov_degrees"), "{error}");
        let flat = r#"{"position_m": [0, 25, 80], "target_m": [0, 25, 80], "vertical_fov_degrees": 30}"#;
        assert!(matches!(
            CameraFile::from_json(flat).unwrap_err(),
            CameraFileError::OutOfRange { field: "target_m", .. }
        ));
        let wide = r#"{"position_m": [0, 25, 80], "target_m": [0, 0, 0], "vertical_fov_degrees": 200}"#;
        assert!(CameraFile::from_json(wide).is_err());
    }
}
