//! How the detector and the pose network, which never saw a rendered picture, do on labelled ones.

use image::RgbImage;

use super::{LabelledPicture, NetworkFigures, RealismError, spread};
use crate::{
    detection::Detector,
    geometry::PixelBox,
    pose::{POSE_SCORE_MIN, PoseEstimator},
    report::Progress,
};

/// People whose pose is looked at, of one picture: enough for a distribution.
const POSES_PER_PICTURE: usize = 6;
/// Overlap at which a detection counts.
const IOU_MIN: f64 = 0.5;

pub(super) struct Looked {
    pub(super) recall: f64,
    pub(super) scores: Vec<f64>,
}

impl Looked {
    pub(super) fn figures(self) -> NetworkFigures {
        let rejected = self.scores.iter().filter(|&&score| score < f64::from(POSE_SCORE_MIN)).count();
        NetworkFigures {
            detector_recall: self.recall,
            pose_rejected: rejected as f64 / self.scores.len().max(1) as f64,
            pose_score: spread(self.scores),
        }
    }
}

pub(super) fn look(pictures: &[LabelledPicture], progress: &Progress) -> Result<Looked, RealismError> {
    let mut detector = Detector::load()?;
    let mut poses = PoseEstimator::load()?;
    let (mut found, mut people, mut scores) = (0, 0, Vec::new());
    for LabelledPicture { picture, people: labels, .. } in pictures {
        people += labels.len();
        found += matched(&mut detector, picture, labels)?;
        let step = labels.len().div_ceil(POSES_PER_PICTURE).max(1);
        for person in labels.iter().step_by(step) {
            // A box without a person to see scores nothing.
            scores.push(poses.look(picture, person)?.map_or(0.0, |look| f64::from(look.score)));
        }
        progress.advance(1);
    }
    Ok(Looked { recall: found as f64 / people.max(1) as f64, scores })
}

/// Labels with a detection of their own, best overlap first.
fn matched(detector: &mut Detector, picture: &RgbImage, labels: &[PixelBox]) -> Result<usize, RealismError> {
    let detections = detector.detect(picture)?;
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (l, label) in labels.iter().enumerate() {
        for (d, detection) in detections.iter().enumerate() {
            let overlap = label.iou(&detection.bounds);
            if overlap >= IOU_MIN {
                pairs.push((overlap, l, d));
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut labels_taken, mut detections_taken) = (vec![false; labels.len()], vec![false; detections.len()]);
    let mut count = 0;
    for (_, l, d) in pairs {
        if !labels_taken[l] && !detections_taken[d] {
            labels_taken[l] = true;
            detections_taken[d] = true;
            count += 1;
        }
    }
    Ok(count)
}
