//! The broadcast camera: pinhole with one radial coefficient, between world metres and image pixels.
//!
//! World: metres, right-handed, y up, origin at the centre mark, x along the touchline, z towards the main camera.
//! Camera: x right, y down, z forward. Image: pixels, origin at the centre of the top-left pixel, x right, y down.

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A pinhole camera with radial distortion `k1`, square pixels and the principal point in the middle of the picture.
///
/// A point at normalised image coordinates `n` (before distortion) lands on pixel
/// `focal_px · n · (1 + k1 · |n|²) + centre`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Picture width in pixels.
    pub width_px: u32,
    /// Picture height in pixels.
    pub height_px: u32,
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Radial distortion, of the squared normalised radius; 0 is none.
    pub k1: f64,
    /// World to camera: `camera = rotation · (world − position)`. Columns, as glam stores them.
    pub rotation: DMat3,
    /// Centre of projection in world metres.
    pub position: DVec3,
}

/// A half-line in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, metres.
    pub origin: DVec3,
    /// Where it goes; unit length.
    pub direction: DVec3,
}

impl Ray {
    /// The point on the ray at height `height_m` above the pitch, in front of the origin.
    #[must_use]
    pub fn at_height(&self, height_m: f64) -> Option<DVec3> {
        let distance = (height_m - self.origin.y) / self.direction.y;
        (distance.is_finite() && distance > 0.0).then(|| self.origin + self.direction * distance)
    }

    /// Where the ray meets the plane through `point` with unit normal `normal`, in front of the origin.
    #[must_use]
    pub fn on_plane(&self, point: DVec3, normal: DVec3) -> Option<DVec3> {
        let distance = (point - self.origin).dot(normal) / self.direction.dot(normal);
        (distance.is_finite() && distance > 0.0).then(|| self.origin + self.direction * distance)
    }
}

impl Camera {
    /// A camera at `position` looking at `target` with the horizon level, world metres.
    #[must_use]
    pub fn looking_at(size_px: (u32, u32), focal_px: f64, position: DVec3, target: DVec3) -> Self {
        let forward = (target - position).normalize_or(DVec3::NEG_Z);
        let right = forward.cross(DVec3::Y).normalize_or(DVec3::X);
        let down = forward.cross(right);
        let rotation = DMat3::from_cols(right, down, forward).transpose();
        Self { width_px: size_px.0, height_px: size_px.1, focal_px, k1: 0.0, rotation, position }
    }

    /// The principal point in pixels: the middle of the picture.
    #[must_use]
    pub fn centre_px(&self) -> DVec2 {
        DVec2::new(f64::from(self.width_px) - 1.0, f64::from(self.height_px) - 1.0) / 2.0
    }

    /// World metres to camera metres (x right, y down, z forward).
    #[must_use]
    pub fn to_camera(&self, world: DVec3) -> DVec3 {
        self.rotation * (world - self.position)
    }

    /// Distance of a world point along the optical axis, metres; negative behind the camera.
    #[must_use]
    pub fn depth(&self, world: DVec3) -> f64 {
        self.to_camera(world).z
    }

    /// The unit direction of the optical axis in the world.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        self.rotation.row(2)
    }

    /// The pixel a world point lands on, inside the picture or not; `None` behind the camera, and so far off the axis that
    /// a negative `k1` would fold the point back into the picture, which no lens does.
    #[must_use]
    pub fn project(&self, world: DVec3) -> Option<DVec2> {
        let p = self.to_camera(world);
        if p.z < 1e-6 {
            return None;
        }
        let n = p.truncate() / p.z;
        let bend = self.k1 * n.length_squared();
        // The distorted radius r(1 + k1 r²) grows only while its derivative 1 + 3 k1 r² is positive.
        (3.0 * bend > -1.0).then(|| n * (1.0 + bend) * self.focal_px + self.centre_px())
    }

    /// Whether a pixel lies in the picture.
    #[must_use]
    pub fn contains(&self, pixel: DVec2) -> bool {
        pixel.x >= -0.5
            && pixel.y >= -0.5
            && pixel.x < f64::from(self.width_px) - 0.5
            && pixel.y < f64::from(self.height_px) - 0.5
    }

    /// The ray of light that a pixel saw.
    #[must_use]
    pub fn ray(&self, pixel: DVec2) -> Ray {
        let distorted = (pixel - self.centre_px()) / self.focal_px;
        // Fixed-point inverse of n(1 + k1 n²): converges in a few rounds for the lenses used at matches (|k1| ≤ 0.3).
        let mut n = distorted;
        for _ in 0..12 {
            n = distorted / (1.0 + self.k1 * n.length_squared()).max(0.1);
        }
        let direction = (self.rotation.transpose() * n.extend(1.0)).normalize_or(self.forward());
        Ray { origin: self.position, direction }
    }

    /// The point of the pitch plane (y = 0) seen at a pixel, metres; `None` above the horizon.
    #[must_use]
    pub fn ground_point(&self, pixel: DVec2) -> Option<DVec3> {
        self.ray(pixel).at_height(0.0)
    }

    /// Pixels that one metre takes up at a world point, across the line of sight.
    #[must_use]
    pub fn pixels_per_metre(&self, world: DVec3) -> f64 {
        self.focal_px / self.depth(world).max(1e-6)
    }

    /// The same view at another picture size (the field of view across stays).
    #[must_use]
    pub fn resized(&self, width_px: u32, height_px: u32) -> Self {
        let scale = f64::from(width_px) / f64::from(self.width_px);
        Self { width_px, height_px, focal_px: self.focal_px * scale, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn main_camera() -> Camera {
        Camera::looking_at((1280, 720), 1500.0, DVec3::new(3.0, 15.0, 70.0), DVec3::new(10.0, 0.0, 0.0))
    }

    #[test]
    fn rotation_is_proper_and_the_target_is_in_the_middle() {
        let camera = main_camera();
        assert!((camera.rotation.determinant() - 1.0).abs() < 1e-12);
        let pixel = camera.project(DVec3::new(10.0, 0.0, 0.0)).unwrap();
        assert!((pixel - camera.centre_px()).length() < 1e-9);
    }

    #[test]
    fn right_is_plus_x_and_up_is_up() {
        let camera = main_camera();
        let centre = camera.centre_px();
        assert!(camera.project(DVec3::new(15.0, 0.0, 0.0)).unwrap().x > centre.x);
        assert!(camera.project(DVec3::new(10.0, 2.0, 0.0)).unwrap().y < centre.y);
    }

    #[test]
    fn ground_point_inverts_projection_with_distortion() {
        for k1 in [-0.2, 0.0, 0.15] {
            let camera = Camera { k1, ..main_camera() };
            for (x, z) in [(0.0, 0.0), (25.0, -30.0), (-8.0, 20.0)] {
                let world = DVec3::new(x, 0.0, z);
                let back = camera.ground_point(camera.project(world).unwrap()).unwrap();
                assert!((back - world).length() < 1e-6, "k1 {k1}: {world} came back as {back}");
            }
        }
    }

    #[test]
    fn what_a_lens_cannot_show_is_not_folded_into_the_picture() {
        let camera = Camera { k1: -0.1, ..main_camera() };
        let aside = |tangent: f64| {
            let ahead = camera.position + camera.forward() * 10.0;
            camera.project(ahead + camera.rotation.row(0) * 10.0 * tangent)
        };
        assert!(aside(1.0).unwrap().x > aside(0.5).unwrap().x);
        // The formula alone would put this point at a tangent of 0.3, in the middle of the picture.
        assert!((3.0 * (1.0 - 0.1 * 9.0) - 0.3f64).abs() < 1e-12);
        assert_eq!(aside(3.0), None);
    }

    #[test]
    fn behind_the_camera_is_not_projected() {
        assert_eq!(main_camera().project(DVec3::new(3.0, 15.0, 200.0)), None);
    }
}
