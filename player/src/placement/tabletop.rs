//! Where the match stands: scaled about the centre mark, turned only about the vertical of its surface.

use glam::{DMat4, DQuat, DVec3};
use serde::Serialize;

use crate::scene::TURF_THICKNESS_M;

/// Room metres per metre of the pitch, least and most: 1:1000 (a pitch as long as a hand) to 1:20 (five metres).
pub const PITCH_SCALE_LIMITS: [f64; 2] = [0.001, 0.05];

/// Maps metres of the pitch (see [`protocol::pitch`]) to metres of the room.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TabletopPose {
    /// Where the centre mark stands, room metres.
    pub position_m: DVec3,
    /// From pitch axes to room axes; the pitch's y becomes the surface's up.
    pub orientation: DQuat,
    /// Room metres per metre of the pitch.
    pub scale: f64,
}

impl TabletopPose {
    /// Stands at `position_m` on a surface whose unit normal is `up`, with the pitch's x along `along` as far as the
    /// surface allows; any direction on the surface when `along` is parallel to `up`.
    #[must_use]
    pub fn upright(position_m: DVec3, up: DVec3, along: DVec3, scale: f64) -> Self {
        let x =
            along.reject_from_normalized(up).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        let orientation = DQuat::from_mat3(&glam::DMat3::from_cols(x, up, x.cross(up))).normalize();
        Self { position_m, orientation, scale }
    }

    /// As [`Self::upright`], with the underside of the turf at `foot_m`: how a match stands on a real surface, its turf
    /// as thick as [`TURF_THICKNESS_M`] says.
    #[must_use]
    pub fn standing_on(foot_m: DVec3, up: DVec3, along: DVec3, scale: f64) -> Self {
        Self::upright(foot_m + up * (TURF_THICKNESS_M * scale), up, along, scale)
    }

    /// The point of the surface under the centre mark, room metres.
    #[must_use]
    pub fn foot_m(&self) -> DVec3 {
        self.to_room(DVec3::NEG_Y * TURF_THICKNESS_M)
    }

    /// The surface's up, unit length.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.orientation * DVec3::Y
    }

    /// Turned about its own up by an angle in radians, counter-clockwise seen from above.
    #[must_use]
    pub fn turned(&self, angle: f64) -> Self {
        Self { orientation: (self.orientation * DQuat::from_rotation_y(angle)).normalize(), ..*self }
    }

    /// The room from the pitch, column vectors.
    #[must_use]
    pub fn room_from_pitch(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(DVec3::splat(self.scale), self.orientation, self.position_m)
    }

    /// A point of the pitch, metres, in the room.
    #[must_use]
    pub fn to_room(&self, pitch_m: DVec3) -> DVec3 {
        self.position_m + self.orientation * (pitch_m * self.scale)
    }

    /// A point of the room in metres of the pitch.
    #[must_use]
    pub fn to_pitch(&self, room_m: DVec3) -> DVec3 {
        self.orientation.inverse() * (room_m - self.position_m) / self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stands_upright_and_runs_along() {
        let up = DVec3::new(0.1, 0.9, -0.3).normalize();
        let pose = TabletopPose::upright(DVec3::new(1.0, 2.0, 3.0), up, DVec3::X, 0.01);
        assert!(pose.up().distance(up) < 1e-12);
        let touchline = pose.to_room(DVec3::X * 50.0) - pose.position_m;
        assert!(touchline.dot(up).abs() < 1e-12 && touchline.x > 0.49);
        assert!((touchline.length() - 0.5).abs() < 1e-12);
        let point = DVec3::new(-30.0, 1.5, 20.0);
        assert!(pose.to_pitch(pose.to_room(point)).distance(point) < 1e-9);
        assert!(pose.room_from_pitch().transform_point3(point).distance(pose.to_room(point)) < 1e-12);
        assert!(pose.turned(1.0).up().distance(up) < 1e-12);
    }

    #[test]
    fn it_stands_on_the_underside_of_its_turf() {
        let foot = DVec3::new(0.2, 0.75, -1.0);
        let pose = TabletopPose::standing_on(foot, DVec3::Y, DVec3::X, 0.01);
        assert!(pose.foot_m().distance(foot) < 1e-12 && pose.position_m.y > foot.y);
    }

    #[test]
    fn a_direction_along_up_is_no_failure() {
        let pose = TabletopPose::upright(DVec3::ZERO, DVec3::Y, DVec3::Y, 0.01);
        assert!(pose.orientation.is_finite() && pose.up().distance(DVec3::Y) < 1e-12);
    }
}
