//! What can be wrong with a clip: each error names the file, the place in it and what to do.

use std::path::PathBuf;

/// Why a clip could not be read.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// The file is missing, a folder, or not readable.
    #[error("{path}: cannot be opened ({source}); give the path of a video file")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// FFmpeg knows no such container, or the header is broken.
    #[error(
        "{path}: not a video container that can be read ({reason}); give an MP4, Matroska, MPEG-TS or similar file"
    )]
    Container {
        /// The file.
        path: PathBuf,
        /// What FFmpeg says.
        reason: String,
    },
    /// A container without moving pictures, such as an audio file.
    #[error("{path}: has no video stream; give a file with H.264, HEVC or AV1 video")]
    NoVideo {
        /// The file.
        path: PathBuf,
    },
    /// This build of FFmpeg cannot decode the stream.
    #[error(
        "{path}: video codec {codec} cannot be decoded ({reason}); convert the clip to H.264, HEVC or AV1"
    )]
    Codec {
        /// The file.
        path: PathBuf,
        /// Name of the codec.
        codec: String,
        /// What FFmpeg says.
        reason: String,
    },
    /// A video stream from which no picture came out.
    #[error("{path}: no frame of its video could be decoded; check that the file is complete")]
    NoFrames {
        /// The file.
        path: PathBuf,
    },
    /// Bad data in the middle.
    #[error(
        "{path}: the video is damaged at frame {frame} ({reason}); use `--frames A..B` to choose a part before it, or \
         a complete copy"
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Index in the whole clip of the first frame that did not decode.
        frame: u32,
        /// What is wrong.
        reason: String,
    },
    /// A picture larger, smaller or stranger than this program takes.
    #[error(
        "{path}: frame {frame} is {width}×{height}; pictures from {min}×{min} to {max}×{max} can be used"
    )]
    PictureSize {
        /// The file.
        path: PathBuf,
        /// Index in the whole clip.
        frame: u32,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Least side, pixels.
        min: u32,
        /// Greatest side, pixels.
        max: u32,
    },
    /// The picture changes its size or format inside the chosen range.
    #[error(
        "{path}: the picture format changes at frame {frame}; use `--frames A..B` to stay on one side of it"
    )]
    FormatChanged {
        /// The file.
        path: PathBuf,
        /// Index in the whole clip of the first frame of the other format.
        frame: u32,
    },
    /// The chosen range is empty or reaches past the end.
    #[error(
        "{path}: frames {start}..{end} are not in the clip, which has {available} frames; choose A < B ≤ {available}"
    )]
    Range {
        /// The file.
        path: PathBuf,
        /// First frame asked for.
        start: u32,
        /// One past the last frame asked for.
        end: u32,
        /// Frames that could be decoded.
        available: u32,
    },
    /// More frames than one reconstruction takes.
    #[error("{path}: more than {limit} frames; choose a part with `--frames A..B`")]
    TooLong {
        /// The file.
        path: PathBuf,
        /// Most frames of one range.
        limit: u32,
    },
    /// Frames without times in a stream without a rate.
    #[error(
        "{path}: frame {frame} has no timestamp and the stream no frame rate; remux the clip into MP4 or Matroska"
    )]
    NoTime {
        /// The file.
        path: PathBuf,
        /// Index in the whole clip.
        frame: u32,
    },
    /// The file gave other frames than when it was opened.
    #[error(
        "{path}: frame {frame} is no longer where it was when the clip was opened; keep the file unchanged during a run"
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Index in the whole clip.
        frame: u32,
    },
    /// A colour conversion that FFmpeg refuses.
    #[error(
        "{path}: the pixel format of frame {frame} cannot be converted to RGB ({reason}); convert the clip to 8-bit 4:2:0"
    )]
    Colour {
        /// The file.
        path: PathBuf,
        /// Index in the whole clip.
        frame: u32,
        /// What FFmpeg says.
        reason: String,
    },
}
