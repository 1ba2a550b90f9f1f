//! Rays through pixels with the lens's radial distortion undone, fast enough for every pixel of every frame.

use glam::{Mat3, Vec2, Vec3};
use protocol::camera::Camera;

/// Rays of one camera.
#[derive(Clone, Debug)]
pub struct PixelRays {
    /// Where all rays start, world metres.
    pub origin: Vec3,
    right: Vec3,
    down: Vec3,
    forward: Vec3,
    per_focal: f32,
    centre: Vec2,
    /// Undistorted over distorted radius for equal steps of the squared distorted radius; empty without distortion.
    factors: Vec<f32>,
    steps_per_unit: f32,
}

/// One pixel's view.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Direction, of length 1 along the optical axis.
    pub direction: Vec3,
    /// How the direction changes to the next pixel on the right.
    pub across: Vec3,
    /// How the direction changes to the next pixel below.
    pub down: Vec3,
}

impl PixelRays {
    /// The rays of a camera, valid over its picture and one third of its width around.
    #[must_use]
    pub fn new(camera: &Camera) -> Self {
        let back: Mat3 = camera.rotation.as_mat3().transpose();
        let mut rays = Self {
            origin: camera.position.as_vec3(),
            right: back.x_axis,
            down: back.y_axis,
            forward: back.z_axis,
            per_focal: (1.0 / camera.focal_px) as f32,
            centre: camera.centre_px().as_vec2(),
            factors: Vec::new(),
            steps_per_unit: 0.0,
        };
        if camera.k1 != 0.0 {
            const STEPS: usize = 2048;
            let far = camera.centre_px().length() / camera.focal_px
                + 0.33 * f64::from(camera.width_px) / camera.focal_px;
            let most = far * far;
            rays.steps_per_unit = (STEPS as f64 / most) as f32;
            rays.factors =
                (0..=STEPS + 1).map(|k| undistort(camera.k1, k as f64 / STEPS as f64 * most)).collect();
        }
        rays
    }

    /// The view through a pixel.
    #[must_use]
    pub fn through(&self, pixel: Vec2) -> View {
        let mut n = (pixel - self.centre) * self.per_focal;
        let mut step = self.per_focal;
        if self.factors.len() > 1 {
            let place = (n.length_squared() * self.steps_per_unit).min((self.factors.len() - 2) as f32);
            let index = place as usize;
            let factor = self.factors[index]
                + (self.factors[index + 1] - self.factors[index]) * (place - index as f32);
            n *= factor;
            step *= factor;
        }
        View {
            direction: self.forward + self.right * n.x + self.down * n.y,
            across: self.right * step,
            down: self.down * step,
        }
    }
}

/// Undistorted over distorted radius where the distorted radius squared is `square`, by Newton's method.
fn undistort(k1: f64, square: f64) -> f32 {
    let distorted = square.sqrt();
    if distorted < 1e-9 {
        return 1.0;
    }
    let mut radius = distorted;
    for _ in 0..20 {
        let slope = 1.0 + 3.0 * k1 * radius * radius;
        if slope < 0.05 {
            break; // beyond the edge of what the lens can show
        }
        radius -= (radius * (1.0 + k1 * radius * radius) - distorted) / slope;
    }
    (radius / distorted) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};

    #[test]
    fn rays_agree_with_the_projection_within_a_hundredth_of_a_pixel() {
        for (k1, focal) in [(0.0, 1800.0), (-0.09, 1250.0), (0.25, 4200.0), (-0.3, 2000.0)] {
            let position = DVec3::new(6.0, 18.0, 66.0);
            let camera =
                Camera { k1, ..Camera::looking_at((1280, 720), focal, position, DVec3::new(15.0, 0.0, 2.0)) };
            let rays = PixelRays::new(&camera);
            for pixel in [[0.0, 719.0], [1279.0, 700.0], [640.0, 360.0], [90.0, 210.0], [1100.0, 400.0]] {
                let view = rays.through(DVec2::from(pixel).as_vec2());
                let world = position + view.direction.as_dvec3() * 80.0;
                let back = camera.project(world).unwrap();
                assert!(back.distance(DVec2::from(pixel)) < 0.01, "k1 {k1}: {pixel:?} came back as {back}");
            }
        }
    }
}
