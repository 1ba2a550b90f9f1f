//! Section 4.1: the camera of every frame from the lines of the pitch.
//!
//! In some frames of a shot the camera is found on its own (or given by hand); the lines of each picture then carry it through
//! the shot in both directions, and one tripod is fitted to all of them together.

mod chains;
pub mod command;
mod dissolves;
mod distance;
mod error;
mod find;
mod fit;
mod gaps;
mod gather;
mod given;
mod grass;
mod homography;
mod initial;
mod input;
mod least_squares;
mod lines;
pub(crate) mod locate;
pub mod overlay;
mod sequence;
mod shot;
#[cfg(test)]
mod shot_tests;
pub mod soccernet;
mod template;
#[cfg(test)]
mod tests;
mod tripod;

use image::RgbImage;
use protocol::{camera::Camera, pitch::Pitch};
use serde::{Deserialize, Serialize};

pub use error::CalibrationError;
pub use find::{FindCamera, Finders, LoadFinder, MODEL, shipped};
pub use given::Given;
pub use input::{Calibration, Correspondence, is_possible};
pub use locate::Located;
pub use shot::ShotFigures;
pub use tripod::Lens;

use crate::{
    detection::Detection,
    ingest::{Clip, ClipInfo, Frame},
    report::Progress,
    shots::ShotList,
};
use chains::Anchor;
use gather::Attempts;
use sequence::FrameLines;

/// Frames of a shot in which the camera is looked for alone: one in so many, at least [`LEAST_LOOKS`], at most
/// [`MOST_LOOKS`].
const LOOK_EVERY: usize = 40;
const LEAST_LOOKS: usize = 3;
const MOST_LOOKS: usize = 12;
/// Times that more frames are looked at where no camera is known yet.
const ROUNDS: usize = 3;
/// Frames in a row without a camera before another one is looked at alone.
const LEAST_STRETCH: usize = 12;

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
    /// How likely the camera is right as a whole, 0..1: 1 where it follows from a given one; `None` without a camera.
    #[serde(default)]
    pub confidence: Option<f64>,
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

/// What is known before the pictures are looked at.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// The size of the pitch.
    pub pitch: Pitch,
    /// Cameras or points given by hand.
    pub given: Option<&'a Given>,
    /// Who finds the camera of single frames in shots without given ones; nobody when `None`.
    pub finders: Option<&'a Finders<'a>>,
    /// Leaves every frame a place and a lens of its own, to see what a common one is worth.
    pub apart: bool,
}

/// The cameras of a clip.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClipCameras {
    /// One per frame.
    pub frames: Vec<CameraEstimate>,
    /// One per shot.
    pub shots: Vec<ShotFigures>,
}

/// Whether what is given can be used for a clip, before any of its pictures is looked at.
///
/// # Errors
/// Names the first thing that is wrong with it.
pub fn check_given(info: &ClipInfo, known: &Known<'_>) -> Result<(), CalibrationError> {
    given::anchors(known, &numbers(info), (info.width_px, info.height_px)).map(|_| ())
}

/// The clip frame of every frame of the range.
fn numbers(info: &ClipInfo) -> Vec<u32> {
    info.frames.iter().map(|frame| frame.clip_frame).collect()
}

/// The camera of every frame of a clip that is one shot, from correspondences of one of its frames. `people` holds the detections
/// of each frame (or is empty when there are none yet).
///
/// # Errors
/// As [`calibrate_shots`].
pub fn calibrate(
    clip: &Clip,
    people: &[Vec<Detection>],
    first: &Calibration,
    progress: &Progress,
) -> Result<Vec<CameraEstimate>, CalibrationError> {
    let given = Given::Points(first.clone());
    let known = Known { pitch: first.pitch, given: Some(&given), finders: None, apart: false };
    let shots = ShotList::single(clip.info().frames.len());
    Ok(calibrate_shots(clip, people, &shots, &known, progress)?.frames)
}

/// The camera of every frame of a clip with its shots. No shot knows of another.
///
/// # Errors
/// When what is given cannot be used, belongs to no shot of the range or contradicts its lines, the clip cannot be read, or the
/// network that finds cameras cannot be run and no camera is given. A frame without a camera is no error: its estimate says why.
pub fn calibrate_shots(
    clip: &Clip,
    people: &[Vec<Detection>],
    shots: &ShotList,
    known: &Known<'_>,
    progress: &Progress,
) -> Result<ClipCameras, CalibrationError> {
    let info = clip.info();
    if !people.is_empty() && people.len() != info.frames.len() {
        return Err(CalibrationError::PeopleMismatch { people: people.len(), frames: info.frames.len() });
    }
    // Before the long part: what cannot work is refused at once.
    let numbers = numbers(info);
    let given = given::anchors(known, &numbers, (info.width_px, info.height_px))?;
    let frames = gather::lines(clip.frames()?, people, &|| progress.advance(1))?;
    let look = |wanted: &[usize], finders: &Finders<'_>| {
        gather::cameras(clip.frames()?, people, wanted, finders, &known.pitch)
    };
    given::check(&given, &numbers, &frames, shots, &template::samples(&known.pitch))?;
    solve(&frames, shots, given, known, &look)
}

/// The cameras of pictures of one shot, in order, from correspondences; `first.frame` counts from 0 in `pictures`.
///
/// # Errors
/// As [`calibrate_shots`].
pub fn calibrate_pictures(
    pictures: Vec<RgbImage>,
    first: &Calibration,
) -> Result<Vec<CameraEstimate>, CalibrationError> {
    let given = Given::Points(first.clone());
    let known = Known { pitch: first.pitch, given: Some(&given), finders: None, apart: false };
    Ok(calibrate_images(&pictures, &known)?.frames)
}

/// The cameras of pictures of one shot, in order, from what is known; frames count from 0 in `pictures`.
///
/// # Errors
/// As [`calibrate_shots`].
pub fn calibrate_images(pictures: &[RgbImage], known: &Known<'_>) -> Result<ClipCameras, CalibrationError> {
    images(pictures, &ShotList::single(pictures.len()), known)
}

fn images(
    pictures: &[RgbImage],
    shots: &ShotList,
    known: &Known<'_>,
) -> Result<ClipCameras, CalibrationError> {
    let size = pictures.first().ok_or(CalibrationError::NoFrames)?.dimensions();
    let numbers: Vec<u32> = (0..).take(pictures.len()).collect();
    let given = given::anchors(known, &numbers, size)?;
    let all = || pictures.iter().enumerate().map(|(index, image)| Ok(Frame { index, image: image.clone() }));
    let frames = gather::lines(all(), &[], &|| {})?;
    let look =
        |wanted: &[usize], finders: &Finders<'_>| gather::cameras(all(), &[], wanted, finders, &known.pitch);
    given::check(&given, &numbers, &frames, shots, &template::samples(&known.pitch))?;
    solve(&frames, shots, given, known, &look)
}

/// Looks for the cameras of some frames alone.
type Look<'a> = dyn Fn(&[usize], &Finders<'_>) -> Result<Attempts, CalibrationError> + 'a;

/// Solves every shot: looks at some of its frames alone, follows, and looks at more where that leaves frames without a camera.
fn solve(
    frames: &[FrameLines],
    shots: &ShotList,
    given: Vec<Anchor>,
    known: &Known<'_>,
    look: &Look<'_>,
) -> Result<ClipCameras, CalibrationError> {
    let samples = template::samples(&known.pitch);
    let mut all: Vec<ShotInWork> = shots
        .shots
        .iter()
        .map(|shot| {
            let inside = given.iter().filter(|anchor| shot.frames.contains(&anchor.index));
            let anchors =
                inside.map(|a| Anchor { index: a.index - shot.frames.start, ..a.clone() }).collect();
            ShotInWork { frames: shot.frames.clone(), anchors, refused: Vec::new(), solution: None }
        })
        .collect();
    let mut finders = known.finders;
    for round in 0..ROUNDS {
        let wanted: Vec<Vec<usize>> =
            all.iter().map(|shot| if finders.is_some() { shot.wanted(round) } else { Vec::new() }).collect();
        if let (Some(found), true) = (finders, wanted.iter().any(|wanted| !wanted.is_empty())) {
            let flat: Vec<usize> = wanted.iter().flatten().copied().collect();
            match look(&flat, found) {
                Ok(attempts) => all.iter_mut().for_each(|shot| shot.take(&attempts)),
                Err(CalibrationError::Inference(error)) if !given.is_empty() => {
                    tracing::warn!("{error}; only shots with given cameras are solved");
                    finders = None;
                }
                Err(error) => return Err(error),
            }
        }
        for (shot, wanted) in all.iter_mut().zip(&wanted) {
            if shot.solution.is_none() || !wanted.is_empty() {
                let part = frames.get(shot.frames.clone()).unwrap_or_default();
                shot.solution = Some(shot::solve(part, &shot.anchors, &shot.refused, &samples, known.apart));
            }
        }
    }
    let mut cameras = together(frames.len(), shots, all);
    dissolves::follow(&mut cameras.frames, frames, shots, &samples);
    Ok(cameras)
}

/// The estimates of all shots in one list; frames between shots say what they are.
fn together(frames: usize, shots: &ShotList, solved: Vec<ShotInWork>) -> ClipCameras {
    let mut cameras = ClipCameras { frames: vec![CameraEstimate::default(); frames], shots: Vec::new() };
    for transition in &shots.transitions {
        let range = transition.frames.start..transition.frames.end.min(frames);
        cameras.frames.get_mut(range).into_iter().flatten().for_each(|estimate| {
            *estimate = CameraEstimate::unsolved(transition.kind.name());
        });
    }
    for shot in solved {
        let Some(solution) = shot.solution else { continue };
        let places = cameras.frames.get_mut(shot.frames.clone()).into_iter().flatten();
        places.zip(solution.estimates).for_each(|(place, estimate)| *place = estimate);
        cameras.shots.push(ShotFigures { frames: shot.frames, ..solution.figures });
    }
    cameras
}

/// A shot while it is being solved; frames counted in the shot, except in `frames`.
struct ShotInWork {
    frames: std::ops::Range<usize>,
    anchors: Vec<Anchor>,
    refused: Vec<(usize, String)>,
    solution: Option<shot::Solution>,
}

impl ShotInWork {
    /// Frames of the clip in which a camera should be looked for next: spread over the shot at first, then in the middle of
    /// what has none. A given camera wins for its shot, so nothing is looked for there before it was followed.
    fn wanted(&self, round: usize) -> Vec<usize> {
        let length = self.frames.len();
        let Some(solution) = &self.solution else {
            if self.anchors.iter().any(|anchor| anchor.given) {
                return Vec::new();
            }
            let count = (length / LOOK_EVERY).clamp(LEAST_LOOKS, MOST_LOOKS).min(length);
            return (0..count).map(|k| self.frames.start + (2 * k + 1) * length / (2 * count)).collect();
        };
        // What was tried splits the stretches without a camera.
        let tried = |index: usize| {
            self.anchors.iter().any(|a| a.index == index) || self.refused.iter().any(|(i, _)| *i == index)
        };
        let missing: Vec<bool> = solution
            .estimates
            .iter()
            .enumerate()
            .map(|(index, estimate)| estimate.camera.is_none() && !tried(index))
            .collect();
        let mut middles = Vec::new();
        let mut start = 0;
        for stretch in missing.split(|missing| !missing) {
            if stretch.len() >= LEAST_STRETCH {
                middles.push((stretch.len(), self.frames.start + start + stretch.len() / 2));
            }
            start += stretch.len() + 1;
        }
        middles.sort_by_key(|(length, _)| std::cmp::Reverse(*length));
        middles.truncate(MOST_LOOKS / round.max(1));
        middles.into_iter().map(|(_, index)| index).collect()
    }

    /// Takes what was found in its frames.
    fn take(&mut self, attempts: &Attempts) {
        for (index, attempt) in attempts.range(self.frames.clone()) {
            let index = index - self.frames.start;
            match attempt {
                Ok(found) => {
                    let Located { camera, confidence } = *found;
                    self.anchors.push(Anchor { index, camera, confidence, given: false });
                }
                Err(reason) => self.refused.push((index, reason.clone())),
            }
        }
    }
}
