//! Tracks in the form of the MOT Challenge, which TrackEval and most trackers read.

use std::fmt::Write;

use super::FrameTruth;

/// Lines of `gt/gt.txt`: frame and identity from 1, left, top, width, height in pixels counted from 1, whether the person
/// counts (`in_view`), class 1 (a person), share that is visible.
pub(super) fn lines(truth: &FrameTruth) -> String {
    let mut text = String::new();
    for person in &truth.people {
        let [left, top, right, bottom] = person.box_px;
        // Pixel 1 of the format begins half a pixel before the middle of the first pixel, which is 0 here.
        let _ = writeln!(
            text,
            "{},{},{:.2},{:.2},{:.2},{:.2},{},1,{}",
            truth.frame + 1,
            person.id + 1,
            left + 1.5,
            top + 1.5,
            right - left,
            bottom - top,
            u8::from(person.in_view),
            person.visible_share
        );
    }
    text
}

/// `seqinfo.ini`.
pub(super) fn sequence(frames: usize, frame_rate: u32, [width, height]: [u32; 2]) -> String {
    format!(
        "[Sequence]\nname=clip\nimDir=\nframeRate={frame_rate}\nseqLength={frames}\nimWidth={width}\nimHeight={height}\nimExt=\n"
    )
}
