//! Who is who over time, on a rendered clip whose truth is known: the product's own way from the clip to tracks, held against
//! the truth by the definitions of TrackEval (DESIGN section 6), with the greedy baseline beside it.
//!
//! A true person counts where at least half of the box is in the picture, hidden or not (the seventh column of `gt.txt`); boxes of
//! ours that fit best to somebody else are neither right nor wrong, as the MOT Challenge treats distractors. Frames in which two
//! pictures are mixed do not count.

mod numbers;
mod scores;
mod truth;

use std::{
    collections::{BTreeMap, BTreeSet},
    io::Write,
    path::{Path, PathBuf},
};

use serde::Serialize;

pub use numbers::NumberFigures;
pub use scores::{FrameBoxes, Matches, Scores, TrackedBox, scores};

use super::frame_truth::TruthError;
use crate::{
    ingest::ClipInfo,
    pipeline::{Observation, ObserveOptions, PipelineError, observe},
    pose::Person,
    report::Reporter,
    teams::{self, Member, Role},
    tracking::{self, Track, TrackingLimits, TrackingMethod},
};
use truth::Truth;

/// Figures of who is who.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrackingFigures {
    /// Frames measured.
    pub frames: usize,
    /// Of the whole clip: truth keeps a person's identity over cuts.
    #[serde(flatten)]
    pub scores: Scores,
    /// Share of the matched boxes of players and goalkeepers that have the right team, under the better of the two assignments of
    /// our teams to the true ones; no team is wrong.
    pub team_accuracy: f64,
    /// Share of all matched boxes that have the right role; no role is wrong.
    pub role_accuracy: f64,
    /// Shirt numbers.
    #[serde(flatten)]
    pub numbers: NumberFigures,
    /// Every shot alone.
    pub shots: Vec<ShotScores>,
    /// The same people linked without identities over cuts.
    pub within_shots: Scores,
    /// The same people linked by the paper's greedy merging, shot by shot.
    pub greedy: Scores,
    /// That baseline in every shot alone.
    pub greedy_shots: Vec<ShotScores>,
}

/// Figures of one shot.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ShotScores {
    /// Number of the shot in the truth.
    pub shot: usize,
    /// Frames measured.
    pub frames: usize,
    /// As if the clip were this shot.
    #[serde(flatten)]
    pub scores: Scores,
}

/// Why tracking could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum TrackingEvaluationError {
    /// The truth is missing or broken.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// The clip could not be looked at.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The tracks could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// What is measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackingEvaluation {
    /// Folder of the clip and its truth.
    pub data: PathBuf,
    /// Where results of stages are kept; a temporary folder when `None`.
    pub work: Option<PathBuf>,
    /// Where our tracks go in the form of the MOT Challenge, for other programs.
    pub tracks: Option<PathBuf>,
    /// Frames worked on at a time.
    pub threads: usize,
}

/// Follows the people of a rendered clip and holds the tracks against its truth.
///
/// # Errors
/// When the truth or the clip cannot be used, a network is missing, or nobody is found.
pub fn evaluate(
    evaluation: &TrackingEvaluation,
    reporter: &mut Reporter,
) -> Result<TrackingFigures, TrackingEvaluationError> {
    let truth = Truth::read(&evaluation.data)?;
    let options = ObserveOptions {
        clip: evaluation.data.join("clip.mp4"),
        calibration: None,
        pitch: Some(truth.pitch),
        frames: None,
        work: evaluation.work.clone(),
        tracking: TrackingLimits::default(),
        threads: evaluation.threads,
    };
    let looked = observe(&options, reporter)?;
    if let Some(path) = &evaluation.tracks {
        write_mot(path, &looked)
            .map_err(|source| TrackingEvaluationError::Write { path: path.clone(), source })?;
    }
    Ok(figures(&truth, &looked))
}

fn figures(truth: &Truth, looked: &Observation) -> TrackingFigures {
    let info = looked.clip.info();
    let linked = |method| {
        let limits = TrackingLimits { method, ..TrackingLimits::default() };
        let tracks =
            tracking::track_shots(&looked.seen.people, &looked.seen.cameras, info, &looked.shots, &limits);
        // Who takes no part is left out of the baseline, too: it is the linking that is compared.
        let tracks = teams::on_the_pitch(tracks, &looked.seen.people, &looked.pitch);
        frames_of(truth, &looked.seen.people, &tracks, info)
    };
    let (within, greedy) = (linked(TrackingMethod::Global), linked(TrackingMethod::Greedy));
    let ours = frames_of(truth, &looked.seen.people, &looked.seen.tracks, info);
    let (scores, matches) = whole(&ours);
    TrackingFigures {
        frames: ours.len(),
        scores,
        team_accuracy: team_accuracy(truth, &looked.seen.members, &matches),
        role_accuracy: role_accuracy(truth, &looked.seen.members, &matches),
        numbers: numbers::figures(truth, &looked.seen.numbers, &matches),
        shots: by_shot(&ours),
        within_shots: whole(&within).0,
        greedy: whole(&greedy).0,
        greedy_shots: by_shot(&greedy),
    }
}

/// A frame that counts, and its shot.
type ShotFrame = (usize, FrameBoxes);

/// The frames of the truth that count, with the boxes of tracks.
fn frames_of(truth: &Truth, people: &[Vec<Person>], tracks: &[Track], info: &ClipInfo) -> Vec<ShotFrame> {
    let mut ours: BTreeMap<usize, Vec<TrackedBox>> = BTreeMap::new();
    for (clip_frame, found) in sightings(people, tracks, info) {
        ours.entry(clip_frame as usize).or_default().push(found);
    }
    let frames = truth.frames.iter().enumerate().filter_map(|(index, frame)| {
        let ours = ours.remove(&index).unwrap_or_default();
        Some((frame.shot?, FrameBoxes { truth: frame.counts.clone(), ours }.without(&frame.ignored)))
    });
    frames.collect()
}

/// Every box of the tracks with its frame of the clip.
fn sightings<'a>(
    people: &'a [Vec<Person>],
    tracks: &'a [Track],
    info: &'a ClipInfo,
) -> impl Iterator<Item = (u32, TrackedBox)> + 'a {
    tracks.iter().flat_map(move |track| {
        track.sightings.iter().filter_map(move |sighting| {
            let clip_frame = info.frames.get(sighting.frame)?.clip_frame;
            let bounds = people.get(sighting.frame)?.get(sighting.person_index)?.bounds;
            Some((clip_frame, TrackedBox { id: track.person.0, bounds }))
        })
    })
}

fn whole(frames: &[ShotFrame]) -> (Scores, Matches) {
    let boxes: Vec<FrameBoxes> = frames.iter().map(|(_, boxes)| boxes.clone()).collect();
    scores(&boxes)
}

fn by_shot(frames: &[ShotFrame]) -> Vec<ShotScores> {
    let shots: BTreeSet<usize> = frames.iter().map(|(shot, _)| *shot).collect();
    let of_shot = shots.into_iter().map(|shot| {
        let frames: Vec<ShotFrame> = frames.iter().filter(|(of, _)| *of == shot).cloned().collect();
        ShotScores { shot, frames: frames.len(), scores: whole(&frames).0 }
    });
    of_shot.collect()
}

fn team_accuracy(truth: &Truth, members: &[Member], matches: &Matches) -> f64 {
    let team_of: BTreeMap<u32, &str> =
        members.iter().filter_map(|m| Some((m.person.0, m.team?.name()))).collect();
    let (mut all, mut right) = (0, [0, 0]);
    for ((person, ours), frames) in matches {
        let Some(person) = truth.people.get(person) else { continue };
        let (Some(team), true) = (&person.team, matches!(person.role.as_str(), "player" | "goalkeeper"))
        else {
            continue;
        };
        all += frames;
        let Some(ours) = team_of.get(ours) else { continue };
        // Ours may be the true ones or the other way round.
        right[usize::from((*ours == teams::Team::A.name()) != (team == "home"))] += frames;
    }
    *right.iter().max().unwrap_or(&0) as f64 / all.max(1) as f64
}

fn role_accuracy(truth: &Truth, members: &[Member], matches: &Matches) -> f64 {
    let role_of: BTreeMap<u32, Role> = members.iter().filter_map(|m| Some((m.person.0, m.role?))).collect();
    let (mut all, mut right) = (0, 0);
    for ((person, ours), frames) in matches {
        let Some(person) = truth.people.get(person) else { continue };
        all += frames;
        if role_of.get(ours).is_some_and(|role| role.name() == person.role) {
            right += frames;
        }
    }
    right as f64 / all.max(1) as f64
}

/// Our tracks as `gt.txt` is written: what TrackEval reads as a tracker's result.
fn write_mot(path: &Path, looked: &Observation) -> std::io::Result<()> {
    let mut rows: Vec<(u32, TrackedBox)> =
        sightings(&looked.seen.people, &looked.seen.tracks, looked.clip.info()).collect();
    rows.sort_by_key(|(frame, found)| (*frame, found.id));
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    for (frame, TrackedBox { id, bounds }) in rows {
        let (corner, size) = (bounds.min + 1.5, bounds.size());
        writeln!(
            file,
            "{},{id},{:.2},{:.2},{:.2},{:.2},1,-1,-1,-1",
            frame + 1,
            corner.x,
            corner.y,
            size.x,
            size.y
        )?;
    }
    file.flush()
}

#[cfg(test)]
mod tests {
    use protocol::{manifest::PersonId, pitch::Pitch};

    use super::*;
    use crate::evaluate::frame_truth::WhoTruth;
    use crate::teams::Team;

    fn truth() -> Truth {
        let person = |(id, team, role): (u32, Option<&str>, &str)| {
            (id, WhoTruth { id, team: team.map(str::to_owned), role: role.to_owned(), number: None })
        };
        let people = [
            (0, Some("home"), "player"),
            (1, Some("away"), "player"),
            (2, Some("away"), "goalkeeper"),
            (3, None, "referee"),
        ];
        Truth { pitch: Pitch::default(), people: people.map(person).into(), frames: Vec::new() }
    }

    fn member(person: u32, team: Option<Team>, role: Option<Role>) -> Member {
        Member {
            person: PersonId(person),
            team,
            team_confidence: 1.0,
            role,
            role_confidence: 1.0,
            shirt_rgb: None,
        }
    }

    #[test]
    fn teams_count_under_the_better_assignment_and_officials_have_none() {
        let members = [
            member(10, Some(Team::B), Some(Role::Player)),
            member(11, Some(Team::A), Some(Role::Player)),
            member(12, None, None),
            member(13, Some(Team::A), Some(Role::Referee)),
        ];
        let matches = Matches::from([((0, 10), 40), ((1, 11), 30), ((2, 12), 10), ((3, 13), 20)]);
        assert!((team_accuracy(&truth(), &members, &matches) - 70.0 / 80.0).abs() < 1e-12);
        assert!((role_accuracy(&truth(), &members, &matches) - 90.0 / 100.0).abs() < 1e-12);
        // All in one team: the better assignment has the larger team right.
        let one_team: Vec<Member> =
            members.iter().map(|m| Member { team: Some(Team::A), ..m.clone() }).collect();
        assert!((team_accuracy(&truth(), &one_team, &matches) - 0.5).abs() < 1e-12);
    }
}
