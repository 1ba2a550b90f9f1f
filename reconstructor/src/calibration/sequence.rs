//! From one known camera to those of the frames around it: forward and backward along the lines, until they are lost.

use glam::{DMat3, DQuat, DVec3};
use protocol::camera::Camera;

use super::{
    CameraEstimate,
    fit::{Expectation, fit, residual},
    least_squares::{LOG_FOCAL, POSITION, RADIAL, ROTATION, Row, turn_between},
    lines::{LineMap, LinePixels},
    template::Sample,
};
use crate::geometry::PixelBox;

/// Fewer visible line points than this do not fix a camera.
pub(super) const LEAST_POINTS: usize = 25;
/// A median distance above this is a fit to something else, at 720 rows.
pub(super) const WORST_RESIDUAL_PX: f64 = 4.0;
/// Frames without lines after which the camera's motion is no longer known.
pub(super) const LONGEST_GAP: usize = 25;

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

/// Standard deviations of a camera's parameters: logarithm of the focal length, angles (radians), position, k1.
pub(super) const fn spread(log_focal: f64, turn: [f64; 3], position_m: f64, k1: f64) -> Row {
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
    // Twice: the points that are visible are chosen again once the camera is better.
    let camera = (0..2).fold(*first, |camera, _| {
        fit(&Expectation { camera, sigma: FIRST_SIGMA }, samples, &frame.people, &map)
    });
    judge(&camera, frame, samples, &map)
}

/// The cameras of the frames around `start`, where the camera is known: as far as the lines can be followed in both
/// directions, and no farther than a frame that `stop` names.
pub(super) fn follow(
    frames: &[FrameLines],
    start: usize,
    first: Camera,
    samples: &[Sample],
    stop: &(dyn Fn(usize) -> bool + Sync),
) -> Vec<(usize, CameraEstimate)> {
    let along = |order: &mut dyn Iterator<Item = usize>| {
        let mut motion = Motion::new(first);
        let mut found = Vec::new();
        for index in order.take_while(|&index| index == start || !stop(index)) {
            let Some(frame) = frames.get(index) else { break };
            let Some(estimate) = motion.next(frame, samples) else { break };
            found.push((index, estimate));
        }
        found
    };
    let (mut ahead, back) =
        rayon::join(|| along(&mut (start..frames.len())), || along(&mut (0..start).rev()));
    ahead.extend(back);
    ahead
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

    /// `None` once the lines were lost too many frames ago.
    fn next(&mut self, frame: &FrameLines, samples: &[Sample]) -> Option<CameraEstimate> {
        if self.lost > LONGEST_GAP {
            return None;
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
        Some(estimate)
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
pub(super) fn judge(
    camera: &Camera,
    frame: &FrameLines,
    samples: &[Sample],
    map: &LineMap<'_>,
) -> CameraEstimate {
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
    CameraEstimate { camera, line_residual_median_px, line_points, reason, ..CameraEstimate::default() }
}
