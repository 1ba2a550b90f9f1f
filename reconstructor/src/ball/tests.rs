//! Balls whose way is known, seen by one camera.

use glam::{DVec2, DVec3, Vec3};
use proptest::prelude::*;
use protocol::{
    camera::Camera,
    time::{Ticks, Timescale},
};
use synthesis::flight::{Flight, lofted, rolled};

use super::*;
use crate::{
    geometry::PixelBox,
    ingest::FrameTime,
    pose::{JOINTS, Joint, index},
};

const RATE_HZ: u32 = 25;

fn camera(frame: usize) -> Camera {
    // It pans after the ball.
    let target = DVec3::new(-5.0 + 0.1 * frame as f64, 0.0, 0.0);
    Camera::looking_at((1280, 720), 2100.0, DVec3::new(0.0, 18.0, 80.0), target)
}

/// A way sampled at the frames, from a start on.
fn way(mut ball: Flight, frames: usize) -> Vec<DVec3> {
    (0..frames)
        .map(|_| {
            let at = ball.at.as_dvec3();
            (0..8).for_each(|_| ball.advance(0.005));
            at
        })
        .collect()
}

fn wobble(k: usize) -> DVec2 {
    let value = |k: usize| ((k * 7919 % 1009) as f64 / 1009.0 - 0.5) * 2.4;
    DVec2::new(value(k), value(k * 31 + 7))
}

/// Somebody upright at a place.
fn person(camera: &Camera, at: DVec3) -> Person {
    let joint =
        |offset: DVec3| Joint { pixel: camera.project(at + offset).unwrap(), depth_m: 0.0, visibility: 0.9 };
    let mut joints = vec![joint(DVec3::Y * 1.4); JOINTS];
    joints[index::NOSE] = joint(DVec3::Y * 1.65);
    for (first, y) in [
        (index::LEFT_ANKLE, 0.12),
        (index::LEFT_HEEL, 0.05),
        (index::LEFT_TOE, 0.05),
        (index::LEFT_KNEE, 0.5),
        (index::LEFT_HIP, 0.95),
        (index::LEFT_WRIST, 0.9),
        (19, 0.85),
    ] {
        joints[first] = joint(DVec3::new(0.12, y, 0.0));
        joints[first + 1] = joint(DVec3::new(-0.12, y, 0.0));
    }
    let pixels = joints.iter().map(|joint| joint.pixel);
    let bounds = PixelBox {
        min: pixels.clone().fold(DVec2::MAX, DVec2::min),
        max: pixels.fold(DVec2::MIN, DVec2::max),
    };
    Person {
        bounds,
        joints,
        neck_px: bounds.centre(),
        ground_m: at,
        neck_m: at + DVec3::Y * 1.4,
        ..Person::blank()
    }
}

/// Follows a ball that takes `way`; every fourth frame misses it, and a penalty mark is always a candidate.
fn followed(way: &[DVec3], bodies: &[DVec3]) -> Vec<Option<BallEstimate>> {
    let cameras: Vec<CameraEstimate> = (0..way.len())
        .map(|frame| CameraEstimate { camera: Some(camera(frame)), ..CameraEstimate::default() })
        .collect();
    let mark = DVec3::new(-41.5, 0.0, 0.0);
    let candidates: Vec<Vec<BallCandidate>> = way
        .iter()
        .enumerate()
        .map(|(frame, &at)| {
            let camera = camera(frame);
            let candidate = |at: DVec3, off: DVec2, score: f32| BallCandidate {
                centre_px: camera.project(at).unwrap() + off,
                diameter_px: 2.0 * RADIUS_M * camera.pixels_per_metre(at),
                score,
            };
            let mut found = vec![candidate(mark, DVec2::ZERO, 0.5)];
            if frame % 4 != 3 {
                found.push(candidate(at, wobble(frame), 0.6));
            }
            found
        })
        .collect();
    let people: Vec<Vec<Person>> =
        (0..way.len()).map(|frame| bodies.iter().map(|&at| person(&camera(frame), at)).collect()).collect();
    follow(&candidates, &cameras, &people, &clip(way.len()), &ShotList::single(way.len()), &Pitch::default())
}

fn clip(frames: usize) -> ClipInfo {
    let time = |frame: usize| FrameTime {
        clip_frame: frame as u32,
        start: Ticks(frame as i64),
        duration: Ticks(1),
        duplicate: false,
    };
    ClipInfo {
        width_px: 1280,
        height_px: 720,
        timescale: Timescale { numerator: RATE_HZ, denominator: 1 },
        frames: (0..frames).map(time).collect(),
    }
}

fn errors(found: &[Option<BallEstimate>], way: &[DVec3]) -> Vec<f64> {
    found.iter().zip(way).filter_map(|(f, at)| Some(f.as_ref()?.position_m.distance(*at))).collect()
}

fn worst(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

#[test]
fn a_rolling_ball_lies_on_the_grass() {
    let (velocity, _) = rolled(glam::Vec2::new(-8.0, 6.0), glam::Vec2::new(9.0, -2.0), 4.0);
    let way = way(Flight { at: Vec3::new(-8.0, 0.11, 6.0), velocity }, 50);
    let found = followed(&way, &[]);
    let errors = errors(&found, &way);
    assert_eq!(errors.len(), 50, "gaps of a frame are bridged");
    assert!(worst(&errors) < 0.35, "{errors:.2?}");
    assert!(found.iter().flatten().all(|ball| ball.state == BallState::Ground && ball.height_known));
    assert!(found.iter().flatten().any(|ball| !ball.seen));
}

#[test]
fn a_high_pass_between_two_players_is_lifted_off_the_grass() {
    let (from, to) = (Vec3::new(-9.0, 0.11, 8.0), Vec3::new(12.0, 0.3, -9.0));
    let (velocity, seconds) = lofted(from, to, 16.0);
    let mut way = way(Flight { at: from, velocity }, (seconds * 25.0) as usize);
    let still = vec![from.as_dvec3(); 10];
    way.splice(0..0, still);
    let found = followed(&way, &[from.as_dvec3().with_y(0.0), to.as_dvec3().with_y(0.0)]);
    let errors = errors(&found, &way);
    assert!(errors.len() + 2 >= way.len(), "{} of {}", errors.len(), way.len());
    assert!(worst(&errors) < 0.8, "{errors:.2?}");
    let highest = found.iter().flatten().max_by(|a, b| a.position_m.y.total_cmp(&b.position_m.y)).unwrap();
    assert_eq!(highest.state, BallState::Flight);
    assert!(highest.sigma_along_m > 1.5 * highest.sigma_across_m, "{highest:?}");
}

#[test]
fn a_bounce_in_the_open_keeps_both_flights_at_one_place() {
    let way = way(Flight { at: Vec3::new(-8.0, 0.11, 2.0), velocity: Vec3::new(13.0, 7.5, -3.0) }, 62);
    let found = followed(&way, &[DVec3::new(-8.0, 0.0, 2.0)]);
    let errors = errors(&found, &way);
    assert!(errors.len() > 55 && worst(&errors) < 1.2, "{errors:.2?}");
}

#[test]
fn a_ball_in_the_air_of_which_only_the_middle_is_seen_admits_doubt_or_is_not_known() {
    let (velocity, _) = lofted(Vec3::new(-12.0, 0.11, 10.0), Vec3::new(16.0, 0.11, -8.0), 18.0);
    let whole = way(Flight { at: Vec3::new(-12.0, 0.11, 10.0), velocity }, 40);
    let part = &whole[14..24];
    for (ball, at) in followed(part, &[]).iter().zip(part) {
        if let Some(ball) = ball {
            let off = ball.position_m.distance(*at);
            assert!(off < 3.0 * (ball.sigma_along_m + ball.sigma_across_m), "{ball:?} is {off} m off");
        }
    }
}

#[test]
fn nothing_seen_is_nothing_known() {
    let clip = clip(30);
    let cameras = vec![CameraEstimate { camera: Some(camera(0)), ..CameraEstimate::default() }; 30];
    let shots = ShotList::single(30);
    let none =
        follow(&vec![Vec::new(); 30], &cameras, &vec![Vec::new(); 30], &clip, &shots, &Pitch::default());
    assert_eq!(none, vec![None; 30]);
    // Fewer entries than frames, and no cameras at all.
    assert_eq!(follow(&[], &[], &[], &clip, &shots, &Pitch::default()), vec![None; 30]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_candidates_are_survived_and_the_answer_is_always_the_same(
        frames in prop::collection::vec(
            prop::collection::vec((-50.0..1400.0f64, -50.0..800.0f64, 0.0..40.0f64, 0.0..1.0f32), 0..4), 1..40),
        broken in any::<bool>(),
    ) {
        let candidates: Vec<Vec<BallCandidate>> = frames
            .iter()
            .map(|frame| frame.iter().map(|&(x, y, diameter_px, score)| BallCandidate {
                centre_px: DVec2::new(if broken && score > 0.9 { f64::NAN } else { x }, y),
                diameter_px,
                score,
            }).collect())
            .collect();
        let cameras: Vec<CameraEstimate> = (0..frames.len())
            .map(|k| CameraEstimate { camera: (k % 5 != 4).then(|| camera(k)), ..CameraEstimate::default() })
            .collect();
        let people = vec![vec![person(&camera(0), DVec3::new(1.0, 0.0, 2.0))]; frames.len()];
        let clip = clip(frames.len());
        let run = || follow(&candidates, &cameras, &people, &clip, &ShotList::single(frames.len()), &Pitch::default());
        let found = run();
        prop_assert_eq!(&found, &run());
        for ball in found.iter().flatten() {
            prop_assert!(ball.position_m.is_finite() && ball.position_m.y >= RADIUS_M - 1e-9);
            prop_assert!(ball.sigma_along_m > 0.0 && ball.sigma_across_m > 0.0);
        }
    }
}

#[test]
fn a_candidate_of_the_wrong_size_or_beyond_the_pitch_is_less_likely_the_ball() {
    let (camera, pitch) = (camera(0), Pitch::default());
    let at = |place: DVec3, size: f64| {
        let diameter_px = 2.0 * RADIUS_M * camera.pixels_per_metre(place) * size;
        let centre_px = camera.project(place).unwrap();
        likely(&camera, &BallCandidate { centre_px, diameter_px, score: 0.6 }, &pitch)
    };
    let place = DVec3::new(-4.0, RADIUS_M, 3.0);
    assert!((at(place, 1.0) - 0.6).abs() < 1e-3, "nothing speaks against it: {}", at(place, 1.0));
    assert!(at(place, 3.0) < 0.3 && at(place, 0.3) < 0.3);
    // In the air it is seen before grass that is farther away.
    assert!(at(place, 1.15) > 0.59);
    assert!(at(DVec3::new(-4.0, RADIUS_M, -50.0), 1.0) < 0.4);
    // The centre mark.
    assert!(at(DVec3::new(0.0, RADIUS_M, 0.0), 1.0) < 0.2);
}
