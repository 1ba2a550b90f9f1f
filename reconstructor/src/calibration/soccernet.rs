//! SoccerNet's camera JSON, in and out.
//!
//! Its world has x along the touchline, y towards the main camera and z down; its pictures have the principal point at
//! (width / 2, height / 2). Angles in degrees: the camera's axes in the world are R = Rz(pan) · Rx(tilt) · Rz(roll).

use glam::{DMat3, DVec3};
use protocol::camera::Camera;
use serde::{Deserialize, Serialize};

/// A camera in SoccerNet's terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SoccerNetCamera {
    /// Turn about the vertical, degrees.
    pub pan_degrees: f64,
    /// Angle of the optical axis from straight down, degrees.
    pub tilt_degrees: f64,
    /// Turn about the optical axis, degrees.
    pub roll_degrees: f64,
    /// Where the camera is, in SoccerNet's axes, metres.
    pub position_meters: [f64; 3],
    /// Focal length across, pixels.
    pub x_focal_length: f64,
    /// Focal length down, pixels.
    pub y_focal_length: f64,
    /// Principal point, pixels.
    pub principal_point: [f64; 2],
    /// Radial coefficients k1 to k6 of OpenCV's model.
    #[serde(default)]
    pub radial_distortion: [f64; 6],
    /// Tangential coefficients.
    #[serde(default)]
    pub tangential_distortion: [f64; 2],
    /// Thin-prism coefficients.
    #[serde(default)]
    pub thin_prism_distortion: [f64; 4],
}

/// Why a SoccerNet camera has no counterpart here.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SoccerNetError {
    /// A number that is not finite, or a focal length that is not positive.
    #[error("the SoccerNet camera has numbers that are not finite, or a focal length that is not positive")]
    NotANumber,
    /// A lens model with more than one radial coefficient, or pixels that are not square.
    #[error("the SoccerNet camera has {what}; only square pixels and one radial coefficient can be used")]
    Unsupported {
        /// What cannot be expressed.
        what: &'static str,
    },
}

/// SoccerNet's world (x, y towards the camera, z down) from ours (x, y up, z towards the camera).
const WORLD: DMat3 =
    DMat3::from_cols_array(&[1.0, 0.0, 0.0, /* y up */ 0.0, 0.0, -1.0, /* z */ 0.0, 1.0, 0.0]);

impl From<&Camera> for SoccerNetCamera {
    fn from(camera: &Camera) -> Self {
        // Columns: the camera's axes in SoccerNet's world.
        let axes = WORLD * camera.rotation.transpose();
        let (right, down, forward) = (axes.x_axis, axes.y_axis, axes.z_axis);
        // Rz(pan)·Rx(tilt)·Rz(roll): forward is (sin pan sin tilt, −cos pan sin tilt, cos tilt), last row ends
        // (sin tilt sin roll, sin tilt cos roll, cos tilt).
        let tilt = forward.z.clamp(-1.0, 1.0).acos();
        let (pan, roll) = if tilt.sin().abs() > 1e-9 {
            (forward.x.atan2(-forward.y), right.z.atan2(down.z))
        } else {
            // Straight down or up: pan and roll turn about the same axis.
            (right.y.atan2(right.x), 0.0)
        };
        let position = WORLD * camera.position;
        Self {
            pan_degrees: pan.to_degrees(),
            tilt_degrees: tilt.to_degrees(),
            roll_degrees: roll.to_degrees(),
            position_meters: position.to_array(),
            x_focal_length: camera.focal_px,
            y_focal_length: camera.focal_px,
            principal_point: [f64::from(camera.width_px) / 2.0, f64::from(camera.height_px) / 2.0],
            radial_distortion: [camera.k1, 0.0, 0.0, 0.0, 0.0, 0.0],
            tangential_distortion: [0.0; 2],
            thin_prism_distortion: [0.0; 4],
        }
    }
}

impl SoccerNetCamera {
    /// This camera in our terms, for pictures of a given size.
    ///
    /// # Errors
    /// When it has numbers or a lens that cannot be used.
    pub fn to_camera(&self, width_px: u32, height_px: u32) -> Result<Camera, SoccerNetError> {
        let angles = [self.pan_degrees, self.tilt_degrees, self.roll_degrees];
        let numbers = angles.iter().chain(&self.position_meters).chain(&self.radial_distortion);
        let focal_px = (self.x_focal_length + self.y_focal_length) / 2.0;
        if !numbers.chain([&focal_px]).all(|v| v.is_finite()) || focal_px <= 0.0 {
            return Err(SoccerNetError::NotANumber);
        }
        if (self.x_focal_length / self.y_focal_length - 1.0).abs() > 0.02 {
            return Err(SoccerNetError::Unsupported { what: "pixels that are not square" });
        }
        let [k1, higher @ ..] = self.radial_distortion;
        let others = higher.iter().chain(&self.tangential_distortion).chain(&self.thin_prism_distortion);
        if others.into_iter().any(|&v| v != 0.0) {
            return Err(SoccerNetError::Unsupported { what: "higher distortion coefficients" });
        }
        let [pan, tilt, roll] = angles.map(f64::to_radians);
        let axes = DMat3::from_rotation_z(pan) * DMat3::from_rotation_x(tilt) * DMat3::from_rotation_z(roll);
        let rotation = (WORLD.transpose() * axes).transpose();
        let position = WORLD.transpose() * DVec3::from_array(self.position_meters);
        Ok(Camera { width_px, height_px, focal_px, k1, rotation, position })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn there_and_back_is_the_same_camera(
            x in -60.0..60.0_f64, y in 2.0..40.0_f64, z in 35.0..100.0_f64, tx in -50.0..50.0_f64, roll in -0.2..0.2_f64,
            k1 in -0.2..0.2_f64,
        ) {
            let mut camera =
                Camera::looking_at((960, 540), 1400.0, DVec3::new(x, y, z), DVec3::new(tx, 0.0, -3.0));
            camera.rotation = DMat3::from_rotation_z(roll) * camera.rotation;
            camera.k1 = k1;
            let text = serde_json::to_string(&SoccerNetCamera::from(&camera)).unwrap();
            let back: SoccerNetCamera = serde_json::from_str(&text).unwrap();
            let back = back.to_camera(960, 540).unwrap();
            for world in [DVec3::ZERO, DVec3::new(20.0, 2.44, -30.0)] {
                // Far off the axis a negative k1 shows nothing: then neither does.
                let same = match (camera.project(world), back.project(world)) {
                    (Some(a), Some(b)) => a.distance(b) < 1e-6,
                    (a, b) => a == b,
                };
                prop_assert!(same);
            }
        }
    }

    #[test]
    fn a_main_camera_has_the_signs_that_soccernet_uses() {
        // From the side of positive y, 15 m up (z = −15), aimed to the right of the centre mark.
        let camera =
            Camera::looking_at((960, 540), 1400.0, DVec3::new(0.0, 15.0, 60.0), DVec3::new(30.0, 0.0, 0.0));
        let theirs = SoccerNetCamera::from(&camera);
        assert_eq!(theirs.position_meters, [0.0, 60.0, -15.0]);
        assert!((theirs.pan_degrees - 30.0_f64.atan2(60.0).to_degrees()).abs() < 1e-9, "{theirs:?}");
        assert!(
            (75.0..85.0).contains(&theirs.tilt_degrees) && theirs.roll_degrees.abs() < 1e-9,
            "{theirs:?}"
        );
    }

    #[test]
    fn lenses_that_cannot_be_expressed_are_refused() {
        let good = SoccerNetCamera::from(&Camera::looking_at(
            (960, 540),
            1400.0,
            DVec3::new(0.0, 15.0, 60.0),
            DVec3::ZERO,
        ));
        let mut bad = good.clone();
        bad.radial_distortion[2] = 0.1;
        assert!(matches!(bad.to_camera(960, 540), Err(SoccerNetError::Unsupported { .. })));
        let mut bad = good.clone();
        bad.y_focal_length *= 1.5;
        assert!(matches!(bad.to_camera(960, 540), Err(SoccerNetError::Unsupported { .. })));
        let mut bad = good;
        bad.pan_degrees = f64::NAN;
        assert_eq!(bad.to_camera(960, 540), Err(SoccerNetError::NotANumber));
    }
}
