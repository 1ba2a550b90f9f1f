//! Views round one person, as on a turntable.

use std::f64::consts::TAU;

use glam::DVec3;
use protocol::camera::Camera;

use super::ViewCamera;

/// Distance from the person, metres: far enough that the near side is not swollen.
const DISTANCE_M: f64 = 7.0;
/// How high the views look from, metres.
const HEIGHT_M: f64 = 1.9;
/// What they look at over the grass, metres.
const MIDDLE_M: f64 = 0.95;
/// The picture shows this much from top to bottom, metres: a jump with arms up fits.
const SHOWN_M: f64 = 2.5;

/// `count` views round somebody who stands at `anchor_m`, world metres; the first from the side of the broadcast camera (of the main stand
/// when it is not known), then to its right round the person.
#[must_use]
pub fn turntable(anchor_m: DVec3, broadcast: Option<&Camera>, count: u32, aspect: f64) -> Vec<ViewCamera> {
    let towards = broadcast.map_or(DVec3::Z, |camera| camera.position - anchor_m);
    let start = towards.x.atan2(towards.z);
    let vertical_fov = 2.0 * (SHOWN_M / 2.0 / DISTANCE_M).atan();
    (0..count)
        .map(|index| {
            let angle = start + TAU * f64::from(index) / f64::from(count.max(1));
            let off = DVec3::new(angle.sin(), 0.0, angle.cos()) * DISTANCE_M + DVec3::Y * HEIGHT_M;
            let target = anchor_m.with_y(0.0) + DVec3::Y * MIDDLE_M;
            ViewCamera::looking_at(anchor_m.with_y(0.0) + off, target, vertical_fov, aspect)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_view_is_on_the_cameras_side_and_the_third_of_four_behind() {
        let anchor = DVec3::new(10.0, 0.0, -5.0);
        let broadcast = Camera::looking_at((1280, 720), 1500.0, DVec3::new(0.0, 18.0, 70.0), anchor);
        let views = turntable(anchor, Some(&broadcast), 4, 0.8);
        let side = |view: &ViewCamera| (view.position_m - anchor).with_y(0.0).normalize();
        let towards = (broadcast.position - anchor).with_y(0.0).normalize();
        assert!(side(&views[0]).dot(towards) > 0.9999 && side(&views[2]).dot(towards) < -0.9999);
        // From the front, the second view stands to the camera's right.
        assert!(side(&views[1]).dot(broadcast.rotation.row(0)) > 0.9);
        assert!(turntable(anchor, None, 0, 1.0).is_empty());
    }
}
