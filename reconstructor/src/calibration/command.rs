//! `reconstructor calibrate`: the cameras of a clip or of pictures, written as JSON, with overlays for checking by eye.

use std::{
    io::Write,
    ops::Range,
    path::{Path, PathBuf},
};

use image::{ImageReader, Limits, RgbImage};
use protocol::pitch::Pitch;
use serde::Serialize;

use super::{
    CalibrationError, CameraEstimate, ClipCameras, Finders, Given, Known, ShotFigures, calibrate_images,
    calibrate_shots, overlay, shipped, soccernet::SoccerNetCamera,
};
use crate::{
    ingest::MAX_SIDE_PX,
    report::{Progress, median},
    shots::{self, Transition},
};

/// Bytes that decoding one picture may take.
const PICTURE_BYTES: u64 = 1 << 30;

/// What `reconstructor calibrate` was asked for.
#[derive(Clone, Debug)]
pub struct CalibrateOptions {
    /// One clip, or one or more pictures of one shot in order.
    pub inputs: Vec<PathBuf>,
    /// Correspondences or cameras of some frames; everything is found without when `None`.
    pub calibration: Option<PathBuf>,
    /// The size of the pitch; when `None` that of `calibration`, else the usual one.
    pub pitch: Option<Pitch>,
    /// Frames of the clip; all when `None`.
    pub frames: Option<Range<u32>>,
    /// Where the cameras go.
    pub out: PathBuf,
    /// Folder for pictures with the lines drawn in, or an `.mp4` file for a video of them, when wanted.
    pub overlay: Option<PathBuf>,
}

/// The file that `reconstructor calibrate` writes.
#[derive(Clone, Debug, Serialize)]
pub struct CalibrationReport {
    /// Size of the pitch the cameras were fitted to.
    pub pitch: Pitch,
    /// Frames with a camera.
    pub solved: usize,
    /// How the cameras of each shot came about.
    pub shots: Vec<ShotFigures>,
    /// Frames between shots.
    pub transitions: Vec<Transition>,
    /// Median over the frames of their median line distance, pixels; `None` when no frame has lines.
    pub line_residual_median_px: Option<f64>,
    /// Greatest of the frames' median line distances, pixels.
    pub line_residual_worst_px: Option<f64>,
    /// One entry per frame.
    pub frames: Vec<FrameCamera>,
}

/// One frame of that file.
#[derive(Clone, Debug, Serialize)]
pub struct FrameCamera {
    /// Index in the whole clip, or of the picture in the list.
    pub clip_frame: u32,
    /// The camera and how well it fits.
    #[serde(flatten)]
    pub estimate: CameraEstimate,
    /// The same camera in SoccerNet's terms.
    pub soccernet: Option<SoccerNetCamera>,
}

/// Runs the command.
///
/// # Errors
/// When an input cannot be read, the correspondences cannot be used, or a result cannot be written.
pub fn run(options: &CalibrateOptions, progress: &Progress) -> Result<CalibrationReport, CalibrationError> {
    let given = options.calibration.as_deref().map(Given::read).transpose()?;
    let pitch = options.pitch.or(given.as_ref().and_then(Given::pitch)).unwrap_or_default();
    let finders = Finders::new(&shipped);
    let known = Known { pitch, given: given.as_ref(), finders: Some(&finders), apart: false };
    let (frames, cameras, transitions) = match options.inputs.as_slice() {
        [] => return Err(CalibrationError::NoFrames),
        [clip] if !is_picture(clip) => {
            let (clip, shots) = shots::open(clip, options.frames.clone())?;
            let cameras = calibrate_shots(&clip, &[], &shots, &known, progress)?;
            let numbers: Vec<u32> = clip.info().frames.iter().map(|frame| frame.clip_frame).collect();
            if let Some(out) = &options.overlay {
                let pictures = clip.frames()?.map(|frame| Ok(frame?.image));
                overlay::write(out, clip.info().rate(), pictures, &numbers, &cameras.frames, &pitch)?;
            }
            (numbers, cameras, shots.transitions)
        }
        paths => {
            let pictures = read_pictures(paths)?;
            let cameras = calibrate_images(&pictures, &known)?;
            let numbers: Vec<u32> = (0..).take(paths.len()).collect();
            if let Some(out) = &options.overlay {
                let pictures = pictures.into_iter().map(Ok);
                overlay::write(out, (1, 1), pictures, &numbers, &cameras.frames, &pitch)?;
            }
            (numbers, cameras, Vec::new())
        }
    };
    let report = report(pitch, frames, cameras, transitions);
    write_report(&options.out, &report)?;
    Ok(report)
}

fn report(
    pitch: Pitch,
    frames: Vec<u32>,
    cameras: ClipCameras,
    transitions: Vec<Transition>,
) -> CalibrationReport {
    let residuals: Vec<f64> = cameras.frames.iter().filter_map(|e| e.line_residual_median_px).collect();
    CalibrationReport {
        pitch,
        solved: cameras.frames.iter().filter(|e| e.camera.is_some()).count(),
        shots: cameras.shots,
        transitions,
        line_residual_worst_px: residuals.iter().copied().max_by(f64::total_cmp),
        line_residual_median_px: median(&residuals),
        frames: frames
            .into_iter()
            .zip(cameras.frames)
            .map(|(clip_frame, estimate)| FrameCamera {
                clip_frame,
                soccernet: estimate.camera.as_ref().map(SoccerNetCamera::from),
                estimate,
            })
            .collect(),
    }
}

fn is_picture(path: &Path) -> bool {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    matches!(extension.as_str(), "png" | "jpg" | "jpeg")
}

fn read_pictures(paths: &[PathBuf]) -> Result<Vec<RgbImage>, CalibrationError> {
    let mut pictures: Vec<RgbImage> = Vec::new();
    for path in paths {
        let broken = |source: image::ImageError| CalibrationError::Picture { path: path.clone(), source };
        let mut reader = ImageReader::open(path).map_err(|e| broken(e.into()))?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(MAX_SIDE_PX);
        limits.max_image_height = Some(MAX_SIDE_PX);
        limits.max_alloc = Some(PICTURE_BYTES);
        reader.limits(limits);
        let picture = reader.decode().map_err(broken)?.into_rgb8();
        let (width, height) = picture.dimensions();
        if let Some((first_width, first_height)) = pictures.first().map(RgbImage::dimensions)
            && (width, height) != (first_width, first_height)
        {
            let path = path.clone();
            return Err(CalibrationError::PictureSize { path, width, height, first_width, first_height });
        }
        pictures.push(picture);
    }
    Ok(pictures)
}

/// Writes beside the target first, so that a full disk leaves no half file.
fn write_report(path: &Path, report: &CalibrationReport) -> Result<(), CalibrationError> {
    let failed = |reason: String| CalibrationError::Write { path: path.into(), reason };
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let text = serde_json::to_vec_pretty(report).map_err(|e| failed(e.to_string()))?;
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(|e| failed(e.to_string()))?;
    file.write_all(&text).map_err(|e| failed(e.to_string()))?;
    file.persist(path).map_err(|e| failed(e.to_string()))?;
    Ok(())
}
