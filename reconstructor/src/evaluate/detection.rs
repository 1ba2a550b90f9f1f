//! How many of the people on the pitch are found, and how much else (DESIGN section 6): by the detector alone, and by what the
//! product makes of it, where the camera and the pose decide who stands on the pitch; and how often the ball is found in a picture
//! alone, before anything is known of the frames around.

use std::path::Path;

use glam::DVec2;
use image::RgbImage;
use protocol::{camera::Camera, pitch::Pitch};
use rayon::prelude::*;
use serde::Serialize;

use super::labelled::{self, LabelError, LabelledPicture};
use crate::{
    ball,
    calibration::{self, FindCamera},
    detection::{BALL_SURE, BallCandidate, DetectionError, Detector, Found as Shown},
    geometry::PixelBox,
    inference::InferenceError,
    pose::{Person, PoseError, PoseEstimator},
    report::{Progress, thread_cpu_s},
};

/// The ball is looked for before the pitch and this far around it, metres.
const BALL_MARGIN_M: f64 = 2.0;

/// Figures of finding people.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DetectionFigures {
    /// Pictures.
    pub pictures: usize,
    /// Of these, pictures whose camera was found; in the others nobody counts as standing on the pitch.
    pub cameras: usize,
    /// Labelled people.
    pub people: usize,
    /// Share of them that have a box of their own.
    pub people_recall: f64,
    /// Share of the boxes that are of a labelled person.
    pub people_precision: f64,
    /// Area under precision over recall, boxes by confidence.
    pub people_average_precision: f64,
    /// The same before camera and pose decide who is on the pitch.
    pub detector_recall: f64,
    /// See `detector_recall`.
    pub detector_precision: f64,
    /// See `detector_recall`.
    pub detector_average_precision: f64,
    /// Labelled balls.
    pub balls: usize,
    /// Share of them in whose box the middle of the picture's best candidate lies, if it is sure.
    pub ball_recall: f64,
    /// Share of the pictures' best candidates, if sure, that lie in a labelled ball's box.
    pub ball_precision: f64,
    /// Area under precision over recall of the pictures' best candidates.
    pub ball_average_precision: f64,
    /// Processor time of a picture, seconds on one core: detector; camera; pose.
    pub cpu_s_per_picture: [f64; 3],
}

/// Why finding people could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum DetectionEvaluationError {
    /// The labelled pictures could not be read.
    #[error(transparent)]
    Labels(#[from] LabelError),
    /// The detector failed.
    #[error(transparent)]
    Detection(#[from] DetectionError),
    /// The network that finds cameras failed.
    #[error(transparent)]
    Camera(#[from] InferenceError),
    /// The pose network failed.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Finds people in labelled pictures (`images/` and `labels/` in the YOLO form), each alone, and holds them against the labels. Every
/// pitch is taken to be 105×68 m: such labels do not say.
///
/// # Errors
/// When the folder holds no labelled pictures or a network cannot run.
pub fn evaluate(data: &Path, progress: &Progress) -> Result<DetectionFigures, DetectionEvaluationError> {
    let pictures = labelled::read(data, None)?;
    let share = pictures.len().div_ceil(rayon::current_num_threads()).max(1);
    let parts: Vec<Vec<Found>> = pictures
        .par_chunks(share)
        .map(|pictures| {
            let mut finder = Finder::load()?;
            pictures
                .iter()
                .map(|picture| {
                    let found = finder.find(&picture.picture);
                    progress.advance(1);
                    found
                })
                .collect()
        })
        .collect::<Result<_, DetectionEvaluationError>>()?;
    let found: Vec<Found> = parts.into_iter().flatten().collect();
    Ok(figures(&pictures, &found))
}

/// A box and how sure it is.
type Scored = (PixelBox, f64);

/// What was found in one picture.
struct Found {
    detections: Vec<Scored>,
    people: Vec<Scored>,
    /// The best ball candidate: its middle, and how sure it is.
    ball: Option<(DVec2, f64)>,
    camera: bool,
    cpu_s: [f64; 3],
}

struct Finder {
    detector: Detector,
    camera: Box<dyn FindCamera>,
    poses: PoseEstimator,
}

impl Finder {
    fn load() -> Result<Self, DetectionEvaluationError> {
        Ok(Self {
            detector: Detector::load()?,
            camera: calibration::shipped()?,
            poses: PoseEstimator::load()?,
        })
    }

    /// As the product does it, but for the frames around.
    fn find(&mut self, picture: &RgbImage) -> Result<Found, DetectionEvaluationError> {
        let pitch = Pitch::default();
        let mut clock = thread_cpu_s();
        let mut lap = || {
            let (before, now) = (clock, thread_cpu_s());
            clock = now;
            now - before
        };
        let Shown { people: detections, balls } = self.detector.detect(picture)?;
        let detector_s = lap();
        let boxes: Vec<PixelBox> = detections.iter().map(|detection| detection.bounds).collect();
        let camera = self.camera.find(picture, &boxes, &pitch)?.ok().filter(|found| found.is_sure());
        let camera_s = lap();
        let people = match &camera {
            Some(found) => self.poses.people(picture, &detections, &found.camera, &pitch)?,
            None => Vec::new(),
        };
        let pose_s = lap();
        Ok(Found {
            detections: detections.iter().map(|found| (found.bounds, f64::from(found.score))).collect(),
            people: people
                .iter()
                .filter(|person| is_on(&pitch, person))
                .map(|person| (person.bounds, f64::from(person.score)))
                .collect(),
            ball: ball(&balls, camera.as_ref().map(|found| &found.camera), &pitch),
            camera: camera.is_some(),
            cpu_s: [detector_s, camera_s, pose_s],
        })
    }
}

/// Whether a person stands on the pitch: who is beside it, as assistants are, is reconstructed but not labelled.
fn is_on(pitch: &Pitch, person: &Person) -> bool {
    pitch.contains(DVec2::new(person.ground_m.x, person.ground_m.z), 0.0)
}

/// The likeliest candidate that the camera sees before the pitch: white things in the stands and beside the pitch are many.
fn ball(candidates: &[BallCandidate], camera: Option<&Camera>, pitch: &Pitch) -> Option<(DVec2, f64)> {
    let likely = candidates.iter().filter_map(|candidate| {
        let Some(camera) = camera else { return Some((candidate.centre_px, f64::from(candidate.score))) };
        let ground = camera.ground_point(candidate.centre_px)?;
        let before_pitch = pitch.contains(DVec2::new(ground.x, ground.z), BALL_MARGIN_M);
        before_pitch.then(|| (candidate.centre_px, ball::likely(camera, candidate, pitch)))
    });
    likely.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn figures(pictures: &[LabelledPicture], found: &[Found]) -> DetectionFigures {
    let detector = rate(pictures, found.iter().map(|found| found.detections.as_slice()));
    let people = rate(pictures, found.iter().map(|found| found.people.as_slice()));
    let ball = rate_ball(pictures, found);
    let count = found.len().max(1) as f64;
    DetectionFigures {
        pictures: pictures.len(),
        cameras: found.iter().filter(|found| found.camera).count(),
        people: pictures.iter().map(|picture| picture.people.len()).sum(),
        people_recall: people.recall,
        people_precision: people.precision,
        people_average_precision: people.average_precision,
        detector_recall: detector.recall,
        detector_precision: detector.precision,
        detector_average_precision: detector.average_precision,
        balls: pictures.iter().map(|picture| picture.balls.len()).sum(),
        ball_recall: ball.recall,
        ball_precision: ball.precision,
        ball_average_precision: ball.average_precision,
        cpu_s_per_picture: [0, 1, 2].map(|k| found.iter().map(|f| f.cpu_s[k]).sum::<f64>() / count),
    }
}

/// Recall, precision and average precision.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rates {
    recall: f64,
    precision: f64,
    average_precision: f64,
}

/// Boxes against labels, picture by picture.
fn rate<'a>(pictures: &[LabelledPicture], boxes: impl IntoIterator<Item = &'a [Scored]>) -> Rates {
    let mut decided: Vec<(f64, bool)> = Vec::new();
    for (picture, boxes) in pictures.iter().zip(boxes) {
        let mut boxes = boxes.to_vec();
        boxes.sort_by(|a, b| b.1.total_cmp(&a.1));
        let claims = picture.claims(boxes.iter().map(|(bounds, _)| bounds));
        decided.extend(boxes.iter().map(|(_, score)| *score).zip(claims));
    }
    let people: usize = pictures.iter().map(|picture| picture.people.len()).sum();
    let right = decided.iter().filter(|(_, right)| *right).count();
    decided.sort_by(|a, b| b.0.total_cmp(&a.0));
    Rates {
        recall: right as f64 / people.max(1) as f64,
        precision: right as f64 / decided.len().max(1) as f64,
        average_precision: average_precision(&decided, people),
    }
}

/// The best candidate of each picture against the labelled balls.
fn rate_ball(pictures: &[LabelledPicture], found: &[Found]) -> Rates {
    let mut decided: Vec<(f64, bool)> = Vec::new();
    for (picture, found) in pictures.iter().zip(found) {
        let is_ball = |middle: DVec2| picture.balls.iter().any(|ball| ball.contains(middle));
        decided.extend(found.ball.map(|(middle, score)| (score, is_ball(middle))));
    }
    let balls: usize = pictures.iter().map(|picture| picture.balls.len()).sum();
    let sure = decided.iter().filter(|(score, _)| *score >= f64::from(BALL_SURE));
    let right = sure.clone().filter(|(_, right)| *right).count();
    let count = sure.count();
    decided.sort_by(|a, b| b.0.total_cmp(&a.0));
    Rates {
        recall: right as f64 / balls.max(1) as f64,
        precision: right as f64 / count.max(1) as f64,
        average_precision: average_precision(&decided, balls),
    }
}

/// Area under the precision that can be had at each recall or better (all points, as PASCAL VOC since 2010); surest first.
fn average_precision(decided: &[(f64, bool)], people: usize) -> f64 {
    let mut right = 0;
    let mut precisions: Vec<f64> = Vec::new();
    for (count, (_, is_right)) in decided.iter().enumerate() {
        if *is_right {
            right += 1;
            precisions.push(f64::from(right) / (count + 1) as f64);
        }
    }
    let mut best = 0.0_f64;
    let mut sum = 0.0;
    for precision in precisions.iter().rev() {
        best = best.max(*precision);
        sum += best;
    }
    sum / people.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> PixelBox {
        PixelBox { min: DVec2::new(x, 0.0), max: DVec2::new(x + 10.0, 20.0) }
    }

    #[test]
    fn every_label_is_found_once_and_the_rest_is_wrong() {
        let picture = |people| LabelledPicture { picture: RgbImage::new(1, 1), people, balls: Vec::new() };
        let labels = [picture(vec![at(0.0), at(100.0)]), picture(Vec::new())];
        // Two boxes on one label, one beside everything; the second picture is empty.
        let boxes = [(at(50.0), 0.7), (at(1.0), 0.9), (at(0.0), 0.8)];
        let rates = rate(&labels, [&boxes[..], &[]]);
        assert_eq!((rates.recall, rates.precision), (0.5, 1.0 / 3.0));
        assert_eq!(rates.average_precision, 0.5);
        assert_eq!(
            rate(&labels[..1], [&[][..]]),
            Rates { recall: 0.0, precision: 0.0, average_precision: 0.0 }
        );
    }

    #[test]
    fn average_precision_takes_the_best_precision_at_each_recall_or_better() {
        // Right, wrong, right: precision 1 at a recall of ½, ⅔ at 1.
        let decided = [(0.9, true), (0.8, false), (0.7, true)];
        assert!((average_precision(&decided, 2) - (1.0 + 2.0 / 3.0) / 2.0).abs() < 1e-12);
        assert_eq!(average_precision(&[(0.9, false), (0.8, true)], 1), 0.5);
    }
}
