//! The whole way from a clip to a stream: `ingest → shots → detection → calibration → pose → tracking → teams → numbers → jumps → ball → segmentation → lifting → depth →
//! skin → mesh → trajectory → encode`.
//!
//! Costly stages keep their results frame by frame in the work folder and take them from there when the clip, the options
//! and the networks are the same. What a stage could not do for a person or a frame goes to the [`Reporter`]; only what
//! stops everything is an error.

mod air;
mod error;
mod frames;
mod numbers;
mod observe;
mod overlay;
mod players;
mod run;
mod work;
mod write;

use std::path::PathBuf;

pub use error::PipelineError;
pub use observe::{Observation, ObserveOptions, Seen, observe};

use protocol::manifest::Profile;

use crate::{
    mesh::MeshBudget,
    report::{ReconstructReport, Reporter},
    trajectory::Smoothing,
};

/// What `reconstructor reconstruct` was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct ReconstructOptions {
    /// The clip and how it is looked at.
    pub observe: ObserveOptions,
    /// Folder of the stream; an older stream in it is replaced.
    pub out: PathBuf,
    /// How its chunks are made.
    pub profile: Profile,
    /// Triangles per body.
    pub budget: MeshBudget,
    /// Of the paths.
    pub smoothing: Smoothing,
    /// Where frames go with what was seen drawn in: a folder for pictures, or an `.mp4` file.
    pub overlay: Option<PathBuf>,
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
    let mut run = run::Run::open(&options.observe, reporter)?;
    // A folder that cannot be written is known now, not after the long work.
    std::fs::create_dir_all(&options.out)
        .map_err(|source| PipelineError::Out { path: options.out.clone(), source })?;
    let Seen { detections, cameras, mut people, tracks, members, numbers, ball, lifts } = run.observe()?;
    let masks = run.segment(&people, &tracks)?;
    let masks = players::by_frame(&masks, &tracks, people.len());
    if let Some(out) = &options.overlay {
        run.overlay(out, &cameras, &masks, &ball)?;
    }
    run.lift(&cameras, &mut people, &masks, &tracks)?;
    let depths = run.depth(&cameras, &people, &masks)?;
    let skins = run.skins(&cameras, &people, &masks, &depths)?;
    let paths = run.smooth(&people, &tracks, options.smoothing);
    let figures = run.write(&write::Scene {
        profile: options.profile,
        out: &options.out,
        budget: options.budget,
        detections: &detections,
        cameras: &cameras,
        people: &people,
        members: &members,
        numbers: &numbers,
        masks: &masks,
        depths: &depths,
        skins: &skins,
        paths: &paths,
        ball: &ball,
        heights_m: &air::heights(&lifts, &tracks),
    })?;
    Ok(run.finish(figures, tracks.len(), numbers.len()))
}
