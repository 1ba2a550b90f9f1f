//! A main camera stands on a tripod: one position and one lens for the whole shot, fitted to its frames together.
//!
//! Each frame alone hardly tells a camera that moves back from one that zooms out; the frames of a pan together do. The
//! unknowns of a frame (pan, tilt, roll, zoom) touch only that frame's lines, so the normal equations are an arrow and are
//! solved by the Schur complement (Triggs et al., "Bundle adjustment", 2000, section 6): cost grows with the frames, not with
//! their cube. Lines are matched afresh a few times (iterated closest points); in between the matches are held.

use glam::{DVec2, DVec3};
use nalgebra::{Matrix4, SMatrix, SVector, Vector4};
use protocol::camera::Camera;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    fit::{middle_near, no_match_cost, robust},
    least_squares::{
        LOG_FOCAL, Normal, PARAMETERS, POSITION, RADIAL, ROTATION, Row, minimise, moved,
        project_with_derivatives, turn_between,
    },
    sequence::FrameLines,
    template::{Sample, visible},
};

/// Unknowns that all frames share: three of the position, two of the lens.
const SHARED: usize = 5;
type Shared = SVector<f64, SHARED>;
type SharedMatrix = SMatrix<f64, SHARED, SHARED>;
/// Parameters of each frame.
const OWN: [usize; 4] = [LOG_FOCAL, ROTATION, ROTATION + 1, ROTATION + 2];
/// Distances at which a point counts half, at 720 rows, one per round of matching.
const SCALES_PX: [f64; 3] = [6.0, 4.0, 3.0];
/// Steps between two rounds of matching.
const ITERATIONS: usize = 15;
/// How far the common position may be from the start, metres, and the usual size of k1 and of its slope.
const POSITION_SIGMA_M: f64 = 6.0;
const RADIAL_SIGMA: f64 = 0.1;
const SLOPE_SIGMA: f64 = 0.1;
/// How far a frame's zoom (of its logarithm) and angles may be from where they were, radians: what its lines leave open stays.
const OWN_SIGMA: [f64; 4] = [0.05, 0.02, 0.02, 0.004];

/// How a lens distorts over its zoom. What it does to the picture is a matter of where on the sensor light falls, so the
/// coefficient, which counts in units of the focal length, grows with the square of that; and zoom lenses go from barrel
/// to pincushion from wide to long, which the slope follows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// The focal length at which `k1` holds, pixels.
    pub focal_px: f64,
    /// Radial coefficient there.
    pub k1: f64,
    /// Change of the coefficient, at that focal length's scale, with the logarithm of the focal length.
    pub slope: f64,
}

impl Lens {
    /// The radial coefficient at a focal length.
    #[must_use]
    pub fn k1_at(&self, focal_px: f64) -> f64 {
        let zoom = focal_px / self.focal_px;
        (self.k1 + self.slope * zoom.ln()) * zoom * zoom
    }
}

/// A frame that takes part: its lines and its camera so far.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    /// Lines and people.
    pub(super) frame: &'a FrameLines,
    /// The camera found for the frame alone.
    pub(super) camera: Camera,
}

/// What the views agree on.
#[derive(Clone, Debug)]
pub(super) struct Tripod {
    /// Where the camera stands, world metres.
    pub(super) position: DVec3,
    /// Its lens.
    pub(super) lens: Lens,
    /// The cameras of the views, all at that position.
    cameras: Vec<Camera>,
}

/// A point of the pitch and the middle of the painted line it was matched with.
struct Match {
    point: DVec3,
    middle: DVec2,
    /// Across the line, in the picture.
    normal: DVec2,
}

/// One position and lens for all views, starting from `position` and `lens`; `None` of no views.
pub(super) fn adjust(views: &[View<'_>], samples: &[Sample], position: DVec3, lens: Lens) -> Option<Tripod> {
    let shown: Vec<Vec<Sample>> =
        views.par_iter().map(|view| visible(&view.camera, samples, &view.frame.people)).collect();
    let cameras: Vec<Camera> = views
        .par_iter()
        .zip(&shown)
        .map(|(view, shown)| placed_at(&view.camera, position, &lens, shown))
        .collect();
    if cameras.is_empty() {
        return None;
    }
    let mut tripod = Tripod { position, lens, cameras };
    for scale_px in SCALES_PX {
        let matched: Vec<Vec<Match>> = tripod
            .cameras
            .par_iter()
            .zip(views)
            .zip(&shown)
            .map(|((camera, view), shown)| matches(camera, view.frame, shown))
            .collect();
        descend(&mut tripod, &matched, position, scale_px);
    }
    Some(tripod)
}

/// The camera with the same picture of `points`, as nearly as it can, from another position and with another lens.
pub(super) fn placed_at(camera: &Camera, position: DVec3, lens: &Lens, points: &[Sample]) -> Camera {
    let start = Camera { position, k1: lens.k1_at(camera.focal_px), ..*camera };
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

/// The lines that the points of a frame lie on.
fn matches(camera: &Camera, frame: &FrameLines, shown: &[Sample]) -> Vec<Match> {
    let map = frame.lines.map();
    let found = shown.iter().filter_map(|sample| {
        let pixel = camera.project(sample.point)?;
        let normal = sample.normal(camera, pixel)?;
        let middle = middle_near(camera, pixel, normal, &map)?;
        Some(Match { point: sample.point, middle, normal })
    });
    found.collect()
}

/// The part of the equations that belongs to one frame.
struct Block {
    shared: SharedMatrix,
    cross: SMatrix<f64, SHARED, 4>,
    own: Matrix4<f64>,
    shared_gradient: Shared,
    own_gradient: Vector4<f64>,
    cost: f64,
}

/// Levenberg–Marquardt on held matches; the position is expected near `place`.
fn descend(tripod: &mut Tripod, matched: &[Vec<Match>], place: DVec3, scale_720_px: f64) {
    let before = tripod.cameras.clone();
    let equations = |tripod: &Tripod| -> (Vec<Block>, f64) {
        let blocks: Vec<Block> = tripod
            .cameras
            .par_iter()
            .zip(&before)
            .zip(matched)
            .map(|((camera, before), matched)| block(camera, before, &tripod.lens, matched, scale_720_px))
            .collect();
        let expected: f64 = prior(tripod, place).iter().map(|(off, sigma)| (off / sigma).powi(2)).sum();
        let cost = blocks.iter().map(|block| block.cost).sum::<f64>() + expected;
        (blocks, cost)
    };
    let mut damping = 1e-3;
    let (mut blocks, mut cost) = equations(tripod);
    for _ in 0..ITERATIONS {
        let Some((shared, own)) = solve(&blocks, &prior(tripod, place), damping) else { return };
        let candidate = stepped(tripod, &shared, &own);
        let (next, next_cost) = equations(&candidate);
        if next_cost <= cost {
            let done = cost - next_cost < 1e-6 * cost;
            *tripod = candidate;
            (blocks, cost) = (next, next_cost);
            damping = f64::max(damping * 0.3, 1e-9);
            if done {
                return;
            }
        } else {
            damping *= 8.0;
            if damping > 1e6 {
                return;
            }
        }
    }
}

/// How far the shared unknowns are from where they are expected, and how far they may be.
fn prior(tripod: &Tripod, place: DVec3) -> [(f64, f64); SHARED] {
    let [x, y, z] = (tripod.position - place).to_array().map(|off| (off, POSITION_SIGMA_M));
    [x, y, z, (tripod.lens.k1, RADIAL_SIGMA), (tripod.lens.slope, SLOPE_SIGMA)]
}

fn block(camera: &Camera, before: &Camera, lens: &Lens, matched: &[Match], scale_720_px: f64) -> Block {
    let scale_px = scale_720_px * f64::from(camera.height_px) / 720.0;
    let mut normal = Normal::new();
    for found in matched {
        match project_with_derivatives(camera, found.point) {
            Some((pixel, rows)) => {
                let across = found.normal;
                let row = std::array::from_fn(|i| across.x * rows[0][i] + across.y * rows[1][i]);
                let residual = (pixel - found.middle).dot(across);
                let (weight, cost) = robust(residual, scale_px);
                normal.add(&row, residual, weight, cost);
            }
            None => normal.cost += no_match_cost(scale_px),
        }
    }
    let turn = turn_between(&before.rotation, &camera.rotation);
    let off = [(camera.focal_px / before.focal_px).ln(), turn.x, turn.y, turn.z];
    for ((parameter, off), sigma) in OWN.into_iter().zip(off).zip(OWN_SIGMA) {
        normal.expect(parameter, off, sigma);
    }
    // How the camera's parameters follow from the shared unknowns and the frame's own: k1 is the lens's at its focal length.
    let zoom = camera.focal_px / lens.focal_px;
    let scale = zoom * zoom;
    let mut by_shared = SMatrix::<f64, PARAMETERS, SHARED>::zeros();
    for axis in 0..3 {
        by_shared[(POSITION + axis, axis)] = 1.0;
    }
    by_shared[(RADIAL, 3)] = scale;
    by_shared[(RADIAL, 4)] = scale * zoom.ln();
    let mut by_own = SMatrix::<f64, PARAMETERS, 4>::zeros();
    for (column, parameter) in OWN.into_iter().enumerate() {
        by_own[(parameter, column)] = 1.0;
    }
    by_own[(RADIAL, 0)] = 2.0 * camera.k1 + scale * lens.slope;
    let (to_shared, to_own) = (by_shared.transpose(), by_own.transpose());
    Block {
        shared: to_shared * normal.matrix * by_shared,
        cross: to_shared * normal.matrix * by_own,
        own: to_own * normal.matrix * by_own,
        shared_gradient: to_shared * normal.gradient,
        own_gradient: to_own * normal.gradient,
        cost: normal.cost,
    }
}

/// The step of the shared unknowns and of each frame's own.
fn solve(
    blocks: &[Block],
    prior: &[(f64, f64); SHARED],
    damping: f64,
) -> Option<(Shared, Vec<Vector4<f64>>)> {
    let (mut shared, mut right) = (SharedMatrix::zeros(), Shared::zeros());
    for (i, (off, sigma)) in prior.iter().enumerate() {
        shared[(i, i)] += 1.0 / (sigma * sigma);
        right[i] -= off / (sigma * sigma);
    }
    for block in blocks {
        shared += block.shared;
        right -= block.shared_gradient;
    }
    for i in 0..SHARED {
        shared[(i, i)] *= 1.0 + damping;
    }
    let mut own = Vec::with_capacity(blocks.len());
    for block in blocks {
        let mut matrix = block.own;
        for i in 0..4 {
            matrix[(i, i)] *= 1.0 + damping;
        }
        let factor = matrix.cholesky()?;
        let by_shared = factor.solve(&block.cross.transpose());
        let alone = factor.solve(&block.own_gradient);
        shared -= block.cross * by_shared;
        right += block.cross * alone;
        own.push((by_shared, alone));
    }
    let shared_step = shared.cholesky()?.solve(&right);
    let own_steps = own.iter().map(|(by_shared, alone)| -(alone + by_shared * shared_step)).collect();
    Some((shared_step, own_steps))
}

fn stepped(tripod: &Tripod, shared: &Shared, own: &[Vector4<f64>]) -> Tripod {
    let position = tripod.position + DVec3::new(shared[0], shared[1], shared[2]);
    let lens = Lens { k1: tripod.lens.k1 + shared[3], slope: tripod.lens.slope + shared[4], ..tripod.lens };
    let turned = tripod.cameras.iter().zip(own).map(|(camera, own)| {
        let mut step: Row = [0.0; PARAMETERS];
        for (k, parameter) in OWN.into_iter().enumerate() {
            step[parameter] = own[k];
        }
        let camera = moved(camera, &step);
        Camera { position, k1: lens.k1_at(camera.focal_px), ..camera }
    });
    Tripod { position, lens, cameras: turned.collect() }
}
