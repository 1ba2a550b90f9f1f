//! Rendered clips and rendered pictures, whose cameras are known.

use std::path::Path;

use glam::{DVec2, DVec3};
use protocol::{camera::Camera, pitch::Pitch};
use serde::{Deserialize, de::IgnoredAny};
use synthesis::shots::ShotKind;

use super::{
    CalibrationEvaluationError, CalibrationFigures, EvaluationOptions, LEAST_POINTS, by_guess,
    figures::{FrameErrors, iou_part, jac5, reprojection_errors_px, summary, turned},
    locate_each, open_picture, parse, parse_lines,
};
use crate::{
    calibration::{
        Calibration, CalibrationError, ClipCameras, FindCamera, Finders, Known, calibrate, calibrate_shots,
        locate::{Locator, pitch_points},
    },
    inference::InferenceError,
    ingest::Clip,
    report::{Progress, process_cpu_s},
    shots,
};

/// Spacing of the pixels at which the error on the ground is taken, as a share of the picture's width.
const GROUND_STEP: f64 = 1.0 / 16.0;

#[derive(Deserialize)]
struct Truth {
    pitch: Pitch,
}

#[derive(Deserialize)]
struct TrueFrame {
    camera: Camera,
    shot: ShotTruth,
}

#[derive(Deserialize)]
struct ShotTruth {
    kind: ShotKind,
    /// The other picture of a dissolve.
    mixed_with: Option<IgnoredAny>,
}

/// A rendered clip: over its shots without help, or from the correspondences that came with it. Frames of dissolves do not count.
pub(super) fn clip(
    data: &Path,
    options: &EvaluationOptions,
    progress: &Progress,
) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    let truth: Truth = parse(&data.join("truth.json"))?;
    let true_frames: Vec<TrueFrame> = parse_lines(&data.join("frames.jsonl"))?;
    let path = data.join("clip.mp4");
    let started = process_cpu_s();
    let cameras = if options.clicks {
        let given = Calibration::read(&data.join("correspondences.json"))?;
        let clip = Clip::open(&path, None).map_err(CalibrationError::from)?;
        ClipCameras { frames: calibrate(&clip, &[], &given, progress)?, shots: Vec::new() }
    } else {
        let (clip, shots) = shots::open(&path, None).map_err(CalibrationError::from)?;
        let load = || -> Result<Box<dyn FindCamera>, InferenceError> {
            Ok(Box::new(Locator::load()?.with_terms(options.terms())))
        };
        let finders = Finders::new(&load);
        let known =
            Known { pitch: truth.pitch, given: None, finders: Some(&finders), apart: options.apart() };
        calibrate_shots(&clip, &[], &shots, &known, progress)?
    };
    let cpu_s = process_cpu_s() - started;
    let points = pitch_points(&truth.pitch);
    let frames: Vec<FrameErrors> = true_frames
        .iter()
        .zip(&cameras.frames)
        .filter(|(frame, _)| frame.shot.mixed_with.is_none())
        .filter_map(|(frame, estimate)| {
            let view =
                View { camera: &frame.camera, kind: frame.shot.kind, pitch: &truth.pitch, points: &points };
            let errors = view.errors(estimate.camera.as_ref())?;
            Some(FrameErrors { line_residual_px: estimate.line_residual_median_px, ..errors })
        })
        .collect();
    Ok(CalibrationFigures {
        shots: cameras.shots,
        cpu_s_per_frame: (cpu_s > 0.0).then(|| cpu_s / true_frames.len().max(1) as f64),
        ..summary(&frames)
    })
}

#[derive(Deserialize)]
struct PictureTruth {
    name: String,
    pitch: Pitch,
    camera: Camera,
    shot: ShotTruth,
}

/// Rendered pictures, each alone.
pub(super) fn pictures(
    data: &Path,
    options: &EvaluationOptions,
    progress: &Progress,
) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    let truths: Vec<PictureTruth> = parse_lines(&data.join("frames.jsonl"))?;
    let measured = locate_each(&truths, options, progress, |truth, finder| {
        let points = pitch_points(&truth.pitch);
        let view =
            View { camera: &truth.camera, kind: truth.shot.kind, pitch: &truth.pitch, points: &points };
        if view.errors(None).is_none() {
            return Ok(None);
        }
        let picture = open_picture(&data.join("images").join(&truth.name).with_extension("jpg"))?;
        let guess = finder.find(&picture, &truth.pitch)?;
        let frame = by_guess(guess.as_ref(), |camera| view.errors(camera).unwrap_or_default());
        tracing::info!(picture = truth.name, right = ?frame.right, confidence = ?frame.confidence, "measured");
        Ok(Some(frame))
    })?;
    Ok(measured.figures())
}

/// What a rendered frame truly shows.
struct View<'a> {
    camera: &'a Camera,
    kind: ShotKind,
    pitch: &'a Pitch,
    points: &'a [DVec3],
}

impl View<'_> {
    /// Errors of a camera found for the frame, or of none; `None` when the frame shows too few points to count.
    fn errors(&self, found: Option<&Camera>) -> Option<FrameErrors> {
        if self.kind == ShotKind::CloseUp {
            return Some(FrameErrors { false_camera: Some(found.is_some()), ..FrameErrors::default() });
        }
        if seen(self.camera, self.points).len() < LEAST_POINTS {
            return None;
        }
        let of = |truth: &Camera| errors(truth, found, self.pitch, &seen(truth, self.points));
        // Behind a goal nothing in the picture tells the two ends of the pitch apart: the better of both counts.
        let (straight, half_turned) = (of(self.camera), of(&turned(self.camera)));
        let sum = |frame: &FrameErrors| frame.errors_px.iter().sum::<f64>();
        let turned = sum(&half_turned) < sum(&straight);
        Some(FrameErrors { turned, ..if turned { half_turned } else { straight } })
    }
}

/// Points inside the picture of a camera.
fn seen(camera: &Camera, points: &[DVec3]) -> Vec<DVec3> {
    let inside = |point: &&DVec3| camera.project(**point).is_some_and(|pixel| camera.contains(pixel));
    points.iter().filter(inside).copied().collect()
}

fn errors(truth: &Camera, found: Option<&Camera>, pitch: &Pitch, seen: &[DVec3]) -> FrameErrors {
    let lost = FrameErrors { counts: true, iou: Some(0.0), jac5: Some(0.0), ..FrameErrors::default() };
    let Some(camera) = found else { return lost };
    let of = |high: bool| {
        let chosen = seen.iter().copied().filter(move |point| (point.y > 0.0) == high);
        reprojection_errors_px(camera, chosen.filter_map(|point| Some((point, truth.project(point)?))))
    };
    let errors_px = of(false);
    FrameErrors {
        counts: true,
        solved: true,
        jac5: jac5(&errors_px, 0),
        errors_px,
        crossbar_px: of(true),
        iou: Some(iou_part(truth, camera, pitch)),
        centre_m: Some(camera.position.distance(truth.position)),
        focal: Some((camera.focal_px / truth.focal_px - 1.0).abs()),
        ground_m: ground_errors_m(truth, camera, pitch),
        ..FrameErrors::default()
    }
}

/// How far apart two cameras see the pitch at pixels spread over the picture, metres.
fn ground_errors_m(truth: &Camera, found: &Camera, pitch: &Pitch) -> Vec<f64> {
    let (width, height) = (f64::from(truth.width_px), f64::from(truth.height_px));
    let step = GROUND_STEP * width;
    let (columns, rows) = ((width / step) as u32, (height / step) as u32);
    let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    places
        .filter_map(|(column, row)| {
            let pixel = DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5) * step;
            let place = truth.ground_point(pixel)?;
            let on_pitch = pitch.contains(DVec2::new(place.x, place.z), 0.0);
            on_pitch.then(|| found.ground_point(pixel).map_or(f64::INFINITY, |other| other.distance(place)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use synthesis::dataset::{FrameOptions, Split, broadcast_frames};

    use super::{super::evaluate, *};

    /// Also holds the names in `calibration::locate` and those that the shipped network was trained with together.
    #[test]
    fn the_shipped_network_finds_main_cameras_and_none_in_close_ups() {
        if !crate::inference::ready() {
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let options = FrameOptions {
            out: folder.path().to_owned(),
            count: 6,
            per_match: 2,
            seed: 77,
            split: Split::Test,
            size_px: (640, 360),
            maps: false,
            kinds: vec![ShotKind::Main, ShotKind::Main, ShotKind::CloseUp],
        };
        broadcast_frames(&options, |_| ()).unwrap();
        let figures = evaluate(folder.path(), &EvaluationOptions::default(), &Progress::hidden()).unwrap();
        assert_eq!((figures.frames_without_pitch, figures.false_camera_rate), (2, Some(0.0)), "{figures:?}");
        assert!(figures.frames >= 3 && figures.completeness > 0.7, "{figures:?}");
        assert!(figures.ground_error_median_m.unwrap() < 0.3, "{figures:?}");
    }
}
