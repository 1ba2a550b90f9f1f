//! Where the picture is seen from: a pinhole view of the pitch, its presets, the orbit of the mouse, and camera files.
//!
//! Positions are world metres of the pitch. The tabletop scale only matters to a headset: a picture of the pitch from
//! 150 m and one of a table a hundredth of that size from 1.5 m are the same picture.

mod eye;
mod file;
mod orbit;
mod preset;
mod turntable;

pub use eye::EyeView;
pub use file::{CameraFile, CameraFileError};
pub use orbit::OrbitCamera;
pub use preset::{NoSuchPreset, Preset};
pub use turntable::turntable;

use glam::{DMat3, DVec2, DVec3, Mat4, Vec4};
use protocol::camera::Camera;

/// Distance of the near plane, metres. The far plane is at infinity (reversed depth keeps its precision there).
const NEAR_M: f64 = 0.1;

/// A pinhole view with the principal point in the middle of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewCamera {
    /// Centre of projection, world metres.
    pub position_m: DVec3,
    /// World to camera (x right, y down, z forward), as in [`Camera`].
    pub rotation: DMat3,
    /// Tangents of half the field of view, across and down.
    pub half_tangent: DVec2,
}

impl ViewCamera {
    /// A view from `position_m` to `target_m` with the horizon level.
    ///
    /// Looking straight down, the far touchline is up. `aspect` is width over height.
    #[must_use]
    pub fn looking_at(position_m: DVec3, target_m: DVec3, vertical_fov: f64, aspect: f64) -> Self {
        let forward = (target_m - position_m).normalize_or(DVec3::NEG_Y);
        let right = forward.cross(DVec3::Y);
        let right = if right.length() < 1e-6 { DVec3::X } else { right.normalize() };
        let down = forward.cross(right);
        let half = (vertical_fov / 2.0).tan();
        Self {
            position_m,
            rotation: DMat3::from_cols(right, down, forward).transpose(),
            half_tangent: DVec2::new(half * aspect, half),
        }
    }

    /// The view of a broadcast camera, its whole picture visible in a picture of width over height `aspect`.
    ///
    /// With the clip's own aspect the pinhole is matched exactly; `k1` is left out, as a projection matrix bends no
    /// lines (at |k1| ≤ 0.1 and a 30° lens that is at most a few pixels in the corners).
    #[must_use]
    pub fn from_broadcast(camera: &Camera, aspect: f64) -> Self {
        let half =
            DVec2::new(f64::from(camera.width_px), f64::from(camera.height_px)) / 2.0 / camera.focal_px;
        // A wider picture shows more at the sides, a taller one more above and below.
        let half_tangent = if half.x < half.y * aspect {
            DVec2::new(half.y * aspect, half.y)
        } else {
            DVec2::new(half.x, half.x / aspect)
        };
        Self { position_m: camera.position, rotation: camera.rotation, half_tangent }
    }

    /// World metres to clip space; depth is 1 at the near plane and 0 at infinity.
    #[must_use]
    pub fn clip_from_world(&self) -> Mat4 {
        let offset = self.rotation * -self.position_m;
        let row = |index: usize, scale: f64| {
            let axis = self.rotation.row(index) * scale;
            axis.extend(offset[index] * scale).as_vec4()
        };
        Mat4::from_cols(
            row(0, 1.0 / self.half_tangent.x),
            row(1, -1.0 / self.half_tangent.y),
            Vec4::new(0.0, 0.0, 0.0, NEAR_M as f32),
            row(2, 1.0),
        )
        .transpose()
    }

    /// The unit direction of the optical axis.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        self.rotation.row(2)
    }

    /// Where a world point lands: 0..1 from the top-left of the picture; `None` behind the camera.
    #[must_use]
    pub fn project(&self, world_m: DVec3) -> Option<DVec2> {
        let camera = self.rotation * (world_m - self.position_m);
        (camera.z > NEAR_M).then(|| camera.truncate() / camera.z / self.half_tangent / 2.0 + 0.5)
    }

    /// The same direction, moved back until all `points` are in the picture with `margin` (share of its size) to spare.
    #[must_use]
    pub(crate) fn fitted(mut self, target_m: DVec3, points: &[DVec3], margin: f64) -> Self {
        let tangent = self.half_tangent * (1.0 - margin);
        let needed = points.iter().map(|point| {
            let p = self.rotation * (*point - target_m);
            (p.x.abs() / tangent.x).max(p.y.abs() / tangent.y) - p.z
        });
        let distance_m = needed.fold(NEAR_M, f64::max);
        self.position_m = target_m - self.forward() * distance_m;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pixel(view: &ViewCamera, world: DVec3, size: DVec2) -> DVec2 {
        view.project(world).unwrap() * size - 0.5
    }

    #[test]
    fn broadcast_view_agrees_with_the_camera_to_a_thousandth_of_a_pixel() {
        let position = DVec3::new(3.0, 15.0, 70.0);
        let camera = Camera::looking_at((1280, 720), 1500.0, position, DVec3::new(10.0, 0.0, 0.0));
        let view = ViewCamera::from_broadcast(&camera, 1280.0 / 720.0);
        for world in [DVec3::ZERO, DVec3::new(20.0, 1.8, -30.0), DVec3::new(-9.0, 0.5, 25.0)] {
            let expected = camera.project(world).unwrap();
            let seen = pixel(&view, world, DVec2::new(1280.0, 720.0));
            assert!((expected - seen).length() < 1e-3, "{world}: {expected} and {seen}");
            let clip = view.clip_from_world() * world.as_vec3().extend(1.0);
            let ndc = clip.truncate() / clip.w;
            let drawn = DVec2::new(f64::from(ndc.x) + 1.0, 1.0 - f64::from(ndc.y)) / 2.0;
            let drawn = drawn * DVec2::new(1280.0, 720.0) - 0.5;
            assert!((expected - drawn).length() < 1e-2, "{world}: {expected} drawn at {drawn}");
            assert!(ndc.z > 0.0 && ndc.z < 1.0, "depth {}", ndc.z);
        }
    }

    #[test]
    fn another_aspect_keeps_the_whole_broadcast_picture() {
        let camera = Camera::looking_at((1280, 720), 1500.0, DVec3::new(0.0, 15.0, 70.0), DVec3::ZERO);
        let corners = [DVec2::new(-0.4, -0.4), DVec2::new(1279.4, 719.4)];
        for aspect in [1.0, 4.0 / 3.0, 2.4] {
            let view = ViewCamera::from_broadcast(&camera, aspect);
            for corner in corners {
                let ray = camera.ray(corner);
                let seen = view.project(ray.origin + ray.direction * 40.0).unwrap();
                assert!(seen.min_element() >= 0.0 && seen.max_element() <= 1.0, "{aspect}: {seen}");
            }
        }
    }

    #[test]
    fn straight_down_has_the_main_camera_side_below() {
        let view = ViewCamera::looking_at(DVec3::new(0.0, 100.0, 0.0), DVec3::ZERO, 0.8, 1.5);
        let near = view.project(DVec3::new(0.0, 0.0, 10.0)).unwrap();
        let right = view.project(DVec3::new(10.0, 0.0, 0.0)).unwrap();
        assert!(near.y > 0.5 && right.x > 0.5, "{near} {right}");
    }
}
