//! What is in the air: people who jump, and the ball.

use std::{collections::BTreeMap, time::Instant};

use protocol::{
    chunk::{Ball, BallSpread},
    manifest::PersonId,
};

use super::run::Run;
use crate::{
    ball::{self, BallEstimate},
    calibration::CameraEstimate,
    detection::BallCandidate,
    jumps::{self, Lift},
    pose::Person,
    report::Stage,
    tracking::Track,
};

/// Height above the pitch of everybody in the air, by frame and person, metres.
pub(super) type Heights = BTreeMap<(usize, PersonId), f64>;

impl Run<'_> {
    /// Finds who jumps and moves them to where they really are.
    pub(super) fn jumps(
        &mut self,
        people: &mut [Vec<Person>],
        tracks: &[Track],
        cameras: &[CameraEstimate],
    ) -> Vec<Lift> {
        let started = Instant::now();
        let lifts = jumps::find(people, tracks, cameras, self.clip.info());
        jumps::place(people, cameras, &lifts);
        self.reporter.stage_done(Stage::Jumps, started.elapsed(), 0);
        lifts
    }

    /// The ball in every frame.
    pub(super) fn ball(
        &mut self,
        candidates: &[Vec<BallCandidate>],
        cameras: &[CameraEstimate],
        people: &[Vec<Person>],
    ) -> Vec<Option<BallEstimate>> {
        let started = Instant::now();
        let found = ball::follow(candidates, cameras, people, self.clip.info(), &self.shots, &self.pitch);
        let known = found.iter().flatten().count();
        tracing::info!("ball: known in {known} of {} frames", found.len());
        self.reporter.stage_done(Stage::Ball, started.elapsed(), 0);
        found
    }
}

/// Heights by whose they are.
pub(super) fn heights(lifts: &[Lift], tracks: &[Track]) -> Heights {
    let above: BTreeMap<(usize, usize), f64> =
        lifts.iter().map(|lift| ((lift.frame, lift.person_index), lift.above_ground_m)).collect();
    let sightings = tracks.iter().flat_map(|track| track.sightings.iter().map(|s| (track.person, s)));
    sightings
        .filter_map(|(person, s)| Some(((s.frame, person), *above.get(&(s.frame, s.person_index))?)))
        .collect()
}

/// As the stream tells it.
pub(super) fn in_stream(estimate: BallEstimate) -> Ball {
    let spread =
        BallSpread { along_m: estimate.sigma_along_m as f32, across_m: estimate.sigma_across_m as f32 };
    Ball { position_m: estimate.position_m, height_known: estimate.height_known, spread: Some(spread) }
}
