//! Levenberg–Marquardt over the eight numbers of a camera, with analytic derivatives.
//!
//! The problem is small and its residuals change their number and weights from step to step (robust matching), so the normal
//! equations are summed directly and solved by Cholesky.

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};
use protocol::camera::Camera;

/// Parameters of a camera: log focal length, rotation about the camera's x, y, z axes (radians), position (m), k1.
pub(super) const PARAMETERS: usize = 8;
/// Index of the logarithm of the focal length.
pub(super) const LOG_FOCAL: usize = 0;
/// Index of the first of three rotation angles.
pub(super) const ROTATION: usize = 1;
/// Index of the first of three position coordinates.
pub(super) const POSITION: usize = 4;
/// Index of the radial coefficient.
pub(super) const RADIAL: usize = 7;

/// One row of the Jacobian.
pub(super) type Row = [f64; PARAMETERS];
/// A step in parameter space.
pub(super) type Step = SVector<f64, PARAMETERS>;

/// Steps smaller than this in every parameter end the search: far below a hundredth of a pixel.
const CONVERGED: f64 = 1e-9;

/// The camera after a step.
pub(super) fn moved(camera: &Camera, step: &Row) -> Camera {
    let turn = DVec3::new(step[ROTATION], step[ROTATION + 1], step[ROTATION + 2]);
    let rotation = DMat3::from_quat(DQuat::from_scaled_axis(turn)) * camera.rotation;
    let travel = DVec3::new(step[POSITION], step[POSITION + 1], step[POSITION + 2]);
    Camera {
        focal_px: camera.focal_px * step[LOG_FOCAL].clamp(-1.0, 1.0).exp(),
        k1: camera.k1 + step[RADIAL],
        rotation,
        position: camera.position + travel,
        ..*camera
    }
}

/// Rotation vector (radians, camera axes) that turns `from` into `to`.
pub(super) fn turn_between(from: &DMat3, to: &DMat3) -> DVec3 {
    DQuat::from_mat3(&(*to * from.transpose())).normalize().to_scaled_axis()
}

/// The pixel of a world point and its derivatives; `None` behind the camera.
pub(super) fn project_with_derivatives(camera: &Camera, world: DVec3) -> Option<(DVec2, [Row; 2])> {
    let p = camera.to_camera(world);
    if p.z < 1e-3 {
        return None;
    }
    let n = p.truncate() / p.z;
    let (r2, f) = (n.length_squared(), camera.focal_px);
    let stretch = 1.0 + camera.k1 * r2;
    let offset = n * stretch * f;
    // d(offset)/dn = f (stretch·I + 2 k1 n nᵀ); dn/dp = [1 0 −n.x; 0 1 −n.y] / z.
    let (xx, xy, yy) = (
        f * (stretch + 2.0 * camera.k1 * n.x * n.x),
        f * 2.0 * camera.k1 * n.x * n.y,
        f * (stretch + 2.0 * camera.k1 * n.y * n.y),
    );
    let by_point =
        [DVec3::new(xx, xy, -(xx * n.x + xy * n.y)) / p.z, DVec3::new(xy, yy, -(xy * n.x + yy * n.y)) / p.z];
    let rows = [0, 1].map(|axis| {
        let g = by_point[axis];
        // Turning by ω moves p by ω × p, so the derivative by ω is p × g; moving the camera by c moves p by −R c.
        let turn = p.cross(g);
        let travel = -(camera.rotation.transpose() * g);
        let radial = f * n[axis] * r2;
        [offset[axis], turn.x, turn.y, turn.z, travel.x, travel.y, travel.z, radial]
    });
    Some((offset + camera.centre_px(), rows))
}

/// Sum of weighted squared residuals and their normal equations.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    /// JᵀWJ.
    pub(super) matrix: SMatrix<f64, PARAMETERS, PARAMETERS>,
    /// JᵀWr.
    pub(super) gradient: Step,
    /// The value that is minimised.
    pub(super) cost: f64,
}

impl Normal {
    pub(super) fn new() -> Self {
        Self { matrix: SMatrix::zeros(), gradient: Step::zeros(), cost: 0.0 }
    }

    /// Adds a residual with its derivatives; `weight` enters the equations, `cost` the value.
    pub(super) fn add(&mut self, row: &Row, residual: f64, weight: f64, cost: f64) {
        let row = Step::from_column_slice(row);
        self.matrix.ger(weight, &row, &row, 1.0);
        self.gradient.axpy(weight * residual, &row, 1.0);
        self.cost += cost;
    }

    /// Adds other terms of the same camera.
    pub(super) fn join(&mut self, other: &Self) {
        self.matrix += other.matrix;
        self.gradient += other.gradient;
        self.cost += other.cost;
    }

    /// Adds a prior on one parameter: `difference` from where it is expected, `sigma` of that.
    pub(super) fn expect(&mut self, parameter: usize, difference: f64, sigma: f64) {
        let scaled = difference / sigma;
        self.matrix[(parameter, parameter)] += 1.0 / (sigma * sigma);
        self.gradient[parameter] += scaled / sigma;
        self.cost += scaled * scaled;
    }
}

/// Minimises `evaluate` from `start`, moving only parameters that are `free`. Returns the camera and its cost.
pub(super) fn minimise(
    start: Camera,
    free: [bool; PARAMETERS],
    iterations: usize,
    evaluate: impl Fn(&Camera) -> Normal,
) -> (Camera, f64) {
    let mut camera = start;
    let mut now = evaluate(&camera);
    let mut damping = 1e-4;
    for _ in 0..iterations {
        let mut matrix = now.matrix;
        let mut gradient = now.gradient;
        for i in 0..PARAMETERS {
            matrix[(i, i)] += damping * matrix[(i, i)].max(1e-12);
            if !free[i] {
                matrix.row_mut(i).fill(0.0);
                matrix.column_mut(i).fill(0.0);
                matrix[(i, i)] = 1.0;
                gradient[i] = 0.0;
            }
        }
        let Some(factor) = matrix.cholesky() else {
            damping = f64::max(damping * 10.0, 1e-6);
            if damping > 1e8 {
                break;
            }
            continue;
        };
        let step = -factor.solve(&gradient);
        let candidate = moved(&camera, &step.into());
        let next = evaluate(&candidate);
        if next.cost.is_finite() && next.cost <= now.cost {
            camera = candidate;
            now = next;
            damping = (damping * 0.3).max(1e-9);
            if step.amax() < CONVERGED {
                break;
            }
        } else {
            damping *= 8.0;
            if damping > 1e8 {
                break;
            }
        }
    }
    (camera, now.cost)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_differences() {
        let mut camera =
            Camera::looking_at((1280, 720), 1700.0, DVec3::new(2.0, 18.0, 75.0), DVec3::new(20.0, 0.0, -5.0));
        camera.k1 = 0.12;
        for world in [DVec3::new(5.0, 0.0, -34.0), DVec3::new(40.0, 2.44, 10.0)] {
            let (pixel, rows) = project_with_derivatives(&camera, world).unwrap();
            assert!((pixel - camera.project(world).unwrap()).length() < 1e-9);
            for parameter in 0..PARAMETERS {
                let h = 1e-6;
                let mut step = [0.0; PARAMETERS];
                step[parameter] = h;
                let plus = moved(&camera, &step).project(world).unwrap();
                step[parameter] = -h;
                let minus = moved(&camera, &step).project(world).unwrap();
                let numeric = (plus - minus) / (2.0 * h);
                for axis in 0..2 {
                    let error = (numeric[axis] - rows[axis][parameter]).abs();
                    assert!(error < 1e-3 * (1.0 + numeric[axis].abs()), "parameter {parameter} axis {axis}");
                }
            }
        }
    }

    #[test]
    fn turn_between_is_what_moved_applies() {
        let camera = Camera::looking_at((1280, 720), 1700.0, DVec3::new(2.0, 18.0, 75.0), DVec3::ZERO);
        let mut step = [0.0; PARAMETERS];
        step[ROTATION..ROTATION + 3].copy_from_slice(&[0.02, -0.3, 0.01]);
        let turned = moved(&camera, &step);
        let turn = turn_between(&camera.rotation, &turned.rotation);
        assert!((turn - DVec3::new(0.02, -0.3, 0.01)).length() < 1e-9);
    }
}
