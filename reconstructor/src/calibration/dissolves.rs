//! Cameras into a dissolve: while one shot fades into the next, the lines of the stronger picture can still be followed. Who is on
//! the pitch is not told from such frames (people of both pictures show), but where the camera looks is.

use std::ops::Range;

use super::{
    CameraEstimate,
    fit::{Expectation, fit},
    gaps::between,
    least_squares::Row,
    sequence::{FrameLines, judge, spread},
    template::Sample,
};
use crate::shots::{ShotList, TransitionKind};

/// How far a camera on its tripod is from even motion: the faint lines of the other picture must not pull it over.
const FADING_SIGMA: Row = spread(0.004, [0.003, 0.003, 0.000_6], 0.0, 0.0);

/// Follows the shot before into the first half of every dissolve and the shot after back into its second half, as far as lines agree.
pub(super) fn follow(
    estimates: &mut [CameraEstimate],
    frames: &[FrameLines],
    shots: &ShotList,
    samples: &[Sample],
) {
    let dissolves = shots.transitions.iter().filter(|t| t.kind == TransitionKind::Dissolve);
    for Range { start, end } in dissolves.map(|transition| transition.frames.clone()) {
        let middle = usize::midpoint(start, end);
        if let Some(last) = start.checked_sub(1) {
            extend(estimates, frames, start..middle, [last, last.saturating_sub(1)], samples);
        }
        extend(estimates, frames, (middle..end).rev(), [end, end + 1], samples);
    }
}

/// Goes on from two frames of the shot, the nearer one first.
fn extend(
    estimates: &mut [CameraEstimate],
    frames: &[FrameLines],
    order: impl Iterator<Item = usize>,
    [nearer, farther]: [usize; 2],
    samples: &[Sample],
) {
    let camera = |index: usize| estimates.get(index).and_then(|estimate| estimate.camera);
    let Some(mut last) = camera(nearer) else { return };
    let mut before = camera(farther).unwrap_or(last);
    let confidence = estimates.get(nearer).and_then(|estimate| estimate.confidence);
    for index in order {
        let (Some(frame), Some(place)) = (frames.get(index), estimates.get_mut(index)) else { return };
        let map = frame.lines.map();
        let expected = Expectation { camera: between(&before, &last, 2.0), sigma: FADING_SIGMA };
        let judged = judge(&fit(&expected, samples, &frame.people, &map), frame, samples, &map);
        let Some(camera) = judged.camera else { return };
        let reason = Some("in a dissolve: followed from the shot beside it".to_owned());
        *place = CameraEstimate { reason, confidence, ..judged };
        (before, last) = (last, camera);
    }
}
