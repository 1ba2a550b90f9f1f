//! One pass over the frames: the line pixels of each, and the cameras that can be found in some of them alone.
//!
//! Needs no camera, so that frames are done in parallel; pictures are dropped as soon as they were looked at.

use std::collections::BTreeMap;

use protocol::pitch::Pitch;
use rayon::prelude::*;

use super::{CalibrationError, find::Finders, lines::LinePixels, locate::Located, sequence::FrameLines};
use crate::{
    detection::Detection,
    geometry::PixelBox,
    ingest::{Frame, IngestError},
};

/// Frames held in memory at a time.
const BATCH: usize = 16;

/// What came of looking for the camera of a frame on its own, by frame.
pub(super) type Attempts = BTreeMap<usize, Result<Located, String>>;

/// The boxes of the people of a frame.
pub(super) fn boxes(people: &[Vec<Detection>], index: usize) -> Vec<PixelBox> {
    people.get(index).map_or(&[][..], Vec::as_slice).iter().map(|detection| detection.bounds).collect()
}

/// Finds the line pixels of all frames.
pub(super) fn lines(
    frames: impl Iterator<Item = Result<Frame, IngestError>>,
    people: &[Vec<Detection>],
    done: &dyn Fn(),
) -> Result<Vec<FrameLines>, CalibrationError> {
    let mut found = Vec::new();
    in_batches(
        frames,
        |_| true,
        done,
        |frame| {
            let people = boxes(people, frame.index);
            Ok(FrameLines { lines: LinePixels::find(&frame.image, &people), people })
        },
        |_, lines| found.push(lines),
    )?;
    Ok(found)
}

/// Looks for the cameras of the frames that `wanted` names, each on its own.
pub(super) fn cameras(
    frames: impl Iterator<Item = Result<Frame, IngestError>>,
    people: &[Vec<Detection>],
    wanted: &[usize],
    finders: &Finders<'_>,
    pitch: &Pitch,
) -> Result<Attempts, CalibrationError> {
    let mut attempts = Attempts::new();
    let last = wanted.iter().max().map_or(0, |last| last + 1);
    in_batches(
        frames.take(last),
        |frame| wanted.contains(&frame.index),
        &|| {},
        |frame| Ok(finders.find(&frame.image, &boxes(people, frame.index), pitch)?),
        |index, attempt| {
            attempts.insert(index, attempt);
        },
    )?;
    Ok(attempts)
}

/// Runs `work` on the frames that `keep` takes, a batch in parallel, and hands the results to `result` in order.
fn in_batches<R: Send>(
    mut frames: impl Iterator<Item = Result<Frame, IngestError>>,
    keep: impl Fn(&Frame) -> bool,
    done: &dyn Fn(),
    work: impl Fn(&Frame) -> Result<R, CalibrationError> + Sync,
    mut result: impl FnMut(usize, R),
) -> Result<(), CalibrationError> {
    loop {
        // Frames that are not wanted must not fill a batch, nor memory.
        let wanted = frames.by_ref().inspect(|_| done()).filter(|frame| frame.as_ref().map_or(true, &keep));
        let batch = wanted.take(BATCH).collect::<Result<Vec<Frame>, _>>()?;
        if batch.is_empty() {
            return Ok(());
        }
        let results: Vec<Result<R, CalibrationError>> = batch.par_iter().map(&work).collect();
        for (frame, found) in batch.iter().zip(results) {
            result(frame.index, found?);
        }
    }
}
