//! The energy of section 4.1 for one frame, and its minimum near an expected camera.
//!
//! Three changes to the paper's sum of squared distances: distances are robust (Geman–McClure, from coarse to fine), so that a
//! line nobody painted pulls no more than a bounded amount; the set of points is fixed before the search and a point that
//! leaves the picture costs as much as one without any line near it, so that losing points never pays; and the camera is
//! expected near where its motion takes it, which decides what a frame with few lines leaves open.

use glam::DVec2;
use protocol::camera::Camera;

use super::{
    least_squares::{
        LOG_FOCAL, Normal, PARAMETERS, POSITION, RADIAL, ROTATION, Row, minimise, project_with_derivatives,
        turn_between,
    },
    lines::LineMap,
    template::{Sample, visible},
};
use crate::geometry::PixelBox;

/// Distances at which a point counts half, one after the other, at 720 rows.
const SCALES_PX: [f64; 3] = [12.0, 5.0, 2.5];
/// Error of a line's middle, pixels, and how many neighbouring points share one error.
const LINE_SIGMA_PX: f64 = 1.0;
const POINTS_PER_ERROR: f64 = 6.0;
/// A nearest line pixel that is farther than this along the line is the end of another line, at 720 rows.
const MOST_ALONG_PX: f64 = 6.0;

/// Where a camera is expected before the lines are looked at: standard deviations of its parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expectation {
    /// The camera expected.
    pub(super) camera: Camera,
    /// Standard deviation of each parameter about it; 0 when it must not move.
    pub(super) sigma: Row,
}

/// What one point of the lines has to say.
pub(super) struct Pull {
    /// Derivatives of the signed distance across the line.
    pub(super) row: Row,
    /// Signed distance across the line, pixels.
    pub(super) residual: f64,
    /// Weight of the residual in the normal equations.
    pub(super) weight: f64,
    /// Robust cost, in the same unit.
    pub(super) cost: f64,
}

impl Expectation {
    /// How far a camera is from the one expected.
    fn terms(&self, camera: &Camera) -> Normal {
        let mut normal = Normal::new();
        let turn = turn_between(&self.camera.rotation, &camera.rotation);
        let travel = camera.position - self.camera.position;
        let mut difference = [0.0; PARAMETERS];
        difference[LOG_FOCAL] = (camera.focal_px / self.camera.focal_px).ln();
        difference[ROTATION..ROTATION + 3].copy_from_slice(&turn.to_array());
        difference[POSITION..POSITION + 3].copy_from_slice(&travel.to_array());
        difference[RADIAL] = camera.k1 - self.camera.k1;
        for (parameter, (&sigma, &off)) in self.sigma.iter().zip(&difference).enumerate() {
            if sigma > 0.0 {
                normal.expect(parameter, off, sigma);
            }
        }
        normal
    }
}

/// The camera of a frame near an expected one.
pub(super) fn fit(
    expected: &Expectation,
    samples: &[Sample],
    people: &[PixelBox],
    map: &LineMap<'_>,
) -> Camera {
    let free = expected.sigma.map(|sigma| sigma > 0.0);
    onto_lines(&expected.camera, free, samples, people, map, |camera| expected.terms(camera))
}

/// A camera moved onto the painted lines; `further` is what else is known of it, and only `free` parameters move.
pub(super) fn onto_lines(
    start: &Camera,
    free: [bool; PARAMETERS],
    samples: &[Sample],
    people: &[PixelBox],
    map: &LineMap<'_>,
    further: impl Fn(&Camera) -> Normal,
) -> Camera {
    let shown = visible(start, samples, people);
    let picture_scale = f64::from(start.height_px) / 720.0;
    SCALES_PX.iter().fold(*start, |camera, scale| {
        let energy = |candidate: &Camera| {
            let mut normal = lines(candidate, &shown, map, scale * picture_scale);
            normal.join(&further(candidate));
            normal
        };
        minimise(camera, free, 12, energy).0
    })
}

/// How far the points of the lines are from the painted lines.
fn lines(camera: &Camera, shown: &[Sample], map: &LineMap<'_>, scale_px: f64) -> Normal {
    let mut normal = Normal::new();
    for sample in shown {
        match pull(camera, sample, map, scale_px) {
            Some(pull) => normal.add(&pull.row, pull.residual, pull.weight, pull.cost),
            None => normal.cost += no_match_cost(scale_px),
        }
    }
    normal
}

/// What a point without any line near it costs.
pub(super) fn no_match_cost(scale_px: f64) -> f64 {
    scale_px * scale_px / (LINE_SIGMA_PX * LINE_SIGMA_PX * POINTS_PER_ERROR)
}

/// How a point of the lines pulls at a camera; `None` when it is out of the picture or no line is near.
pub(super) fn pull(camera: &Camera, sample: &Sample, map: &LineMap<'_>, scale_px: f64) -> Option<Pull> {
    let (pixel, rows) = project_with_derivatives(camera, sample.point)?;
    let normal = sample.normal(camera, pixel)?;
    let residual = (pixel - middle_near(camera, pixel, normal, map)?).dot(normal);
    let row = std::array::from_fn(|i| normal.x * rows[0][i] + normal.y * rows[1][i]);
    let (weight, cost) = robust(residual, scale_px);
    Some(Pull { row, residual, weight, cost })
}

/// The middle of the line near a pixel, unless that is the end of another line.
pub(super) fn middle_near(camera: &Camera, pixel: DVec2, normal: DVec2, map: &LineMap<'_>) -> Option<DVec2> {
    let middle = map.nearest(pixel, normal)?;
    let along = MOST_ALONG_PX * f64::from(camera.height_px) / 720.0;
    ((pixel - middle).dot(normal.perp()).abs() <= along).then_some(middle)
}

/// Weight and cost of a distance across a line (Geman and McClure), in units of a line's error.
pub(super) fn robust(residual_px: f64, scale_px: f64) -> (f64, f64) {
    let squared = residual_px * residual_px;
    let unit = 1.0 / (LINE_SIGMA_PX * LINE_SIGMA_PX * POINTS_PER_ERROR);
    let bounded = geman_mcclure(squared, scale_px);
    (unit * bounded * bounded, unit * squared * bounded)
}

/// What a squared distance counts for of what it would without a bound: 1 at no distance, ½ at `scale_px`.
pub(super) fn geman_mcclure(squared_px: f64, scale_px: f64) -> f64 {
    let scale = scale_px * scale_px;
    scale / (scale + squared_px)
}

/// Median distance in pixels from the visible line points to the nearest line pixel, and the number of points.
pub(super) fn residual(
    camera: &Camera,
    samples: &[Sample],
    people: &[PixelBox],
    map: &LineMap<'_>,
) -> (Option<f64>, usize) {
    let shown = visible(camera, samples, people);
    let pixels = shown.iter().filter_map(|sample| camera.project(sample.point));
    let mut distances: Vec<f64> = pixels.map(|pixel: DVec2| map.distance_px(pixel)).collect();
    distances.sort_by(f64::total_cmp);
    (distances.get(distances.len() / 2).copied(), distances.len())
}
