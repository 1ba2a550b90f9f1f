//! Who is looked at, and what the shipped network reads on drawn backs.

use std::collections::BTreeMap;

use glam::{DVec2, Vec2};
use image::Rgb;
use protocol::{
    manifest::PersonId,
    time::{Ticks, Timescale},
};
use synthesis::lettering;

use super::*;
use crate::{
    geometry::PixelBox,
    inference,
    ingest::FrameTime,
    pose::{JOINTS, Joint, index},
};

const GRASS: [f32; 3] = [60.0, 120.0, 50.0];
/// Pixels per metre of the drawn people, who are about 160 px tall.
const PER_M: f32 = 90.0;

/// Somebody upright at `neck`, from behind.
fn from_behind(neck: DVec2) -> Person {
    let joint = |x: f64, y: f64| {
        let pixel = neck + DVec2::new(x, y) * f64::from(PER_M);
        Joint { pixel, depth_m: 0.0, visibility: 1.0 }
    };
    let mut joints = vec![joint(0.0, 0.0); JOINTS];
    joints[index::LEFT_SHOULDER] = joint(-0.17, 0.0);
    joints[index::RIGHT_SHOULDER] = joint(0.17, 0.0);
    joints[index::LEFT_HIP] = joint(-0.10, 0.50);
    joints[index::RIGHT_HIP] = joint(0.10, 0.50);
    let corner = |x: f64, y: f64| neck + DVec2::new(x, y) * f64::from(PER_M);
    let bounds = PixelBox { min: corner(-0.3, -0.35), max: corner(0.3, 1.45) };
    Person { joints, bounds, ..Person::blank() }
}

/// A shirt with a text on its back on grass, and its wearer.
fn shirt(text: &str, shirt: [f32; 3], ink: [f32; 3]) -> (RgbImage, Person) {
    let neck = Vec2::new(60.0, 50.0);
    let picture = RgbImage::from_fn(120, 190, |x, y| {
        let at = (Vec2::new(x as f32, y as f32) - neck) / PER_M;
        let cloth = at.x.abs() < 0.24 && (-0.06..0.62).contains(&at.y);
        let place = Vec2::new(at.x / 0.115 + lettering::width(text) / 2.0, (at.y - 0.06) / 0.150);
        let cover = lettering::ink(text, place, 0.24, 1.0 / (0.13 * PER_M));
        let mixed = [0, 1, 2].map(|k| match cloth {
            true => shirt[k] + (ink[k] - shirt[k]) * cover,
            false => GRASS[k],
        });
        Rgb(mixed.map(|value| value as u8))
    });
    (picture, from_behind(neck.as_dvec2()))
}

/// The number that several looks at such a shirt give.
fn read(reader: &mut NumberReader, text: &str, cloth: [f32; 3], ink: [f32; 3]) -> Option<u8> {
    let (picture, person) = shirt(text, cloth, ink);
    let reading = reader.read(&picture, &person).unwrap().unwrap();
    let sightings: Vec<Sighting> = (0..6).map(|frame| Sighting { frame, person_index: 0 }).collect();
    let readings: Readings = sightings.iter().map(|sighting| (*sighting, reading.clone())).collect();
    let track = Track { person: PersonId(1), sightings };
    decide(&[track], &[], &readings).get(&PersonId(1)).map(|read| read.number)
}

#[test]
fn clearly_drawn_numbers_are_read_and_plain_shirts_have_none() {
    if !inference::ready() {
        return;
    }
    let mut reader = NumberReader::load().unwrap();
    let (white, black, blue, yellow) = ([240.0; 3], [20.0; 3], [20.0, 40.0, 160.0], [230.0, 210.0, 40.0]);
    for (text, cloth, ink) in [
        ("7", blue, white),
        ("10", white, black),
        ("23", yellow, black),
        ("48", blue, white),
        ("96", black, yellow),
    ] {
        let number = read(&mut reader, text, cloth, ink);
        assert_eq!(number.map(|number| number.to_string()).as_deref(), Some(text));
    }
    for cloth in [white, black, blue, yellow] {
        assert_eq!(read(&mut reader, "", cloth, white), None);
        // A number of the shirt's own colour.
        assert_eq!(read(&mut reader, "55", cloth, cloth), None);
    }
}

#[test]
fn a_chest_is_not_read() {
    if !inference::ready() {
        return;
    }
    let mut reader = NumberReader::load().unwrap();
    let (picture, mut person) = shirt("8", [20.0; 3], [240.0; 3]);
    person.joints.swap(index::LEFT_SHOULDER, index::RIGHT_SHOULDER);
    assert_eq!(reader.read(&picture, &person).unwrap(), None);
    assert_eq!(reader.read(&RgbImage::new(0, 0), &from_behind(DVec2::ZERO)).unwrap(), None);
}

/// Frames of a twenty-fifth of a second.
fn clip(frames: usize) -> ClipInfo {
    let time = |frame: usize| FrameTime {
        clip_frame: frame as u32,
        start: Ticks(frame as i64),
        duration: Ticks(1),
        duplicate: false,
    };
    ClipInfo {
        width_px: 640,
        height_px: 360,
        timescale: Timescale { numerator: 25, denominator: 1 },
        frames: (0..frames).map(time).collect(),
    }
}

fn looks(frames: &[Vec<Person>]) -> BTreeMap<usize, Vec<usize>> {
    let sightings = (0..frames.len()).map(|frame| Sighting { frame, person_index: 0 });
    let track = Track { person: PersonId(1), sightings: sightings.collect() };
    due(frames, &[track], &clip(frames.len()))
        .into_iter()
        .enumerate()
        .filter(|(_, people)| !people.is_empty())
        .collect()
}

#[test]
fn a_back_is_looked_at_five_times_a_second_where_it_is_drawn_largest() {
    let mut frames: Vec<Vec<Person>> = (0..20).map(|_| vec![from_behind(DVec2::new(60.0, 40.0))]).collect();
    for joint in &mut frames[8][0].joints {
        joint.pixel *= 1.2;
    }
    let looks = looks(&frames);
    assert_eq!(looks.keys().copied().collect::<Vec<_>>(), [0, 8, 10, 15]);
}

#[test]
fn nobody_is_looked_at_from_the_front_or_behind_somebody_nearer() {
    let mut facing = from_behind(DVec2::new(60.0, 40.0));
    facing.joints.swap(index::LEFT_SHOULDER, index::RIGHT_SHOULDER);
    assert!(looks(&vec![vec![facing]; 10]).is_empty());
    let hidden = vec![from_behind(DVec2::new(60.0, 40.0)), from_behind(DVec2::new(62.0, 45.0))];
    assert!(looks(&vec![hidden.clone(); 10]).is_empty());
    let in_front: Vec<Person> = hidden.into_iter().rev().collect();
    assert_eq!(looks(&vec![in_front; 10]).len(), 2);
    let mut standing = from_behind(DVec2::new(60.0, 40.0));
    standing.pose_score = 0.0;
    assert!(looks(&vec![vec![standing]; 10]).is_empty());
}
