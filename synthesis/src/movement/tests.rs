//! Feet that stand, bodies above the ground, joints within range: for every gait at every pace, every action, and whole
//! matches. All measured on the skinned surface that is rendered, not on the skeleton that was asked for.

use rand::SeedableRng;

use super::*;
use crate::{
    body::{BaseBody, Build},
    cast::{Cast, Member},
    figure::{Detail, Material, dress},
    outfit::{Kit, Outfit},
    rig,
    trajectories::Trajectories,
};
use protocol::pitch::Pitch;

/// A contact may slide by so much in all, metres.
const SLIDE_M: f32 = 0.03;
/// The lowest point of a body may lie so deep, metres: studs sink in and skinning smooths a sole by some millimetres.
const DEEP_M: f32 = 0.02;
/// While a foot is in contact some part of the body is this close to the ground at most, metres.
const FLOAT_M: f32 = 0.02;

fn figure(seed: u64, female: f32, height_m: f32) -> Figure {
    let base = BaseBody::load().unwrap();
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let build = Build { female, origin: [0.3, 0.3, 0.4], muscle: 0.2, weight: 0.0, height_m };
    let kit = Kit::random(&mut rng, "k".into());
    let outfit = Outfit::random(&mut rng, kit, None, female > 0.5);
    dress(&base, base.shape(&build), outfit, Detail::Broadcast)
}

fn moved(figure: &Figure, path: impl Fn(f32) -> Vec2, ball: Vec3, events: &[Event], role: Role) -> Movement {
    let path =
        Path2 { role, team: Some(0), number: Some(7), xz: (0..100).map(|k| path(k as f32 / 25.0)).collect() };
    let habits = Habits { mood: 0.4, phase: 0.3, size: 1.0 };
    let motions = Motions::shipped().unwrap();
    Movement::along(&path, &vec![ball; 100], 25.0, &motions, habits, events, figure).unwrap()
}

/// What was measured over some movements.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    /// Largest slide of one contact, metres, and the frame in which it got so large.
    slide_m: f32,
    slide_frame: usize,
    /// Deepest point below the ground, metres.
    deep_m: f32,
    /// Largest gap under a body of which a foot is in contact, metres.
    float_m: f32,
    contacts: usize,
    /// Frames with a joint out of range.
    broken: usize,
}

/// Largest slide over the contacts of `steps`, with the depth and the gap of the lowest point.
fn measured(figure: &Figure, steps: &[Step], what: &str) -> Measured {
    let mut worst = Measured::default();
    let soles = [1.0f32, -1.0].map(|side| {
        let mut own: Vec<usize> = figure
            .triangles
            .iter()
            .zip(&figure.materials)
            .filter(|(_, material)| **material == Material::Boot)
            .flat_map(|(triangle, _)| triangle.map(|v| v as usize))
            .filter(|&v| figure.vertices[v].rest.x * side > 0.0)
            .collect();
        own.sort_unstable();
        own.dedup();
        own
    });
    let mut before: Option<rig::Posed> = None;
    let mut slid = [0.0f32; 2];
    for (k, step) in steps.iter().enumerate() {
        if let Some((joint, degrees)) = limits::broken(&step.pose) {
            worst.broken += 1;
            println!("{what}, frame {k}, {:?} {:?}: {joint:?} at {degrees:.0}°", step.kind, step.contacts);
        }
        let posed = rig::pose_at(figure, &step.pose, step.hips_m).placed(&step.placement);
        let lowest = posed.positions.iter().map(|p| p.y).fold(f32::MAX, f32::min);
        worst.deep_m = worst.deep_m.max(-lowest);
        if step.contacts != [false; 2] {
            worst.float_m = worst.float_m.max(lowest);
        }
        for side in SIDES {
            let held = k > 0 && step.contacts[side] && steps[k - 1].contacts[side];
            if !step.contacts[side] {
                slid[side] = 0.0;
            }
            let Some(before) = before.as_ref().filter(|_| held) else { continue };
            if slid[side] == 0.0 {
                worst.contacts += 1;
            }
            // The part of the sole that touches in both frames.
            let low = |posed: &rig::Posed| {
                soles[side].iter().map(|&v| posed.positions[v].y).fold(f32::MAX, f32::min) + 0.008
            };
            let (low_before, low_now) = (low(before), low(&posed));
            let touching: Vec<f32> = soles[side]
                .iter()
                .filter(|&&v| before.positions[v].y < low_before && posed.positions[v].y < low_now)
                .map(|&v| (posed.positions[v] - before.positions[v]).with_y(0.0).length())
                .collect();
            if !touching.is_empty() {
                slid[side] += touching.iter().sum::<f32>() / touching.len() as f32;
                if slid[side] > worst.slide_m {
                    (worst.slide_m, worst.slide_frame) = (slid[side], k);
                }
            }
        }
        before = Some(posed);
    }
    println!("{what}: {worst:?}");
    worst
}

fn assert_sound(measured: Measured, what: &str) {
    assert_eq!(measured.broken, 0, "{what}: joints out of range");
    assert!(
        measured.slide_m <= SLIDE_M,
        "{what}: a standing foot slides {:.3} m at frame {}",
        measured.slide_m,
        measured.slide_frame
    );
    assert!(measured.deep_m <= DEEP_M, "{what}: {:.3} m under the ground", measured.deep_m);
    assert!(measured.float_m <= FLOAT_M, "{what}: in contact but {:.3} m over the ground", measured.float_m);
}

/// Asserts that somebody of a match does not slide, sink or float.
pub(crate) fn assert_stands(member: &Member, what: &str) {
    assert_sound(measured(&member.figure, &member.movement.steps, what), what);
}

#[test]
fn standing_feet_do_not_slide_at_any_pace_in_any_direction() {
    let figure = figure(4, 0.0, 1.80);
    for speed in [0.0, 0.15, 0.5, 1.2, 2.0, 3.0, 4.5, 6.0, 8.0] {
        for direction in [0.0f32, 1.1, 1.57, 2.4, std::f32::consts::PI] {
            // Looks towards +z, where the ball is.
            let way = Vec2::new(direction.sin(), direction.cos()) * speed;
            let done = moved(&figure, |t| way * t, Vec3::new(0.0, 0.11, 400.0), &[], Role::Player);
            let what = format!("{speed} m/s at {direction} rad");
            let measured = measured(&figure, &done.steps, &what);
            assert!(speed < 0.4 || measured.contacts >= 4, "{what}: {} contacts", measured.contacts);
            assert_sound(measured, &what);
        }
    }
}

#[test]
fn standing_feet_do_not_slide_in_turns_starts_and_stops() {
    let figure = figure(5, 1.0, 1.66);
    let ball = Vec3::new(30.0, 0.11, 0.0);
    let circle = |radius: f32, speed: f32| move |t: f32| Vec2::from_angle(t * speed / radius) * radius;
    for (radius, speed) in [(1.5, 1.5), (4.0, 3.5), (9.0, 6.5)] {
        let what = format!("round a circle of {radius} m at {speed} m/s");
        assert_sound(
            measured(&figure, &moved(&figure, circle(radius, speed), ball, &[], Role::Player).steps, &what),
            &what,
        );
    }
    let shuttle = |t: f32| Vec2::new(0.0, 5.0 * (t * 1.1).sin());
    assert_sound(
        measured(&figure, &moved(&figure, shuttle, ball, &[], Role::Player).steps, "shuttle"),
        "shuttle",
    );
    let stop = |t: f32| Vec2::new(0.0, 6.0 * (1.0 - (-t).exp()));
    assert_sound(measured(&figure, &moved(&figure, stop, ball, &[], Role::Player).steps, "stop"), "stop");
    let set = |t: f32| Vec2::new(50.0, (t * 1.3).sin() * 1.2);
    let keeper = moved(&figure, set, ball, &[], Role::Goalkeeper);
    assert_sound(measured(&figure, &keeper.steps, "goalkeeper"), "goalkeeper");
}

#[test]
fn every_action_keeps_its_feet_its_height_and_its_joints() {
    let figure = figure(6, 0.0, 1.86);
    for kind in Kind::KEYED {
        for mirrored in [None, Some(false), Some(true)] {
            for speed in [0.0f32, 2.5, 5.0] {
                let lift_m = if kind == Kind::Header { 0.45 } else { 0.0 };
                let event = Event { kind, time_s: 1.8, facing: Some(0.0), mirrored, lift_m };
                // Who goes down comes to rest.
                let still = speed == 0.0 || kind == Kind::ThrowIn;
                let path = |t: f32| {
                    let way = match () {
                        () if still => 0.0,
                        () if kind.goes_down() && t > 1.6 => 1.6 + 0.5 * (1.0 - (-(t - 1.6) / 0.5).exp()),
                        () => t,
                    };
                    Vec2::new(0.0, way * speed)
                };
                let done = moved(&figure, path, Vec3::new(0.0, 0.11, 40.0), &[event], Role::Player);
                let what = format!("{kind:?} at {speed} m/s, mirrored {mirrored:?}");
                assert_sound(measured(&figure, &done.steps, &what), &what);
                assert!(done.steps.iter().any(|step| step.kind == kind), "{what} does not happen");
            }
        }
    }
}

#[test]
fn a_header_is_a_jump_under_gravity() {
    let figure = figure(7, 0.0, 1.80);
    let event = Event { kind: Kind::Header, time_s: 2.0, facing: None, mirrored: None, lift_m: 0.5 };
    let done = moved(&figure, |t| Vec2::new(0.0, t * 2.0), Vec3::new(0.0, 2.2, 40.0), &[event], Role::Player);
    let top = &done.steps[50];
    assert!(top.contacts == [false; 2] && top.clearance_m > 0.35, "{top:?}");
    // Second differences of the hips' height in the air are −g.
    for k in 46..=54 {
        let [a, b, c] = [k - 1, k, k + 1].map(|k: usize| done.steps[k].hips_m);
        let acceleration = (a - 2.0 * b + c) * 625.0;
        assert!((acceleration + 9.81).abs() < 1.5, "frame {k}: {acceleration} m/s²");
    }
    assert!(done.steps[30].contacts != [false; 2] && done.steps[70].contacts != [false; 2]);
}

#[test]
fn hips_stay_over_the_anchor_and_people_look_where_they_run() {
    let figure = figure(8, 0.0, 1.80);
    let done = moved(&figure, |t| Vec2::new(t * 4.0, 3.0), Vec3::new(300.0, 0.11, 3.0), &[], Role::Player);
    for step in &done.steps[10..90] {
        let posed = rig::pose_at(&figure, &step.pose, step.hips_m).placed(&step.placement);
        let hips = (posed.landmarks[23] + posed.landmarks[24]) / 2.0;
        assert!((hips - step.placement.anchor_m).with_y(0.0).length() < 0.01);
        assert!((step.placement.yaw - std::f32::consts::FRAC_PI_2).abs() < 0.05, "runs along +x");
    }
}

#[test]
fn whole_matches_stand_on_their_feet() {
    for seed in [12, 13] {
        let paths = Trajectories::generated(seed, 20.0).resampled(0.0, 25.0, 500);
        let cast = Cast::new(&paths, 25.0, &Pitch::default(), seed).unwrap();
        let mut contacts = 0;
        for (index, member) in cast.members.iter().enumerate() {
            let what = format!("match {seed}, person {index}");
            let one = measured(&member.figure, &member.movement.steps, &what);
            assert_sound(one, &what);
            contacts += one.contacts;
        }
        assert!(contacts > 400, "{contacts} contacts");
    }
}
