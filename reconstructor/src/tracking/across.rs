//! Identities over cuts and out of the picture: tracks of a clip are joined where places, kits, shirt numbers and the people left over make it
//! sure, and are honestly new where not.
//!
//! Live pictures follow each other without a gap, so whoever stood somewhere before a cut stands there after it. A replay shows another moment: its
//! people do not stand where those before it stood, and none of them is joined.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3};
use protocol::manifest::PersonId;

use super::{
    Sighting, Track,
    links::{Node, Round, join, links},
    motion::Place,
    tracklets::{Seen, Tracklet},
};
use crate::{
    calibration::CameraEstimate,
    ingest::ClipInfo,
    numbers::{Reading, Readings, evidence::NumberEvidence},
    pose::Person,
    shots::ShotList,
};

/// Rounds, from what is nearly certain to what is only unambiguous: longest gap in seconds, and by how much a link must be clear.
const ROUNDS: [(f64, f64); 5] = [(AT_CUT_S, 3.0), (1.0, 2.0), (3.0, 1.5), (8.0, 1.5), (20.0, 1.5)];
/// Sightings nearer in time than this to a cut are at the cut, seconds.
const AT_CUT_S: f64 = 0.3;
/// People who are not accounted for, per square metre.
const OTHERS_PER_M2: f64 = 0.0002;
/// Places from two cameras, or of two spells in the picture, differ by this more (standard deviation), metres.
const APART_M: f64 = 0.6;
/// Loss of a second in which the person should have been in the picture and was not seen.
const UNSEEN_PER_S: f64 = 1.0;
/// Loss when the teams or roles differ.
const OTHER_SIDE: f64 = 5.0;
/// Of the people whom both pictures of a cut should show, this share must be found again, if there are so many; else time does not run on.
const FOUND_AGAIN: f64 = 0.5;
const ENOUGH_AT_CUT: usize = 3;
/// Frames looked at in a gap.
const LOOKS_IN_GAP: usize = 16;

/// All that joining needs of the clip.
#[derive(Clone, Copy)]
pub(crate) struct Clip<'a> {
    pub(crate) people: &'a [Vec<Person>],
    pub(crate) cameras: &'a [CameraEstimate],
    pub(crate) info: &'a ClipInfo,
    pub(crate) shots: &'a ShotList,
}

/// What is known of tracks besides places and looks.
#[derive(Clone, Copy)]
pub(crate) struct Marks<'a> {
    /// Team and role of a track as a number, where known.
    pub(crate) side: &'a dyn Fn(PersonId) -> Option<u8>,
    /// What looks at backs show.
    pub(crate) backs: &'a Readings,
}

/// Joins tracks of the same person. The result is numbered anew, in order of first sighting.
pub(crate) fn join_tracks(tracks: &[Track], clip: &Clip<'_>, marks: &Marks<'_>) -> Vec<Track> {
    let mut runs: Vec<Tracklet> = tracks.iter().map(|track| clip.seen(&track.sightings)).collect();
    let mut sides: Vec<Option<u8>> = tracks.iter().map(|track| (marks.side)(track.person)).collect();
    let whole: Vec<bool> = runs.iter().zip(tracks).map(|(run, t)| run.len() == t.sightings.len()).collect();
    let mut broken: BTreeSet<usize> = BTreeSet::new();
    for (round, (gap_s, clear_by)) in ROUNDS.into_iter().enumerate() {
        let round_of =
            Round { gap_s, clear_by, others_per_m2: OTHERS_PER_M2, apart_m: APART_M, unseen_per_s: 0.0 };
        // A run without a place stays as it is, in its place.
        let nodes: Vec<(usize, Node)> =
            runs.iter().enumerate().filter_map(|(i, run)| Some((i, Node::of(run)?))).collect();
        let (places, nodes): (Vec<usize>, Vec<Node>) = nodes.into_iter().unzip();
        let looks = |run: &Tracklet| -> Vec<&Reading> {
            run.iter().filter_map(|seen| marks.backs.get(&seen.sighting)).collect()
        };
        let numbers: Vec<NumberEvidence> = runs.iter().map(|run| NumberEvidence::of(&looks(run))).collect();
        let at = |node: usize| places.get(node).copied().unwrap_or(usize::MAX);
        let extra = |from: usize, to: usize| {
            let (a, b) = (runs.get(at(from))?, runs.get(at(to))?);
            if clip.crosses(a, b, &broken) {
                return None;
            }
            let other_side = match (sides.get(at(from))?, sides.get(at(to))?) {
                (Some(a), Some(b)) if a != b => OTHER_SIDE,
                _ => 0.0,
            };
            let number = numbers.get(at(from))?.log_same(numbers.get(at(to))?);
            Some(number - other_side - UNSEEN_PER_S * clip.unseen_s(a.last()?, b.first()?))
        };
        let mut found: Vec<(usize, usize)> =
            links(&nodes, &round_of, &extra).into_iter().map(|(from, to)| (at(from), at(to))).collect();
        if round == 0 {
            broken = clip.broken_cuts(&runs, &found);
            found.retain(|&(from, to)| {
                let ends = runs.get(from).zip(runs.get(to));
                ends.is_some_and(|(a, b)| !clip.crosses(a, b, &broken))
            });
        }
        for &(from, to) in &found {
            let known = sides.get(to).copied().flatten();
            if let Some(place) = sides.get_mut(from) {
                *place = place.or(known);
            }
        }
        join(&mut runs, &found, |run| run.first().map_or(0.0, |seen| seen.seconds));
    }
    let joined = runs.into_iter().map(|run| run.into_iter().map(|seen| seen.sighting).collect::<Vec<_>>());
    // Tracks with places that are no numbers were never part of this.
    let untouched = tracks.iter().zip(&whole).filter(|(_, whole)| !**whole).map(|(t, _)| t.sightings.clone());
    let mut all: Vec<Vec<Sighting>> = joined
        .zip(&whole)
        .filter(|(run, whole)| **whole && !run.is_empty())
        .map(|(run, _)| run)
        .chain(untouched)
        .collect();
    all.sort_by_key(|sightings| sightings.first().map(|s| (s.frame, s.person_index)));
    all.into_iter()
        .zip(1..)
        .map(|(sightings, number)| Track { person: PersonId(number), sightings })
        .collect()
}

impl Clip<'_> {
    fn seconds(&self, frame: usize) -> Option<f64> {
        Some(self.info.timescale.seconds(self.info.frames.get(frame)?.start))
    }

    fn camera(&self, frame: usize) -> Option<&protocol::camera::Camera> {
        self.cameras.get(frame)?.camera.as_ref()
    }

    /// Sightings with what linking needs; empty when one of them cannot be placed.
    fn seen(&self, sightings: &[Sighting]) -> Tracklet {
        let seen = sightings.iter().map(|&sighting| {
            let person = self.people.get(sighting.frame)?.get(sighting.person_index)?;
            let from = self.camera(sighting.frame).map(|c| DVec2::new(c.position.x, c.position.z));
            let place = Place::seen(DVec2::new(person.neck_m.x, person.neck_m.z), from);
            let seconds = self.seconds(sighting.frame)?;
            place.at.is_finite().then_some(Seen { sighting, seconds, place, looks: person.looks })
        });
        seen.collect::<Option<Tracklet>>().unwrap_or_default()
    }

    fn shot(&self, seen: Option<&Seen>) -> Option<usize> {
        self.shots.shot_of(seen?.sighting.frame)
    }

    /// Whether a link goes over one of these cuts (by the shot before it) to the very next shot.
    fn crosses(&self, from: &[Seen], to: &[Seen], cuts: &BTreeSet<usize>) -> bool {
        let (from, to) = (self.shot(from.last()), self.shot(to.first()));
        from.zip(to).is_some_and(|(from, to)| to == from + 1 && cuts.contains(&from))
    }

    fn shows(&self, frame: usize, at: DVec2) -> bool {
        // The middle of the body: whoever is cut off at the edge may not be found.
        let pixel = self.camera(frame).and_then(|camera| camera.project(DVec3::new(at.x, 1.0, at.y)));
        let (width, height) = (f64::from(self.info.width_px), f64::from(self.info.height_px));
        pixel.is_some_and(|p| {
            (0.01 * width..0.99 * width).contains(&p.x) && (0.03 * height..0.97 * height).contains(&p.y)
        })
    }

    /// Seconds between two sightings in which the person, on a straight way, should have been in the picture.
    fn unseen_s(&self, from: &Seen, to: &Seen) -> f64 {
        let (first, last) = (from.sighting.frame, to.sighting.frame);
        let frames = last.saturating_sub(first);
        let looks = frames.saturating_sub(1).min(LOOKS_IN_GAP);
        let shown = (1..=looks)
            .filter(|look| {
                let part = *look as f64 / (looks + 1) as f64;
                self.shows(first + (part * frames as f64) as usize, from.place.at.lerp(to.place.at, part))
            })
            .count();
        (to.seconds - from.seconds) * shown as f64 / looks.max(1) as f64
    }

    /// Cuts (by the number of the shot before) over which time does not run on.
    fn broken_cuts(&self, runs: &[Tracklet], found: &[(usize, usize)]) -> BTreeSet<usize> {
        let mut broken = BTreeSet::new();
        for (before, pair) in self.shots.shots.windows(2).enumerate() {
            let [a, b] = pair else { continue };
            let (last, first) = (a.frames.end.saturating_sub(1), b.frames.start);
            let (Some(end_s), Some(start_s)) = (self.seconds(last), self.seconds(first)) else { continue };
            let ends = runs.iter().filter(|run| {
                self.shot(run.last()) == Some(before)
                    && run
                        .last()
                        .is_some_and(|s| end_s - s.seconds < AT_CUT_S && self.shows(first, s.place.at))
            });
            let starts = runs.iter().filter(|run| {
                self.shot(run.first()) == Some(before + 1)
                    && run
                        .first()
                        .is_some_and(|s| s.seconds - start_s < AT_CUT_S && self.shows(last, s.place.at))
            });
            let expected = ends.count().min(starts.count());
            let again = found
                .iter()
                .filter(|(from, to)| {
                    let shot = |run: Option<&Seen>| self.shot(run);
                    runs.get(*from).is_some_and(|run| shot(run.last()) == Some(before))
                        && runs.get(*to).is_some_and(|run| shot(run.first()) == Some(before + 1))
                })
                .count();
            if expected >= ENOUGH_AT_CUT && (again as f64) < FOUND_AGAIN * expected as f64 {
                tracing::info!(
                    "cut after frame {last}: {again} of {expected} people found again; time does not run on"
                );
                broken.insert(before);
            }
        }
        broken
    }
}
