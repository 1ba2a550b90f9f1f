//! Clip to frames.

use image::RgbImage;
use protocol::time::{Ticks, Timescale};
use serde::{Deserialize, Serialize};

/// What is known of a clip before its pictures are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipInfo {
    /// Picture width in pixels.
    pub width_px: u32,
    /// Picture height in pixels.
    pub height_px: u32,
    /// Ticks per second of every time of this clip.
    pub timescale: Timescale,
    /// The frames of the chosen range, in order.
    pub frames: Vec<FrameTime>,
}

/// When a frame is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameTime {
    /// Index of the frame in the whole clip, from 0.
    pub clip_frame: u32,
    /// When it is shown, from the first frame of the chosen range.
    pub start: Ticks,
    /// How long it is shown.
    pub duration: Ticks,
    /// Whether the picture repeats the one before (telecine, frozen feed).
    pub duplicate: bool,
}

/// One picture of the clip.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Index in [`ClipInfo::frames`]: 0 is the first frame of the chosen range.
    pub index: usize,
    /// The picture, sRGB as the clip's colour tags say.
    pub image: RgbImage,
}
