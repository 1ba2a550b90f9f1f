//! What can be wrong with given correspondences or with the pictures, and what to do about it.

use std::path::PathBuf;

use super::soccernet::SoccerNetError;
use crate::{inference::InferenceError, ingest::IngestError};

/// Why no camera could be fitted.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The correspondence file cannot be read.
    #[error("{path}: cannot be read ({source}); give the correspondences with `--calibration POINTS.json`")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The correspondence file is not the JSON it should be.
    #[error(
        "{path}: not a correspondence file ({source}); write {{\"frame\": 0, \"points\": [{{\"name\": …, \"pixel\": \
         [x, y], \"world_m\": [x, y, z]}}, …]}}"
    )]
    Parse {
        /// The file.
        path: PathBuf,
        /// Where it breaks.
        source: serde_json::Error,
    },
    /// More data than any picture can hold.
    #[error("{path}: larger than {limit_bytes} bytes; keep the correspondences of one frame only")]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Most bytes taken.
        limit_bytes: u64,
    },
    /// Too few points on the pitch plane.
    #[error(
        "{given} correspondences on the pitch plane (y = 0); at least 4 are needed, no three of them on one line"
    )]
    TooFewPoints {
        /// How many there are.
        given: usize,
    },
    /// All points, or all but one, lie on one line.
    #[error(
        "the correspondences lie on one line {where_} (all but at most one of them); add points well away from it, for \
         example on the centre circle or a penalty area"
    )]
    Collinear {
        /// "in the world" or "in the picture".
        where_: &'static str,
    },
    /// A point outside the picture.
    #[error("correspondence {index} ({name}): pixel ({x}, {y}) is outside the {width}×{height} picture")]
    OutsidePicture {
        /// Position in the list, from 0.
        index: usize,
        /// Its name.
        name: String,
        /// Column.
        x: f64,
        /// Row.
        y: f64,
        /// Picture width in pixels.
        width: u32,
        /// Picture height in pixels.
        height: u32,
    },
    /// A number that is not finite, or a point far from any pitch.
    #[error(
        "correspondence {index} ({name}): coordinates must be finite and within 200 m of the centre mark"
    )]
    BadPoint {
        /// Position in the list, from 0.
        index: usize,
        /// Its name.
        name: String,
    },
    /// A pitch that no match is played on.
    #[error("a pitch of {length_m} × {width_m} m is not possible; length 40 to 150 m, width 30 to 110 m")]
    BadPitch {
        /// Goal line to goal line.
        length_m: f64,
        /// Touchline to touchline.
        width_m: f64,
    },
    /// No camera above the pitch sees the points where they are said to be.
    #[error(
        "no camera 3 to 60 m above the pitch sees the correspondences where they are given (best fit {rms_px:.1} px off); \
         check for swapped or mirrored points (x along the touchline to the right, z towards the main camera)"
    )]
    NoCamera {
        /// Root mean square distance of the best attempt, pixels.
        rms_px: f64,
    },
    /// The correspondences belong to a frame that is not read.
    #[error(
        "the correspondences are of frame {frame}, outside the frames {start}..{end}; choose a range that contains it"
    )]
    FrameOutside {
        /// The frame of the correspondences, in the whole clip.
        frame: u32,
        /// First frame of the range.
        start: u32,
        /// One past the last frame of the range.
        end: u32,
    },
    /// Nothing to work on.
    #[error("there are no frames to calibrate")]
    NoFrames,
    /// A list of people that does not go with the frames.
    #[error("{people} lists of people for {frames} frames; detect people in every frame first")]
    PeopleMismatch {
        /// Lists given.
        people: usize,
        /// Frames of the range.
        frames: usize,
    },
    /// The first frame shows no grass or no lines.
    #[error(
        "frame {frame}: no pitch in view ({reason}); the correspondences must belong to a frame that shows grass and lines"
    )]
    NoPitch {
        /// Frame in the whole clip.
        frame: u32,
        /// What is missing.
        reason: String,
    },
    /// The correspondences disagree with the lines in the picture.
    #[error(
        "frame {frame}: the lines of the picture are {residual_px:.1} px (median) from where the correspondences put them; \
         check the points, the pitch size and the frame number"
    )]
    LinesDisagree {
        /// Frame in the whole clip.
        frame: u32,
        /// Median distance in pixels.
        residual_px: f64,
    },
    /// A given camera that has no counterpart here.
    #[error("the given camera of frame {frame} cannot be used: {source}")]
    Camera {
        /// Frame in the whole clip.
        frame: u32,
        /// What cannot be expressed.
        source: SoccerNetError,
    },
    /// The network that finds cameras cannot be run.
    #[error(transparent)]
    Inference(#[from] InferenceError),
    /// The clip could not be read.
    #[error(transparent)]
    Ingest(#[from] IngestError),
    /// A picture could not be read.
    #[error("{path}: not a picture that can be read ({source}); give PNG or JPEG")]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: image::ImageError,
    },
    /// Pictures of one calibration must have one size.
    #[error(
        "{path}: is {width}×{height} but the first picture is {first_width}×{first_height}; give pictures of one size"
    )]
    PictureSize {
        /// The file.
        path: PathBuf,
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// Width of the first, pixels.
        first_width: u32,
        /// Height of the first, pixels.
        first_height: u32,
    },
    /// A result could not be written.
    #[error("{path}: cannot be written ({reason}); check the folder and the free space")]
    Write {
        /// The file.
        path: PathBuf,
        /// What went wrong.
        reason: String,
    },
}
