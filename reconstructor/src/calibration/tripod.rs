//! A main camera stands on a tripod: one position and one lens for the whole shot, fitted to several frames together.
//!
//! Each frame alone hardly tells a camera that moves back from one that zooms out; the frames of a pan together do.

use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use protocol::camera::Camera;

use super::{
    fit::{no_match_cost, pull},
    least_squares::{
        LOG_FOCAL, PARAMETERS, POSITION, RADIAL, ROTATION, Row, minimise, moved, project_with_derivatives,
    },
    lines::LineMap,
    template::{Sample, visible},
};
use crate::{calibration::least_squares::Normal, geometry::PixelBox};

/// Parameters that all frames share: position and radial coefficient.
const SHARED: [usize; 4] = [POSITION, POSITION + 1, POSITION + 2, RADIAL];
/// Parameters of each frame.
const OWN: [usize; 4] = [LOG_FOCAL, ROTATION, ROTATION + 1, ROTATION + 2];
/// Distance at which a point counts half, at 720 rows.
const SCALE_PX: f64 = 4.0;
const ITERATIONS: usize = 40;
/// How far the common position may be from the start, metres, and the usual size of k1.
const POSITION_SIGMA_M: f64 = 6.0;
const RADIAL_SIGMA: f64 = 0.1;

/// A frame that takes part: its camera so far, its line points and its lines.
pub(super) struct View<'a> {
    /// The camera found for the frame alone.
    pub(super) camera: Camera,
    /// Boxes of people.
    pub(super) people: &'a [PixelBox],
    /// The frame's lines.
    pub(super) map: LineMap<'a>,
}

/// One position and radial coefficient for all views, starting from `position`.
pub(super) fn common(views: &[View<'_>], samples: &[Sample], position: DVec3, k1: f64) -> (DVec3, f64) {
    let shown: Vec<Vec<Sample>> =
        views.iter().map(|view| visible(&view.camera, samples, view.people)).collect();
    let mut cameras: Vec<Camera> =
        views.iter().zip(&shown).map(|(view, shown)| placed_at(&view.camera, position, k1, shown)).collect();
    let start = (position, k1);
    let mut damping = 1e-3;
    let mut now = equations(&cameras, views, &shown, start);
    for _ in 0..ITERATIONS {
        let (matrix, gradient, cost) = &now;
        let mut damped = matrix.clone();
        for i in 0..damped.nrows() {
            damped[(i, i)] += damping * damped[(i, i)].max(1e-12);
        }
        let Some(factor) = damped.cholesky() else { break };
        let step = -factor.solve(gradient);
        let candidate: Vec<Camera> =
            cameras.iter().enumerate().map(|(i, camera)| stepped(camera, &step, i)).collect();
        let next = equations(&candidate, views, &shown, start);
        if next.2 <= *cost {
            let done = cost - next.2 < 1e-6 * cost;
            cameras = candidate;
            now = next;
            damping = f64::max(damping * 0.3, 1e-9);
            if done {
                break;
            }
        } else {
            damping *= 8.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    cameras.first().map_or(start, |camera| (camera.position, camera.k1))
}

/// The camera with the same picture of `points`, as nearly as it can, from another position and with another lens.
pub(super) fn placed_at(camera: &Camera, position: DVec3, k1: f64, points: &[Sample]) -> Camera {
    let start = Camera { position, k1, ..*camera };
    let mut free = [false; PARAMETERS];
    for parameter in OWN {
        free[parameter] = true;
    }
    let energy = |candidate: &Camera| {
        let mut normal = Normal::new();
        for sample in points {
            let (Some(wanted), Some((pixel, rows))) =
                (camera.project(sample.point), project_with_derivatives(candidate, sample.point))
            else {
                continue;
            };
            for axis in 0..2 {
                let residual = pixel[axis] - wanted[axis];
                normal.add(&rows[axis], residual, 1.0, residual * residual);
            }
        }
        normal
    };
    minimise(start, free, 30, energy).0
}

fn stepped(camera: &Camera, step: &DVector<f64>, frame: usize) -> Camera {
    let mut own: Row = [0.0; PARAMETERS];
    for (k, parameter) in SHARED.into_iter().enumerate() {
        own[parameter] = step[k];
    }
    for (k, parameter) in OWN.into_iter().enumerate() {
        own[parameter] = step[SHARED.len() + OWN.len() * frame + k];
    }
    moved(camera, &own)
}

/// Column of a camera parameter of a frame in the common system.
fn column(parameter: usize, frame: usize) -> usize {
    match SHARED.iter().position(|&shared| shared == parameter) {
        Some(k) => k,
        None => SHARED.len() + OWN.len() * frame + parameter - LOG_FOCAL,
    }
}

fn equations(
    cameras: &[Camera],
    views: &[View<'_>],
    shown: &[Vec<Sample>],
    start: (DVec3, f64),
) -> (DMatrix<f64>, DVector<f64>, f64) {
    let size = SHARED.len() + OWN.len() * cameras.len();
    let (mut matrix, mut gradient, mut cost) = (DMatrix::zeros(size, size), DVector::zeros(size), 0.0);
    for (frame, ((camera, view), shown)) in cameras.iter().zip(views).zip(shown).enumerate() {
        let scale_px = SCALE_PX * f64::from(camera.height_px) / 720.0;
        let mut normal = Normal::new();
        for sample in shown {
            match pull(camera, sample, &view.map, scale_px) {
                Some(pull) => normal.add(&pull.row, pull.residual, pull.weight, pull.cost),
                None => normal.cost += no_match_cost(scale_px),
            }
        }
        cost += normal.cost;
        for i in 0..PARAMETERS {
            gradient[column(i, frame)] += normal.gradient[i];
            for j in 0..PARAMETERS {
                matrix[(column(i, frame), column(j, frame))] += normal.matrix[(i, j)];
            }
        }
    }
    if let Some(camera) = cameras.first() {
        let differences = (camera.position - start.0).to_array().map(|d| (d, POSITION_SIGMA_M));
        for (k, (difference, sigma)) in differences.into_iter().chain([(camera.k1, RADIAL_SIGMA)]).enumerate()
        {
            matrix[(k, k)] += 1.0 / (sigma * sigma);
            gradient[k] += difference / (sigma * sigma);
            cost += (difference / sigma).powi(2);
        }
    }
    (matrix, gradient, cost)
}
