//! What is given by hand or by another program: points of one frame, or cameras of some frames in SoccerNet's terms.

use std::path::Path;

use protocol::{camera::Camera, pitch::Pitch};
use serde::Deserialize;

use super::{
    Calibration, CalibrationError, Known,
    chains::Anchor,
    grass, initial,
    input::read_file,
    sequence::{self, FrameLines},
    soccernet::SoccerNetCamera,
    template::Sample,
};
use crate::shots::ShotList;

/// Most bytes of a file with cameras: a clip of an hour.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// What is given, told apart by what the file holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Given {
    /// Points of one frame.
    Points(Calibration),
    /// Cameras of some frames.
    Cameras {
        /// The pitch they were fitted to, where the file says so.
        pitch: Option<Pitch>,
        /// Frame in the whole clip and its camera.
        cameras: Vec<(u32, SoccerNetCamera)>,
    },
}

/// A frame of a file of cameras: as `reconstructor calibrate` writes it, or a bare camera.
#[derive(Deserialize)]
#[serde(untagged)]
enum Entry {
    Frame {
        clip_frame: u32,
        soccernet: Option<SoccerNetCamera>,
    },
    Camera {
        #[serde(default)]
        frame: u32,
        #[serde(flatten)]
        camera: SoccerNetCamera,
    },
}

/// The files that hold cameras.
#[derive(Deserialize)]
#[serde(untagged)]
enum CameraFile {
    Report {
        #[serde(default)]
        pitch: Option<Pitch>,
        frames: Vec<Entry>,
    },
    List(Vec<Entry>),
    One(Entry),
}

impl Given {
    /// Reads a `--calibration` file: correspondences, a SoccerNet camera (with `frame` for another than the first), a list of
    /// these, or the cameras that `reconstructor calibrate` wrote.
    ///
    /// # Errors
    /// When it cannot be read or is none of these. Points and cameras are checked when they are used.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        let text = read_file(path, MAX_FILE_BYTES)?;
        // A message about points is the most helpful one for a file that is neither.
        match serde_json::from_slice::<CameraFile>(&text) {
            Ok(file) => Ok(Self::from(file)),
            Err(_) => Calibration::parse(path, &text).map(Self::Points),
        }
    }

    /// The pitch that the file is about, where it says so.
    #[must_use]
    pub fn pitch(&self) -> Option<Pitch> {
        match self {
            Self::Points(points) => Some(points.pitch),
            Self::Cameras { pitch, .. } => *pitch,
        }
    }

    /// The given cameras for pictures of a size: frame in the whole clip and camera.
    fn cameras(&self, size_px: (u32, u32)) -> Result<Vec<(u32, Camera)>, CalibrationError> {
        match self {
            Self::Points(points) => Ok(vec![(points.frame, initial::camera(points, size_px)?)]),
            Self::Cameras { cameras, .. } => {
                let convert = |(frame, camera): &(u32, SoccerNetCamera)| {
                    // The principal point in the middle tells the size of the pictures it was fitted to.
                    let [width, height] = camera.principal_point.map(|side| (side * 2.0).round() as u32);
                    let converted = camera.to_camera(width.max(1), height.max(1));
                    let converted =
                        converted.map_err(|source| CalibrationError::Camera { frame: *frame, source })?;
                    Ok((*frame, converted.resized(size_px.0, size_px.1)))
                };
                cameras.iter().map(convert).collect()
            }
        }
    }
}

impl From<CameraFile> for Given {
    fn from(file: CameraFile) -> Self {
        let (pitch, entries) = match file {
            CameraFile::Report { pitch, frames } => (pitch, frames),
            CameraFile::List(entries) => (None, entries),
            CameraFile::One(entry) => (None, vec![entry]),
        };
        let cameras = entries.into_iter().filter_map(|entry| match entry {
            Entry::Frame { clip_frame, soccernet } => Some((clip_frame, soccernet?)),
            Entry::Camera { frame, camera } => Some((frame, camera)),
        });
        Self::Cameras { pitch, cameras: cameras.collect() }
    }
}

/// The given cameras as anchors; indices are places in `numbers`, which holds the clip frame of every frame of the range.
pub(super) fn anchors(
    known: &Known<'_>,
    numbers: &[u32],
    size_px: (u32, u32),
) -> Result<Vec<Anchor>, CalibrationError> {
    let Some(given) = known.given else { return Ok(Vec::new()) };
    let outside = |frame| CalibrationError::FrameOutside {
        frame,
        start: numbers.first().copied().unwrap_or(0),
        end: numbers.last().map_or(0, |last| last + 1),
    };
    if let Given::Points(points) = given
        && !numbers.contains(&points.frame)
    {
        return Err(outside(points.frame));
    }
    let cameras = given.cameras(size_px)?;
    let anchors: Vec<Anchor> = cameras
        .iter()
        .filter_map(|(frame, camera)| {
            let index = numbers.binary_search(frame).ok()?;
            Some(Anchor { index, camera: *camera, confidence: 1.0, given: true })
        })
        .collect();
    match cameras.first() {
        // A file of cameras may be about more than this range, but must have something to say about it.
        Some((frame, _)) if anchors.is_empty() => Err(outside(*frame)),
        None => Err(CalibrationError::NoFrames),
        Some(_) => Ok(anchors),
    }
}

/// Whether given cameras go with the lines of their frames; `numbers` are the clip frames of `frames`. Of several in a shot the worst
/// may be wrong, not all.
pub(super) fn check(
    given: &[Anchor],
    numbers: &[u32],
    frames: &[FrameLines],
    shots: &ShotList,
    samples: &[Sample],
) -> Result<(), CalibrationError> {
    let mut first_error = None;
    for anchor in given {
        let (Some(frame), Some(&number)) = (frames.get(anchor.index), numbers.get(anchor.index)) else {
            continue;
        };
        let no_pitch = |reason: String| CalibrationError::NoPitch { frame: number, reason };
        let share = frame.lines.grass_share;
        let error = if share < grass::LEAST_SHARE {
            no_pitch(format!("grass covers {:.0} % of it", share * 100.0))
        } else if shots.shot_of(anchor.index).is_none() {
            no_pitch("it is in the middle of a dissolve".to_owned())
        } else {
            let settled = sequence::settle(&anchor.camera, frame, samples);
            match settled.line_residual_median_px {
                _ if settled.camera.is_some() => return Ok(()),
                Some(residual_px)
                    if settled.line_points >= sequence::LEAST_POINTS && !frame.lines.pixels.is_empty() =>
                {
                    CalibrationError::LinesDisagree { frame: number, residual_px }
                }
                _ => no_pitch(settled.reason.unwrap_or_default()),
            }
        };
        first_error.get_or_insert(error);
    }
    first_error.map_or(Ok(()), Err)
}
