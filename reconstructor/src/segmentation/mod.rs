//! Section 4.3: which pixels belong to a tracked player.
//!
//! A [`Segmenter`] decides for one track at a time and may look at everybody in every frame. The one here takes the
//! pose network's instance mask and gives pixels that two people claim to one of them.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    geometry::Mask,
    pose::{Person, bones, cut},
    tracking::{Sighting, Track},
};

/// The pixels of one tracked person in one frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlayerMask {
    /// Whose.
    pub sighting: Sighting,
    /// Which pixels.
    pub mask: Mask,
}

/// A way to find the pixels of tracked people.
pub trait Segmenter {
    /// The pixels of one track, a mask per sighting in the order of the track. `people` is everybody who was found in
    /// each frame; sightings point into it.
    fn segment(&mut self, people: &[Vec<Person>], track: &Track) -> Vec<PlayerMask>;
}

/// The masks of all tracks, track by track; sightings without any pixel are left out.
#[must_use]
pub fn segment(people: &[Vec<Person>], tracks: &[Track], segmenter: &mut dyn Segmenter) -> Vec<PlayerMask> {
    let masks = tracks.iter().flat_map(|track| segmenter.segment(people, track));
    masks.filter(|found| found.mask.area_px() > 0).collect()
}

/// The pose network's instance mask, minus the pixels that belong more to somebody else in the frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct InstanceMaskSegmenter;

impl Segmenter for InstanceMaskSegmenter {
    fn segment(&mut self, people: &[Vec<Person>], track: &Track) -> Vec<PlayerMask> {
        let mask_of = |sighting: &Sighting| {
            let frame = people.get(sighting.frame)?;
            let person = frame.get(sighting.person_index)?;
            let others = frame.iter().enumerate().filter(|(i, _)| *i != sighting.person_index);
            let mask = own_pixels(person, others.map(|(_, other)| other));
            Some(PlayerMask { sighting: *sighting, mask })
        };
        track.sightings.iter().filter_map(mask_of).collect()
    }
}

/// The person's mask without the pixels that one of the others claims more strongly.
fn own_pixels<'a>(person: &Person, others: impl Iterator<Item = &'a Person>) -> Mask {
    let own = &person.mask;
    let width = own.width.max(1) as usize;
    let person_claim = Claim::of(person);
    let mut mask = own.clone();
    let mut lost = false;
    for other in others.filter(|other| touch(own, &other.mask)) {
        let other_claim = Claim::of(other);
        for (i, &coverage) in own.coverage.iter().enumerate() {
            let (x, y) = (own.x0 + (i % width) as i32, own.y0 + (i / width) as i32);
            let rival = other.mask.at(x, y);
            if coverage == 0 || rival == 0 {
                continue;
            }
            let pixel = DVec2::new(f64::from(x), f64::from(y));
            if other_claim.strength(pixel, rival) > person_claim.strength(pixel, coverage) {
                mask.coverage[i] = 0;
                lost = true;
            }
        }
    }
    if lost { cut(&mask) } else { mask }
}

fn touch(a: &Mask, b: &Mask) -> bool {
    let span = |start: i32, length: u32| (i64::from(start), i64::from(start) + i64::from(length));
    let overlap = |p: (i64, i64), q: (i64, i64)| p.0 < q.1 && q.0 < p.1;
    overlap(span(a.x0, a.width), span(b.x0, b.width)) && overlap(span(a.y0, a.height), span(b.y0, b.height))
}

/// What a person's skeleton says about a pixel.
struct Claim {
    bones: Vec<(DVec2, DVec2)>,
    /// Half the thickness of a limb, pixels.
    limb_px: f64,
}

impl Claim {
    fn of(person: &Person) -> Self {
        // A limb is about an eighth of the body's height across.
        let limb_px = (person.bounds.size().max_element() / 16.0).max(1.0);
        Self { bones: bones(&person.joints), limb_px }
    }

    /// Coverage, weighted down with the distance from the skeleton.
    fn strength(&self, pixel: DVec2, coverage: u8) -> f64 {
        let squared =
            self.bones.iter().map(|&bone| squared_distance(pixel, bone)).fold(f64::INFINITY, f64::min);
        f64::from(coverage) / (1.0 + squared / self.limb_px.powi(2))
    }
}

fn squared_distance(point: DVec2, (from, to): (DVec2, DVec2)) -> f64 {
    let along = to - from;
    let length = along.length_squared();
    let part = if length > 0.0 { ((point - from).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
    point.distance_squared(from + along * part)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use protocol::manifest::PersonId;

    use super::*;
    use crate::{
        geometry::PixelBox,
        pose::{JOINTS, Joint},
    };

    /// Somebody whose skeleton is an upright line at `x`, with a mask `reach` pixels to both sides.
    fn upright(x: i32, reach: i32) -> Person {
        let pixel = |i: usize| DVec2::new(f64::from(x), i as f64 * 2.0);
        let joints = (0..JOINTS).map(|i| Joint { pixel: pixel(i), depth_m: 0.0, visibility: 1.0 }).collect();
        let width = (2 * reach + 1) as u32;
        let mask = Mask { x0: x - reach, y0: 0, width, height: 60, coverage: vec![255; width as usize * 60] };
        let side = f64::from(reach);
        let bounds = PixelBox {
            min: DVec2::new(f64::from(x) - side, 0.0),
            max: DVec2::new(f64::from(x) + side, 64.0),
        };
        Person {
            bounds,
            score: 0.5,
            pose_score: 0.9,
            joints,
            mask,
            neck_px: pixel(10),
            ground_m: DVec3::ZERO,
            neck_m: DVec3::ZERO,
        }
    }

    fn track(person: u32, person_index: usize) -> Track {
        Track { person: PersonId(person), sightings: vec![Sighting { frame: 0, person_index }] }
    }

    #[test]
    fn a_pixel_two_people_claim_goes_to_the_nearer_skeleton() {
        let people = vec![vec![upright(100, 8), upright(110, 8)]];
        let tracks = [track(1, 0), track(2, 1)];
        let masks = segment(&people, &tracks, &mut InstanceMaskSegmenter);
        assert_eq!(masks.len(), 2);
        let (left, right) = (&masks[0].mask, &masks[1].mask);
        for x in 92..=118 {
            assert!(left.at(x, 30) == 0 || right.at(x, 30) == 0 || x == 105, "both have column {x}");
        }
        assert_eq!((left.at(103, 30), right.at(103, 30)), (255, 0));
        assert_eq!((left.at(107, 30), right.at(107, 30)), (0, 255));
        assert_eq!((left.at(92, 30), right.at(118, 30)), (255, 255));
    }

    #[test]
    fn somebody_alone_keeps_the_mask_and_lost_sightings_are_left_out() {
        let people = vec![vec![upright(100, 8)]];
        let gone = Track { person: PersonId(2), sightings: vec![Sighting { frame: 7, person_index: 3 }] };
        let masks = segment(&people, &[track(1, 0), gone], &mut InstanceMaskSegmenter);
        assert_eq!(masks.len(), 1);
        assert_eq!(masks[0].mask, people[0][0].mask);
    }
}
