//! Made-up jumpers and runners seen by one camera.

use glam::{DVec2, DVec3};
use protocol::{
    camera::Camera,
    manifest::PersonId,
    pitch::Pitch,
    time::{Ticks, Timescale},
};

use super::*;
use crate::{
    ingest::FrameTime,
    pose::{self, JOINTS, Joint},
    tracking::Sighting,
};

fn camera() -> Camera {
    Camera::looking_at((1280, 720), 2300.0, DVec3::new(0.0, 17.0, 72.0), DVec3::new(4.0, 0.0, 0.0))
}

/// Somebody upright whose soles are `above_m` over a place, with the network's errors of `k`.
fn person(camera: &Camera, at: DVec3, above_m: f64, k: usize) -> Option<Person> {
    let noise = |k: usize| ((k * 7919 % 1013) as f64 / 1013.0 - 0.5) * 3.0;
    let mut joints: Vec<Joint> = Vec::new();
    for joint in 0..JOINTS {
        let side = if joint % 2 == 1 { 0.12 } else { -0.12 };
        let height_m = match joint {
            index::LEFT_ANKLE | index::RIGHT_ANKLE => 0.13,
            index::LEFT_HEEL | index::RIGHT_HEEL => 0.07,
            index::LEFT_TOE | index::RIGHT_TOE => 0.05,
            index::LEFT_KNEE | index::RIGHT_KNEE => 0.5,
            index::LEFT_HIP | index::RIGHT_HIP => 0.95,
            0..=10 => 1.65,
            _ => 1.3,
        };
        let world = at + DVec3::new(side, height_m + above_m, 0.0);
        let off = DVec2::new(noise(k * 67 + joint), noise(k * 131 + joint * 7));
        joints.push(Joint { pixel: camera.project(world)? + off, depth_m: 0.0, visibility: 0.9 });
    }
    let ground_m = pose::stand(camera, &Pitch::default(), &joints)?;
    Some(Person {
        neck_px: joints.get(index::LEFT_SHOULDER)?.pixel,
        joints,
        ground_m,
        neck_m: ground_m + DVec3::Y * 1.4,
        ..Person::blank()
    })
}

/// A clip of one person: where the anchor is and how high the soles are, by seconds.
fn found(
    frames: usize,
    at: impl Fn(f64) -> DVec3,
    above_m: impl Fn(f64) -> f64,
) -> (Vec<Lift>, Vec<Vec<Person>>, Vec<CameraEstimate>) {
    found_by(frames, |_| camera(), at, above_m)
}

/// The same with the camera of every frame.
fn found_by(
    frames: usize,
    camera: impl Fn(usize) -> Camera,
    at: impl Fn(f64) -> DVec3,
    above_m: impl Fn(f64) -> f64,
) -> (Vec<Lift>, Vec<Vec<Person>>, Vec<CameraEstimate>) {
    let seconds = |k: usize| k as f64 / 25.0;
    let people: Vec<Vec<Person>> = (0..frames)
        .map(|k| person(&camera(k), at(seconds(k)), above_m(seconds(k)), k).into_iter().collect())
        .collect();
    let cameras: Vec<CameraEstimate> = (0..frames)
        .map(|k| CameraEstimate { camera: Some(camera(k)), ..CameraEstimate::default() })
        .collect();
    let time = |k: usize| FrameTime {
        clip_frame: k as u32,
        start: Ticks(k as i64),
        duration: Ticks(1),
        duplicate: false,
    };
    let clip = ClipInfo {
        width_px: 1280,
        height_px: 720,
        timescale: Timescale { numerator: 25, denominator: 1 },
        frames: (0..frames).map(time).collect(),
    };
    let sightings = people.iter().enumerate().filter(|(_, people)| !people.is_empty());
    let sightings = sightings.map(|(frame, _)| Sighting { frame, person_index: 0 }).collect();
    let tracks = [Track { person: PersonId(1), sightings }];
    (find(&people, &tracks, &cameras, &clip), people, cameras)
}

fn run(t: f64) -> DVec3 {
    DVec3::new(2.0 + 3.0 * t, 0.0, -4.0 + 1.5 * t)
}

/// From the ground at 1.2 s for `air_s`.
fn jump(air_s: f64) -> impl Fn(f64) -> f64 {
    move |t| (4.905 * (t - 1.2) * (1.2 + air_s - t)).max(0.0)
}

#[test]
fn a_jump_is_as_high_as_it_is_and_happens_where_it_happens() {
    for air_s in [0.4, 0.52, 0.64] {
        let (lifts, mut people, cameras) = found(80, run, jump(air_s));
        let peak_m = lifts.iter().map(|lift| lift.above_ground_m).fold(0.0, f64::max);
        let true_m = 9.81 * air_s * air_s / 8.0;
        assert!((peak_m - true_m).abs() < 0.08, "{peak_m} for {true_m}");
        let before: f64 = lifts
            .iter()
            .map(|lift| people[lift.frame][0].ground_m.distance(run(lift.frame as f64 / 25.0)))
            .fold(0.0, f64::max);
        place(&mut people, &cameras, &lifts);
        for lift in &lifts {
            let off = people[lift.frame][0].ground_m.distance(run(lift.frame as f64 / 25.0));
            assert!(off < 0.45, "{off} m off in frame {}; it was {before} m", lift.frame);
        }
        assert!(before > 0.7, "a jump looks like running away: {before}");
    }
}

#[test]
fn who_runs_turns_or_starts_does_not_jump() {
    let sprint = |t: f64| DVec3::new(3.0, 0.0, 10.0 - 8.0 * t);
    // Away from the camera and back, as hard as people can turn.
    let turn = |t: f64| DVec3::new(3.0, 0.0, -2.0 - 6.0 * (t * 1.4).sin());
    let start = |t: f64| DVec3::new(3.0, 0.0, -2.5 * (t - 1.0).max(0.0).powi(2));
    let stride = |t: f64| 0.06 * (t * 18.0).sin().max(0.0);
    assert_eq!(found(70, sprint, stride).0, []);
    assert_eq!(found(70, turn, |_| 0.0).0, []);
    assert_eq!(found(70, start, stride).0, []);
}

#[test]
fn feet_that_are_read_too_high_are_no_jump_when_the_hips_stay() {
    let camera = camera();
    let (_, mut people, cameras) = found(80, run, |_| 0.0);
    for person in people[30..42].iter_mut().flatten() {
        for joint in index::LEFT_ANKLE..=index::RIGHT_TOE {
            person.joints[joint].pixel.y -= 11.0;
        }
        person.ground_m = pose::stand(&camera, &Pitch::default(), &person.joints).unwrap();
    }
    let frames = (0..80).map(|k| FrameTime {
        clip_frame: k as u32,
        start: Ticks(k as i64),
        duration: Ticks(1),
        duplicate: false,
    });
    let timescale = Timescale { numerator: 25, denominator: 1 };
    let clip = ClipInfo { width_px: 1280, height_px: 720, timescale, frames: frames.collect() };
    let sightings = (0..80).map(|frame| Sighting { frame, person_index: 0 }).collect();
    let tracks = [Track { person: PersonId(1), sightings }];
    assert_eq!(find(&people, &tracks, &cameras, &clip), []);
}

#[test]
fn a_cut_is_no_jump() {
    // For some frames the pictures come from 3 to 9 m farther back: the runner seems to leap away and back.
    for behind_m in [3.0, 5.0, 9.0] {
        let back = DVec3::new(0.0, 17.0, 72.0 + behind_m);
        let farther = Camera::looking_at((1280, 720), 2300.0, back, DVec3::new(4.0, 0.0, 0.0));
        for air in [10, 13, 16] {
            let by = |k: usize| if (30..30 + air).contains(&k) { farther } else { camera() };
            assert_eq!(found_by(80, by, run, |_| 0.0).0, [], "{behind_m} m, {air} frames");
        }
    }
}

#[test]
fn a_jump_cut_off_by_the_end_of_the_shot_is_left_alone() {
    assert_eq!(found(34, run, jump(0.6)).0, []);
    assert!(
        find(
            &[],
            &[],
            &[],
            &ClipInfo {
                width_px: 1,
                height_px: 1,
                timescale: Timescale { numerator: 25, denominator: 1 },
                frames: Vec::new(),
            }
        )
        .is_empty()
    );
}
