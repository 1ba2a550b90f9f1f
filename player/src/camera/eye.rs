//! The eye of a headset: a pose in the room and a field of view that need not be symmetric.
//!
//! Room axes are those of OpenXR: right-handed, the eye looks along its own −z with y up. The pitch is not moved to the
//! table; the eye is moved to the pitch instead, and sees it from a hundred metres away.

use glam::{DMat4, DQuat, DVec3, DVec4};

use crate::{placement::TabletopPose, renderer::View};

/// Nearest that is drawn, room metres.
const NEAR_M: f64 = 0.05;

/// One eye of a headset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeView {
    /// Where it is, room metres.
    pub position_m: DVec3,
    /// From eye axes (x right, y up, z backwards) to room axes.
    pub orientation: DQuat,
    /// Tangents of the angles to the left, right, upper and lower edge of the picture; left and lower are negative.
    pub tangents: [f64; 4],
}

impl EyeView {
    /// Room metres to clip space; depth is 1 at the near plane and 0 at infinity.
    #[must_use]
    pub fn clip_from_room(&self) -> DMat4 {
        let [left, right, up, down] = self.tangents;
        let (width, height) = (right - left, up - down);
        let clip_from_eye = DMat4::from_cols(
            DVec4::new(2.0 / width, 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 / height, 0.0, 0.0),
            DVec4::new((right + left) / width, (up + down) / height, 0.0, -1.0),
            DVec4::new(0.0, 0.0, NEAR_M, 0.0),
        );
        let eye_from_room =
            DMat4::from_quat(self.orientation.inverse()) * DMat4::from_translation(-self.position_m);
        clip_from_eye * eye_from_room
    }

    /// The room as this eye sees it; metres are the room's.
    #[must_use]
    pub fn of_room(&self) -> View {
        View { clip_from_world: self.clip_from_room().as_mat4(), eye_m: self.position_m.as_vec3() }
    }

    /// The pitch as this eye sees it standing at `pose`.
    #[must_use]
    pub fn of_pitch(&self, pose: &TabletopPose) -> View {
        View {
            clip_from_world: (self.clip_from_room() * pose.room_from_pitch()).as_mat4(),
            eye_m: pose.to_pitch(self.position_m).as_vec3(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A left eye: wider to its own side.
    fn eye() -> EyeView {
        EyeView {
            position_m: DVec3::new(0.2, 1.6, 0.9),
            orientation: DQuat::from_rotation_y(0.3) * DQuat::from_rotation_x(-0.5),
            tangents: [-1.1, 0.8, 0.9, -1.0],
        }
    }

    #[test]
    fn the_edges_of_the_field_of_view_are_the_edges_of_the_picture() {
        let eye = eye();
        let [left, right, up, down] = eye.tangents;
        for (x, y, expected) in [(left, up, [-1.0, 1.0]), (right, down, [1.0, -1.0])] {
            let point = eye.position_m + eye.orientation * DVec3::new(x, y, -1.0) * 2.0;
            let clip = eye.clip_from_room() * point.extend(1.0);
            let at = clip.truncate() / clip.w;
            assert!((at.x - expected[0]).abs() < 1e-12 && (at.y - expected[1]).abs() < 1e-12, "{at}");
            assert!((at.z - NEAR_M / 2.0).abs() < 1e-12 && clip.w > 0.0, "depth {}", at.z);
        }
    }

    #[test]
    fn the_pitch_lands_where_its_place_in_the_room_does() {
        let eye = eye();
        let pose =
            TabletopPose::upright(DVec3::new(0.1, 0.74, -0.2), DVec3::Y, DVec3::new(1.0, 0.0, 0.4), 0.01);
        let view = eye.of_pitch(&pose);
        for pitch in [DVec3::ZERO, DVec3::new(52.5, 0.0, -34.0), DVec3::new(-20.0, 1.8, 10.0)] {
            let direct = eye.clip_from_room() * pose.to_room(pitch).extend(1.0);
            let (direct, through) = (direct / direct.w, view.clip_from_world * pitch.as_vec3().extend(1.0));
            let difference = direct.as_vec4() - through / through.w;
            assert!(difference.length() < 1e-5, "{pitch}: {difference}");
        }
        assert!(view.eye_m.distance(pose.to_pitch(eye.position_m).as_vec3()) < 1e-4);
        assert!(view.eye_m.y > 50.0, "the eye looks down from {} m of the pitch", view.eye_m.y);
    }
}
