//! What stops a whole reconstruction.

use std::path::PathBuf;

use thiserror::Error;

use crate::{
    calibration::CalibrationError, depth::DepthError, detection::DetectionError, encode::EncodeError,
    inference::InferenceError, ingest::IngestError, overlay::OverlayError, pose::PoseError,
    segmentation::SegmentationError,
};

/// Why a clip was not reconstructed.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// The clip cannot be read.
    #[error(transparent)]
    Ingest(#[from] IngestError),
    /// The networks cannot be run.
    #[error(transparent)]
    Inference(#[from] InferenceError),
    /// The detector failed.
    #[error(transparent)]
    Detection(#[from] DetectionError),
    /// No camera.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The correspondences do not fit the clip.
    #[error("{}: {source}", path.display())]
    Correspondences {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        source: Box<CalibrationError>,
    },
    /// The pose network failed.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// The mask network failed.
    #[error(transparent)]
    Segmentation(#[from] SegmentationError),
    /// The depth network failed.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// The pictures for checking by eye cannot be written.
    #[error(transparent)]
    Overlay(#[from] OverlayError),
    /// The stream cannot be written.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The work folder cannot be used.
    #[error("cannot {doing} {} in the work folder: {source}; free some space or choose another --work", path.display())]
    Work {
        /// What was tried.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The folder of the stream cannot be made.
    #[error("cannot create {} for the stream: {source}; choose another --out", path.display())]
    Out {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// No frame has a camera.
    #[error(
        "{}: no camera in any of {frames} frames ({reason}); check the calibration points and that the pitch lines are in view",
        clip.display()
    )]
    NoCamera {
        /// The clip.
        clip: PathBuf,
        /// Frames looked at.
        frames: usize,
        /// Why the first has none.
        reason: String,
    },
    /// Nobody in the whole clip.
    #[error(
        "{}: nobody could be followed on the pitch in {frames} frames ({seen} sightings); check that the clip shows a match from the main camera and that the calibration points are right",
        clip.display()
    )]
    Nobody {
        /// The clip.
        clip: PathBuf,
        /// Frames looked at.
        frames: usize,
        /// People seen on the pitch, too short or too scattered to be followed.
        seen: usize,
    },
    /// The clip ended before its own count of frames.
    #[error("{}: only {read} of {expected} frames could be read again; the file changed or is damaged", clip.display())]
    FramesMissing {
        /// The clip.
        clip: PathBuf,
        /// Frames that came.
        read: usize,
        /// Frames that came the first time.
        expected: usize,
    },
}
