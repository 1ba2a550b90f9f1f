//! From cameras of single frames to runs of frames that were followed along their lines, and which of them to believe.
//!
//! A camera found in one frame may be wrong; followed through the shot it must then contradict the cameras found in other
//! frames. Runs are started from the surest frames and kept when the frames they pass vote for them.

use std::collections::BTreeMap;

use glam::DVec2;
use protocol::camera::Camera;
use rayon::prelude::*;

use super::{
    CameraEstimate, locate,
    sequence::{FrameLines, follow, settle},
    template::Sample,
};
use crate::report::median;

/// Two cameras of one frame agree when they show the pitch this near to each other (median), pixels at 720 rows.
const AGREE_PX: f64 = 12.0;
/// What a frame counts against a run when no camera was found in it: that may be for want of lines.
const REFUSED_VOTE: f64 = 0.1;
/// Votes that a run needs: one camera that is sure alone, or several that are not but agree.
const LEAST_VOTES: f64 = locate::CONFIDENCE_MIN;

/// A camera known or found for one frame of the shot.
#[derive(Clone, Debug)]
pub(super) struct Anchor {
    /// Which frame of the shot.
    pub(super) index: usize,
    /// Its camera.
    pub(super) camera: Camera,
    /// How likely it is right, 0..1.
    pub(super) confidence: f64,
    /// Given by hand: it outvotes all that was found.
    pub(super) given: bool,
}

/// Frames that were followed from one anchor.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// Frames with a camera.
    pub(super) frames: BTreeMap<usize, CameraEstimate>,
    /// Confidence, 0..1, from the anchors that agree and those that do not.
    pub(super) confidence: f64,
    /// Anchors that agree.
    pub(super) agreeing: usize,
    /// Whether it starts from a given camera.
    pub(super) given: bool,
}

/// The believable runs of a shot. `refused` names frames in which no camera was found.
pub(super) fn find(
    frames: &[FrameLines],
    anchors: &[Anchor],
    refused: &[usize],
    samples: &[Sample],
) -> Vec<Chain> {
    // On their lines the cameras are comparable, and those without any are out.
    let mut settled: Vec<(Anchor, f64)> = anchors
        .par_iter()
        .filter_map(|anchor| {
            let estimate = settle(&anchor.camera, frames.get(anchor.index)?, samples);
            let (camera, residual) = (estimate.camera?, estimate.line_residual_median_px?);
            Some((Anchor { camera, ..anchor.clone() }, residual))
        })
        .collect();
    let merit = |(anchor, residual): &(Anchor, f64)| {
        if anchor.given { f64::INFINITY } else { anchor.confidence / (1.0 + residual) }
    };
    settled.sort_by(|a, b| merit(b).total_cmp(&merit(a)).then(a.0.index.cmp(&b.0.index)));
    let mut covered = vec![false; frames.len()];
    let mut kept: Vec<Chain> = Vec::new();
    for (anchor, _) in &settled {
        if covered.get(anchor.index).copied().unwrap_or(true) {
            continue;
        }
        let is_covered = |index: usize| covered.get(index).copied().unwrap_or(true);
        let followed = follow(frames, anchor.index, anchor.camera, samples, &is_covered);
        let solved: BTreeMap<usize, CameraEstimate> =
            followed.into_iter().filter(|(_, estimate)| estimate.camera.is_some()).collect();
        let Some(chain) = judged(solved, anchor, &settled, refused) else { continue };
        for &index in chain.frames.keys() {
            if let Some(place) = covered.get_mut(index) {
                *place = true;
            }
        }
        kept.push(chain);
    }
    kept
}

/// The run with its votes; `None` when it is not to be believed.
fn judged(
    frames: BTreeMap<usize, CameraEstimate>,
    start: &Anchor,
    anchors: &[(Anchor, f64)],
    refused: &[usize],
) -> Option<Chain> {
    let (mut votes, mut against, mut doubt, mut agreeing) = (0.0, 0.0, 1.0, 0);
    for (anchor, _) in anchors {
        let Some(camera) = frames.get(&anchor.index).and_then(|estimate| estimate.camera) else { continue };
        let apart = apart_px(&camera, &anchor.camera);
        if apart.is_some_and(|apart| apart <= AGREE_PX * f64::from(camera.height_px) / 720.0) {
            votes += anchor.confidence;
            doubt *= 1.0 - anchor.confidence;
            agreeing += 1;
        } else {
            against += anchor.confidence;
        }
    }
    against += REFUSED_VOTE * refused.iter().filter(|index| frames.contains_key(index)).count() as f64;
    if start.given {
        return Some(Chain { frames, confidence: 1.0, agreeing, given: true });
    }
    let believed = !frames.is_empty() && votes >= LEAST_VOTES && votes > against;
    let confidence = (1.0 - doubt) * votes / (votes + against).max(f64::MIN_POSITIVE);
    believed.then_some(Chain { frames, confidence, agreeing, given: false })
}

/// Median distance in pixels between where two cameras show the ground that the first one sees.
pub(super) fn apart_px(camera: &Camera, other: &Camera) -> Option<f64> {
    let (width, height) = (f64::from(camera.width_px), f64::from(camera.height_px));
    let mut distances = Vec::new();
    for row in 0..6 {
        for column in 0..8 {
            let share = DVec2::new((f64::from(column) + 0.5) / 8.0, (f64::from(row) + 0.5) / 6.0);
            let pixel = share * DVec2::new(width, height);
            // Grass far outside any pitch is near the horizon, where pixels mean nothing.
            let Some(ground) = camera.ground_point(pixel).filter(|ground| ground.length() < 120.0) else {
                continue;
            };
            distances.push(other.project(ground).map_or(f64::INFINITY, |seen| seen.distance(pixel)));
        }
    }
    median(&distances)
}
