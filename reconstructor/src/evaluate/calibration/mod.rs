//! How near the cameras are to the truth: reprojection error at 960×540, completeness, overlap of the visible pitch.
//!
//! Four kinds of folders: a rendered clip (`truth.json`, `clip.mp4`, `correspondences.json`) and rendered pictures (`frames.jsonl`,
//! `images/`), where every camera is known; annotated pictures (`pitch_points.json`, `images/`, `labels/`: SoccerNet's keypoints
//! in the YOLO pose format); pictures with homographies (`homographies.json`: World Cup 2014).

mod annotated;
mod figures;
mod homographies;
mod rendered;

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use image::{ImageReader, RgbImage};
use protocol::{camera::Camera, pitch::Pitch};
use rayon::prelude::*;

pub use annotated::{AnnotatedView, annotated_views};
pub use figures::CalibrationFigures;

use crate::{
    calibration::{
        CalibrationError,
        locate::{Located, Locator, Terms},
    },
    inference::InferenceError,
    report::Progress,
};
use figures::FrameErrors;

/// Errors are stated for pictures of this width, whatever the picture's own.
const STATED_WIDTH_PX: f64 = 960.0;
/// Frames with fewer annotated points do not count.
const LEAST_POINTS: usize = 5;
/// Most bytes of one text file of a data folder.
const MAX_FILE_BYTES: u64 = 512 << 20;

/// A part of the fit that can be left out, to see what it is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Part {
    /// Named points.
    Points,
    /// Named lines, and the crossings of lines drawn on.
    Lines,
    /// Radial distortion.
    K1,
    /// Where broadcast cameras usually stand, level, with an ordinary lens (made twenty times as wide).
    Priors,
    /// The last step onto the painted lines of the picture.
    Polish,
    /// One place and one lens for all frames of a shot.
    Tripod,
}

/// How the stage is evaluated.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EvaluationOptions {
    /// Give four annotated points of each picture (a clip's correspondences), as a person would, instead of finding the camera
    /// without.
    pub clicks: bool,
    /// Leave these parts out.
    pub without: Vec<Part>,
}

impl EvaluationOptions {
    fn apart(&self) -> bool {
        self.without.contains(&Part::Tripod)
    }

    fn terms(&self) -> Terms {
        let with = |part| !self.without.contains(&part);
        Terms {
            points: with(Part::Points),
            lines: with(Part::Lines),
            priors: with(Part::Priors),
            radial: with(Part::K1),
            polish: with(Part::Polish),
        }
    }
}

/// Why the stage could not be evaluated on a folder.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationEvaluationError {
    /// The folder holds no kind of truth.
    #[error(
        "{path}: none of truth.json (a rendered clip), frames.jsonl (rendered pictures), pitch_points.json (annotated pictures) \
         and homographies.json is in it; give a folder that `reconstructor synthesize` or `cargo xtask dataset frames-test` \
         wrote, SoccerNet keypoints or World Cup 2014 homographies"
    )]
    NoTruth {
        /// The folder.
        path: PathBuf,
    },
    /// Single pictures have no tripod in common.
    #[error(
        "{path}: `--without tripod` leaves out what the frames of a shot share, and these are single pictures; give a rendered clip"
    )]
    NoShots {
        /// The folder.
        path: PathBuf,
    },
    /// A file of the folder cannot be read or understood.
    #[error("{path}: {reason}; restore the file from its source")]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The stage itself failed on the whole clip.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The network failed.
    #[error(transparent)]
    Inference(#[from] InferenceError),
}

/// What tells folders of single pictures.
const PICTURE_SETS: [&str; 3] = ["frames.jsonl", "pitch_points.json", "homographies.json"];

/// Evaluates the stage on a folder with truth.
///
/// # Errors
/// When the folder has no truth that can be read, or its clip cannot be calibrated at all.
pub fn evaluate(
    data: &Path,
    options: &EvaluationOptions,
    progress: &Progress,
) -> Result<CalibrationFigures, CalibrationEvaluationError> {
    let figures = if data.join("truth.json").is_file() {
        rendered::clip(data, options, progress)?
    } else if options.apart() && PICTURE_SETS.iter().any(|name| data.join(name).is_file()) {
        return Err(CalibrationEvaluationError::NoShots { path: data.into() });
    } else if data.join("frames.jsonl").is_file() {
        rendered::pictures(data, options, progress)?
    } else if data.join("pitch_points.json").is_file() {
        annotated::evaluate(data, options, progress)?
    } else if data.join("homographies.json").is_file() {
        homographies::evaluate(data, options, progress)?
    } else {
        return Err(CalibrationEvaluationError::NoTruth { path: data.into() });
    };
    let mode = if options.clicks { "points given" } else { "automatic" };
    let without = options.without.iter().map(|part| format!("{part:?}").to_lowercase()).collect();
    Ok(CalibrationFigures { mode, without, ..figures })
}

/// What was measured on one picture after another, and the processor time of it.
struct Measured {
    frames: Vec<FrameErrors>,
    cpu_s: f64,
    network_s: f64,
}

impl Measured {
    fn figures(&self) -> CalibrationFigures {
        let per_frame = |seconds: f64| (seconds > 0.0).then(|| seconds / self.frames.len().max(1) as f64);
        CalibrationFigures {
            cpu_s_per_frame: per_frame(self.cpu_s),
            network_s_per_frame: per_frame(self.network_s),
            ..figures::summary(&self.frames)
        }
    }
}

/// Finds the camera of each item's picture, several at a time, and measures it; `None` of `measure` leaves the item out.
fn locate_each<T: Sync>(
    items: &[T],
    options: &EvaluationOptions,
    progress: &Progress,
    measure: impl Fn(&T, &mut Finder) -> Result<Option<FrameErrors>, CalibrationEvaluationError> + Sync,
) -> Result<Measured, CalibrationEvaluationError> {
    let share = items.len().div_ceil(rayon::current_num_threads()).max(1);
    let parts: Vec<Measured> = items
        .par_chunks(share)
        .map(|items| {
            let mut finder = Finder { locator: Locator::load()?.with_terms(options.terms()), cpu_s: 0.0 };
            let mut frames = Vec::new();
            for item in items {
                frames.extend(measure(item, &mut finder)?);
                progress.advance(1);
            }
            Ok(Measured { frames, cpu_s: finder.cpu_s, network_s: finder.locator.network_s() })
        })
        .collect::<Result<_, CalibrationEvaluationError>>()?;
    let sum = |of: &dyn Fn(&Measured) -> f64| parts.iter().map(of).sum();
    let (cpu_s, network_s) = (sum(&|part| part.cpu_s), sum(&|part| part.network_s));
    Ok(Measured { frames: parts.into_iter().flat_map(|part| part.frames).collect(), cpu_s, network_s })
}

/// The automatic camera of single pictures, with the time it takes.
struct Finder {
    locator: Locator,
    cpu_s: f64,
}

impl Finder {
    /// The stage's best guess, however unsure; `None` when it has none.
    fn find(&mut self, picture: &RgbImage, pitch: &Pitch) -> Result<Option<Located>, InferenceError> {
        let started = crate::report::thread_cpu_s();
        let guess = self.locator.guess(picture, &[], pitch)?.ok();
        self.cpu_s += crate::report::thread_cpu_s() - started;
        Ok(guess)
    }
}

/// Errors of a frame by its guess: `of` measures a camera, or none. Unsure guesses count as none, but it is kept whether
/// they were right.
fn by_guess(guess: Option<&Located>, of: impl Fn(Option<&Camera>) -> FrameErrors) -> FrameErrors {
    let Some(located) = guess else { return of(None) };
    let guessed = of(Some(&located.camera));
    let right = Some(guessed.is_right());
    let frame = if located.is_sure() { guessed } else { of(None) };
    FrameErrors { confidence: Some(located.confidence), right, ..frame }
}

fn open_picture(path: &Path) -> Result<RgbImage, CalibrationEvaluationError> {
    let unreadable = |reason: String| CalibrationEvaluationError::File { path: path.into(), reason };
    let reader = ImageReader::open(path).map_err(|e| unreadable(e.to_string()))?;
    Ok(reader.decode().map_err(|e| unreadable(e.to_string()))?.into_rgb8())
}

fn read(path: &Path) -> Result<String, CalibrationEvaluationError> {
    let failed = |reason: String| CalibrationEvaluationError::File { path: path.into(), reason };
    let file = std::fs::File::open(path).map_err(|e| failed(e.to_string()))?;
    let mut text = String::new();
    file.take(MAX_FILE_BYTES).read_to_string(&mut text).map_err(|e| failed(e.to_string()))?;
    Ok(text)
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T, CalibrationEvaluationError> {
    let failed = |reason: String| CalibrationEvaluationError::File { path: path.into(), reason };
    serde_json::from_str(&read(path)?).map_err(|e| failed(e.to_string()))
}

/// A file with one JSON value per line.
fn parse_lines<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Vec<T>, CalibrationEvaluationError> {
    let text = read(path)?;
    text.lines()
        .enumerate()
        .map(|(line, json)| {
            serde_json::from_str(json).map_err(|error| CalibrationEvaluationError::File {
                path: path.into(),
                reason: format!("line {}: {error}", line + 1),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_truth_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let run = || evaluate(folder.path(), &EvaluationOptions::default(), &Progress::hidden()).unwrap_err();
        assert!(matches!(run(), CalibrationEvaluationError::NoTruth { .. }));
        std::fs::write(folder.path().join("truth.json"), "{}").unwrap();
        let error = run();
        assert!(error.to_string().contains("truth.json"), "{error}");
    }

    #[test]
    fn single_pictures_have_no_tripod_to_leave_out() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("frames.jsonl"), "").unwrap();
        let options = EvaluationOptions { without: vec![Part::Tripod], ..EvaluationOptions::default() };
        let error = evaluate(folder.path(), &options, &Progress::hidden()).unwrap_err();
        assert!(error.to_string().contains("single pictures"), "{error}");
    }
}
