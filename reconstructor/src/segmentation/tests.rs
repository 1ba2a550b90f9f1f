//! Rules that hold for every way to segment, and what each part must be worth on a made-up crop.

use glam::DVec2;
use image::{Rgb, RgbImage};
use protocol::manifest::PersonId;

use super::*;
use crate::{
    geometry::PixelBox,
    pose::{JOINTS, Joint, index},
};

/// Somebody whose skeleton is an upright line at `x`, with a mask `reach` pixels to both sides.
pub(crate) fn upright(x: i32, reach: i32) -> Person {
    let pixel = |i: usize| DVec2::new(f64::from(x), i as f64 * 2.0);
    let joints = (0..JOINTS).map(|i| Joint { pixel: pixel(i), depth_m: 0.0, visibility: 1.0 }).collect();
    let width = (2 * reach + 1) as u32;
    let mask = Mask { x0: x - reach, y0: 0, width, height: 60, coverage: vec![255; width as usize * 60] };
    let side = f64::from(reach);
    let bounds =
        PixelBox { min: DVec2::new(f64::from(x) - side, 0.0), max: DVec2::new(f64::from(x) + side, 64.0) };
    Person { bounds, score: 0.5, joints, mask, neck_px: pixel(10), ..Person::blank() }
}

fn all_masks(
    segmenter: &mut dyn Segmenter,
    picture: &RgbImage,
    people: &[Vec<Person>],
) -> BTreeMap<usize, Vec<PlayerMask>> {
    let mut masks = Vec::new();
    for (index, people) in people.iter().enumerate() {
        let followed: Vec<(PersonId, usize)> =
            (0..people.len()).map(|i| (PersonId(i as u32 + 1), i)).collect();
        masks.extend(segmenter.push(&FrameSeen { index, picture, people, followed: &followed }).unwrap());
    }
    masks.extend(segmenter.finish().unwrap());
    settled(masks, people)
}

const METHODS: [Method; 5] =
    [Method::Network, Method::Claims, Method::NetworkEnergy, Method::Crf, Method::Paper];

#[test]
fn a_pixel_two_people_claim_goes_to_the_nearer_skeleton() {
    let people = vec![vec![upright(100, 8), upright(110, 8)]];
    let picture = RgbImage::new(200, 80);
    for claims in [false, true] {
        let frames = all_masks(&mut InstanceMaskSegmenter { claims }, &picture, &people);
        let [left, right] = [&frames[&0][0].mask, &frames[&0][1].mask];
        for x in 92..=118 {
            assert!(left.at(x, 30) == 0 || right.at(x, 30) == 0, "both have column {x}");
        }
        assert_eq!((left.at(103, 30), right.at(103, 30)), (255, 0));
        assert_eq!((left.at(107, 30), right.at(107, 30)), (0, 255));
        assert_eq!((left.at(92, 30), right.at(118, 30)), (255, 255));
    }
}

#[test]
fn somebody_alone_keeps_the_mask_and_lost_sightings_are_left_out() {
    let people = vec![vec![upright(100, 8)]];
    let gone = Track { person: PersonId(2), sightings: vec![Sighting { frame: 7, person_index: 3 }] };
    let here = Track { person: PersonId(1), sightings: vec![Sighting { frame: 0, person_index: 0 }] };
    assert_eq!(followed(&[gone, here], 1), [vec![(PersonId(1), 0)]]);
    let frames = all_masks(&mut InstanceMaskSegmenter { claims: true }, &RgbImage::new(200, 80), &people);
    assert_eq!(frames[&0][0].mask, people[0][0].mask);
}

/// A player in red on a green field, 20 pixels wide and 60 high, upright at `x`, with a mask of the network's kind: too wide by `extra`.
fn scene(columns: &[(i32, [u8; 3])], extra: i32) -> (RgbImage, Vec<Person>) {
    let mut picture = RgbImage::from_fn(160, 90, |x, y| Rgb([40, 110 + ((x * 7 + y * 3) % 5) as u8, 45]));
    let mut people = Vec::new();
    for &(x, colour) in columns {
        for (px, py) in (x - 10..=x + 10).flat_map(|px| (10..=70).map(move |py| (px, py))) {
            picture.put_pixel(px as u32, py as u32, Rgb(colour));
        }
        let mut person = upright(x, 10 + extra);
        for (i, joint) in person.joints.iter_mut().enumerate() {
            joint.pixel = DVec2::new(f64::from(x), 12.0 + i as f64 * 56.0 / 32.0);
        }
        for (joint, side) in [
            (index::LEFT_SHOULDER, 6),
            (index::RIGHT_SHOULDER, -6),
            (index::LEFT_HIP, 5),
            (index::RIGHT_HIP, -5),
        ] {
            person.joints[joint].pixel.x += f64::from(side);
        }
        person.mask.y0 = 10;
        person.mask.height = 61;
        person.mask.coverage = vec![200; person.mask.width as usize * 61];
        person.bounds = PixelBox {
            min: DVec2::new(f64::from(x - 10 - extra), 10.0),
            max: DVec2::new(f64::from(x + 10 + extra), 70.0),
        };
        people.push(person);
    }
    (picture, people)
}

fn wrong_px(mask: &Mask, inside: impl Fn(i32, i32) -> bool) -> usize {
    let pixels = (0..90).flat_map(|y| (0..160).map(move |x| (x, y)));
    pixels.filter(|&(x, y)| (mask.at(x, y) >= 128) != inside(x, y)).count()
}

#[test]
fn every_part_of_the_paper_improves_a_mask_that_is_too_wide() {
    let (picture, people) = scene(&[(60, [200, 30, 30])], 4);
    let truth = |x: i32, y: i32| (50..=70).contains(&x) && (10..=70).contains(&y);
    let before = wrong_px(&people[0].mask, truth);
    // In four frames that are all wrong in the same way the CRF has only colours to go by.
    for (method, times) in [(Method::NetworkEnergy, 3), (Method::Crf, 2), (Method::Paper, 3)] {
        let frames = all_masks(method.open().unwrap().as_mut(), &picture, &vec![people.clone(); 4]);
        let after = wrong_px(&frames[&2][0].mask, truth);
        assert!(before > 400 && after * times < before, "{}: {before} became {after}", method.name());
    }
}

#[test]
fn the_energy_leaves_a_neighbour_out() {
    let (picture, people) = scene(&[(60, [200, 30, 30]), (81, [30, 30, 200])], 6);
    let truth = |x: i32, y: i32| (50..=70).contains(&x) && (10..=70).contains(&y);
    let frames = all_masks(Method::NetworkEnergy.open().unwrap().as_mut(), &picture, &[people]);
    assert!(wrong_px(&frames[&0][0].mask, truth) < 120, "{}", wrong_px(&frames[&0][0].mask, truth));
}

#[test]
fn every_sighting_gets_one_mask_whatever_the_gaps() {
    let (picture, person) = scene(&[(60, [200, 30, 30])], 2);
    // Seen in 0..20, away until 60, back for 3 frames.
    let people: Vec<Vec<Person>> =
        (0..63).map(|i| if (20..60).contains(&i) { Vec::new() } else { person.clone() }).collect();
    for method in METHODS {
        let frames = all_masks(method.open().unwrap().as_mut(), &picture, &people);
        let expected: Vec<usize> = (0..20).chain(60..63).collect();
        assert_eq!(frames.keys().copied().collect::<Vec<_>>(), expected, "{}", method.name());
        assert!(frames.values().all(|masks| masks.len() == 1));
    }
}

#[test]
fn what_is_broken_gets_no_mask_and_does_no_harm() {
    let sound = upright(30, 8);
    let nan = PixelBox { min: DVec2::NAN, max: DVec2::splat(f64::INFINITY) };
    let mut lost = upright(30, 8);
    lost.joints.iter_mut().for_each(|joint| joint.pixel = DVec2::NAN);
    let broken = vec![
        Person { mask: Mask::default(), ..sound.clone() },
        Person { bounds: nan, ..sound.clone() },
        Person { bounds: PixelBox { min: DVec2::splat(5.0), max: DVec2::splat(5.0) }, ..sound.clone() },
        Person { bounds: PixelBox { min: DVec2::splat(-900.0), max: DVec2::splat(-800.0) }, ..sound.clone() },
        Person { joints: Vec::new(), ..sound.clone() },
        Person {
            mask: Mask { width: 1000, height: 1000, coverage: vec![9; 3], ..Mask::default() },
            ..sound.clone()
        },
        lost,
    ];
    let mut methods = METHODS.to_vec();
    if crate::inference::ready() {
        methods.push(Method::Refined);
    }
    for method in methods {
        for picture in [RgbImage::new(64, 64), RgbImage::new(1, 1), RgbImage::new(0, 0)] {
            let frames =
                all_masks(method.open().unwrap().as_mut(), &picture, &[broken.clone(), broken.clone()]);
            assert!(frames.values().flatten().all(|found| found.mask.area_px() > 0));
        }
    }
}
