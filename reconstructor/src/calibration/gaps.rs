//! Frames whose own lines do not fix a camera, between frames that have one: even motion, helped by the lines that there are.

use glam::{DMat3, DQuat};
use protocol::camera::Camera;

use super::{
    CameraEstimate, CameraSource,
    fit::{Expectation, fit},
    least_squares::{Row, turn_between},
    sequence::{FrameLines, LONGEST_GAP, judge, spread},
    template::Sample,
};

/// How far a camera on its tripod is from even motion per frame of distance to a solved one: operators turn smoothly.
const EVEN_SIGMA: Row = spread(0.004, [0.002, 0.002, 0.000_5], 0.0, 0.0);
/// Fewer line points than this say nothing, not even together with the motion.
const LEAST_POINTS: usize = 8;

/// The camera at a share `t` of the way from one to another, at even speed of turning and zooming.
pub(super) fn between(a: &Camera, b: &Camera, t: f64) -> Camera {
    let turn = turn_between(&a.rotation, &b.rotation);
    Camera {
        focal_px: a.focal_px.powf(1.0 - t) * b.focal_px.powf(t),
        k1: a.k1 + (b.k1 - a.k1) * t,
        rotation: DMat3::from_quat(DQuat::from_scaled_axis(turn * t)) * a.rotation,
        position: a.position.lerp(b.position, t),
        ..*a
    }
}

/// Fills short gaps between solved frames, and says so.
pub(super) fn bridge(estimates: &mut [CameraEstimate], frames: &[FrameLines], samples: &[Sample]) {
    let solved: Vec<(usize, Camera)> =
        estimates.iter().enumerate().filter_map(|(i, e)| Some((i, e.camera?))).collect();
    for pair in solved.windows(2) {
        let [(before, a), (after, b)] = pair else { continue };
        let gap = after - before;
        if !(2..=LONGEST_GAP).contains(&gap) {
            continue;
        }
        for index in before + 1..*after {
            let even = between(a, b, (index - before) as f64 / gap as f64);
            let (Some(estimate), Some(frame)) = (estimates.get_mut(index), frames.get(index)) else {
                continue;
            };
            let why = estimate.reason.take().unwrap_or_default();
            tracing::warn!(frame = index, why, "camera taken from the frames around it");
            let distance = (index - before).min(after - index) as f64;
            let (camera, judged) = held(&even, distance, frame, samples);
            *estimate = CameraEstimate {
                camera: Some(camera),
                reason: Some(format!("between solved frames: {why}")),
                source: CameraSource::Predicted,
                ..judged
            };
        }
    }
}

/// A camera that even motion expects, moved by the few lines of the frame where they agree with it.
fn held(even: &Camera, distance: f64, frame: &FrameLines, samples: &[Sample]) -> (Camera, CameraEstimate) {
    let map = frame.lines.map();
    let sigma = EVEN_SIGMA.map(|sigma| sigma * distance);
    let fitted = fit(&Expectation { camera: *even, sigma }, samples, &frame.people, &map);
    let (by_lines, by_motion) = (judge(&fitted, frame, samples, &map), judge(even, frame, samples, &map));
    let better = by_lines.line_residual_median_px < by_motion.line_residual_median_px;
    if by_lines.line_points >= LEAST_POINTS && better { (fitted, by_lines) } else { (*even, by_motion) }
}
