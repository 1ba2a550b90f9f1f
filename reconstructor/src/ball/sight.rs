//! What the camera of a frame says about the ball: when, along which ray, and how large a ball would be there.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::{Matrix2x3, Vector2};
use protocol::camera::Camera;

use super::RADIUS_M;

/// Pixels per metre are taken at this distance where a ray does not meet the pitch, metres.
const FAR_M: f64 = 90.0;

/// A frame of a shot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// From the start of the clip.
    pub(super) seconds: f64,
    /// The camera, when it is known.
    pub(super) camera: Option<Camera>,
}

/// The ball in one frame, as far as a picture tells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// Index in the shot's moments.
    pub(super) frame: usize,
    /// From the start of the clip.
    pub(super) seconds: f64,
    /// The camera that saw it.
    pub(super) camera: Camera,
    /// Where, pixels of the clip.
    pub(super) pixel: DVec2,
}

/// The middle of a ball on the grass that is seen at `pixel`, no farther than [`FAR_M`] beyond the pitch's middle.
pub(super) fn on_grass(camera: &Camera, pixel: DVec2) -> Option<DVec3> {
    camera.ray(pixel).at_height(RADIUS_M).filter(|point| point.length() < 2.0 * FAR_M)
}

/// Pixels that a metre takes up where a ball on the grass would be seen at `pixel`.
pub(super) fn scale_px(camera: &Camera, pixel: DVec2) -> f64 {
    match on_grass(camera, pixel) {
        Some(point) => camera.pixels_per_metre(point),
        None => camera.focal_px / FAR_M,
    }
}

/// The pixel of a world point and its derivative by the point; `None` behind the camera.
pub(super) fn project(camera: &Camera, point: DVec3) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
    let p = camera.to_camera(point);
    if p.z < 1.0 {
        return None;
    }
    let n = p.truncate() / p.z;
    let bend = 1.0 + camera.k1 * n.length_squared();
    let pixel = n * bend * camera.focal_px + camera.centre_px();
    // d pixel / d n, then d n / d camera coordinates, then the rotation.
    let by_n = [
        [bend + 2.0 * camera.k1 * n.x * n.x, 2.0 * camera.k1 * n.x * n.y],
        [2.0 * camera.k1 * n.x * n.y, bend + 2.0 * camera.k1 * n.y * n.y],
    ];
    let n_by_p = [DVec3::new(1.0 / p.z, 0.0, -n.x / p.z), DVec3::new(0.0, 1.0 / p.z, -n.y / p.z)];
    let to_world: DMat3 = camera.rotation.transpose();
    let rows = by_n.map(|[x, y]| to_world * ((n_by_p[0] * x + n_by_p[1] * y) * camera.focal_px));
    let [a, b] = rows;
    Some((Vector2::new(pixel.x, pixel.y), Matrix2x3::new(a.x, a.y, a.z, b.x, b.y, b.z)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_derivative_is_that_of_the_projection(
            x in -40.0..40.0f64, y in 0.0..8.0f64, z in -30.0..25.0f64, k1 in -0.2..0.2f64,
        ) {
            let mut camera = Camera::looking_at((1280, 720), 2000.0, DVec3::new(2.0, 18.0, 75.0), DVec3::new(x, 1.0, z));
            camera.k1 = k1;
            let point = DVec3::new(x + 3.0, y, z - 2.0);
            let (pixel, derivative) = project(&camera, point).unwrap();
            let exact = camera.project(point).unwrap();
            prop_assert!((DVec2::new(pixel.x, pixel.y) - exact).length() < 1e-9);
            for (axis, unit) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
                let moved = camera.project(point + unit * 1e-5).unwrap();
                let numeric = (moved - exact) / 1e-5;
                prop_assert!((derivative[(0, axis)] - numeric.x).abs() < 1e-2);
                prop_assert!((derivative[(1, axis)] - numeric.y).abs() < 1e-2);
            }
        }
    }
}
