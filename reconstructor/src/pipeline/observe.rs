//! The first half of the way, from a clip to who was seen where: all that happens before pictures become bodies.
//!
//! [`observe`] stops there, for the measures and for tools that need no stream; a reconstruction goes the same way on.

use std::{collections::BTreeMap, ops::Range, path::PathBuf};

use protocol::{manifest::PersonId, pitch::Pitch};

use super::{PipelineError, numbers::numbers, players::smooth_poses, run::Run};
use crate::{
    ball::BallEstimate,
    calibration::CameraEstimate,
    detection::Detection,
    ingest::Clip,
    jumps::Lift,
    numbers::ShirtNumber,
    pose::Person,
    report::Reporter,
    shots::ShotList,
    teams::Member,
    tracking::{Track, TrackingLimits},
};

/// Which clip is looked at, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct ObserveOptions {
    /// The clip.
    pub clip: PathBuf,
    /// Pitch points or cameras of some frames, JSON; everything is found without when `None`.
    pub calibration: Option<PathBuf>,
    /// The size of the pitch; when `None` that of `calibration`, else the usual one.
    pub pitch: Option<Pitch>,
    /// Frames of the clip; all when `None`.
    pub frames: Option<Range<u32>>,
    /// Where results of stages are kept; a temporary folder when `None`.
    pub work: Option<PathBuf>,
    /// Who is who.
    pub tracking: TrackingLimits,
    /// Frames worked on at a time.
    pub threads: usize,
}

/// A clip that was looked at.
#[derive(Debug)]
pub struct Observation {
    /// The clip, to read its pictures again.
    pub clip: Clip,
    /// The pitch.
    pub pitch: Pitch,
    /// Its shots.
    pub shots: ShotList,
    /// What was seen in it.
    pub seen: Seen,
}

/// What was seen in a clip. Lists by frame have an entry for every frame of [`Clip::info`].
#[derive(Debug)]
pub struct Seen {
    /// What the detector found.
    pub detections: Vec<Vec<Detection>>,
    /// The camera of every frame; none in dissolves, whose people are not taken.
    pub cameras: Vec<CameraEstimate>,
    /// Everybody on the pitch in every frame.
    pub people: Vec<Vec<Person>>,
    /// Who of them is who.
    pub tracks: Vec<Track>,
    /// Team and role of every track, in the same order.
    pub members: Vec<Member>,
    /// Shirt numbers of those of whom they could be read.
    pub numbers: BTreeMap<PersonId, ShirtNumber>,
    /// The ball in every frame.
    pub ball: Vec<Option<BallEstimate>>,
    /// Who is in the air.
    pub lifts: Vec<Lift>,
}

impl Run<'_> {
    /// Everything up to who is who.
    pub(super) fn observe(&mut self) -> Result<Seen, PipelineError> {
        let found = self.detect()?;
        let (detections, balls): (Vec<_>, Vec<_>) =
            found.into_iter().map(|found| (found.people, found.balls)).unzip();
        let mut cameras = self.calibrate(&detections)?;
        let mut people = self.pose(&detections, &cameras)?;
        self.settle_sides(&mut people, &mut cameras);
        let followed = self.follow(&people, &cameras)?;
        let filled = smooth_poses(&mut people, &followed, &cameras);
        let readings = self.read_backs(&people, &followed)?;
        let (tracks, members) = self.identify(followed, &people, &cameras, &readings);
        self.note_poses(&people, &tracks, &filled);
        let numbers = numbers(&tracks, &members, &readings);
        let lifts = self.jumps(&mut people, &tracks, &cameras);
        let ball = self.ball(&balls, &cameras, &people);
        Ok(Seen { detections, cameras, people, tracks, members, numbers, ball, lifts })
    }
}

/// Looks at a clip: who is where, as a reconstruction sees it before it makes bodies.
///
/// # Errors
/// When the clip or the correspondences cannot be used, a network is missing, nobody is found, or the disk says no.
/// Results up to there stay in the work folder.
pub fn observe(options: &ObserveOptions, reporter: &mut Reporter) -> Result<Observation, PipelineError> {
    let mut run = Run::open(options, reporter)?;
    let seen = run.observe()?;
    let Run { clip, pitch, shots, .. } = run;
    Ok(Observation { clip, pitch, shots, seen })
}
