//! Section 4.2, last paragraph: who is who over time.
//!
//! Offline and on the pitch in metres, so that the camera's motion is out of it: tracklets that leave no doubt are linked over gaps by the
//! likeliest set of links of the whole shot ([`TrackingMethod::Global`]), by how people move, their kits and their build. The
//! paper's greedy merging is kept as the baseline.

pub(crate) mod across;
pub(crate) mod appearance;
mod global;
mod links;
mod merge;
mod motion;
pub(crate) mod sides;
mod tracklets;

#[cfg(test)]
mod crowd_tests;

use glam::DVec2;
use protocol::manifest::PersonId;
use serde::{Deserialize, Serialize};

use crate::{calibration::CameraEstimate, ingest::ClipInfo, pose::Person, shots::ShotList};

/// One person over the clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Identity in the stream.
    pub person: PersonId,
    /// Where it was seen, in order of time.
    pub sightings: Vec<Sighting>,
}

/// A link from a track to a person of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Sighting {
    /// Index in `ClipInfo::frames`.
    pub frame: usize,
    /// Index in that frame's people.
    pub person_index: usize,
}

/// How sightings become tracks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrackingMethod {
    /// The paper's: the nearest end and start first, by places alone.
    Greedy,
    /// The likeliest set of links of a shot, by motion and looks.
    #[default]
    Global,
}

/// What two sightings may be apart and still be one person.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackingLimits {
    /// How sightings become tracks.
    pub method: TrackingMethod,
    /// Of the greedy method: error of a position on the pitch, metres; what a runner covers in the time between comes on top.
    pub max_distance_m: f64,
    /// Of the greedy method: from one sighting of a person to the next at most, frames.
    pub max_gap_frames: usize,
    /// Of the global method: from one sighting of a person to the next at most, seconds.
    pub max_gap_s: f64,
    /// Whether tracks are joined over cuts and spells out of the picture, where that is sure; else everybody is new.
    pub over_cuts: bool,
    /// Tracks with fewer sightings are dropped; in a clip of few frames half of its frames is enough.
    pub min_length_frames: usize,
}

impl Default for TrackingLimits {
    /// The paper's public code bridges 20 frames and keeps tracks of at least 20; positions here are sure enough for 10.
    fn default() -> Self {
        Self {
            method: TrackingMethod::Global,
            max_distance_m: 1.0,
            max_gap_frames: 20,
            max_gap_s: 2.5,
            over_cuts: true,
            min_length_frames: 10,
        }
    }
}

/// Links the people of all frames to tracks; the same input gives the same tracks.
///
/// `people` has an entry per frame of `clip`, `cameras` one or none. Tracks are numbered from 1 in the order in which they begin (from left to
/// right of the picture within a frame). No two sightings of a frame share a track.
#[must_use]
pub fn track(
    people: &[Vec<Person>],
    cameras: &[CameraEstimate],
    clip: &ClipInfo,
    limits: &TrackingLimits,
) -> Vec<Track> {
    let seconds: Vec<f64> = (0..people.len())
        .map(|frame| match clip.frames.get(frame) {
            Some(time) => clip.timescale.seconds(time.start),
            // Frames that the clip does not know of cannot be placed in time: an hour apart joins nothing.
            None => 3600.0 * (frame + 1) as f64,
        })
        .collect();
    let shortest = limits.min_length_frames.min(people.len().div_ceil(2)).max(1);
    let mut chains = match limits.method {
        TrackingMethod::Greedy => {
            let place = |person: &Person| DVec2::new(person.neck_m.x, person.neck_m.z);
            let necks: Vec<Vec<DVec2>> =
                people.iter().map(|frame| frame.iter().map(place).collect()).collect();
            merge::chains(&necks, &seconds, limits)
        }
        TrackingMethod::Global => {
            let place = |estimate: &CameraEstimate| {
                estimate.camera.map(|camera| DVec2::new(camera.position.x, camera.position.z))
            };
            let cameras: Vec<Option<DVec2>> = cameras.iter().map(place).collect();
            global::chains(people, &seconds, &cameras, limits.max_gap_s)
        }
    };
    chains.retain(|chain| chain.len() >= shortest);
    chains.sort_by_key(|chain| chain.first().map(|s| (s.frame, s.person_index)));
    let numbered = chains.into_iter().zip(1..);
    numbered.map(|(sightings, number)| Track { person: PersonId(number), sightings }).collect()
}

/// Links the people of each shot on its own: nobody is followed over a cut, and a person of two shots is two. Tracks are
/// numbered from 1 through all shots; otherwise as [`track`].
#[must_use]
pub fn track_shots(
    people: &[Vec<Person>],
    cameras: &[CameraEstimate],
    clip: &ClipInfo,
    shots: &ShotList,
    limits: &TrackingLimits,
) -> Vec<Track> {
    let mut all: Vec<Track> = Vec::new();
    for shot in &shots.shots {
        let part = |length: usize| shot.frames.start.min(length)..shot.frames.end.min(length);
        let frames = clip.frames.get(part(clip.frames.len())).unwrap_or_default().to_vec();
        let of_shot = people.get(part(people.len())).unwrap_or_default();
        let cameras = cameras.get(part(cameras.len())).unwrap_or_default();
        for track in track(of_shot, cameras, &ClipInfo { frames, ..clip.clone() }, limits) {
            let sightings = track
                .sightings
                .into_iter()
                .map(|sighting| Sighting { frame: sighting.frame + shot.frames.start, ..sighting })
                .collect();
            let person = PersonId(u32::try_from(all.len() + 1).unwrap_or(u32::MAX));
            all.push(Track { person, sightings });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;
    use protocol::time::{Ticks, Timescale};

    use super::*;
    use crate::{geometry::PixelBox, ingest::FrameTime, shots::Shot};

    fn at(x: f64, z: f64) -> Person {
        Person {
            score: 0.5,
            pose_score: 0.5,
            ground_m: DVec3::new(x, 0.0, z),
            neck_m: DVec3::new(x, 1.5, z),
            ..Person::blank()
        }
    }

    fn clip(frames: usize) -> ClipInfo {
        let frame = |i: usize| FrameTime {
            clip_frame: i as u32,
            start: Ticks(i as i64 * 1001),
            duration: Ticks(1001),
            duplicate: false,
        };
        ClipInfo {
            width_px: 1280,
            height_px: 720,
            timescale: Timescale { numerator: 30_000, denominator: 1 },
            frames: (0..frames).map(frame).collect(),
        }
    }

    /// Seconds at frame `i`.
    fn time(i: usize) -> f64 {
        i as f64 * 1001.0 / 30_000.0
    }

    #[test]
    fn players_who_cross_keep_their_identity() {
        // They run at 5 m/s towards each other and pass 0.6 m apart; the order in the list changes as they cross.
        let people: Vec<Vec<Person>> = (0..60)
            .map(|i| {
                let along = 5.0 * (time(i) - 1.0);
                let (a, b) = (at(along, 0.0), at(-along, 0.6));
                if along < 0.0 { vec![a, b] } else { vec![b, a] }
            })
            .collect();
        let tracks = track(&people, &[], &clip(60), &TrackingLimits::default());
        assert_eq!(tracks.len(), 2);
        for track in &tracks {
            let side = |s: &Sighting| people[s.frame][s.person_index].neck_m.z;
            assert_eq!(track.sightings.len(), 60);
            assert!(track.sightings.iter().all(|s| side(s) == side(&track.sightings[0])), "{track:?}");
        }
    }

    #[test]
    fn a_gap_is_bridged_at_running_speed_but_not_beyond_the_limit() {
        let limits = TrackingLimits {
            method: TrackingMethod::Greedy,
            max_gap_frames: 12,
            ..TrackingLimits::default()
        };
        let hidden = |from: usize, to: usize| -> Vec<Vec<Person>> {
            (0..60)
                .map(|i| if (from..to).contains(&i) { vec![] } else { vec![at(7.0 * time(i), 3.0)] })
                .collect()
        };
        assert_eq!(track(&hidden(20, 31), &[], &clip(60), &limits).len(), 1);
        assert_eq!(track(&hidden(20, 33), &[], &clip(60), &limits).len(), 2);
    }

    #[test]
    fn nobody_runs_faster_than_a_sprinter() {
        let people: Vec<Vec<Person>> =
            (0..40).map(|i| vec![at(if i < 20 { 0.0 } else { 8.0 }, 0.0)]).collect();
        assert_eq!(track(&people, &[], &clip(40), &TrackingLimits::default()).len(), 2);
    }

    #[test]
    fn short_tracks_are_dropped_but_a_short_clip_keeps_its_people() {
        let mut people = vec![vec![at(0.0, 0.0)]; 40];
        for frame in people.iter_mut().take(14).skip(10) {
            frame.push(at(20.0, 10.0));
        }
        let tracks = track(&people, &[], &clip(40), &TrackingLimits::default());
        assert_eq!(tracks.len(), 1);
        assert_eq!(tracks[0].person, PersonId(1));
        assert_eq!(track(&people[..3], &[], &clip(3), &TrackingLimits::default()).len(), 1);
        assert_eq!(track(&people[..1], &[], &clip(1), &TrackingLimits::default()).len(), 1);
        assert_eq!(track(&[], &[], &clip(0), &TrackingLimits::default()), []);
    }

    #[test]
    fn nobody_is_followed_over_a_cut() {
        let people = vec![vec![at(1.0, 1.0)]; 60];
        let cut = ShotList {
            shots: vec![Shot { frames: 0..25 }, Shot { frames: 28..60 }],
            transitions: Vec::new(),
        };
        let tracks = track_shots(&people, &[], &clip(60), &cut, &TrackingLimits::default());
        let spans: Vec<(usize, usize)> =
            tracks.iter().map(|t| (t.sightings[0].frame, t.sightings.last().unwrap().frame)).collect();
        assert_eq!(spans, [(0, 24), (28, 59)]);
        assert_eq!(tracks.iter().map(|t| t.person.0).collect::<Vec<_>>(), [1, 2]);
        let whole = track_shots(&people, &[], &clip(60), &ShotList::single(60), &TrackingLimits::default());
        assert_eq!(whole, track(&people, &[], &clip(60), &TrackingLimits::default()));
    }

    #[test]
    fn a_position_that_is_no_number_is_left_alone() {
        let people = vec![vec![at(f64::NAN, 0.0), at(1.0, 1.0)]; 12];
        assert_eq!(track(&people, &[], &clip(12), &TrackingLimits::default()).len(), 1);
    }

    #[test]
    fn who_is_seen_twice_is_followed_once() {
        let mut people = vec![vec![at(0.0, 0.0), at(0.5, 0.0)]; 40];
        assert_eq!(track(&people, &[], &clip(40), &TrackingLimits::default()).len(), 1);
        for frame in &mut people {
            frame[1].bounds = PixelBox { min: DVec2::X, max: DVec2::new(2.0, 1.0) };
        }
        assert_eq!(track(&people, &[], &clip(40), &TrackingLimits::default()).len(), 2);
    }

    proptest! {
        #[test]
        fn no_two_sightings_of_a_frame_share_a_track(
            frames in prop::collection::vec(prop::collection::vec((-5.0..5.0, -5.0..5.0), 0..6), 0..25),
            min_length_frames in 1usize..4,
        ) {
            // Boxes side by side: nobody is a second sighting of another.
            let beside = |(i, &(x, z)): (usize, &(f64, f64))| Person {
                bounds: PixelBox { min: DVec2::new(i as f64, 0.0), max: DVec2::new(i as f64 + 1.0, 2.0) },
                ..at(x, z)
            };
            let people: Vec<Vec<Person>> =
                frames.iter().map(|f| f.iter().enumerate().map(beside).collect()).collect();
            let limits = TrackingLimits { min_length_frames, ..TrackingLimits::default() };
            let tracks = track(&people, &[], &clip(people.len()), &limits);
            let mut seen = std::collections::HashSet::new();
            for track in &tracks {
                prop_assert!(track.sightings.windows(2).all(|w| w[0].frame < w[1].frame));
                for s in &track.sightings {
                    prop_assert!(s.person_index < people[s.frame].len());
                    prop_assert!(seen.insert((s.frame, s.person_index)), "sighting in two tracks");
                }
            }
            prop_assert_eq!(track_again(&people, &limits), tracks);
            if min_length_frames == 1 {
                prop_assert_eq!(seen.len(), people.iter().map(Vec::len).sum::<usize>());
            }
        }
    }

    fn track_again(people: &[Vec<Person>], limits: &TrackingLimits) -> Vec<Track> {
        track(people, &[], &clip(people.len()), limits)
    }
}
