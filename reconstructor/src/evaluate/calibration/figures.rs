//! The measures of the camera (DESIGN section 6) and how single errors become one figure.

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};
use serde::Serialize;

use super::STATED_WIDTH_PX;
use crate::calibration::ShotFigures;

/// Spacing of the grid on which the overlap of visible pitch areas is counted, metres.
const AREA_GRID_M: f64 = 0.5;
/// A camera that puts a point farther than this from its place is false there, pixels at 960×540.
pub(super) const FALSE_PX: f64 = 20.0;
/// SoccerNet's distance within which a point counts as right, pixels at 960×540.
const JAC_PX: f64 = 5.0;

/// Figures of the calibration stage. What a folder has no truth for is absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CalibrationFigures {
    /// How the cameras were found: `automatic`, or `points given`.
    pub mode: &'static str,
    /// Parts of the fit that were left out.
    pub without: Vec<String>,
    /// Frames that count: with at least five annotated points on the ground, or with a true camera.
    pub frames: usize,
    /// Of these, frames that got a camera.
    pub solved: usize,
    /// `solved / frames`.
    pub completeness: f64,
    /// Points at which the error is measured.
    pub points: usize,
    /// Median reprojection error over all points of all solved frames, pixels at 960×540.
    pub reprojection_median_px: Option<f64>,
    /// Nine of ten points are nearer than this.
    pub reprojection_p90_px: Option<f64>,
    /// Median error of the crossbar's ends, which no fit uses, pixels at 960×540.
    pub crossbar_median_px: Option<f64>,
    /// Crossbar ends measured.
    pub crossbar_points: usize,
    /// Mean over frames of TP / (TP + FN + FP): annotated points within 5 px, farther or not shown, and shown but not
    /// annotated. SoccerNet counts lines by their annotated ends so; here every annotated point counts.
    pub jac5: Option<f64>,
    /// Solved frames in which the world turned by half a turn fits better: behind the goal nothing tells the two ends apart.
    pub turned: usize,
    /// Frames that show no pitch as a whole: fewer than three annotated points on the ground, or a rendered close-up.
    pub frames_without_pitch: usize,
    /// Share of these that got a camera which puts an annotated point more than 20 px off (any camera where it is rendered).
    pub false_camera_rate: Option<f64>,
    /// Overlap of the visible pitch areas (intersection over union): mean and median over all frames, 0 for those without a camera.
    pub iou_part_mean: Option<f64>,
    /// See `iou_part_mean`.
    pub iou_part_median: Option<f64>,
    /// Median distance of the camera from the true place, metres.
    pub centre_error_median_m: Option<f64>,
    /// Median error of the focal length as a share of it.
    pub focal_error_median: Option<f64>,
    /// Median error of where a pixel sees the pitch, metres, over the visible pitch of all solved frames.
    pub ground_error_median_m: Option<f64>,
    /// Median over frames of the line residual that the stage reports, pixels of the picture.
    pub line_residual_median_px: Option<f64>,
    /// Frames by how sure the stage was and how often it was right, nine of ten points within 20 px: (lowest, highest confidence,
    /// frames, right).
    pub reliability: Vec<(f64, f64, usize, usize)>,
    /// What `reliability` counts: the confidence of every best guess, sure enough or not, and whether it was right.
    pub guesses: Vec<(f64, bool)>,
    /// How the cameras of a clip's shots came about.
    pub shots: Vec<ShotFigures>,
    /// Processor time of a frame, seconds on one core, of a clip with decoding it; and the network's share of a picture's.
    pub cpu_s_per_frame: Option<f64>,
    /// See `cpu_s_per_frame`.
    pub network_s_per_frame: Option<f64>,
}

/// Errors of one frame.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameErrors {
    /// Counts for completeness and errors.
    pub(super) counts: bool,
    /// Whether it got a camera.
    pub(super) solved: bool,
    /// At the points on the ground, pixels at 960×540.
    pub(super) errors_px: Vec<f64>,
    /// At the crossbar's ends.
    pub(super) crossbar_px: Vec<f64>,
    /// See [`CalibrationFigures::jac5`].
    pub(super) jac5: Option<f64>,
    pub(super) turned: bool,
    /// Of a frame without a pitch: whether it got a wrong camera.
    pub(super) false_camera: Option<bool>,
    pub(super) iou: Option<f64>,
    pub(super) centre_m: Option<f64>,
    pub(super) focal: Option<f64>,
    pub(super) ground_m: Vec<f64>,
    pub(super) line_residual_px: Option<f64>,
    pub(super) confidence: Option<f64>,
    /// Whether the best guess was right, sure or not.
    pub(super) right: Option<bool>,
}

impl FrameErrors {
    /// Nine of ten points within [`FALSE_PX`], and no camera where there is no pitch.
    pub(super) fn is_right(&self) -> bool {
        let mut errors = self.errors_px.clone();
        errors.sort_by(f64::total_cmp);
        let high = errors.get((0.9 * errors.len() as f64) as usize);
        self.false_camera != Some(true) && high.is_some_and(|&error| error <= FALSE_PX)
    }
}

pub(super) fn summary(frames: &[FrameErrors]) -> CalibrationFigures {
    let all = |of: &dyn Fn(&FrameErrors) -> Vec<f64>| -> Vec<f64> {
        let mut values: Vec<f64> = frames.iter().filter(|frame| frame.counts).flat_map(of).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let at = |values: &[f64], share: f64| values.get((share * values.len() as f64) as usize).copied();
    let mean =
        |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let errors = all(&|frame| frame.errors_px.clone());
    let crossbar = all(&|frame| frame.crossbar_px.clone());
    let ious = all(&|frame| frame.iou.into_iter().collect());
    let counted = frames.iter().filter(|frame| frame.counts).count();
    let solved = frames.iter().filter(|frame| frame.counts && frame.solved).count();
    let empty: Vec<bool> = frames.iter().filter_map(|frame| frame.false_camera).collect();
    let wrong = empty.iter().filter(|wrong| **wrong).count();
    CalibrationFigures {
        frames: counted,
        solved,
        completeness: solved as f64 / counted.max(1) as f64,
        points: errors.len(),
        reprojection_median_px: at(&errors, 0.5),
        reprojection_p90_px: at(&errors, 0.9),
        crossbar_median_px: at(&crossbar, 0.5),
        crossbar_points: crossbar.len(),
        jac5: mean(&all(&|frame| frame.jac5.into_iter().collect())),
        turned: frames.iter().filter(|frame| frame.counts && frame.turned).count(),
        frames_without_pitch: empty.len(),
        false_camera_rate: (!empty.is_empty()).then(|| wrong as f64 / empty.len() as f64),
        iou_part_mean: mean(&ious),
        iou_part_median: at(&ious, 0.5),
        centre_error_median_m: at(&all(&|frame| frame.centre_m.into_iter().collect()), 0.5),
        focal_error_median: at(&all(&|frame| frame.focal.into_iter().collect()), 0.5),
        ground_error_median_m: at(&all(&|frame| frame.ground_m.clone()), 0.5),
        line_residual_median_px: at(&all(&|frame| frame.line_residual_px.into_iter().collect()), 0.5),
        reliability: reliability(frames),
        guesses: frames.iter().filter_map(|frame| frame.confidence.zip(frame.right)).collect(),
        ..CalibrationFigures::default()
    }
}

/// Frames by confidence, and how many of each were right.
fn reliability(frames: &[FrameErrors]) -> Vec<(f64, f64, usize, usize)> {
    let limits = [0.0, 0.25, 0.5, 0.7, 0.85, 0.95, 1.001];
    let band = |low: f64, high: f64| {
        let inside = |frame: &&FrameErrors| frame.confidence.is_some_and(|c| (low..high).contains(&c));
        let chosen: Vec<bool> = frames.iter().filter(inside).filter_map(|frame| frame.right).collect();
        (low, high, chosen.len(), chosen.iter().filter(|right| **right).count())
    };
    limits
        .windows(2)
        .filter_map(|pair| Some(band(*pair.first()?, *pair.get(1)?)))
        .filter(|b| b.2 > 0)
        .collect()
}

/// Distances between given pixels and where a camera sees the points, in pixels at 960×540.
pub(super) fn reprojection_errors_px(
    camera: &Camera,
    points: impl Iterator<Item = (DVec3, DVec2)>,
) -> Vec<f64> {
    let scale = STATED_WIDTH_PX / f64::from(camera.width_px);
    // A point behind the camera is as wrong as a point can be: the diagonal of the picture.
    let behind = STATED_WIDTH_PX * 1.15;
    points.map(|(point, pixel)| camera.project(point).map_or(behind, |p| p.distance(pixel) * scale)).collect()
}

/// TP / (TP + FN + FP) of one frame: `errors_px` at the annotated points, and the number of `others` in view of the camera.
pub(super) fn jac5(errors_px: &[f64], others: usize) -> Option<f64> {
    let right = errors_px.iter().filter(|&&error| error <= JAC_PX).count();
    // An annotated point that is off misses one and shows one where none is.
    let wrong = errors_px.len() - right;
    let all = right + 2 * wrong + others;
    (all > 0).then(|| right as f64 / all as f64)
}

/// Overlap (intersection over union) of the parts of the pitch that two cameras show.
pub(super) fn iou_part(a: &Camera, b: &Camera, pitch: &Pitch) -> f64 {
    let shows = |camera: &Camera, place: DVec2| {
        let point = DVec3::new(place.x, 0.0, place.y);
        camera.project(point).is_some_and(|pixel| camera.contains(pixel))
    };
    overlap(pitch, |place| shows(a, place), |place| shows(b, place))
}

/// Overlap of two parts of a pitch, each told by whether a place (world x, z) belongs to it.
pub(super) fn overlap(pitch: &Pitch, a: impl Fn(DVec2) -> bool, b: impl Fn(DVec2) -> bool) -> f64 {
    let (columns, rows) = ((pitch.length_m / AREA_GRID_M) as u32, (pitch.width_m / AREA_GRID_M) as u32);
    let (mut both, mut either) = (0_u32, 0_u32);
    for column in 0..columns {
        for row in 0..rows {
            let cell = DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5) * AREA_GRID_M;
            let place = cell - DVec2::new(pitch.length_m, pitch.width_m) / 2.0;
            let (in_a, in_b) = (a(place), b(place));
            both += u32::from(in_a && in_b);
            either += u32::from(in_a || in_b);
        }
    }
    if either == 0 { 0.0 } else { f64::from(both) / f64::from(either) }
}

/// The camera in the world turned by half a turn about the centre mark.
pub(super) fn turned(camera: &Camera) -> Camera {
    let half = glam::DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
    Camera { rotation: camera.rotation * half, position: half * camera.position, ..*camera }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::looking_at((1920, 1080), 2600.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(5.0, 0.0, -5.0))
    }

    #[test]
    fn errors_are_stated_at_960_pixels() {
        let camera = camera();
        let shifted = camera.project(DVec3::ZERO).unwrap() + DVec2::new(6.0, 8.0);
        let errors = reprojection_errors_px(&camera, [(DVec3::ZERO, shifted)].into_iter());
        assert!((errors[0] - 5.0).abs() < 1e-9);
    }

    #[test]
    fn the_same_camera_overlaps_fully_and_another_partly() {
        let pitch = Pitch::default();
        assert_eq!(iou_part(&camera(), &camera(), &pitch), 1.0);
        let other = Camera::looking_at(
            (1920, 1080),
            2600.0,
            DVec3::new(0.0, 18.0, 75.0),
            DVec3::new(15.0, 0.0, -5.0),
        );
        assert!((0.3..0.9).contains(&iou_part(&camera(), &other, &pitch)));
    }

    #[test]
    fn half_a_turn_of_the_world_shows_the_opposite_points() {
        let point = DVec3::new(12.0, 0.5, -7.0);
        let opposite = DVec3::new(-12.0, 0.5, 7.0);
        let (a, b) = (camera().project(point).unwrap(), turned(&camera()).project(opposite).unwrap());
        assert!(a.distance(b) < 1e-9);
    }

    #[test]
    fn jac5_counts_misses_and_inventions() {
        assert_eq!(jac5(&[1.0, 4.9], 0), Some(1.0));
        assert_eq!(jac5(&[1.0, 6.0], 1), Some(0.25));
        assert_eq!(jac5(&[], 0), None);
    }

    #[test]
    fn frames_without_a_pitch_count_only_for_false_cameras() {
        let good = FrameErrors {
            counts: true,
            solved: true,
            errors_px: vec![1.0, 2.0, 3.0],
            confidence: Some(0.9),
            right: Some(true),
            ..FrameErrors::default()
        };
        assert!(good.is_right());
        let lost = FrameErrors { counts: true, ..FrameErrors::default() };
        let empty = FrameErrors {
            false_camera: Some(true),
            confidence: Some(0.9),
            right: Some(false),
            ..FrameErrors::default()
        };
        let figures = summary(&[good, lost, empty]);
        assert_eq!((figures.frames, figures.solved, figures.completeness), (2, 1, 0.5));
        assert_eq!((figures.frames_without_pitch, figures.false_camera_rate), (1, Some(1.0)));
        assert_eq!(figures.reprojection_median_px, Some(2.0));
        assert_eq!(figures.reliability, [(0.85, 0.95, 2, 1)]);
    }
}
