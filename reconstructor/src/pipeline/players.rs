//! The stages that look at one player at a time: who is who, which pixels, how deep, and the path on the pitch.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

use glam::DVec3;
use protocol::manifest::PersonId;

use super::{PipelineError, frames::each_frame, run::Run, work::Results};
use crate::{
    calibration::CameraEstimate,
    depth::{self, DepthError, DepthEstimator, DepthMap, PoseLifter, View},
    geometry::Mask,
    mesh::{self, Skin},
    numbers::Readings,
    pose::{Joint, POSE_SCORE_MIN, Person},
    report::{Failure, Loss, Stage},
    segmentation::{self, FrameSeen, PlayerMask, RefiningSegmenter, Segmenter},
    shots::ShotList,
    teams::{self, Member},
    tracking::{self, Sighting, Track, across::Clip},
    trajectory::{self, Path, Smoothing},
};

/// One frame of so many is looked at for what people look like all round.
const SKIN_STEP: usize = 3;

/// A depth map, or why there is none.
pub(super) type PersonDepth = Result<DepthMap, String>;
/// Joints in space, or why they stay as they were read.
type PersonJoints = Result<Vec<Joint>, String>;

/// Smooths poses along the tracks of each shot; gives those that were made from the frames before and after.
pub(super) fn smooth_poses(
    people: &mut [Vec<Person>],
    tracks: &[Track],
    cameras: &[CameraEstimate],
) -> BTreeSet<Sighting> {
    let changes = trajectory::smooth_poses(people, tracks, cameras);
    tracing::info!(
        "poses: {} with left and right exchanged, {} made from those before and after, {} joints set right",
        changes.exchanged,
        changes.filled.len(),
        changes.outliers
    );
    changes.filled.into_iter().collect()
}

/// The masks of a frame: whose, which of the frame's people, which pixels.
pub(super) type FrameMasks<'a> = BTreeMap<PersonId, &'a PlayerMask>;

impl Run<'_> {
    /// Turns shots from behind a goal that stand the wrong way round; notes those of which nothing tells.
    pub(super) fn settle_sides(&mut self, people: &mut [Vec<Person>], cameras: &mut [CameraEstimate]) {
        let sides = tracking::sides::settle(people, cameras, &self.shots, &self.pitch);
        for shot in sides.turned {
            tracing::info!(
                "shot {}: people before or after it show that its camera stands behind the right goal",
                shot + 1
            );
        }
        for shot in sides.open {
            let reason = format!(
                "shot {} is seen from behind a goal, and no shot beside it tells which: it stays where its camera was put, the left one when it was found without \
                 `--calibration`",
                shot + 1
            );
            tracing::warn!("{reason}");
            let first = self.shots.shots.get(shot).and_then(|shot| self.clip_frame(shot.frames.start));
            let (stage, loss) = (Stage::Calibration, Loss::Fallback);
            self.reporter.note(Failure { stage, loss, frame: first, person: None, reason });
        }
    }

    /// Who is who within each shot.
    pub(super) fn follow(
        &mut self,
        people: &[Vec<Person>],
        cameras: &[CameraEstimate],
    ) -> Result<Vec<Track>, PipelineError> {
        let started = Instant::now();
        let (info, limits) = (self.clip.info(), &self.options.tracking);
        let tracks = tracking::track_shots(people, cameras, info, &self.shots, limits);
        let tracks = teams::on_the_pitch(tracks, people, &self.pitch);
        self.reporter.stage_done(Stage::Tracking, started.elapsed(), 0);
        if tracks.is_empty() {
            return Err(PipelineError::Nobody {
                clip: self.options.clip.clone(),
                frames: self.frame_count(),
                seen: people.iter().map(Vec::len).sum(),
            });
        }
        Ok(tracks)
    }

    /// Who is who over the whole clip, and on whose side.
    pub(super) fn identify(
        &self,
        tracks: Vec<Track>,
        people: &[Vec<Person>],
        cameras: &[CameraEstimate],
        readings: &Readings,
    ) -> (Vec<Track>, Vec<Member>) {
        if self.options.tracking.over_cuts {
            let clip = Clip { people, cameras, info: self.clip.info(), shots: &self.shots };
            teams::join_tracks(&tracks, &clip, &self.pitch, readings)
        } else {
            let members = teams::assign(&tracks, people, &self.pitch);
            (tracks, members)
        }
    }

    /// Notes who has no pose of their own: it was made from the frames around, or they are left standing.
    pub(super) fn note_poses(
        &mut self,
        people: &[Vec<Person>],
        tracks: &[Track],
        filled: &BTreeSet<Sighting>,
    ) {
        for track in tracks {
            for sighting in &track.sightings {
                let person = people.get(sighting.frame).and_then(|frame| frame.get(sighting.person_index));
                if person.is_none_or(|person| person.pose_score >= POSE_SCORE_MIN) {
                    continue;
                }
                let instead = match filled.contains(sighting) {
                    true => "that of the frames around is shown",
                    false => "a standing figure is shown",
                };
                let reason = format!("no readable pose: {instead}");
                let (stage, loss, person) = (Stage::Pose, Loss::Fallback, Some(track.person.0));
                self.reporter.note(Failure {
                    stage,
                    loss,
                    frame: self.clip_frame(sighting.frame),
                    person,
                    reason,
                });
            }
        }
    }

    /// Which pixels belong to whom.
    pub(super) fn segment(
        &mut self,
        people: &[Vec<Person>],
        tracks: &[Track],
    ) -> Result<Vec<PlayerMask>, PipelineError> {
        let settings = format!("{:?}", self.options.tracking);
        let results = self.results(Stage::Segmentation, segmentation::MODEL, &[settings.as_bytes()])?;
        let followed = segmentation::followed(tracks, people.len());
        let wanted: Vec<bool> = followed.iter().map(|followed| !followed.is_empty()).collect();
        let found = self.per_frame(
            Stage::Segmentation,
            &results,
            &wanted,
            // It looks at each frame alone, so frames may come to several of them in any order.
            || Ok(RefiningSegmenter::load()?),
            |segmenter, frame| {
                let (people, followed) = (people.get(frame.index), followed.get(frame.index));
                let (Some(people), Some(followed)) = (people, followed) else { return Ok(Vec::new()) };
                let seen = FrameSeen { index: frame.index, picture: &frame.image, people, followed };
                Ok(segmenter.push(&seen)?)
            },
        )?;
        let masks = found.into_iter().flatten().flatten().collect();
        let masks: Vec<PlayerMask> = segmentation::settled(masks, people).into_values().flatten().collect();
        let kept: BTreeSet<(usize, usize)> =
            masks.iter().map(|mask| (mask.sighting.frame, mask.sighting.person_index)).collect();
        for track in tracks {
            for sighting in track.sightings.iter().filter(|s| !kept.contains(&(s.frame, s.person_index))) {
                let frame = self.clip_frame(sighting.frame);
                let reason = "hidden: none of its pixels is its own".to_owned();
                let (stage, person) = (Stage::Segmentation, Some(track.person.0));
                self.reporter.note(Failure { stage, loss: Loss::LeftOut, frame, person, reason });
            }
        }
        Ok(masks)
    }

    /// Puts the joints of everybody with a mask to where they are in space, and smooths them along the tracks once more.
    pub(super) fn lift(
        &mut self,
        cameras: &[CameraEstimate],
        people: &mut [Vec<Person>],
        masks: &[FrameMasks<'_>],
        tracks: &[Track],
    ) -> Result<(), PipelineError> {
        let settings = format!("{:?}", self.options.tracking);
        let results = self.results(Stage::Lifting, depth::LIFTING_MODEL, &[settings.as_bytes()])?;
        let wanted: Vec<bool> = masks.iter().map(|masks| !masks.is_empty()).collect();
        let seen = &*people;
        let lifted = self.per_frame(
            Stage::Lifting,
            &results,
            &wanted,
            || Ok(PoseLifter::load()?),
            |lifter, frame| {
                let mut all: BTreeMap<u32, PersonJoints> = BTreeMap::new();
                let Some(camera) = cameras.get(frame.index).and_then(|estimate| estimate.camera) else {
                    return Ok(all);
                };
                for (id, person, mask) in of_frame(frame.index, masks, seen) {
                    let view = View::from_camera(&camera, person.ground_m).ok_or(DepthError::OutOfView);
                    let joints = view.and_then(|view| lifter.lift(&frame.image, view, &person.joints, mask));
                    all.insert(id.0, of_one_player(joints)?);
                }
                Ok(all)
            },
        )?;
        for (index, frame) in lifted.into_iter().enumerate() {
            for (person, joints) in frame.unwrap_or_default() {
                let place = masks.get(index).and_then(|masks| masks.get(&PersonId(person)));
                let place = place.map(|mask| mask.sighting.person_index);
                match (joints, place.and_then(|place| people.get_mut(index)?.get_mut(place))) {
                    (Ok(joints), Some(known)) => known.joints = joints,
                    (Err(reason), _) => {
                        let (stage, frame) = (Stage::Lifting, self.clip_frame(index));
                        let (loss, person) = (Loss::Fallback, Some(person));
                        let reason = format!("{reason}; the pose stays as it was read");
                        self.reporter.note(Failure { stage, loss, frame, person, reason });
                    }
                    (Ok(_), None) => {}
                }
            }
        }
        smooth_poses(people, &in_shots(tracks, &self.shots), cameras);
        Ok(())
    }

    /// The depth map of every mask; they stay in the work folder.
    pub(super) fn depth(
        &mut self,
        cameras: &[CameraEstimate],
        people: &[Vec<Person>],
        masks: &[FrameMasks<'_>],
    ) -> Result<Results, PipelineError> {
        let settings = format!("{:?}", self.options.tracking);
        let results = self.results(Stage::Depth, depth::MODEL_NAME, &[settings.as_bytes()])?;
        let wanted: Vec<bool> = masks.iter().map(|masks| !masks.is_empty()).collect();
        let depths = self.per_frame(
            Stage::Depth,
            &results,
            &wanted,
            || Ok(DepthEstimator::load()?),
            |estimator, frame| {
                let mut all: BTreeMap<u32, PersonDepth> = BTreeMap::new();
                let Some(camera) = cameras.get(frame.index).and_then(|estimate| estimate.camera) else {
                    return Ok(all);
                };
                for (id, found, mask) in of_frame(frame.index, masks, people) {
                    all.insert(id.0, of_one_player(estimator.estimate(&frame.image, &camera, found, mask))?);
                }
                Ok(all)
            },
        )?;
        for (index, frame) in depths.into_iter().enumerate() {
            for (person, map) in frame.unwrap_or_default() {
                if let Err(reason) = map {
                    let (stage, frame) = (Stage::Depth, self.clip_frame(index));
                    self.reporter.note(Failure {
                        stage,
                        loss: Loss::LeftOut,
                        frame,
                        person: Some(person),
                        reason,
                    });
                }
            }
        }
        Ok(results)
    }

    /// What everybody looks like all round, from some of the frames.
    pub(super) fn skins(
        &mut self,
        cameras: &[CameraEstimate],
        people: &[Vec<Person>],
        masks: &[FrameMasks<'_>],
        depths: &Results,
    ) -> Result<BTreeMap<PersonId, Skin>, PipelineError> {
        let started = Instant::now();
        let wanted: Vec<bool> =
            masks.iter().enumerate().map(|(i, masks)| i % SKIN_STEP == 0 && !masks.is_empty()).collect();
        let expected = wanted.iter().filter(|wanted| **wanted).count();
        let progress = self.reporter.progress(Stage::Skin, expected);
        let mut skins: BTreeMap<PersonId, Skin> = BTreeMap::new();
        let read = each_frame(
            || self.clip.frames(),
            self.options.threads,
            &wanted,
            || Ok(()),
            |(), frame| {
                let camera = cameras.get(frame.index).and_then(|estimate| estimate.camera);
                let Some(camera) = camera else { return Ok(Vec::new()) };
                let depths: BTreeMap<u32, PersonDepth> = depths.load(frame.index).unwrap_or_default();
                let people = of_frame(frame.index, masks, people).filter_map(|(id, person, _)| {
                    let map = depths.get(&id.0)?.as_ref().ok()?;
                    Some((id, mesh::skin_of(&frame.image, &camera, person, map)))
                });
                Ok(people.collect())
            },
            |_, shown| {
                for (id, samples) in shown {
                    skins.entry(id).or_default().add(&samples);
                }
                progress.advance(1);
                Ok(())
            },
        )?;
        drop(progress);
        self.check_all_read(read, expected)?;
        self.reporter.stage_done(Stage::Skin, started.elapsed(), 0);
        Ok(skins)
    }

    /// The smooth path of everybody. Paths need only the anchors, so they are solved before the surfaces are lifted, and
    /// each surface is moved as it comes: no more than a few frames of surfaces are in memory.
    pub(super) fn smooth(
        &mut self,
        people: &[Vec<Person>],
        tracks: &[Track],
        smoothing: Smoothing,
    ) -> BTreeMap<PersonId, Path> {
        let started = Instant::now();
        let info = self.clip.info();
        let seconds: f64 = info.frames.iter().map(|frame| info.timescale.seconds(frame.duration)).sum();
        let weight = smoothing.weight(info.frames.len() as f64 / seconds.max(1e-3));
        let mut paths = BTreeMap::new();
        for track in tracks {
            let anchors = track.sightings.iter().filter_map(|sighting| {
                let person = people.get(sighting.frame)?.get(sighting.person_index)?;
                Some((sighting.frame, person.ground_m))
            });
            // Smoothing ends with the shot: the next camera errs in another way.
            let mut by_shot: BTreeMap<Option<usize>, BTreeMap<usize, DVec3>> = BTreeMap::new();
            for (frame, anchor_m) in anchors {
                by_shot.entry(self.shots.shot_of(frame)).or_default().insert(frame, anchor_m);
            }
            match Path::through_parts(by_shot.values(), weight) {
                Ok(path) => {
                    paths.insert(track.person, path);
                }
                Err(error) => self.reporter.note(Failure {
                    stage: Stage::Trajectory,
                    loss: Loss::Fallback,
                    frame: None,
                    person: Some(track.person.0),
                    reason: format!("{error}; its places stay as measured"),
                }),
            }
        }
        self.reporter.stage_done(Stage::Trajectory, started.elapsed(), 0);
        paths
    }
}

/// What went wrong with one player is said of that player; a network that is broken ends the run.
fn of_one_player<T>(result: Result<T, DepthError>) -> Result<Result<T, String>, PipelineError> {
    match result {
        Err(error @ DepthError::Inference(_)) => Err(error.into()),
        result => Ok(result.map_err(|error| error.to_string())),
    }
}

/// Every track's part in each shot: over a cut people are seen from somewhere else.
fn in_shots(tracks: &[Track], shots: &ShotList) -> Vec<Track> {
    let mut parts: BTreeMap<(PersonId, Option<usize>), Vec<Sighting>> = BTreeMap::new();
    for track in tracks {
        for sighting in &track.sightings {
            parts.entry((track.person, shots.shot_of(sighting.frame))).or_default().push(*sighting);
        }
    }
    parts.into_iter().map(|((person, _), sightings)| Track { person, sightings }).collect()
}

/// The people of a frame with a mask.
pub(super) fn of_frame<'a>(
    index: usize,
    masks: &'a [FrameMasks<'a>],
    people: &'a [Vec<Person>],
) -> impl Iterator<Item = (PersonId, &'a Person, &'a Mask)> {
    let frame = masks.get(index).into_iter().flatten();
    frame.filter_map(move |(id, found)| {
        let person = people.get(index)?.get(found.sighting.person_index)?;
        Some((*id, person, &found.mask))
    })
}

/// Masks by frame and person.
pub(super) fn by_frame<'a>(masks: &'a [PlayerMask], tracks: &[Track], frames: usize) -> Vec<FrameMasks<'a>> {
    let mut id_of = BTreeMap::new();
    for track in tracks {
        for sighting in &track.sightings {
            id_of.insert((sighting.frame, sighting.person_index), track.person);
        }
    }
    let mut all = vec![FrameMasks::new(); frames];
    for mask in masks {
        let (frame, person_index) = (mask.sighting.frame, mask.sighting.person_index);
        if let (Some(place), Some(id)) = (all.get_mut(frame), id_of.get(&(frame, person_index))) {
            place.insert(*id, mask);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shots::Shot;

    #[test]
    fn a_track_over_a_cut_is_smoothed_in_two_parts() {
        let shots =
            ShotList { shots: vec![Shot { frames: 0..5 }, Shot { frames: 5..9 }], ..ShotList::default() };
        let sightings = [1, 3, 4, 5, 8].map(|frame| Sighting { frame, person_index: 0 }).to_vec();
        let parts = in_shots(&[Track { person: PersonId(2), sightings }], &shots);
        let frames: Vec<Vec<usize>> =
            parts.iter().map(|part| part.sightings.iter().map(|sighting| sighting.frame).collect()).collect();
        assert_eq!(frames, [vec![1, 3, 4], vec![5, 8]]);
    }
}
