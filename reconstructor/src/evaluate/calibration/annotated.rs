//! Annotated broadcast pictures: SoccerNet's pitch keypoints in the YOLO pose format.
//!
//! The camera is found without the points and all of them measure it; or four stand for the correspondences that a person
//! gives, and the others measure.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glam::{DVec2, DVec3};
use image::RgbImage;
use protocol::{camera::Camera, pitch::Pitch};
use rayon::prelude::*;
use serde::Deserialize;

use super::{
    CalibrationEvaluationError, CalibrationFigures, EvaluationOptions, LEAST_POINTS, by_guess,
    figures::{FALSE_PX, FrameErrors, jac5, reprojection_errors_px, summary, turned},
    locate_each, open_picture, parse, read,
};
use crate::{
    calibration::{Calibration, Correspondence, calibrate_pictures, locate::pitch_points},
    report::Progress,
};

#[derive(Deserialize)]
struct NamedPoint {
    name: String,
    xyz_m: [f64; 3],
}

/// A frame with fewer annotated points on the ground shows no pitch as a whole.
const PITCH_POINTS: usize = 3;

pub(super) fn evaluate(
    data: &Path,
    options: &EvaluationOptions,
    progress: &Progress,
) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    let names: BTreeMap<usize, NamedPoint> = parse(&data.join("pitch_points.json"))?;
    let labels = label_files(data)?;
    if options.clicks {
        let frames: Vec<Option<FrameErrors>> = labels
            .par_iter()
            .map(|label| {
                let frame = clicked_picture(data, label, &names);
                progress.advance(1);
                frame
            })
            .collect::<Result<_, _>>()?;
        return Ok(summary(&frames.into_iter().flatten().collect::<Vec<_>>()));
    }
    let pitch = Pitch::default();
    let measured = locate_each(&labels, options, progress, |label, finder| {
        let (picture, points) = annotated(data, label, &names)?;
        let flat = points.iter().filter(|point| point.world_m.y == 0.0).count();
        if (PITCH_POINTS..LEAST_POINTS).contains(&flat) {
            return Ok(None);
        }
        let guess = finder.find(&picture, &pitch)?;
        let frame = by_guess(guess.as_ref(), |camera| located_errors(camera, &points));
        tracing::info!(label = %label.display(), ?guess, ?frame, "measured");
        Ok(Some(frame))
    })?;
    Ok(measured.figures())
}

/// Errors of a camera that was found without the annotated points.
fn located_errors(camera: Option<&Camera>, points: &[Correspondence]) -> FrameErrors {
    let (flat, high): (Vec<&Correspondence>, Vec<&Correspondence>) =
        points.iter().partition(|point| point.world_m.y == 0.0);
    let errors = |camera: &Camera, points: &[&Correspondence]| {
        reprojection_errors_px(camera, points.iter().map(|point| (point.world_m, point.pixel)))
    };
    // Behind a goal nothing in the picture tells the two ends of the pitch apart: the better of both counts.
    let better = camera.map(|&straight| {
        let half_turned = turned(&straight);
        let sum = |camera: &Camera| errors(camera, &points.iter().collect::<Vec<_>>()).iter().sum::<f64>();
        if sum(&half_turned) < sum(&straight) { (half_turned, true) } else { (straight, false) }
    });
    if flat.len() < PITCH_POINTS {
        let wrong = |(camera, _): &(Camera, bool)| {
            let all: Vec<&Correspondence> = points.iter().collect();
            all.is_empty() || errors(camera, &all).iter().any(|&error| error > FALSE_PX)
        };
        let false_camera = Some(better.as_ref().is_some_and(wrong));
        return FrameErrors { false_camera, ..FrameErrors::default() };
    }
    let Some((camera, turned)) = better else {
        return FrameErrors { counts: true, jac5: Some(0.0), ..FrameErrors::default() };
    };
    let errors_px = errors(&camera, &flat);
    let annotated = |world: &DVec3| points.iter().any(|point| point.world_m.distance(*world) < 0.1);
    let others = pitch_points(&Pitch::default())
        .iter()
        .filter(|world| world.y == 0.0 && !annotated(world))
        .filter(|world| camera.project(**world).is_some_and(|pixel| camera.contains(pixel)))
        .count();
    FrameErrors {
        counts: true,
        solved: true,
        turned,
        jac5: jac5(&errors_px, others),
        errors_px,
        crossbar_px: errors(&camera, &high),
        ..FrameErrors::default()
    }
}

/// A picture with the camera that its annotated points and its lines give.
#[derive(Clone, Debug)]
pub struct AnnotatedView {
    /// The picture.
    pub picture: RgbImage,
    /// Its camera.
    pub camera: Camera,
}

/// Every annotated picture that has a camera, in the order of names.
///
/// # Errors
/// When a file cannot be read or is not of the form.
pub fn annotated_views(
    data: &Path,
    progress: &Progress,
) -> Result<Vec<AnnotatedView>, CalibrationEvaluationError> {
    let names: BTreeMap<usize, NamedPoint> = parse(&data.join("pitch_points.json"))?;
    let views: Vec<Option<AnnotatedView>> = label_files(data)?
        .par_iter()
        .map(|label| {
            let (picture, points) = annotated(data, label, &names)?;
            progress.advance(1);
            if points.len() < LEAST_POINTS {
                return Ok(None);
            }
            let calibration = Calibration { frame: 0, pitch: Pitch::default(), points };
            let estimate = calibrate_pictures(vec![picture.clone()], &calibration)
                .ok()
                .and_then(|estimates| estimates.into_iter().next());
            Ok(estimate.and_then(|e| e.camera).map(|camera| AnnotatedView { picture, camera }))
        })
        .collect::<Result<_, CalibrationEvaluationError>>()?;
    Ok(views.into_iter().flatten().collect())
}

/// Errors of one annotated picture whose camera comes from four of its points; `None` when it has too few to count.
fn clicked_picture(
    data: &Path,
    label: &Path,
    names: &BTreeMap<usize, NamedPoint>,
) -> Result<Option<FrameErrors>, CalibrationEvaluationError> {
    let (picture, points) = annotated(data, label, names)?;
    if points.len() < LEAST_POINTS {
        return Ok(None);
    }
    let (given, held_out) = split(&points);
    let calibration = Calibration { frame: 0, pitch: Pitch::default(), points: given };
    let estimate = match calibrate_pictures(vec![picture], &calibration) {
        Ok(estimates) => estimates.into_iter().next().unwrap_or_default(),
        Err(error) => {
            tracing::info!(label = %label.display(), %error, "no camera");
            return Ok(Some(FrameErrors { counts: true, ..FrameErrors::default() }));
        }
    };
    let Some(camera) = &estimate.camera else {
        return Ok(Some(FrameErrors { counts: true, ..FrameErrors::default() }));
    };
    let pairs = held_out.iter().map(|point| (point.world_m, point.pixel));
    Ok(Some(FrameErrors {
        counts: true,
        solved: true,
        errors_px: reprojection_errors_px(camera, pairs),
        line_residual_px: estimate.line_residual_median_px,
        ..FrameErrors::default()
    }))
}

/// The label files, in the order of names.
fn label_files(data: &Path) -> Result<Vec<PathBuf>, CalibrationEvaluationError> {
    let folder = data.join("labels");
    let entries = std::fs::read_dir(&folder)
        .map_err(|error| CalibrationEvaluationError::File { path: folder, reason: error.to_string() })?;
    let mut labels: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    labels.sort();
    Ok(labels)
}

/// The picture of a label and its points.
fn annotated(
    data: &Path,
    label: &Path,
    names: &BTreeMap<usize, NamedPoint>,
) -> Result<(RgbImage, Vec<Correspondence>), CalibrationEvaluationError> {
    let stem = label.file_stem().unwrap_or_default();
    let path = data.join("images").join(stem).with_extension("jpg");
    let picture = open_picture(&path)?;
    let points = label_points(&read(label)?, names, picture.dimensions());
    Ok((picture, points))
}

/// The annotated points of one YOLO pose label: five numbers of the box, then x, y (shares of the picture) and visibility each.
fn label_points(
    text: &str,
    names: &BTreeMap<usize, NamedPoint>,
    (width, height): (u32, u32),
) -> Vec<Correspondence> {
    let numbers: Vec<f64> = text.split_whitespace().skip(5).map_while(|word| word.parse().ok()).collect();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let named =
        numbers.chunks_exact(3).enumerate().filter(|(_, point)| point.get(2).is_some_and(|&v| v > 0.0));
    named
        .filter_map(|(index, point)| {
            let name = names.get(&index)?;
            // Their world: x along the touchline, y towards the main camera, z up.
            let [x, y, z] = name.xyz_m;
            // YOLO counts from the picture's corner, we from the middle of the first pixel.
            let pixel = DVec2::new(*point.first()?, *point.get(1)?) * size - 0.5;
            let inside = pixel.cmpge(DVec2::splat(-0.5)).all() && pixel.cmple(size - 0.5).all();
            inside.then(|| Correspondence { name: name.name.clone(), pixel, world_m: DVec3::new(x, z, y) })
        })
        .collect()
}

/// The points given to the fit (four of the pitch plane, far apart in the picture) and the others.
fn split(points: &[Correspondence]) -> (Vec<Correspondence>, Vec<Correspondence>) {
    let flat: Vec<usize> = (0..points.len()).filter(|&i| points[i].world_m.y == 0.0).collect();
    let mut chosen: Vec<usize> = Vec::new();
    // Four whose least triangle is largest keep clear of one line.
    let mut best = 0.0;
    for (a, &i) in flat.iter().enumerate() {
        for (b, &j) in flat.iter().enumerate().skip(a + 1) {
            for (c, &k) in flat.iter().enumerate().skip(b + 1) {
                for &l in flat.iter().skip(c + 1) {
                    let four = [i, j, k, l];
                    let spread = least_triangle_px2(four.map(|index| points[index].pixel));
                    if spread > best {
                        best = spread;
                        chosen = four.to_vec();
                    }
                }
            }
        }
    }
    let given = chosen.iter().map(|&i| points[i].clone()).collect();
    let held_out = (0..points.len()).filter(|i| !chosen.contains(i)).map(|i| points[i].clone()).collect();
    (given, held_out)
}

/// Area of the smallest of the four triangles that four points make.
fn least_triangle_px2(p: [DVec2; 4]) -> f64 {
    let area = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a).abs() / 2.0;
    let all =
        [area(p[0], p[1], p[2]), area(p[0], p[1], p[3]), area(p[0], p[2], p[3]), area(p[1], p[2], p[3])];
    all.into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn given_points_are_not_measured() {
        let camera =
            Camera::looking_at((1920, 1080), 2600.0, DVec3::new(0.0, 18.0, 75.0), DVec3::new(5.0, 0.0, -5.0));
        let points: Vec<Correspondence> = pitch_points(&Pitch::default())
            .into_iter()
            .filter_map(|world_m| {
                let pixel = camera.project(world_m).filter(|&p| camera.contains(p))?;
                Some(Correspondence { name: String::new(), pixel, world_m })
            })
            .collect();
        let (given, held_out) = split(&points);
        assert_eq!((given.len(), given.len() + held_out.len()), (4, points.len()));
        assert!(held_out.iter().all(|point| !given.contains(point)));
        let calibration = Calibration { frame: 0, pitch: Pitch::default(), points: given };
        calibration.check(1920, 1080).unwrap();
    }

    /// The folder of real pictures, where it is at hand.
    fn real() -> Option<PathBuf> {
        let data =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/calibration/soccernet-keypoints");
        let here = data.exists();
        if !here {
            eprintln!("skipped: {} is not here", data.display());
        }
        here.then_some(data)
    }

    #[test]
    fn cameras_of_real_pictures_are_found() {
        let Some(data) = real().filter(|_| crate::inference::ready()) else { return };
        let figures = evaluate(&data, &EvaluationOptions::default(), &Progress::hidden()).unwrap();
        // docs/calibration.md has the figures; a picture or two may fall otherwise on another processor.
        assert!(figures.frames == 81 && figures.completeness >= 0.87, "{figures:?}");
        assert!(figures.reprojection_median_px.unwrap() <= 3.0, "{figures:?}");
        assert!(figures.crossbar_median_px.unwrap() <= 6.0, "{figures:?}");
        assert!(figures.false_camera_rate.unwrap() <= 0.08, "{figures:?}");
    }

    #[test]
    fn real_pictures_are_calibrated_from_four_points() {
        let Some(data) = real() else { return };
        let clicks = EvaluationOptions { clicks: true, ..EvaluationOptions::default() };
        let figures = evaluate(&data, &clicks, &Progress::hidden()).unwrap();
        assert!(figures.frames > 70, "{figures:?}");
        let median_px = figures.reprojection_median_px.unwrap();
        assert!(figures.completeness >= 0.85 && median_px <= 3.0, "{figures:?}");
    }
}
