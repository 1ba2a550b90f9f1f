//! Association alone, on made-up people whose truth is known: they run, crowd, hide each other for a second or two and are measured with
//! noise; nothing here depends on detectors. Design decisions were made here and on rendered clips of development seeds.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use protocol::{
    camera::Camera,
    time::{Ticks, Timescale},
};

use super::*;
use crate::{
    evaluate::tracking::{FrameBoxes, Scores, TrackedBox, scores},
    geometry::PixelBox,
    ingest::FrameTime,
    pose::{Lab, Looks},
};

/// Uniform numbers from a seed.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
    }

    fn gauss(&mut self) -> f64 {
        (-2.0 * self.next().max(1e-12).ln()).sqrt() * (TAU * self.next()).cos()
    }

    fn gauss_2d(&mut self) -> DVec2 {
        DVec2::new(self.gauss(), self.gauss())
    }
}

/// A made-up scene.
#[derive(Clone, Copy)]
struct Crowd {
    people: usize,
    frames: usize,
    /// Half the sides of the area that they run in, metres: small areas make tangles.
    area_m: DVec2,
    /// Chance that somebody is missed although in plain view.
    missed: f64,
    /// Sightings per frame where nobody is.
    false_ones: f64,
    /// Whether all wear one kit.
    one_kit: bool,
}

const MATCH: Crowd = Crowd {
    people: 22,
    frames: 750,
    area_m: DVec2::new(25.0, 20.0),
    missed: 0.08,
    false_ones: 0.3,
    one_kit: false,
};

/// Sightings of each frame with the true person of each (`None`: nobody), and where all true people are.
struct Scene {
    people: Vec<Vec<Person>>,
    of: Vec<Vec<Option<u32>>>,
    truth: Vec<Vec<DVec2>>,
}

fn frame_s() -> f64 {
    0.04
}

fn broadcast() -> Camera {
    Camera::looking_at((1280, 720), 2000.0, DVec3::new(0.0, 18.0, 70.0), DVec3::ZERO)
}

fn play(crowd: &Crowd, seed: u64) -> Scene {
    let mut draw = Draw(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(1));
    for _ in 0..20 {
        draw.next();
    }
    let camera = DVec2::new(0.0, 70.0);
    let mut at: Vec<DVec2> = (0..crowd.people)
        .map(|_| DVec2::new(draw.next() * 2.0 - 1.0, draw.next() * 2.0 - 1.0) * crowd.area_m)
        .collect();
    let mut speed = vec![DVec2::ZERO; crowd.people];
    let mut goal = at.clone();
    // Errors of a place last about as long as a step.
    let mut error = vec![DVec2::ZERO; crowd.people];
    let mut hidden_for = vec![0_usize; crowd.people];
    let mut scene = Scene { people: Vec::new(), of: Vec::new(), truth: Vec::new() };
    for _ in 0..crowd.frames {
        for i in 0..crowd.people {
            if at[i].distance(goal[i]) < 1.5 || draw.next() < 0.01 {
                goal[i] = DVec2::new(draw.next() * 2.0 - 1.0, draw.next() * 2.0 - 1.0) * crowd.area_m;
            }
            let wish = (goal[i] - at[i]).clamp_length_max(5.5);
            let change = (wish - speed[i]).clamp_length_max(5.0 * frame_s());
            speed[i] += change;
            at[i] += speed[i] * frame_s();
            error[i] = error[i] * 0.85 + draw.gauss_2d() * 0.53;
        }
        let mut seen: Vec<(Option<u32>, DVec2)> = Vec::new();
        for i in 0..crowd.people {
            let sight = (at[i] - camera).normalize();
            // Somebody nearer to the camera in the same line of sight hides this one, sometimes for longer.
            let covered = (0..crowd.people).any(|j| {
                let to = at[j] - at[i];
                j != i && to.dot(-sight) > 0.0 && to.dot(-sight) < 5.0 && to.dot(sight.perp()).abs() < 0.35
            });
            if covered && draw.next() < 0.03 {
                hidden_for[i] = (25.0 + 25.0 * draw.next()) as usize;
            }
            hidden_for[i] = hidden_for[i].saturating_sub(1);
            let missed = draw.next() < crowd.missed || hidden_for[i] > 0 || (covered && draw.next() < 0.85);
            let noise = sight * error[i].x * 0.3 + sight.perp() * error[i].y * 0.1 + draw.gauss_2d() * 0.05;
            if !missed {
                seen.push((Some(i as u32), at[i] + noise));
            }
        }
        if draw.next() < crowd.false_ones {
            seen.push((None, DVec2::new(draw.next() * 2.0 - 1.0, draw.next() * 2.0 - 1.0) * crowd.area_m));
        }
        seen.sort_by(|a, b| a.1.x.total_cmp(&b.1.x));
        let people = seen.iter().map(|&(who, place)| sighting(who, place, crowd, &mut draw)).collect();
        scene.people.push(people);
        scene.of.push(seen.into_iter().map(|(who, _)| who).collect());
        scene.truth.push(at.clone());
    }
    scene
}

fn sighting(who: Option<u32>, place: DVec2, crowd: &Crowd, draw: &mut Draw) -> Person {
    let kits = [Lab { l: 45.0, a: 50.0, b: 30.0 }, Lab { l: 40.0, a: 5.0, b: -40.0 }];
    let kit = who.map(|who| kits[if crowd.one_kit { 0 } else { who as usize % 2 }]).unwrap_or_default();
    let mut noisy = || {
        let mut add = |value: f32, spread: f64| value + (spread * draw.gauss()) as f32;
        Some(Lab { l: add(kit.l, 10.0), a: add(kit.a, 6.0), b: add(kit.b, 6.0) })
    };
    let looks = Looks { kit: [noisy(), noisy(), noisy()], nose_m: None };
    Person {
        bounds: PixelBox { min: place * 100.0, max: place * 100.0 + 1.0 },
        score: 0.5,
        pose_score: 0.5,
        ground_m: DVec3::new(place.x, 0.0, place.y),
        neck_m: DVec3::new(place.x, 1.5, place.y),
        looks,
        ..Person::blank()
    }
}

fn clip(frames: usize) -> ClipInfo {
    let frame = |i: usize| FrameTime {
        clip_frame: i as u32,
        start: Ticks(i as i64),
        duration: Ticks(1),
        duplicate: false,
    };
    ClipInfo {
        width_px: 1280,
        height_px: 720,
        timescale: Timescale { numerator: 25, denominator: 1 },
        frames: (0..frames).map(frame).collect(),
    }
}

/// Scores of the association alone: only people who were sighted count as truth, and a sighting is exactly its person's box.
fn measure(scene: &Scene, method: TrackingMethod) -> Scores {
    let limits = TrackingLimits { method, ..TrackingLimits::default() };
    let camera = CameraEstimate { camera: Some(broadcast()), ..CameraEstimate::default() };
    let cameras = vec![camera; scene.people.len()];
    let tracks = track(&scene.people, &cameras, &clip(scene.people.len()), &limits);
    let unit = |id: u32, at: f64| TrackedBox {
        id,
        bounds: PixelBox { min: DVec2::new(at, 0.0), max: DVec2::new(at + 1.0, 1.0) },
    };
    let mut frames: Vec<FrameBoxes> = scene
        .of
        .iter()
        .map(|of| FrameBoxes {
            truth: of.iter().flatten().map(|who| unit(*who, f64::from(*who) * 2.0)).collect(),
            ours: Vec::new(),
        })
        .collect();
    for track in &tracks {
        for s in &track.sightings {
            let at = scene.of[s.frame][s.person_index].map_or(-10.0, |who| f64::from(who) * 2.0);
            frames[s.frame].ours.push(unit(track.person.0, at));
        }
    }
    scores(&frames).0
}

fn mean(crowd: &Crowd, method: TrackingMethod) -> (f64, f64, f64) {
    let all: Vec<Scores> = (1..=3).map(|seed| measure(&play(crowd, seed), method)).collect();
    let mean = |of: fn(&Scores) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    (mean(|s| s.idf1), mean(|s| s.hota), mean(|s| s.id_switches as f64))
}

#[test]
fn people_are_followed_through_crossings_and_occlusions() {
    for (name, crowd, least_idf1) in [
        ("a match", MATCH, 0.8),
        ("one kit", Crowd { one_kit: true, ..MATCH }, 0.65),
        ("a corner", Crowd { area_m: DVec2::new(9.0, 9.0), frames: 250, ..MATCH }, 0.68),
        ("many missed", Crowd { missed: 0.3, ..MATCH }, 0.8),
    ] {
        let (global, greedy) = (mean(&crowd, TrackingMethod::Global), mean(&crowd, TrackingMethod::Greedy));
        println!("{name}: idf1, hota, switches: global {global:.3?}, greedy {greedy:.3?}");
        assert!(global.0 >= least_idf1, "{name}: {global:?}");
        assert!(global.0 > greedy.0, "{name}: {global:?}, greedy {greedy:?}");
    }
}

#[test]
fn the_same_sightings_give_the_same_tracks() {
    let scene = play(&Crowd { frames: 100, ..MATCH }, 5);
    let run = || track(&scene.people, &[], &clip(100), &TrackingLimits::default());
    assert_eq!(run(), run());
}
