//! Poses of the runtime as the player's values, and back.
//!
//! Both are metres, right-handed; the runtime's spaces have y up and the user facing −z.

use glam::{DQuat, DVec3};
use openxr::{Posef, Quaternionf, Vector3f, View};

use crate::{camera::EyeView, placement::TabletopPose, scene::TABLETOP_SCALE};

/// Against gravity in every reference space of OpenXR.
pub(super) const UP: DVec3 = DVec3::Y;

/// Where the match floats before anybody has placed it: an arm's length ahead, well below the eyes.
pub(super) fn before_the_user() -> TabletopPose {
    TabletopPose::upright(DVec3::new(0.0, -0.45, -0.85), UP, DVec3::X, TABLETOP_SCALE)
}

/// One eye.
pub(super) fn eye(view: &View) -> EyeView {
    let fov = view.fov;
    EyeView {
        position_m: position(view.pose.position),
        orientation: orientation(view.pose.orientation),
        tangents: [fov.angle_left, fov.angle_right, fov.angle_up, fov.angle_down]
            .map(|angle| f64::from(angle).tan()),
    }
}

/// The point between both eyes and where it looks.
pub(super) fn head(views: &[View; 2]) -> (DVec3, DQuat) {
    let [left, right] = views;
    ((position(left.pose.position) + position(right.pose.position)) / 2.0, orientation(left.pose.orientation))
}

pub(super) fn position(v: Vector3f) -> DVec3 {
    DVec3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}

/// Unit length whatever the runtime says; the identity for nonsense.
pub(super) fn orientation(q: Quaternionf) -> DQuat {
    let raw = DQuat::from_xyzw(f64::from(q.x), f64::from(q.y), f64::from(q.z), f64::from(q.w));
    let length = raw.length();
    if length.is_finite() && length > 1e-6 { raw / length } else { DQuat::IDENTITY }
}

/// Place and turn: maps a point p to turn · p + place.
pub(super) type Rigid = (DVec3, DQuat);

/// Place and turn of a pose.
pub(super) fn rigid(pose: Posef) -> Rigid {
    (position(pose.position), orientation(pose.orientation))
}

/// First `inner`, then `outer`.
pub(super) fn compose(outer: Rigid, inner: Rigid) -> Rigid {
    (outer.0 + outer.1 * inner.0, (outer.1 * inner.1).normalize())
}

/// The way back.
pub(super) fn inverse(way: Rigid) -> Rigid {
    let back = way.1.inverse();
    (back * -way.0, back)
}

pub(super) fn pose(position_m: DVec3, orientation: DQuat) -> Posef {
    let (p, q) = (position_m.as_vec3(), orientation.as_quat());
    Posef {
        orientation: Quaternionf { x: q.x, y: q.y, z: q.z, w: q.w },
        position: Vector3f { x: p.x, y: p.y, z: p.z },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_go_there_and_back() {
        let (place, turn) = (DVec3::new(0.1, 1.5, -2.0), DQuat::from_rotation_y(0.7));
        let there = pose(place, turn);
        assert!(position(there.position).distance(place) < 1e-6);
        assert!(orientation(there.orientation).angle_between(turn) < 1e-3);
        let nonsense = Quaternionf { x: 0.0, y: f32::NAN, z: 0.0, w: 0.0 };
        assert_eq!(orientation(nonsense), DQuat::IDENTITY);
    }

    #[test]
    fn there_and_back_is_nowhere() {
        let way = (DVec3::new(0.1, 1.5, -2.0), DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.2));
        let (place, turn) = compose(way, inverse(way));
        assert!(place.length() < 1e-12 && turn.angle_between(DQuat::IDENTITY) < 1e-6);
    }

    #[test]
    fn the_first_place_is_ahead_and_below() {
        let pose = before_the_user();
        assert!(pose.position_m.z < 0.0 && pose.position_m.y < 0.0 && pose.up().distance(UP) < 1e-12);
        assert!(pose.to_room(DVec3::Z * 34.0).z > pose.position_m.z, "the main camera's side is the user's");
    }
}
