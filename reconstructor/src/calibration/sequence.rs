//! From the one known camera to the cameras of all frames: forward and backward through the shot, then once more with the
//! camera held at the position that suits all frames together.

use glam::{DMat3, DQuat, DVec3};
use protocol::camera::Camera;

use super::{
    CameraEstimate, CameraSource,
    fit::{Expectation, fit, residual},
    least_squares::{LOG_FOCAL, POSITION, RADIAL, ROTATION, Row, turn_between},
    lines::{LineMap, LinePixels},
    template::{Sample, visible},
    tripod::{View, common, placed_at},
};
use crate::{geometry::PixelBox, report::median};

/// Fewer visible line points than this do not fix a camera.
pub(super) const LEAST_POINTS: usize = 25;
/// A median distance above this is a fit to something else, at 720 rows.
pub(super) const WORST_RESIDUAL_PX: f64 = 4.0;
/// Frames without lines after which the camera's motion is no longer known.
const LONGEST_GAP: usize = 25;
/// Frames that vote on the common position.
const VIEWS: usize = 14;
/// The common position is not used when it fits this much worse, pixels at 720 rows: the camera was not on a tripod.
const TRIPOD_LOSS_PX: f64 = 0.5;

/// One frame as the fit sees it.
pub(super) struct FrameLines {
    /// Its line pixels.
    pub(super) lines: LinePixels,
    /// Boxes of people.
    pub(super) people: Vec<PixelBox>,
}

/// How the camera of a frame differs from its expectation: a pan of a degree, a turn of the zoom, a tripod that gives way.
const MOTION_SIGMA: Row = spread(0.02, [0.010, 0.015, 0.002], 0.05, 0.003);
/// How the first camera differs from the one that a few points found by hand gave.
const FIRST_SIGMA: Row = spread(0.15, [0.03, 0.03, 0.02], 4.0, 0.08);
/// How the camera on the tripod differs from the one that was fitted without it.
const TRIPOD_SIGMA: Row = spread(0.03, [0.010, 0.010, 0.004], 0.0, 0.0);

const fn spread(log_focal: f64, turn: [f64; 3], position_m: f64, k1: f64) -> Row {
    let mut row = [0.0; 8];
    row[LOG_FOCAL] = log_focal;
    row[ROTATION] = turn[0];
    row[ROTATION + 1] = turn[1];
    row[ROTATION + 2] = turn[2];
    row[POSITION] = position_m;
    row[POSITION + 1] = position_m;
    row[POSITION + 2] = position_m;
    row[RADIAL] = k1;
    row
}

/// The first camera, moved onto the lines of its frame, with its estimate.
pub(super) fn settle(first: &Camera, frame: &FrameLines, samples: &[Sample]) -> CameraEstimate {
    let map = frame.lines.map();
    let mut camera = *first;
    // Twice: the points that are visible are chosen again once the camera is better.
    for _ in 0..2 {
        camera = fit(&Expectation { camera, sigma: FIRST_SIGMA }, samples, &frame.people, &map);
    }
    judge(&camera, frame, samples, &map)
}

/// The cameras of all frames from that of frame `start`.
pub(super) fn follow(
    frames: &[FrameLines],
    start: usize,
    first: Camera,
    samples: &[Sample],
) -> Vec<CameraEstimate> {
    let mut estimates: Vec<CameraEstimate> = vec![CameraEstimate::default(); frames.len()];
    let ahead: Vec<usize> = (start..frames.len()).collect();
    let back: Vec<usize> = (0..start).rev().collect();
    for order in [ahead, back] {
        let mut motion = Motion::new(first);
        for index in order {
            let Some(frame) = frames.get(index) else { continue };
            let estimate = motion.next(frame, samples);
            if let Some(slot) = estimates.get_mut(index) {
                *slot = estimate;
            }
        }
    }
    let estimates = on_tripod(frames, estimates, samples);
    bridge_gaps(estimates)
}

/// The camera's motion while a shot is followed frame by frame.
struct Motion {
    last: Camera,
    turn: DVec3,
    zoom: f64,
    lost: usize,
}

impl Motion {
    fn new(first: Camera) -> Self {
        Self { last: first, turn: DVec3::ZERO, zoom: 0.0, lost: 0 }
    }

    fn next(&mut self, frame: &FrameLines, samples: &[Sample]) -> CameraEstimate {
        if self.lost > LONGEST_GAP {
            return CameraEstimate::unsolved("the lines were lost too many frames ago");
        }
        let map = frame.lines.map();
        let turned = DMat3::from_quat(DQuat::from_scaled_axis(self.turn)) * self.last.rotation;
        let steady = Camera { rotation: turned, focal_px: self.last.focal_px * self.zoom.exp(), ..self.last };
        // The lens of a camera may start or stop turning at any frame: also try standing still.
        let mut estimate = self.attempt(&steady, frame, samples, &map);
        if estimate.camera.is_none() {
            let still = self.attempt(&self.last, frame, samples, &map);
            if still.camera.is_some() {
                estimate = still;
            }
        }
        match estimate.camera {
            Some(camera) => {
                let gap = (self.lost + 1) as f64;
                self.turn = turn_between(&self.last.rotation, &camera.rotation) / gap;
                self.zoom = (camera.focal_px / self.last.focal_px).ln() / gap;
                self.last = camera;
                self.lost = 0;
            }
            None => {
                self.last = steady;
                self.lost += 1;
            }
        }
        estimate
    }

    fn attempt(
        &self,
        expected: &Camera,
        frame: &FrameLines,
        samples: &[Sample],
        map: &LineMap<'_>,
    ) -> CameraEstimate {
        let more = 1.0 + self.lost as f64;
        let sigma = MOTION_SIGMA.map(|sigma| sigma * more.sqrt());
        let camera = fit(&Expectation { camera: *expected, sigma }, samples, &frame.people, map);
        judge(&camera, frame, samples, map)
    }
}

/// Measures a camera against the lines of its frame and keeps it when they agree.
fn judge(camera: &Camera, frame: &FrameLines, samples: &[Sample], map: &LineMap<'_>) -> CameraEstimate {
    let (line_residual_median_px, line_points) = residual(camera, samples, &frame.people, map);
    let limit = WORST_RESIDUAL_PX * f64::from(camera.height_px) / 720.0;
    let reason = match line_residual_median_px {
        _ if line_points < LEAST_POINTS => {
            Some(format!("only {line_points} points of the lines are in view"))
        }
        Some(median) if median > limit => Some(format!("the lines are {median:.1} px away (median)")),
        _ => None,
    };
    let camera = reason.is_none().then_some(*camera);
    CameraEstimate { camera, line_residual_median_px, line_points, reason, source: CameraSource::Lines }
}

/// Fits all frames again with the position and lens that suit them together, unless that fits clearly worse.
fn on_tripod(frames: &[FrameLines], alone: Vec<CameraEstimate>, samples: &[Sample]) -> Vec<CameraEstimate> {
    let solved: Vec<usize> =
        (0..frames.len()).filter(|&i| alone.get(i).is_some_and(|e| e.camera.is_some())).collect();
    let count = solved.len().min(VIEWS);
    if count < 3 {
        return alone;
    }
    let chosen = (0..count).filter_map(|k| solved.get(k * (solved.len() - 1) / (count - 1)).copied());
    let views: Vec<View<'_>> = chosen
        .filter_map(|i| {
            let (frame, estimate) = (frames.get(i)?, alone.get(i)?);
            Some(View { camera: estimate.camera?, people: &frame.people, map: frame.lines.map() })
        })
        .collect();
    let middle = |of: &dyn Fn(&Camera) -> f64| {
        let values: Vec<f64> = views.iter().map(|view| of(&view.camera)).collect();
        median(&values).unwrap_or_default() // there are views
    };
    let start = DVec3::new(middle(&|c| c.position.x), middle(&|c| c.position.y), middle(&|c| c.position.z));
    let (position, k1) = common(&views, samples, start, middle(&|c| c.k1));
    drop(views);

    let together: Vec<CameraEstimate> = frames
        .iter()
        .zip(&alone)
        .map(|(frame, estimate)| {
            let Some(camera) = estimate.camera else { return estimate.clone() };
            let map = frame.lines.map();
            let shown = visible(&camera, samples, &frame.people);
            let placed = placed_at(&camera, position, k1, &shown);
            let fitted =
                fit(&Expectation { camera: placed, sigma: TRIPOD_SIGMA }, samples, &frame.people, &map);
            judge(&fitted, frame, samples, &map)
        })
        .collect();
    let overall = |all: &[CameraEstimate]| {
        let residuals: Vec<f64> = all.iter().filter_map(|e| e.line_residual_median_px).collect();
        median(&residuals).unwrap_or(f64::INFINITY)
    };
    let (before, after) = (overall(&alone), overall(&together));
    let solved_together = together.iter().filter(|e| e.camera.is_some()).count();
    tracing::info!(%position, k1, free_px = before, tripod_px = after, "one position for all frames");
    let scale = frames.first().map_or(1.0, |frame| frame.lines.height_px() / 720.0);
    if after > before + TRIPOD_LOSS_PX * scale || solved_together < solved.len() {
        tracing::warn!(
            free_px = before,
            tripod_px = after,
            "the camera's position changes; frames are fitted one by one"
        );
        return alone;
    }
    together
}

/// Fills short gaps between solved frames by even motion, and says so.
fn bridge_gaps(mut estimates: Vec<CameraEstimate>) -> Vec<CameraEstimate> {
    let solved: Vec<(usize, Camera)> =
        estimates.iter().enumerate().filter_map(|(i, e)| Some((i, e.camera?))).collect();
    for pair in solved.windows(2) {
        let [(before, a), (after, b)] = pair else { continue };
        let gap = after - before;
        if !(2..=LONGEST_GAP).contains(&gap) {
            continue;
        }
        let turn = turn_between(&a.rotation, &b.rotation);
        for (i, estimate) in estimates.iter_mut().enumerate().take(*after).skip(before + 1) {
            let t = (i - before) as f64 / gap as f64;
            let camera = Camera {
                focal_px: a.focal_px.powf(1.0 - t) * b.focal_px.powf(t),
                k1: a.k1 + (b.k1 - a.k1) * t,
                rotation: DMat3::from_quat(DQuat::from_scaled_axis(turn * t)) * a.rotation,
                position: a.position.lerp(b.position, t),
                ..*a
            };
            let why = estimate.reason.take().unwrap_or_default();
            tracing::warn!(frame = i, why, "camera taken from the frames around it");
            estimate.reason = Some(format!("between solved frames: {why}"));
            estimate.camera = Some(camera);
            estimate.source = CameraSource::Predicted;
        }
    }
    estimates
}
