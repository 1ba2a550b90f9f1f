//! How near the cameras are to the truth: reprojection error at 960×540, completeness, overlap of the visible pitch.
//!
//! Two kinds of folders. A rendered clip (`truth.json`, `clip.mp4`, `correspondences.json`): every camera is known. Annotated
//! pictures (`pitch_points.json`, `images/`, `labels/`, SoccerNet's keypoints in the YOLO pose format): four of the
//! annotated points of each picture are given to the fit, and the error is taken at the others only.

mod annotated;

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};
use protocol::{
    camera::Camera,
    pitch::{
        CIRCLE_RADIUS_M, GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M, GOAL_HEIGHT_M, GOAL_WIDTH_M,
        PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M, PENALTY_MARK_M, Pitch,
    },
};
use serde::{Deserialize, Serialize};

pub use annotated::{AnnotatedView, annotated_views};

use crate::{
    calibration::{Calibration, CalibrationError, calibrate},
    ingest::Clip,
    report::Progress,
};

/// Errors are stated for pictures of this width, whatever the picture's own.
const STATED_WIDTH_PX: f64 = 960.0;
/// Frames with fewer annotated points do not count.
const LEAST_POINTS: usize = 5;
/// Most bytes of one text file of a data folder.
const MAX_FILE_BYTES: u64 = 512 << 20;
/// Spacing of the grid on which the overlap of visible pitch areas is counted, metres.
const AREA_GRID_M: f64 = 0.5;

/// Figures of the calibration stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CalibrationFigures {
    /// Frames with at least five annotated points.
    pub frames: usize,
    /// Of these, frames that got a camera.
    pub solved: usize,
    /// `solved / frames`.
    pub completeness: f64,
    /// Points at which the error is measured.
    pub points: usize,
    /// Median reprojection error over all points, pixels at 960×540.
    pub reprojection_error_median_px: f64,
    /// Below this lie 95 % of the points, pixels at 960×540.
    pub reprojection_error_p95_px: f64,
    /// Root mean square error, pixels at 960×540.
    pub reprojection_error_rms_px: f64,
    /// Mean overlap of the visible pitch areas (intersection over union), where the true camera is known.
    pub iou_part_mean: Option<f64>,
    /// Median over frames of the line residual that the stage reports, pixels of the picture.
    pub line_residual_median_px: f64,
}

/// Why the stage could not be evaluated on a folder.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationEvaluationError {
    /// The folder holds neither kind of truth.
    #[error(
        "{path}: neither truth.json (a rendered clip) nor pitch_points.json (annotated pictures) is in it; give a folder \
         that `reconstructor synthesize` wrote, or SoccerNet keypoints"
    )]
    NoTruth {
        /// The folder.
        path: PathBuf,
    },
    /// A file of the folder cannot be read or understood.
    #[error("{path}: {reason}; restore the file from its source")]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The stage itself failed on the whole clip.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Evaluates the stage on a folder with truth.
///
/// # Errors
/// When the folder has no truth that can be read, or its clip cannot be calibrated at all.
pub fn evaluate(data: &Path, progress: &Progress) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    if data.join("truth.json").is_file() {
        rendered_clip(data, progress)
    } else if data.join("pitch_points.json").is_file() {
        annotated::evaluate(data, progress)
    } else {
        Err(CalibrationEvaluationError::NoTruth { path: data.into() })
    }
}

/// Errors of one frame.
#[derive(Clone, Debug, Default)]
struct FrameErrors {
    solved: bool,
    errors_px: Vec<f64>,
    iou: Option<f64>,
    line_residual_px: Option<f64>,
}

fn summary(frames: &[FrameErrors]) -> CalibrationFigures {
    let mut errors: Vec<f64> = frames.iter().flat_map(|frame| frame.errors_px.iter().copied()).collect();
    errors.sort_by(f64::total_cmp);
    let at = |share: f64| errors.get((share * errors.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    let ious: Vec<f64> = frames.iter().filter_map(|frame| frame.iou).collect();
    let mut residuals: Vec<f64> = frames.iter().filter_map(|frame| frame.line_residual_px).collect();
    residuals.sort_by(f64::total_cmp);
    let solved = frames.iter().filter(|frame| frame.solved).count();
    CalibrationFigures {
        frames: frames.len(),
        solved,
        completeness: solved as f64 / frames.len().max(1) as f64,
        points: errors.len(),
        reprojection_error_median_px: at(0.5),
        reprojection_error_p95_px: at(0.95),
        reprojection_error_rms_px: (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64)
            .sqrt(),
        iou_part_mean: (!ious.is_empty()).then(|| ious.iter().sum::<f64>() / ious.len() as f64),
        line_residual_median_px: residuals.get(residuals.len() / 2).copied().unwrap_or(f64::NAN),
    }
}

#[derive(Deserialize)]
struct Truth {
    pitch: Pitch,
}

#[derive(Deserialize)]
struct TrueFrame {
    camera: Camera,
}

fn rendered_clip(data: &Path, progress: &Progress) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    let truth: Truth = parse(&data.join("truth.json"))?;
    let true_frames: Vec<TrueFrame> = parse_lines(&data.join("frames.jsonl"))?;
    let given = Calibration::read(&data.join("correspondences.json"))?;
    let clip = Clip::open(&data.join("clip.mp4"), None).map_err(CalibrationError::from)?;
    let estimates = calibrate(&clip, &[], &given, progress)?;
    let points = pitch_points(&truth.pitch);
    let frames: Vec<FrameErrors> = true_frames
        .iter()
        .zip(&estimates)
        .filter_map(|(truth_frame, estimate)| {
            let true_camera = &truth_frame.camera;
            let seen: Vec<DVec3> = points
                .iter()
                .copied()
                .filter(|&point| true_camera.project(point).is_some_and(|pixel| true_camera.contains(pixel)))
                .collect();
            if seen.len() < LEAST_POINTS {
                return None;
            }
            let Some(camera) = &estimate.camera else { return Some(FrameErrors::default()) };
            let pairs = seen.iter().filter_map(|&point| Some((point, true_camera.project(point)?)));
            Some(FrameErrors {
                solved: true,
                errors_px: reprojection_errors_px(camera, pairs),
                iou: Some(iou_part(true_camera, camera, &truth.pitch)),
                line_residual_px: estimate.line_residual_median_px,
            })
        })
        .collect();
    Ok(summary(&frames))
}

/// Distances between given pixels and where a camera sees the points, in pixels at 960×540.
fn reprojection_errors_px(camera: &Camera, points: impl Iterator<Item = (DVec3, DVec2)>) -> Vec<f64> {
    let scale = STATED_WIDTH_PX / f64::from(camera.width_px);
    // A point behind the camera is as wrong as a point can be: the diagonal of the picture.
    let behind = STATED_WIDTH_PX * 1.15;
    points.map(|(point, pixel)| camera.project(point).map_or(behind, |p| p.distance(pixel) * scale)).collect()
}

/// Overlap (intersection over union) of the parts of the pitch that two cameras show.
fn iou_part(a: &Camera, b: &Camera, pitch: &Pitch) -> f64 {
    let shows =
        |camera: &Camera, point: DVec3| camera.project(point).is_some_and(|pixel| camera.contains(pixel));
    let (columns, rows) = ((pitch.length_m / AREA_GRID_M) as u32, (pitch.width_m / AREA_GRID_M) as u32);
    let (mut both, mut either) = (0_u32, 0_u32);
    for column in 0..columns {
        for row in 0..rows {
            let x = (f64::from(column) + 0.5) * AREA_GRID_M - pitch.length_m / 2.0;
            let z = (f64::from(row) + 0.5) * AREA_GRID_M - pitch.width_m / 2.0;
            let (in_a, in_b) = (shows(a, DVec3::new(x, 0.0, z)), shows(b, DVec3::new(x, 0.0, z)));
            both += u32::from(in_a && in_b);
            either += u32::from(in_a || in_b);
        }
    }
    if either == 0 { 0.0 } else { f64::from(both) / f64::from(either) }
}

/// Points of a pitch that people annotate: corners, crossings, marks, posts and crossbar ends.
fn pitch_points(pitch: &Pitch) -> Vec<DVec3> {
    let (half_length, half_width) = (pitch.length_m / 2.0, pitch.width_m / 2.0);
    let flat = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let mut points = vec![DVec3::ZERO, flat(-CIRCLE_RADIUS_M, 0.0), flat(CIRCLE_RADIUS_M, 0.0)];
    let arc_half_width = (CIRCLE_RADIUS_M.powi(2) - (PENALTY_AREA_DEPTH_M - PENALTY_MARK_M).powi(2)).sqrt();
    for up in [-1.0, 1.0] {
        points.push(flat(0.0, up * half_width));
        points.push(flat(0.0, up * CIRCLE_RADIUS_M));
        for side in [-1.0, 1.0] {
            let goal_line = side * half_length;
            points.push(flat(goal_line, up * half_width));
            for (depth, width) in
                [(PENALTY_AREA_DEPTH_M, PENALTY_AREA_WIDTH_M), (GOAL_AREA_DEPTH_M, GOAL_AREA_WIDTH_M)]
            {
                points.push(flat(goal_line, up * width / 2.0));
                points.push(flat(goal_line - side * depth, up * width / 2.0));
            }
            points.push(flat(goal_line - side * PENALTY_AREA_DEPTH_M, up * arc_half_width));
            points.push(flat(goal_line, up * GOAL_WIDTH_M / 2.0));
            points.push(DVec3::new(goal_line, GOAL_HEIGHT_M, up * GOAL_WIDTH_M / 2.0));
        }
    }
    points.extend([-1.0, 1.0].map(|side| flat(side * (half_length - PENALTY_MARK_M), 0.0)));
    points
}

fn read(path: &Path) -> Result<String, CalibrationEvaluationError> {
    let failed = |reason: String| CalibrationEvaluationError::File { path: path.into(), reason };
    let file = std::fs::File::open(path).map_err(|e| failed(e.to_string()))?;
    let mut text = String::new();
    file.take(MAX_FILE_BYTES).read_to_string(&mut text).map_err(|e| failed(e.to_string()))?;
    Ok(text)
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, CalibrationEvaluationError> {
    let failed = |reason: String| CalibrationEvaluationError::File { path: path.into(), reason };
    serde_json::from_str(&read(path)?).map_err(|e| failed(e.to_string()))
}

/// A file with one JSON value per line.
fn parse_lines<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Vec<T>, CalibrationEvaluationError> {
    let text = read(path)?;
    text.lines()
        .enumerate()
        .map(|(line, json)| {
            serde_json::from_str(json).map_err(|error| CalibrationEvaluationError::File {
                path: path.into(),
                reason: format!("line {}: {error}", line + 1),
            })
        })
        .collect()
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
    fn every_annotated_point_lies_on_a_marking_or_the_goal() {
        let pitch = Pitch::default();
        let points = pitch_points(&pitch);
        assert_eq!(points.len(), 41);
        let marked: Vec<DVec2> = pitch.markings().iter().flat_map(|marking| marking.sample(0.02)).collect();
        for point in points {
            let near = marked.iter().any(|m| m.distance(DVec2::new(point.x, point.z)) < 0.03);
            assert!(near && (point.y == 0.0 || point.y == GOAL_HEIGHT_M), "{point}");
        }
    }

    #[test]
    fn a_folder_without_truth_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = evaluate(folder.path(), &Progress::hidden()).unwrap_err();
        assert!(matches!(error, CalibrationEvaluationError::NoTruth { .. }));
        std::fs::write(folder.path().join("truth.json"), "{}").unwrap();
        let error = evaluate(folder.path(), &Progress::hidden()).unwrap_err();
        assert!(error.to_string().contains("truth.json"), "{error}");
    }
}
