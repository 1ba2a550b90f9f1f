//! Clip to frames: opens a video file, fixes the times of every frame of the chosen range, and gives the pictures in order.
//!
//! Frames are numbered as they are shown, from 0 at the first picture that FFmpeg's decoder gives out.

mod colour;
mod error;
mod source;
#[cfg(test)]
mod tests;

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use image::RgbImage;
use protocol::time::{Ticks, Timescale};
use serde::{Deserialize, Serialize};

pub use error::IngestError;

use colour::Converter;
use source::Source;

/// Least width and height of a picture, pixels.
pub const MIN_SIDE_PX: u32 = 64;
/// Greatest width and height of a picture, pixels.
pub const MAX_SIDE_PX: u32 = 8192;
/// Most frames in one range: five hours at 50 frames per second.
pub const MAX_FRAMES: u32 = 900_000;

/// Size of the grey signatures by which repeated pictures are found.
const SIGNATURE_SIZE: (u32, u32) = (64, 36);
/// Size of the colour thumbnails that [`Clip::open_watched`] hands out.
pub const THUMBNAIL_SIZE: (u32, u32) = (64, 36);
/// A repeated picture differs from the one before by coding noise only: no block of it by more than this, of 255.
const DUPLICATE_BLOCK_DIFFERENCE: u8 = 3;

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

impl ClipInfo {
    /// Frames per second as a fraction, from how long the first frame is shown.
    #[must_use]
    pub fn rate(&self) -> (u32, u32) {
        let ticks = self.frames.first().map_or(1, |frame| frame.duration.0.max(1));
        let per_frame = u64::from(self.timescale.denominator).saturating_mul(ticks.unsigned_abs());
        (self.timescale.numerator, u32::try_from(per_frame).unwrap_or(u32::MAX).max(1))
    }
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

/// A video file whose chosen frames have been found, timed and checked.
#[derive(Clone, Debug)]
pub struct Clip {
    path: PathBuf,
    info: ClipInfo,
    key: Option<KeyFrame>,
}

/// Sees the thumbnails of a clip's frames: RGB, row by row, [`THUMBNAIL_SIZE`].
pub type Watch<'w> = &'w mut dyn FnMut(&[u8]);

/// A place from which decoding can start: where [`Clip::frames`] seeks to.
#[derive(Clone, Copy, Debug)]
struct KeyFrame {
    clip_frame: u32,
    timestamp: i64,
}

impl Clip {
    /// Opens a clip and decodes it up to the end of `range` (clip frames; all when `None`) to learn the times.
    ///
    /// # Errors
    /// When the file is missing, has no video that can be decoded, is damaged inside the range, or the range is not in it.
    pub fn open(path: &Path, range: Option<Range<u32>>) -> Result<Self, IngestError> {
        Self::survey(path, range, None)
    }

    /// As [`Clip::open`], and hands a thumbnail of every frame of the range to `watch`, in order: RGB, row by row,
    /// [`THUMBNAIL_SIZE`], each pixel the mean of its area.
    ///
    /// # Errors
    /// As [`Clip::open`].
    pub fn open_watched(
        path: &Path,
        range: Option<Range<u32>>,
        watch: Watch<'_>,
    ) -> Result<Self, IngestError> {
        Self::survey(path, range, Some(watch))
    }

    fn survey(path: &Path, range: Option<Range<u32>>, watch: Option<Watch<'_>>) -> Result<Self, IngestError> {
        let wanted = range.clone().unwrap_or(0..u32::MAX);
        let outside = |available| IngestError::Range {
            path: path.into(),
            start: wanted.start,
            end: wanted.end,
            available,
        };
        let mut source = Source::open(path, wanted.start)?;
        let timescale =
            source.timescale().ok_or_else(|| IngestError::NoTime { path: path.into(), frame: 0 })?;
        let mut survey = Survey::new(path, &source, watch);
        let mut clip_frame = 0_u32;
        // One frame past the range tells how long the last one is shown.
        while clip_frame <= wanted.end {
            match source.advance() {
                Ok(true) => {}
                Ok(false) => break,
                Err(IngestError::Damaged { .. }) if clip_frame >= wanted.end => break,
                Err(error) => return Err(error),
            }
            survey.add(&source, clip_frame, &wanted)?;
            clip_frame += 1;
        }
        if clip_frame == 0 {
            return Err(IngestError::NoFrames { path: path.into() });
        }
        if range.is_some() && (wanted.is_empty() || wanted.end > clip_frame) {
            // Asked for more than there is: an empty range may have stopped the count early, so count on.
            while source.advance().unwrap_or(false) && clip_frame < MAX_FRAMES {
                clip_frame += 1;
            }
            return Err(outside(clip_frame));
        }
        let (size, frames, key) = survey.finish();
        let (width_px, height_px) = size.ok_or_else(|| outside(clip_frame))?;
        let info = ClipInfo { width_px, height_px, timescale, frames };
        Ok(Self { path: path.into(), info, key })
    }

    /// Size, timescale and the frames of the range.
    #[must_use]
    pub fn info(&self) -> &ClipInfo {
        &self.info
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the pictures of the range from its first frame; may be called again.
    ///
    /// # Errors
    /// When the file can no longer be opened.
    pub fn frames(&self) -> Result<FrameReader, IngestError> {
        let first = self.info.frames.first().map_or(0, |frame| frame.clip_frame);
        let mut source = Source::open(&self.path, first)?;
        let mut clip_frame = 0;
        if let Some(key) = self.key {
            if source.seek(key.timestamp, key.clip_frame)? {
                clip_frame = key.clip_frame;
            } else {
                tracing::warn!(clip = %self.path.display(), frame = first, "seeking failed; decoding from the start");
                source = Source::open(&self.path, first)?;
            }
        }
        Ok(FrameReader {
            path: self.path.clone(),
            info: self.info.clone(),
            source,
            clip_frame,
            next: 0,
            converter: None,
            failed: false,
        })
    }
}

/// Collects times while [`Clip::open`] decodes.
struct Survey<'w> {
    path: PathBuf,
    nominal: Option<i64>,
    previous: Option<i64>,
    first: i64,
    times_are_real: bool,
    size: Option<(u32, u32)>,
    grey: Option<Converter>,
    signature: Option<Vec<u8>>,
    frames: Vec<FrameTime>,
    key: Option<KeyFrame>,
    watch: Option<Watch<'w>>,
    thumbnails: Option<Converter>,
}

impl<'w> Survey<'w> {
    fn new(path: &Path, source: &Source, watch: Option<Watch<'w>>) -> Self {
        Self {
            path: path.into(),
            nominal: source.nominal_duration(),
            previous: None,
            first: 0,
            times_are_real: true,
            size: None,
            grey: None,
            signature: None,
            frames: Vec::new(),
            key: None,
            watch,
            thumbnails: None,
        }
    }

    fn add(&mut self, source: &Source, clip_frame: u32, wanted: &Range<u32>) -> Result<(), IngestError> {
        let timestamp = self.time(source.timestamp(), clip_frame)?;
        let step = self.previous.map(|previous| timestamp - previous);
        if let (Some(last), Some(step)) = (self.frames.last_mut(), step) {
            last.duration = Ticks(step);
        }
        self.previous = Some(timestamp);
        if clip_frame <= wanted.start && source.picture().is_key() && clip_frame > 0 {
            self.key = Some(KeyFrame { clip_frame, timestamp });
        }
        // The frame before the range is looked at too: the first of the range may repeat it.
        if clip_frame.saturating_add(1) < wanted.start || clip_frame >= wanted.end {
            return Ok(());
        }
        let duplicate = self.repeats(source, clip_frame)?;
        if clip_frame < wanted.start {
            return Ok(());
        }
        if self.frames.len() >= MAX_FRAMES as usize {
            return Err(IngestError::TooLong { path: self.path.clone(), limit: MAX_FRAMES });
        }
        let picture = source.picture();
        let size = *self.size.get_or_insert((picture.width(), picture.height()));
        if size != (picture.width(), picture.height()) {
            return Err(IngestError::FormatChanged { path: self.path.clone(), frame: clip_frame });
        }
        if self.frames.is_empty() {
            self.first = timestamp;
        }
        // Until the next frame comes, this one lasts as long as the one before, or as the stream's rate says.
        let duration = self.frames.last().map(|last| last.duration.0).or(self.nominal).or(step).unwrap_or(1);
        let start = Ticks(timestamp - self.first);
        self.frames.push(FrameTime { clip_frame, start, duration: Ticks(duration), duplicate });
        self.show(source, clip_frame)
    }

    /// Hands a thumbnail of the picture to whoever watches.
    fn show(&mut self, source: &Source, clip_frame: u32) -> Result<(), IngestError> {
        let Some(watch) = self.watch.as_mut() else { return Ok(()) };
        let picture = source.picture();
        let colour = |e: ffmpeg_the_third::Error| IngestError::Colour {
            path: self.path.clone(),
            frame: clip_frame,
            reason: e.to_string(),
        };
        if self.thumbnails.as_ref().is_none_or(|thumbnails| !thumbnails.fits(picture)) {
            self.thumbnails = Some(Converter::thumbnail(picture, THUMBNAIL_SIZE).map_err(colour)?);
        }
        if let Some(thumbnails) = self.thumbnails.as_mut() {
            watch(&thumbnails.convert(picture).map_err(colour)?);
        }
        Ok(())
    }

    /// The file's own time of a frame, or one made up from the nominal rate where it says none or goes backwards.
    fn time(&mut self, timestamp: Option<i64>, clip_frame: u32) -> Result<i64, IngestError> {
        // Beyond this, differences of times could overflow; no real clip comes near.
        const FAR: i64 = i64::MAX / 4;
        match (timestamp, self.previous) {
            (Some(t), None) if t.abs() < FAR => Ok(t),
            (Some(t), Some(previous)) if t > previous && t.abs() < FAR => Ok(t),
            (_, previous) => {
                if self.times_are_real {
                    self.times_are_real = false;
                    tracing::warn!(
                        clip = %self.path.display(),
                        frame = clip_frame,
                        "timestamps missing or not increasing; the nominal frame rate is used there"
                    );
                }
                let nominal = self
                    .nominal
                    .ok_or_else(|| IngestError::NoTime { path: self.path.clone(), frame: clip_frame })?;
                Ok(previous.map_or(0, |previous| previous + nominal))
            }
        }
    }

    fn repeats(&mut self, source: &Source, clip_frame: u32) -> Result<bool, IngestError> {
        let picture = source.picture();
        let colour = |e: ffmpeg_the_third::Error| IngestError::Colour {
            path: self.path.clone(),
            frame: clip_frame,
            reason: e.to_string(),
        };
        if self.grey.as_ref().is_none_or(|grey| !grey.fits(picture)) {
            self.grey = Some(Converter::grey(picture, SIGNATURE_SIZE).map_err(colour)?);
        }
        let Some(grey) = self.grey.as_mut() else { return Ok(false) };
        let signature = grey.convert(picture).map_err(colour)?;
        let duplicate = self.signature.as_ref().is_some_and(|previous| {
            previous.iter().zip(&signature).all(|(a, b)| a.abs_diff(*b) <= DUPLICATE_BLOCK_DIFFERENCE)
        });
        self.signature = Some(signature);
        Ok(duplicate)
    }

    fn finish(self) -> (Option<(u32, u32)>, Vec<FrameTime>, Option<KeyFrame>) {
        (self.size, self.frames, self.key.filter(|_| self.times_are_real))
    }
}

/// The pictures of a clip's range, in order. After an error it gives nothing more.
pub struct FrameReader {
    path: PathBuf,
    info: ClipInfo,
    source: Source,
    /// Index in the clip of the picture that the source gives next.
    clip_frame: u32,
    /// Index in the range of the picture to be given next.
    next: usize,
    converter: Option<Converter>,
    failed: bool,
}

impl Iterator for FrameReader {
    type Item = Result<Frame, IngestError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let wanted = self.info.frames.get(self.next)?.clip_frame;
        let frame = self.read(wanted);
        self.failed = frame.is_err();
        self.next += 1;
        Some(frame)
    }
}

impl FrameReader {
    fn read(&mut self, wanted: u32) -> Result<Frame, IngestError> {
        loop {
            if !self.source.advance()? {
                return Err(IngestError::Changed { path: self.path.clone(), frame: wanted });
            }
            self.clip_frame += 1;
            if self.clip_frame > wanted {
                break;
            }
        }
        let picture = self.source.picture();
        if (picture.width(), picture.height()) != (self.info.width_px, self.info.height_px) {
            return Err(IngestError::Changed { path: self.path.clone(), frame: wanted });
        }
        let colour = |e: ffmpeg_the_third::Error| IngestError::Colour {
            path: self.path.clone(),
            frame: wanted,
            reason: e.to_string(),
        };
        if self.converter.as_ref().is_none_or(|converter| !converter.fits(picture)) {
            self.converter = Some(Converter::rgb(picture).map_err(colour)?);
        }
        let rgb = match self.converter.as_mut() {
            Some(converter) => converter.convert(picture).map_err(colour)?,
            None => Vec::new(),
        };
        let image = RgbImage::from_raw(self.info.width_px, self.info.height_px, rgb)
            .ok_or_else(|| IngestError::Changed { path: self.path.clone(), frame: wanted })?;
        Ok(Frame { index: self.next, image })
    }
}
