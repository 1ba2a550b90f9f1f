//! The camera over one shot: runs of frames that can be followed, one tripod for all of them, and what is left between.

use std::ops::Range;

use glam::DVec3;
use protocol::camera::Camera;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    CameraEstimate,
    chains::{self, Anchor, Chain},
    fit::{Expectation, fit},
    gaps,
    least_squares::Row,
    sequence::{FrameLines, judge, spread},
    template::{Sample, visible},
    tripod::{Lens, Tripod, View, adjust, placed_at},
};
use crate::report::median;

/// Frames that take part in the common adjustment at most; more tell nothing new.
const MOST_VIEWS: usize = 240;
/// Fewer frames cannot tell a tripod from a camera that moves.
const LEAST_VIEWS: usize = 3;
/// The common position is not used when it fits this much worse, pixels at 720 rows: the camera was not on a tripod.
const TRIPOD_LOSS_PX: f64 = 0.5;
/// Nor when it loses more frames than this share leaves.
const LEAST_KEPT: f64 = 0.95;
/// Nor when both halves of the shot, each adjusted alone, are farther apart than this, metres, and it fits worse by the half of
/// that: a camera on rails or wires.
const HALVES_APART_M: f64 = 3.0;
/// How a frame's camera differs from the one placed on the tripod.
const PLACED_SIGMA: Row = spread(0.03, [0.010, 0.010, 0.004], 0.0, 0.0);
/// How it differs from the middle of the frames before and after: half of what turning and zooming change their speed by in a
/// frame. A frame with its lines in full view is not held by this, one with a single line is.
const EVEN_SIGMA: Row = spread(0.003, [0.002, 0.002, 0.000_6], 0.0, 0.0);
/// Why a camera on rails, wires or a shoulder is reported.
const MOVING: &str = "the camera is not on a tripod: its place was fitted frame by frame";

/// How the cameras of one shot came about.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShotFigures {
    /// Frames of the clip's range.
    pub frames: Range<usize>,
    /// Frames in which a camera was looked for alone.
    pub tried: usize,
    /// Frames in which one was found.
    pub located: usize,
    /// Of these, frames that agree with the cameras kept.
    pub agreeing: usize,
    /// Frames with a camera.
    pub solved: usize,
    /// Whether the camera moves, so that every frame has a place of its own.
    pub moving: bool,
    /// Where the tripod stands, world metres.
    pub position_m: Option<DVec3>,
    /// Its lens.
    pub lens: Option<Lens>,
    /// Standard deviation of the camera's place over the shot, metres: 0 on a tripod by construction.
    pub centre_std_m: Option<f64>,
    /// The same when every frame has a place of its own: what one frame's lines leave open.
    pub free_centre_std_m: Option<f64>,
    /// Distance between the places that the two halves of the shot give on their own, metres: what the tripod is known to.
    pub halves_apart_m: Option<f64>,
    /// Median over the frames of their median line distance, pixels, with the tripod.
    pub line_residual_median_px: Option<f64>,
    /// The same with a place of its own for every frame.
    pub free_line_residual_median_px: Option<f64>,
}

/// The cameras of a shot.
#[derive(Debug)]
pub(super) struct Solution {
    /// One per frame of the shot.
    pub(super) estimates: Vec<CameraEstimate>,
    /// How they came about; frames counted in the shot.
    pub(super) figures: ShotFigures,
}

/// Solves a shot from what is known of single frames. `refused` holds the frames in which no camera was found, with reasons;
/// `apart` leaves every frame its own place.
pub(super) fn solve(
    frames: &[FrameLines],
    anchors: &[Anchor],
    refused: &[(usize, String)],
    samples: &[Sample],
    apart: bool,
) -> Solution {
    let tried: Vec<usize> = refused.iter().map(|(index, _)| *index).collect();
    let chains = chains::find(frames, anchors, &tried, samples);
    let mut figures = ShotFigures {
        frames: 0..frames.len(),
        tried: refused.len() + anchors.iter().filter(|anchor| !anchor.given).count(),
        located: anchors.iter().filter(|anchor| !anchor.given).count(),
        agreeing: chains.iter().map(|chain| chain.agreeing).sum(),
        ..ShotFigures::default()
    };
    let together = if apart { None } else { on_tripod(frames, &chains, samples, &mut figures) };
    let mut estimates = together.unwrap_or_else(|| alone(frames, &chains));
    let why = nothing_found(anchors, refused, &chains);
    for estimate in estimates.iter_mut().filter(|e| e.camera.is_none() && e.reason.is_none()) {
        estimate.reason = Some(why.clone());
    }
    gaps::bridge(&mut estimates, frames, samples);
    figures.solved = estimates.iter().filter(|e| e.camera.is_some()).count();
    figures.line_residual_median_px = residual(&estimates);
    figures.centre_std_m = deviation(&estimates.iter().filter_map(|e| e.camera).collect::<Vec<_>>());
    Solution { estimates, figures }
}

/// Why frames that no run reached have no camera.
fn nothing_found(anchors: &[Anchor], refused: &[(usize, String)], chains: &[Chain]) -> String {
    if !chains.is_empty() {
        return "the lines were lost too many frames ago".to_owned();
    }
    match (anchors, refused) {
        ([], []) => "no camera was given for this shot and none was looked for".to_owned(),
        ([], [.., (_, reason)]) => format!("no pitch camera in this shot: {reason}"),
        _ => "the cameras found in frames of this shot contradict its lines or each other".to_owned(),
    }
}

/// The frames of all runs, as they were followed.
fn alone<'a>(frames: &[FrameLines], chains: impl IntoIterator<Item = &'a Chain>) -> Vec<CameraEstimate> {
    let mut estimates = vec![CameraEstimate::default(); frames.len()];
    for chain in chains {
        for (&index, estimate) in &chain.frames {
            if let Some(place) = estimates.get_mut(index) {
                *place = CameraEstimate { confidence: Some(chain.confidence), ..estimate.clone() };
            }
        }
    }
    estimates
}

/// All frames of all runs with one place and one lens; `None` when there are too few. Runs that stand elsewhere are dropped; when
/// the longest one has no place that suits all its frames, the camera moves and every frame keeps its own.
fn on_tripod(
    frames: &[FrameLines],
    chains: &[Chain],
    samples: &[Sample],
    figures: &mut ShotFigures,
) -> Option<Vec<CameraEstimate>> {
    let main = chains.iter().max_by_key(|chain| (chain.given, chain.frames.len()))?;
    let free = alone(frames, chains);
    let scale = frames.first().map_or(1.0, |frame| frame.lines.height_px() / 720.0);
    figures.free_line_residual_median_px = residual(&free);
    let of_main = views(frames, [main]);
    figures.free_centre_std_m = deviation(&of_main.iter().map(|view| view.camera).collect::<Vec<_>>());
    let mut tripod = if of_main.len() < LEAST_VIEWS { None } else { common(&of_main, samples) }?;
    let mut kept: Vec<&Chain> = vec![main];
    for other in chains.iter().filter(|chain| !std::ptr::eq(*chain, main)) {
        let placed = fitted(frames, &[other], &tripod, samples);
        let loss = residual(&placed).unwrap_or(f64::INFINITY) - residual(&alone(frames, [other]))?;
        if loss <= TRIPOD_LOSS_PX * scale {
            kept.push(other);
        } else {
            tracing::warn!(
                loss,
                frames = other.frames.len(),
                "a run of frames has its camera elsewhere; it is left out"
            );
        }
    }
    let all = views(frames, kept.iter().copied());
    if kept.len() > 1 {
        tripod = common(&all, samples)?;
    }
    let halves = all.split_at(all.len() / 2);
    let apart = [halves.0, halves.1].map(|half| common(half, samples).map(|tripod| tripod.position));
    if let [Some(first), Some(second)] = apart {
        figures.halves_apart_m = Some(first.distance(second));
    }
    let together = fitted(frames, &kept, &tripod, samples);
    let before = residual(&alone(frames, kept.iter().copied()))?;
    let loss = residual(&together).unwrap_or(f64::INFINITY) - before;
    let limit = if figures.halves_apart_m.is_some_and(|apart| apart > HALVES_APART_M) { 0.5 } else { 1.0 };
    tracing::info!(position = %tripod.position, lens = ?tripod.lens, free_px = before, loss_px = loss, "one place for the shot");
    let count =
        |all: &[CameraEstimate]| all.iter().filter(|estimate| estimate.camera.is_some()).count() as f64;
    let expected: usize = kept.iter().map(|chain| chain.frames.len()).sum();
    if loss > limit * TRIPOD_LOSS_PX * scale || count(&together) < LEAST_KEPT * expected as f64 {
        tracing::warn!(loss_px = loss, "{MOVING}");
        figures.moving = true;
        return Some(
            free.into_iter()
                .map(|mut estimate| {
                    if estimate.camera.is_some() {
                        estimate.reason = Some(MOVING.to_owned());
                    }
                    estimate
                })
                .collect(),
        );
    }
    (figures.position_m, figures.lens) = (Some(tripod.position), Some(tripod.lens));
    Some(together)
}

/// The frames of some runs, thinned out evenly.
fn views<'a>(frames: &'a [FrameLines], chains: impl IntoIterator<Item = &'a Chain>) -> Vec<View<'a>> {
    let mut all: Vec<(usize, View<'a>)> = chains
        .into_iter()
        .flat_map(|chain| &chain.frames)
        .filter_map(|(&index, estimate)| {
            Some((index, View { frame: frames.get(index)?, camera: estimate.camera? }))
        })
        .collect();
    all.sort_by_key(|(index, _)| *index);
    let count = all.len().min(MOST_VIEWS);
    (0..count).filter_map(|k| all.get(k * all.len() / count)).map(|(_, view)| *view).collect()
}

/// One place for some views, from the middle of their own.
fn common(views: &[View<'_>], samples: &[Sample]) -> Option<Tripod> {
    let middle =
        |of: &dyn Fn(&Camera) -> f64| median(&views.iter().map(|view| of(&view.camera)).collect::<Vec<_>>());
    let place =
        DVec3::new(middle(&|c| c.position.x)?, middle(&|c| c.position.y)?, middle(&|c| c.position.z)?);
    let lens = Lens { focal_px: middle(&|c| c.focal_px)?, k1: middle(&|c| c.k1)?, slope: 0.0 };
    adjust(views, samples, place, lens)
}

/// Every frame of some runs, fitted again with the tripod's place and lens.
fn fitted(
    frames: &[FrameLines],
    chains: &[&Chain],
    tripod: &Tripod,
    samples: &[Sample],
) -> Vec<CameraEstimate> {
    let mut placed: Vec<Option<(Camera, f64)>> = vec![None; frames.len()];
    for chain in chains {
        for (&index, estimate) in &chain.frames {
            if let (Some(place), Some(camera)) = (placed.get_mut(index), estimate.camera) {
                *place = Some((camera, chain.confidence));
            }
        }
    }
    let start: Vec<Option<Camera>> = frames
        .par_iter()
        .enumerate()
        .map(|(index, frame)| {
            let (camera, _) = placed.get(index).copied().flatten()?;
            let shown = visible(&camera, samples, &frame.people);
            Some(placed_at(&camera, tripod.position, &tripod.lens, &shown))
        })
        .collect();
    let at = |index: Option<usize>| start.get(index?).copied().flatten();
    frames
        .par_iter()
        .enumerate()
        .map(|(index, frame)| {
            let Some(own) = at(Some(index)) else { return CameraEstimate::default() };
            let map = frame.lines.map();
            let expected = match (at(index.checked_sub(1)), at(Some(index + 1))) {
                (Some(before), Some(after)) => {
                    Expectation { camera: gaps::between(&before, &after, 0.5), sigma: EVEN_SIGMA }
                }
                _ => Expectation { camera: own, sigma: PLACED_SIGMA },
            };
            let camera = fit(&expected, samples, &frame.people, &map);
            let confidence = placed.get(index).copied().flatten().map(|(_, confidence)| confidence);
            CameraEstimate { confidence, ..judge(&camera, frame, samples, &map) }
        })
        .collect()
}

/// Median of the frames' residuals, pixels.
fn residual(estimates: &[CameraEstimate]) -> Option<f64> {
    let solved = estimates.iter().filter(|estimate| estimate.camera.is_some());
    median(&solved.filter_map(|estimate| estimate.line_residual_median_px).collect::<Vec<_>>())
}

/// Standard deviation of the cameras' places, metres: root of the mean squared distance from their mean.
fn deviation(cameras: &[Camera]) -> Option<f64> {
    let n = cameras.len() as f64;
    let mean = cameras.iter().map(|camera| camera.position).sum::<DVec3>() / n;
    let squared: f64 = cameras.iter().map(|camera| camera.position.distance_squared(mean)).sum();
    (!cameras.is_empty()).then(|| (squared / n).sqrt())
}
