//! A camera that circles a point of the pitch: dragged, panned and zoomed by hand, within limits.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};
use protocol::pitch::Pitch;

use super::{ViewCamera, preset::turf_corners};

/// The camera stays above the grass and never goes over the top.
const ELEVATION_LIMITS: (f64, f64) = (0.03, FRAC_PI_2 - 1e-3);
/// Closest and farthest distance from the target, metres of the pitch.
const DISTANCE_LIMITS_M: (f64, f64) = (2.5, 700.0);
/// Vertical field of view.
const FOV: f64 = 0.55;
/// The target stays within this much of the turf, metres beyond the lines.
const TARGET_MARGIN_M: f64 = 5.0;

/// A camera that circles a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitCamera {
    /// The point in the middle of the picture, world metres.
    pub target_m: DVec3,
    /// Direction from the target to the camera: 0 is +z (the main camera's side), growing towards +x, radians.
    pub yaw: f64,
    /// Angle of the camera above the pitch, radians.
    pub elevation: f64,
    /// From the target to the camera, metres of the pitch.
    pub distance_m: f64,
    half_pitch_m: DVec2,
}

impl OrbitCamera {
    /// Three quarters from above, the whole turf in a picture of width over height `aspect`.
    #[must_use]
    pub fn table(pitch: &Pitch, aspect: f64) -> Self {
        let mut orbit = Self {
            target_m: DVec3::ZERO,
            yaw: 0.24,
            elevation: 0.60,
            distance_m: 150.0,
            half_pitch_m: DVec2::new(pitch.length_m, pitch.width_m) / 2.0,
        };
        let fitted = orbit.view(aspect).fitted(orbit.target_m, &turf_corners(pitch), 0.05);
        orbit.distance_m = fitted.position_m.distance(orbit.target_m);
        orbit.limited()
    }

    /// The orbit that continues a view: same direction, around the point of the pitch in its middle.
    #[must_use]
    pub fn from_view(view: &ViewCamera, pitch: &Pitch) -> Self {
        let forward = view.forward();
        let to_ground_m = if forward.y < -0.02 { -view.position_m.y / forward.y } else { 40.0 };
        let distance_m = to_ground_m.clamp(DISTANCE_LIMITS_M.0, DISTANCE_LIMITS_M.1);
        let back = -forward;
        Self {
            target_m: view.position_m + forward * distance_m,
            yaw: back.x.atan2(back.z),
            elevation: back.y.clamp(-1.0, 1.0).asin(),
            distance_m,
            half_pitch_m: DVec2::new(pitch.length_m, pitch.width_m) / 2.0,
        }
        .limited()
    }

    /// The view in a picture of width over height `aspect`.
    #[must_use]
    pub fn view(&self, aspect: f64) -> ViewCamera {
        let level = DVec3::new(self.yaw.sin(), 0.0, self.yaw.cos());
        let back = level * self.elevation.cos() + DVec3::Y * self.elevation.sin();
        ViewCamera::looking_at(self.target_m + back * self.distance_m, self.target_m, FOV, aspect)
    }

    /// Turns by a drag, in shares of the picture's height; dragging right turns the table to the right.
    pub fn turn(&mut self, drag: DVec2) {
        self.yaw = (self.yaw - drag.x * 2.6).rem_euclid(TAU);
        self.elevation += drag.y * 1.8;
        *self = self.limited();
    }

    /// Moves over the pitch by a drag, in shares of the picture's height; the grass follows the hand.
    pub fn pan(&mut self, drag: DVec2) {
        let metres = 2.0 * (FOV / 2.0).tan() * self.distance_m;
        let right = DVec3::new(self.yaw.cos(), 0.0, -self.yaw.sin());
        let away = DVec3::new(-self.yaw.sin(), 0.0, -self.yaw.cos());
        // Up the picture is further over the pitch the flatter the view is; capped, so that it stays usable.
        let stretch = 1.0 / self.elevation.sin().max(0.3);
        self.target_m += (right * -drag.x + away * drag.y * stretch) * metres;
        *self = self.limited();
    }

    /// Comes closer by `steps` (turns of a wheel; negative goes away).
    pub fn zoom(&mut self, steps: f64) {
        self.distance_m *= (-steps * 0.12).clamp(-3.0, 3.0).exp();
        *self = self.limited();
    }

    fn limited(mut self) -> Self {
        let most = self.half_pitch_m + TARGET_MARGIN_M;
        self.target_m = DVec3::new(
            self.target_m.x.clamp(-most.x, most.x),
            self.target_m.y.clamp(0.0, 3.0),
            self.target_m.z.clamp(-most.y, most.y),
        );
        self.elevation = self.elevation.clamp(ELEVATION_LIMITS.0, ELEVATION_LIMITS.1);
        self.distance_m = self.distance_m.clamp(DISTANCE_LIMITS_M.0, DISTANCE_LIMITS_M.1);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_gesture_brings_the_camera_under_the_table_or_away() {
        let mut orbit = OrbitCamera::table(&Pitch::default(), 1.6);
        for step in 0..400 {
            let wild = DVec2::new((step as f64).sin(), (step as f64 * 1.7).cos()) * 3.0;
            orbit.turn(wild);
            orbit.pan(wild * 20.0);
            orbit.zoom(wild.x * 30.0);
            let view = orbit.view(1.6);
            assert!(view.position_m.y > 0.0, "{view:?}");
            assert!(view.position_m.is_finite() && orbit.target_m.x.abs() <= 57.5 + 1e-9);
            assert!(orbit.distance_m >= DISTANCE_LIMITS_M.0 && orbit.distance_m <= DISTANCE_LIMITS_M.1);
        }
    }

    #[test]
    fn the_grass_follows_the_hand() {
        let mut orbit = OrbitCamera::table(&Pitch::default(), 1.0);
        orbit.distance_m = 60.0;
        let before = orbit.view(1.0).project(DVec3::ZERO).unwrap();
        orbit.pan(DVec2::new(0.1, 0.0));
        let after = orbit.view(1.0).project(DVec3::ZERO).unwrap();
        assert!((after.x - before.x - 0.1).abs() < 0.01, "{before} to {after}");
    }

    #[test]
    fn an_orbit_continues_the_view_it_came_from() {
        let pitch = Pitch::default();
        let view = ViewCamera::looking_at(DVec3::new(8.0, 20.0, 60.0), DVec3::new(2.0, 0.0, 5.0), FOV, 1.5);
        let continued = OrbitCamera::from_view(&view, &pitch).view(1.5);
        assert!(continued.position_m.distance(view.position_m) < 1e-6, "{continued:?}");
        assert!((continued.forward() - view.forward()).length() < 1e-9);
    }
}
