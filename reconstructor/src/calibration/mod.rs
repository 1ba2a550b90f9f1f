//! Section 4.1: the camera of every frame from the lines of the pitch.
//!
//! Correspondences give the camera of one frame; the lines of each picture then carry it through the shot in both directions.

pub mod command;
mod distance;
mod error;
mod fit;
mod grass;
mod homography;
mod initial;
mod input;
mod least_squares;
mod lines;
pub(crate) mod locate;
pub mod overlay;
mod sequence;
pub mod soccernet;
mod template;
#[cfg(test)]
mod tests;
mod tripod;

use image::RgbImage;
use protocol::camera::Camera;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use error::CalibrationError;
pub use input::{Calibration, Correspondence};

use crate::{
    detection::Detection,
    geometry::PixelBox,
    ingest::{Clip, ClipInfo, Frame, IngestError},
    report::Progress,
};
use lines::LinePixels;
use sequence::FrameLines;

/// Frames held in memory at a time while their lines are found.
const BATCH: usize = 16;

/// The camera of one frame, or why there is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraEstimate {
    /// The camera; `None` when it could not be solved.
    pub camera: Option<Camera>,
    /// Median distance between projected line points and the nearest line pixel, pixels; over projected points in the
    /// picture that are not hidden by people.
    pub line_residual_median_px: Option<f64>,
    /// Projected line points that the residual is measured on.
    pub line_points: usize,
    /// Why there is no camera, or why it is only predicted, in plain words.
    pub reason: Option<String>,
    /// What the camera rests on.
    #[serde(default)]
    pub source: CameraSource,
}

impl CameraEstimate {
    /// A frame without a camera.
    #[must_use]
    pub fn unsolved(reason: impl Into<String>) -> Self {
        Self { reason: Some(reason.into()), ..Self::default() }
    }
}

/// What the camera of a frame rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CameraSource {
    /// The pitch lines of the frame itself.
    #[default]
    Lines,
    /// The frames before and after; its own lines were not enough.
    Predicted,
}

/// The camera of every frame of a clip. `people` holds the detections of each frame (or is empty when there are none yet);
/// `first` the correspondences of one frame of the range.
///
/// # Errors
/// When the correspondences cannot be used, belong to no frame of the range or contradict its lines, or the clip cannot be
/// read. A frame whose lines cannot be followed is no error: its estimate says why it has no camera.
pub fn calibrate(
    clip: &Clip,
    people: &[Vec<Detection>],
    first: &Calibration,
    progress: &Progress,
) -> Result<Vec<CameraEstimate>, CalibrationError> {
    let info = clip.info();
    let start = start_in(info, first)?;
    if !people.is_empty() && people.len() != info.frames.len() {
        return Err(CalibrationError::PeopleMismatch { people: people.len(), frames: info.frames.len() });
    }
    // Before the long part: correspondences that cannot work are refused at once.
    let camera = initial::camera(first, (info.width_px, info.height_px))?;
    let frames = find_lines(clip.frames()?, people, &|| progress.advance(1))?;
    solve(&frames, start, &camera, first)
}

/// Where in the range the frame of the correspondences is.
pub(crate) fn start_in(info: &ClipInfo, first: &Calibration) -> Result<usize, CalibrationError> {
    info.frames.iter().position(|frame| frame.clip_frame == first.frame).ok_or_else(|| {
        CalibrationError::FrameOutside {
            frame: first.frame,
            start: info.frames.first().map_or(0, |frame| frame.clip_frame),
            end: info.frames.last().map_or(0, |frame| frame.clip_frame + 1),
        }
    })
}

/// The cameras of pictures of one shot, in order; `first.frame` counts from 0 in `pictures`.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_pictures(
    pictures: Vec<RgbImage>,
    first: &Calibration,
) -> Result<Vec<CameraEstimate>, CalibrationError> {
    let size = pictures.first().ok_or(CalibrationError::NoFrames)?.dimensions();
    let outside = CalibrationError::FrameOutside {
        frame: first.frame,
        start: 0,
        end: u32::try_from(pictures.len()).unwrap_or(u32::MAX),
    };
    let start = usize::try_from(first.frame).ok().filter(|&start| start < pictures.len()).ok_or(outside)?;
    let camera = initial::camera(first, size)?;
    let frames = pictures.into_iter().enumerate().map(|(index, image)| Ok(Frame { index, image }));
    let frames = find_lines(frames, &[], &|| {})?;
    solve(&frames, start, &camera, first)
}

/// Finds the line pixels of all frames, several frames at a time.
fn find_lines(
    mut frames: impl Iterator<Item = Result<Frame, IngestError>>,
    people: &[Vec<Detection>],
    done: &dyn Fn(),
) -> Result<Vec<FrameLines>, CalibrationError> {
    let mut found = Vec::new();
    loop {
        let batch = frames.by_ref().take(BATCH).collect::<Result<Vec<Frame>, _>>()?;
        if batch.is_empty() {
            return Ok(found);
        }
        let lines: Vec<FrameLines> = batch
            .par_iter()
            .map(|frame| {
                let detections = people.get(frame.index).map_or(&[][..], Vec::as_slice);
                let people: Vec<PixelBox> = detections.iter().map(|detection| detection.bounds).collect();
                FrameLines { lines: LinePixels::find(&frame.image, &people), people }
            })
            .collect();
        lines.iter().for_each(|_| done());
        found.extend(lines);
    }
}

/// Puts the first camera on the lines of its frame and follows the shot from there.
fn solve(
    frames: &[FrameLines],
    start: usize,
    camera: &Camera,
    given: &Calibration,
) -> Result<Vec<CameraEstimate>, CalibrationError> {
    let frame = given.frame;
    let first = frames.get(start).ok_or(CalibrationError::NoFrames)?;
    let samples = template::samples(&given.pitch);
    if first.lines.grass_share < grass::LEAST_SHARE {
        let reason = format!("grass covers {:.0} % of it", first.lines.grass_share * 100.0);
        return Err(CalibrationError::NoPitch { frame, reason });
    }
    let settled = sequence::settle(camera, first, &samples);
    let Some(camera) = settled.camera else {
        return Err(match settled.line_residual_median_px {
            Some(residual_px)
                if settled.line_points >= sequence::LEAST_POINTS && !first.lines.pixels.is_empty() =>
            {
                CalibrationError::LinesDisagree { frame, residual_px }
            }
            _ => CalibrationError::NoPitch { frame, reason: settled.reason.unwrap_or_default() },
        });
    };
    Ok(sequence::follow(frames, start, camera, &samples))
}
