//! How the detector, which real and then rendered pictures trained, and the pose network, which never saw a rendered one, do on labelled
//! pictures.

use super::{LabelledPicture, NetworkFigures, RealismError, spread};
use crate::{
    detection::Detector,
    pose::{POSE_SCORE_MIN, PoseEstimator},
    report::Progress,
};

/// People whose pose is looked at, of one picture: enough for a distribution.
const POSES_PER_PICTURE: usize = 6;

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
    for labelled in pictures {
        let LabelledPicture { picture, people: labels, .. } = labelled;
        people += labels.len();
        let detections = detector.detect(picture)?.people;
        let claims = labelled.claims(detections.iter().map(|detection| &detection.bounds));
        found += claims.iter().filter(|is_person| **is_person).count();
        let step = labels.len().div_ceil(POSES_PER_PICTURE).max(1);
        for person in labels.iter().step_by(step) {
            // A box without a person to see scores nothing.
            scores.push(poses.look(picture, person)?.map_or(0.0, |look| f64::from(look.score)));
        }
        progress.advance(1);
    }
    Ok(Looked { recall: found as f64 / people.max(1) as f64, scores })
}
