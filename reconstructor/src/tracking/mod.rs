//! Section 4.2, last paragraph: who is who over time.
//!
//! The paper's greedy merging, on the pitch in metres instead of in pixels: every sighting starts as a track of its own,
//! and the end of one is joined to the start of another while they are near enough for the time between them.

mod merge;

use protocol::manifest::PersonId;
use serde::{Deserialize, Serialize};

use crate::{ingest::ClipInfo, pose::Person, shots::ShotList};

/// One person over the clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Identity in the stream.
    pub person: PersonId,
    /// Where it was seen, in order of time.
    pub sightings: Vec<Sighting>,
}

/// A link from a track to a person of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sighting {
    /// Index in `ClipInfo::frames`.
    pub frame: usize,
    /// Index in that frame's people.
    pub person_index: usize,
}

/// What two sightings may be apart and still be one person.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackingLimits {
    /// Error of a position on the pitch, metres; what a runner covers in the time between comes on top.
    pub max_distance_m: f64,
    /// From one sighting of a person to the next at most, frames.
    pub max_gap_frames: usize,
    /// Tracks with fewer sightings are dropped; in a clip of few frames half of its frames is enough.
    pub min_length_frames: usize,
}

impl Default for TrackingLimits {
    /// The paper's public code bridges 20 frames and keeps tracks of at least 20; positions here are sure enough for 10.
    fn default() -> Self {
        Self { max_distance_m: 1.0, max_gap_frames: 20, min_length_frames: 10 }
    }
}

/// Links the people of all frames to tracks; the same input gives the same tracks.
///
/// `people` has an entry per frame of `clip`. Tracks are numbered from 1 in the order in which they begin (from left to
/// right of the picture within a frame). No two sightings of a frame share a track.
#[must_use]
pub fn track(people: &[Vec<Person>], clip: &ClipInfo, limits: &TrackingLimits) -> Vec<Track> {
    let seconds: Vec<f64> = (0..people.len())
        .map(|frame| match clip.frames.get(frame) {
            Some(time) => clip.timescale.seconds(time.start),
            // Frames that the clip does not know of cannot be placed in time: an hour apart joins nothing.
            None => 3600.0 * (frame + 1) as f64,
        })
        .collect();
    let necks: Vec<Vec<glam::DVec2>> = people
        .iter()
        .map(|frame| frame.iter().map(|person| glam::DVec2::new(person.neck_m.x, person.neck_m.z)).collect())
        .collect();
    let shortest = limits.min_length_frames.min(people.len().div_ceil(2)).max(1);
    let mut chains = merge::chains(&necks, &seconds, limits);
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
    clip: &ClipInfo,
    shots: &ShotList,
    limits: &TrackingLimits,
) -> Vec<Track> {
    let mut all: Vec<Track> = Vec::new();
    for shot in &shots.shots {
        let part = |length: usize| shot.frames.start.min(length)..shot.frames.end.min(length);
        let frames = clip.frames.get(part(clip.frames.len())).unwrap_or_default().to_vec();
        let of_shot = people.get(part(people.len())).unwrap_or_default();
        for track in track(of_shot, &ClipInfo { frames, ..clip.clone() }, limits) {
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
    use glam::{DVec2, DVec3};
    use proptest::prelude::*;
    use protocol::time::{Ticks, Timescale};

    use super::*;
    use crate::{
        geometry::{Mask, PixelBox},
        ingest::FrameTime,
        shots::Shot,
    };

    fn at(x: f64, z: f64) -> Person {
        Person {
            bounds: PixelBox { min: DVec2::ZERO, max: DVec2::ZERO },
            score: 0.5,
            pose_score: 0.5,
            joints: Vec::new(),
            mask: Mask::default(),
            neck_px: DVec2::ZERO,
            ground_m: DVec3::new(x, 0.0, z),
            neck_m: DVec3::new(x, 1.5, z),
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
        let tracks = track(&people, &clip(60), &TrackingLimits::default());
        assert_eq!(tracks.len(), 2);
        for track in &tracks {
            let side = |s: &Sighting| people[s.frame][s.person_index].neck_m.z;
            assert_eq!(track.sightings.len(), 60);
            assert!(track.sightings.iter().all(|s| side(s) == side(&track.sightings[0])), "{track:?}");
        }
    }

    #[test]
    fn a_gap_is_bridged_at_running_speed_but_not_beyond_the_limit() {
        let limits = TrackingLimits { max_gap_frames: 12, ..TrackingLimits::default() };
        let hidden = |from: usize, to: usize| -> Vec<Vec<Person>> {
            (0..60)
                .map(|i| if (from..to).contains(&i) { vec![] } else { vec![at(7.0 * time(i), 3.0)] })
                .collect()
        };
        assert_eq!(track(&hidden(20, 31), &clip(60), &limits).len(), 1);
        assert_eq!(track(&hidden(20, 33), &clip(60), &limits).len(), 2);
    }

    #[test]
    fn nobody_runs_faster_than_a_sprinter() {
        let people: Vec<Vec<Person>> =
            (0..40).map(|i| vec![at(if i < 20 { 0.0 } else { 8.0 }, 0.0)]).collect();
        assert_eq!(track(&people, &clip(40), &TrackingLimits::default()).len(), 2);
    }

    #[test]
    fn short_tracks_are_dropped_but_a_short_clip_keeps_its_people() {
        let mut people = vec![vec![at(0.0, 0.0)]; 40];
        for frame in people.iter_mut().take(14).skip(10) {
            frame.push(at(20.0, 10.0));
        }
        let tracks = track(&people, &clip(40), &TrackingLimits::default());
        assert_eq!(tracks.len(), 1);
        assert_eq!(tracks[0].person, PersonId(1));
        assert_eq!(track(&people[..3], &clip(3), &TrackingLimits::default()).len(), 1);
        assert_eq!(track(&people[..1], &clip(1), &TrackingLimits::default()).len(), 1);
        assert_eq!(track(&[], &clip(0), &TrackingLimits::default()), []);
    }

    #[test]
    fn nobody_is_followed_over_a_cut() {
        let people = vec![vec![at(1.0, 1.0)]; 60];
        let cut = ShotList {
            shots: vec![Shot { frames: 0..25 }, Shot { frames: 28..60 }],
            transitions: Vec::new(),
        };
        let tracks = track_shots(&people, &clip(60), &cut, &TrackingLimits::default());
        let spans: Vec<(usize, usize)> =
            tracks.iter().map(|t| (t.sightings[0].frame, t.sightings.last().unwrap().frame)).collect();
        assert_eq!(spans, [(0, 24), (28, 59)]);
        assert_eq!(tracks.iter().map(|t| t.person.0).collect::<Vec<_>>(), [1, 2]);
        let whole = track_shots(&people, &clip(60), &ShotList::single(60), &TrackingLimits::default());
        assert_eq!(whole, track(&people, &clip(60), &TrackingLimits::default()));
    }

    #[test]
    fn a_position_that_is_no_number_is_left_alone() {
        let people = vec![vec![at(f64::NAN, 0.0), at(1.0, 1.0)]; 12];
        assert_eq!(track(&people, &clip(12), &TrackingLimits::default()).len(), 1);
    }

    proptest! {
        #[test]
        fn no_two_sightings_of_a_frame_share_a_track(
            frames in prop::collection::vec(prop::collection::vec((-5.0..5.0, -5.0..5.0), 0..6), 0..25),
            min_length_frames in 1usize..4,
        ) {
            let people: Vec<Vec<Person>> =
                frames.iter().map(|f| f.iter().map(|&(x, z)| at(x, z)).collect()).collect();
            let limits = TrackingLimits { min_length_frames, ..TrackingLimits::default() };
            let tracks = track(&people, &clip(people.len()), &limits);
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
        track(people, &clip(people.len()), limits)
    }
}
