//! The whole way from a clip to a stream: `ingest → shots → detection → calibration → pose → tracking → segmentation → depth →
//! mesh → trajectory → encode`.
//!
//! Costly stages keep their results frame by frame in the work folder and take them from there when the clip, the options
//! and the networks are the same. What a stage could not do for a person or a frame goes to the [`Reporter`]; only what
//! stops everything is an error.

mod error;
mod frames;
mod kit;
mod players;
mod run;
mod work;
mod write;

use std::{ops::Range, path::PathBuf};

use protocol::pitch::Pitch;

pub use error::PipelineError;

use crate::{
    mesh::MeshBudget,
    report::{ReconstructReport, Reporter},
    tracking::TrackingLimits,
    trajectory::Smoothing,
};

/// What `reconstructor reconstruct` was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct ReconstructOptions {
    /// The clip.
    pub clip: PathBuf,
    /// Folder of the stream; an older stream in it is replaced.
    pub out: PathBuf,
    /// Pitch points or cameras of some frames, JSON; everything is found without when `None`.
    pub calibration: Option<PathBuf>,
    /// The size of the pitch; when `None` that of `calibration`, else the usual one.
    pub pitch: Option<Pitch>,
    /// Frames of the clip; all when `None`.
    pub frames: Option<Range<u32>>,
    /// Where results of stages are kept; a temporary folder when `None`.
    pub work: Option<PathBuf>,
    /// Triangles per body.
    pub budget: MeshBudget,
    /// Who is who.
    pub tracking: TrackingLimits,
    /// Of the paths.
    pub smoothing: Smoothing,
    /// Frames worked on at a time.
    pub threads: usize,
}

/// Reconstructs a clip into a stream.
///
/// # Errors
/// When the clip or the correspondences cannot be used, a network is missing, nobody is found, or the disk says no.
/// Results up to there stay in the work folder.
pub fn reconstruct(
    options: &ReconstructOptions,
    reporter: &mut Reporter,
) -> Result<ReconstructReport, PipelineError> {
    let mut run = run::Run::open(options, reporter)?;
    let detections = run.detect()?;
    let cameras = run.calibrate(&detections)?;
    let people = run.pose(&detections, &cameras)?;
    let tracks = run.track(&people)?;
    let masks = run.segment(&people, &tracks);
    let masks = players::by_frame(&masks, &tracks, people.len());
    let depths = run.depth(&cameras, &people, &masks)?;
    let paths = run.smooth(&people, &tracks);
    let figures = run.write(&write::Scene {
        detections: &detections,
        cameras: &cameras,
        people: &people,
        tracks: &tracks,
        masks: &masks,
        depths: &depths,
        paths: &paths,
    })?;
    Ok(run.finish(figures, tracks.len()))
}
