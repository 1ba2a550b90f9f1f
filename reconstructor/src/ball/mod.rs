//! The ball over a clip: which candidates are it, and where it is in metres, with how far that can be trusted.
//!
//! The paper leaves the ball out. Each shot is looked at as a whole: [`path`] chains candidates in the picture, [`cuts`]
//! finds where the way bends, [`segments`] explains it by stretches on the grass, in the air and in hands, and [`joint`]
//! fits these together. One camera sees only the direction of a ball in the air; gravity, the grass and bodies at both ends
//! of a flight tell its distance. Method and figures: `docs/ball.md`.

mod arc;
mod bodies;
mod cuts;
mod fit;
mod joint;
mod lift;
mod path;
mod segments;
mod sight;

use glam::DVec3;
use protocol::{camera::Camera, pitch::Pitch};
use serde::{Deserialize, Serialize};

use crate::{
    calibration::CameraEstimate, detection::BallCandidate, ingest::ClipInfo, pose::Person, shots::ShotList,
};
use sight::{Moment, Sight};

/// Radius of a ball, metres (Law 2: 68 to 70 cm round).
pub(crate) const RADIUS_M: f64 = 0.11;
/// Runs of sights farther apart in time than this are explained apart.
const APART_S: f64 = 1.2;
/// A run of fewer sights is no ball.
const SIGHTS_MIN: usize = 4;
/// Longest run that is explained at once, sights: bounds time and memory.
const SIGHTS_MAX: usize = 3_000;

/// The ball in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BallEstimate {
    /// Its middle, world metres.
    pub position_m: DVec3,
    /// Standard deviation of its distance from the camera, metres.
    pub sigma_along_m: f64,
    /// Standard deviation across the line of sight, metres.
    pub sigma_across_m: f64,
    /// Whether its height is measured; when not, it is taken to lie on the grass.
    pub height_known: bool,
    /// Whether it flies, lies or rolls on the grass, or is held.
    pub state: BallState,
    /// Whether a candidate of this frame is the ball; otherwise its place follows from the frames around.
    pub seen: bool,
}

/// What the ball does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BallState {
    /// It lies, rolls or is dribbled.
    Ground,
    /// It is in the air.
    Flight,
    /// In somebody's hands.
    Held,
}

/// How likely a candidate is the ball, 0..1, by its score, its size and where it is seen; in one picture alone.
#[must_use]
pub fn likely(camera: &Camera, candidate: &BallCandidate, pitch: &Pitch) -> f64 {
    path::likely(camera, candidate, pitch)
}

/// The ball in every frame of `clip`, `None` where it is not known.
///
/// `candidates`, `cameras` and `people` have an entry per frame. Nothing is carried over from one shot to the next.
#[must_use]
pub fn follow(
    candidates: &[Vec<BallCandidate>],
    cameras: &[CameraEstimate],
    people: &[Vec<Person>],
    clip: &ClipInfo,
    shots: &ShotList,
    pitch: &Pitch,
) -> Vec<Option<BallEstimate>> {
    let mut ball = vec![None; clip.frames.len()];
    for shot in &shots.shots {
        let frames = shot.frames.start.min(ball.len())..shot.frames.end.min(ball.len());
        let moments: Vec<Moment> = frames
            .clone()
            .map(|frame| Moment {
                seconds: clip.frames.get(frame).map_or(0.0, |time| clip.timescale.seconds(time.start)),
                camera: cameras.get(frame).and_then(|estimate| estimate.camera),
            })
            .collect();
        let of_shot = |length: usize| frames.start.min(length)..frames.end.min(length);
        let people = people.get(of_shot(people.len())).unwrap_or_default();
        let candidates = candidates.get(of_shot(candidates.len())).unwrap_or_default();
        let found = follow_shot(candidates, &moments, people, pitch);
        for (place, estimate) in ball.get_mut(frames).into_iter().flatten().zip(found) {
            *place = estimate;
        }
    }
    ball
}

fn follow_shot(
    candidates: &[Vec<BallCandidate>],
    moments: &[Moment],
    people: &[Vec<Person>],
    pitch: &Pitch,
) -> Vec<Option<BallEstimate>> {
    let pixels = path::choose(moments, candidates, people, pitch);
    let sights: Vec<Sight> = pixels
        .iter()
        .zip(moments)
        .enumerate()
        .filter_map(|(frame, (pixel, moment))| {
            Some(Sight { frame, seconds: moment.seconds, camera: moment.camera?, pixel: (*pixel)? })
        })
        .collect();
    let mut found = vec![None; moments.len()];
    let mut rest = sights.as_slice();
    while !rest.is_empty() {
        let apart = rest.windows(2).position(|pair| match pair {
            [a, b] => b.seconds - a.seconds > APART_S,
            _ => false,
        });
        let length = apart.map_or(rest.len(), |last| last + 1).min(SIGHTS_MAX);
        let (run, after) = rest.split_at(length);
        if run.len() >= SIGHTS_MIN {
            lift::explain(run, moments, people, pitch, &mut found);
        }
        rest = after;
    }
    found
}

#[cfg(test)]
mod tests;
