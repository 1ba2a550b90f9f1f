//! The stages that look at one player at a time: who is who, which pixels, how deep, and the path on the pitch.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Instant,
};

use protocol::manifest::PersonId;

use super::{PipelineError, kit, run::Run, work::Results};
use crate::{
    calibration::CameraEstimate,
    depth::{self, DepthError, DepthEstimator, DepthMap},
    geometry::Mask,
    pose::Person,
    report::{Failure, Loss, Stage},
    segmentation::{self, InstanceMaskSegmenter, PlayerMask},
    tracking::{self, Track},
    trajectory::Path,
};

/// A depth map, or why there is none, and the shirt's colour.
pub(super) type PersonDepth = (Result<DepthMap, String>, Option<[u8; 3]>);

/// The masks of a frame: whose, which of the frame's people, which pixels.
pub(super) type FrameMasks<'a> = BTreeMap<PersonId, &'a PlayerMask>;

/// Where the depth maps are, and what was learnt with them.
pub(super) struct Depths {
    pub(super) results: Results,
    pub(super) shirts: BTreeMap<PersonId, [u8; 3]>,
}

impl Run<'_> {
    /// Who is who.
    pub(super) fn track(&mut self, people: &[Vec<Person>]) -> Result<Vec<Track>, PipelineError> {
        let started = Instant::now();
        let tracks = tracking::track_shots(people, self.clip.info(), &self.shots, &self.options.tracking);
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

    /// Which pixels belong to whom.
    pub(super) fn segment(&mut self, people: &[Vec<Person>], tracks: &[Track]) -> Vec<PlayerMask> {
        let started = Instant::now();
        let masks = segmentation::segment(people, tracks, &mut InstanceMaskSegmenter);
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
        self.reporter.stage_done(Stage::Segmentation, started.elapsed(), 0);
        masks
    }

    /// The depth map of every mask; they stay in the work folder.
    pub(super) fn depth(
        &mut self,
        cameras: &[CameraEstimate],
        people: &[Vec<Person>],
        masks: &[FrameMasks<'_>],
    ) -> Result<Depths, PipelineError> {
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
                    let map = match estimator.estimate(&frame.image, &camera, found, mask) {
                        Ok(map) => Ok(map),
                        // The network itself is broken: that is not this player's fault.
                        Err(error @ DepthError::Inference(_)) => return Err(error.into()),
                        Err(error) => Err(error.to_string()),
                    };
                    all.insert(id.0, (map, kit::shirt_rgb(&frame.image, found, mask)));
                }
                Ok(all)
            },
        )?;
        let mut colours: BTreeMap<PersonId, Vec<[u8; 3]>> = BTreeMap::new();
        for (index, frame) in depths.into_iter().enumerate() {
            for (person, (map, shirt)) in frame.unwrap_or_default() {
                colours.entry(PersonId(person)).or_default().extend(shirt);
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
        let shirts =
            colours.iter().filter_map(|(id, samples)| Some((*id, kit::middle_rgb(samples)?))).collect();
        Ok(Depths { results, shirts })
    }

    /// The smooth path of everybody. Paths need only the anchors, so they are solved before the surfaces are lifted, and
    /// each surface is moved as it comes: no more than a few frames of surfaces are in memory.
    pub(super) fn smooth(&mut self, people: &[Vec<Person>], tracks: &[Track]) -> BTreeMap<PersonId, Path> {
        let started = Instant::now();
        let info = self.clip.info();
        let seconds: f64 = info.frames.iter().map(|frame| info.timescale.seconds(frame.duration)).sum();
        let weight = self.options.smoothing.weight(info.frames.len() as f64 / seconds.max(1e-3));
        let mut paths = BTreeMap::new();
        for track in tracks {
            let anchors = track.sightings.iter().filter_map(|sighting| {
                let person = people.get(sighting.frame)?.get(sighting.person_index)?;
                Some((sighting.frame, person.ground_m))
            });
            match Path::through(&anchors.collect(), weight) {
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
