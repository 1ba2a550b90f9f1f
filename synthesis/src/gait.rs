//! Movement made of formulas: gaits and single poses that the recorded clips lack, and the list of everything a
//! training player may do. Angles are radians; flexion moves a limb forwards, knees and elbows bend their own way.

use std::f32::consts::{PI, TAU};

use glam::Quat;
use rand::Rng;

use crate::{
    acts::{self, Kind},
    dataset::Split,
    motion::{Clip, Joint, Motions, Pose},
};

fn limb(flex: f32, out: f32, twist: f32, left: bool) -> Quat {
    let side = if left { 1.0 } else { -1.0 };
    Quat::from_rotation_z(out * side) * Quat::from_rotation_x(-flex) * Quat::from_rotation_y(twist * side)
}

/// Both arms and legs of one side, from shoulder and hip outwards.
#[derive(Clone, Copy, Debug, Default)]
struct Side {
    /// Flexion forwards, outwards, twist.
    thigh: [f32; 3],
    knee: f32,
    /// Positive points the toes down.
    ankle: f32,
    /// Flexion forwards, outwards, twist.
    arm: [f32; 3],
    elbow: f32,
}

/// A pose of both sides; the trunk leans forwards by `lean`, bends to the right by `sway`, the hips turn left by `turn`
/// and the chest the other way.
fn assemble(left: Side, right: Side, lean: f32, sway: f32, turn: f32) -> Pose {
    let mut pose = Pose::default();
    *pose.joint(Joint::Pelvis) = Quat::from_rotation_y(turn) * Quat::from_rotation_x(lean * 0.35);
    *pose.joint(Joint::Chest) =
        Quat::from_rotation_y(-2.0 * turn) * Quat::from_rotation_x(lean * 0.65) * Quat::from_rotation_z(sway);
    *pose.joint(Joint::Neck) = Quat::from_rotation_y(turn) * Quat::from_rotation_x(-lean * 0.7);
    for (side, is_left) in [(left, true), (right, false)] {
        let [thigh, calf, foot, upper, lower] = if is_left {
            [Joint::ThighL, Joint::CalfL, Joint::FootL, Joint::UpperArmL, Joint::LowerArmL]
        } else {
            [Joint::ThighR, Joint::CalfR, Joint::FootR, Joint::UpperArmR, Joint::LowerArmR]
        };
        // The pelvis' lean is taken out of the legs, so that `thigh` is measured from upright.
        let [flex, out, twist] = side.thigh;
        *pose.joint(thigh) = limb(flex + lean * 0.35, out, twist, is_left);
        *pose.joint(calf) = Quat::from_rotation_x(side.knee);
        *pose.joint(foot) = Quat::from_rotation_x(side.ankle);
        let [flex, out, twist] = side.arm;
        *pose.joint(upper) = limb(flex, out, twist, is_left);
        *pose.joint(lower) = Quat::from_rotation_x(-side.elbow);
    }
    pose
}

/// How a running or walking gait is shaped.
#[derive(Clone, Copy, Debug)]
pub struct Stride {
    /// Swing of the thigh to either side of its middle.
    pub reach: f32,
    /// Middle of the thigh's swing, forwards.
    pub lift: f32,
    /// Greatest bend of the knee in the swing.
    pub fold: f32,
    /// Bend of the knee at all times.
    pub bend: f32,
    /// Swing of the arm.
    pub pump: f32,
    /// Bend of the elbow.
    pub elbow: f32,
    /// Lean of the trunk.
    pub lean: f32,
    /// Height of the flight phase, metres.
    pub flight_m: f32,
}

/// A loose jog.
pub const JOG: Stride = Stride {
    reach: 0.48,
    lift: 0.16,
    fold: 1.15,
    bend: 0.28,
    pump: 0.45,
    elbow: 1.35,
    lean: 0.12,
    flight_m: 0.04,
};
/// A full sprint.
pub const SPRINT: Stride = Stride {
    reach: 0.86,
    lift: 0.26,
    fold: 1.75,
    bend: 0.30,
    pump: 0.85,
    elbow: 1.55,
    lean: 0.26,
    flight_m: 0.09,
};
/// Walking backwards, to be played with falling phase.
pub const BACKPEDAL: Stride = Stride {
    reach: 0.34,
    lift: 0.10,
    fold: 0.75,
    bend: 0.34,
    pump: 0.25,
    elbow: 0.9,
    lean: 0.10,
    flight_m: 0.0,
};

/// Going sideways, low, feet apart.
pub const SHUFFLE: Stride = Stride {
    reach: 0.05,
    lift: 0.42,
    fold: 0.42,
    bend: 0.95,
    pump: 0.12,
    elbow: 1.0,
    lean: 0.24,
    flight_m: 0.0,
};

/// A gait at a share 0..1 of its cycle; at 0 the left foot is furthest ahead.
#[must_use]
pub fn stride(shape: &Stride, phase: f32) -> Pose {
    let side = |turn: f32| {
        let angle = (phase + turn).rem_euclid(1.0) * TAU;
        // The knee folds while the leg swings forwards: around three quarters of the cycle.
        let from_peak = (angle - 1.42 * PI + PI).rem_euclid(TAU) - PI;
        let fold = (-from_peak * from_peak / 0.95).exp();
        // It also gives a little when it takes the weight.
        let load = (-((angle - 0.35) / 0.5).powi(2)).exp() * 0.18;
        Side {
            thigh: [shape.lift + shape.reach * angle.cos(), 0.03, 0.0],
            knee: shape.bend * 0.5 + shape.fold * fold + load,
            ankle: 0.12 * angle.cos() + 0.45 * fold - 0.05,
            arm: [-0.12 - shape.pump * angle.cos(), 0.17, 0.1],
            elbow: shape.elbow - 0.25 * angle.cos(),
        }
    };
    let angle = phase * TAU;
    let mut pose = assemble(side(0.0), side(0.5), shape.lean, 0.0, -0.12 * angle.cos());
    pose.clearance_m = shape.flight_m * (1.0 - (2.0 * angle + 0.6).cos()) / 2.0;
    pose
}

/// Shuffling sideways to the left, low.
#[must_use]
pub fn sidestep(phase: f32) -> Pose {
    let open = 0.5 - 0.5 * (phase * TAU).cos();
    let side = |lead: f32| Side {
        thigh: [0.38, 0.06 + 0.34 * open * lead, 0.1],
        knee: 0.62 + 0.2 * (1.0 - open),
        ankle: -0.25,
        arm: [0.15, 0.45, 0.2],
        elbow: 0.9,
    };
    assemble(side(1.0), side(0.8), 0.28, 0.04 * (phase * TAU).sin(), 0.0)
}

/// Standing about; `mood` 0..1 chooses the arms, `phase` moves the weight.
#[must_use]
pub fn stand(mood: f32, phase: f32) -> Pose {
    let sway = (phase * TAU).sin();
    let rest =
        Side { thigh: [0.04, 0.07, 0.12], knee: 0.08, ankle: -0.04, arm: [0.02, 0.12, 0.0], elbow: 0.28 };
    let (mut left, mut right) = (rest, rest);
    left.thigh[0] += 0.05 * sway;
    left.knee += 0.10 * (0.5 + 0.5 * sway);
    match (mood * 6.0) as usize {
        0 => {
            // Hands on the hips.
            for side in [&mut left, &mut right] {
                side.arm = [-0.42, 0.62, -0.6];
                side.elbow = 1.55;
            }
        }
        1 => {
            // Leaning on the knees.
            for side in [&mut left, &mut right] {
                side.thigh = [0.45, 0.16, 0.1];
                side.knee = 0.5;
                side.ankle = -0.08;
                side.arm = [1.05, 0.12, 0.0];
                side.elbow = 0.35;
            }
            return assemble(left, right, 0.85, 0.0, 0.0);
        }
        2 => {
            // Pointing.
            right.arm = [1.45, 0.2, 0.0];
            right.elbow = 0.12;
        }
        3 => {
            // Ready, knees bent.
            for side in [&mut left, &mut right] {
                side.thigh = [0.5, 0.22, 0.15];
                side.knee = 0.75;
                side.ankle = -0.25;
                side.arm = [0.35, 0.35, 0.1];
                side.elbow = 0.95;
            }
            return assemble(left, right, 0.35, 0.03 * sway, 0.05 * sway);
        }
        _ => {}
    }
    assemble(left, right, 0.03, 0.02 * sway, 0.06 * sway)
}

/// One thing a training player may do.
#[derive(Clone, Debug)]
pub struct Action<'a> {
    /// Name; formulas start with `made-`.
    pub name: String,
    /// How often it is drawn, relative.
    pub weight: f32,
    source: Source<'a>,
}

/// Makes a pose from phase and mood.
type Formula = fn(f32, f32) -> Pose;

#[derive(Clone, Debug)]
enum Source<'a> {
    Clip(&'a Clip),
    Made(Formula),
}

impl Action<'_> {
    /// The pose at a share of the action; `mood` 0..1 chooses among variants.
    #[must_use]
    pub fn pose(&self, phase: f32, mood: f32) -> Pose {
        match &self.source {
            Source::Clip(clip) => clip.pose(phase).facing_ahead(),
            Source::Made(make) => make(phase, mood),
        }
    }
}

/// Whole actions that only the test split uses.
const HELD_OUT: [&str; 8] = [
    "kick",
    "turn_left1",
    "turn_right1",
    "0walk_forward",
    "dance_b",
    "made-sprint",
    "made-throw-in",
    "made-backpedal",
];

/// Actions that only validation shows.
const VALIDATION: [&str; 4] = ["jump", "spin", "made-fast-run", "made-slide"];

fn split_of(name: &str) -> Split {
    if HELD_OUT.contains(&name) {
        Split::Test
    } else if VALIDATION.contains(&name) {
        Split::Validation
    } else {
        Split::Train
    }
}

/// Everything a player of a split may do.
#[must_use]
pub fn repertoire(motions: &Motions, split: Split) -> Vec<Action<'_>> {
    let clips = motions.clips().iter().map(|clip| {
        let weight = match clip.name.as_str() {
            "run" => 10.0,
            "walk" | "kick" => 6.0,
            "jump" | "turn_left0" | "turn_right0" | "turn_left1" | "turn_right1" | "0walk_forward" => 3.0,
            "punch" | "spin" | "dance_a" | "dance_b" => 1.5,
            _ => 0.5,
        };
        Action { name: clip.name.clone(), weight, source: Source::Clip(clip) }
    });
    let made: [(&str, f32, Formula); 13] = [
        ("made-jog", 9.0, |phase, mood| stride(&JOG, phase).blend(&stand(0.9, 0.0), 0.35 * mood)),
        ("made-fast-run", 6.0, |phase, mood| {
            stride(&JOG, phase).blend(&stride(&SPRINT, phase), 0.3 + 0.5 * mood)
        }),
        ("made-sprint", 6.0, |phase, _| stride(&SPRINT, phase)),
        ("made-backpedal", 3.0, |phase, _| stride(&BACKPEDAL, -phase)),
        ("made-sidestep", 5.0, |phase, _| sidestep(phase)),
        ("made-stand", 7.0, |phase, mood| stand(mood, phase)),
        ("made-pass", 3.0, |phase, _| acts::drawn(Kind::Pass, phase)),
        ("made-shot", 3.0, |phase, _| acts::drawn(Kind::Shot, phase)),
        ("made-header", 2.0, |phase, _| acts::drawn(Kind::Header, phase)),
        ("made-throw-in", 1.5, |phase, _| acts::drawn(Kind::ThrowIn, phase)),
        ("made-tackle", 1.5, |phase, _| acts::drawn(Kind::Tackle, phase)),
        ("made-dive", 1.5, |phase, _| acts::drawn(Kind::Dive, phase)),
        ("made-fall", 1.0, |phase, _| acts::drawn(Kind::Fall, phase)),
    ];
    let made = made.into_iter().map(|(name, weight, make)| Action {
        name: name.into(),
        weight,
        source: Source::Made(make),
    });
    clips.chain(made).filter(|action| split_of(&action.name) == split).collect()
}

/// Draws an action by weight.
pub fn draw<'a, 'b>(actions: &'b [Action<'a>], rng: &mut impl Rng) -> Option<&'b Action<'a>> {
    let total: f32 = actions.iter().map(|action| action.weight).sum();
    let mut place = rng.random_range(0.0..total.max(1e-6));
    actions.iter().find(|action| {
        place -= action.weight;
        place < 0.0
    })
}

/// Two movements in one pose: the arms of one with the legs of the other, or something between both. So training players move in more ways
/// than there are actions.
#[must_use]
pub fn mixed(first: &Pose, second: &Pose, rng: &mut impl Rng) -> Pose {
    const ARMS: [Joint; 4] = [Joint::UpperArmR, Joint::LowerArmR, Joint::UpperArmL, Joint::LowerArmL];
    // The trunk leans with the legs, or the player would not stand.
    let (mut pose, arms_of) = match rng.random_range(0..3) {
        0 => return first.blend(second, rng.random_range(0.25..0.75)),
        1 => (*first, second),
        _ => (*second, first),
    };
    for joint in ARMS {
        *pose.joint(joint) = arms_of.rotations[joint as usize];
    }
    pose
}

/// Small random turns of every joint and sometimes the other side leading: no two players move alike.
#[must_use]
pub fn personal(pose: Pose, strength: f32, rng: &mut impl Rng) -> Pose {
    let mut pose = if rng.random_bool(0.5) { pose.mirrored() } else { pose };
    let mut turn = |range: f32| rng.random_range(-1.0..1.0f32) * range * strength;
    for (joint, range) in [
        (Joint::Chest, 0.14),
        (Joint::Neck, 0.35),
        (Joint::ThighL, 0.10),
        (Joint::ThighR, 0.10),
        (Joint::UpperArmL, 0.28),
        (Joint::UpperArmR, 0.28),
    ] {
        let noise = Quat::from_rotation_y(turn(range))
            * Quat::from_rotation_x(turn(range))
            * Quat::from_rotation_z(turn(range));
        let rotation = pose.joint(joint);
        *rotation *= noise;
    }
    for (joint, range) in
        [(Joint::CalfL, 0.1), (Joint::CalfR, 0.1), (Joint::LowerArmL, 0.3), (Joint::LowerArmR, 0.3)]
    {
        let bend = Quat::from_rotation_x(turn(range));
        let rotation = pose.joint(joint);
        *rotation *= bend;
    }
    pose
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    #[test]
    fn who_does_two_things_has_limbs_of_both() {
        let (run, throw) = (stride(&SPRINT, 0.1), acts::drawn(Kind::ThrowIn, 0.6));
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        let same = |a: Quat, b: Quat| a.dot(b).abs() > 0.9999;
        let mut whole = [0; 2];
        for _ in 0..60 {
            let pose = mixed(&run, &throw, &mut rng);
            let from = |joint: Joint| {
                let rotation = pose.rotations[joint as usize];
                [&run, &throw].map(|one| same(rotation, one.rotations[joint as usize]))
            };
            let (leg, arm) = (from(Joint::ThighL), from(Joint::UpperArmR));
            for (one, count) in whole.iter_mut().enumerate() {
                *count += usize::from(leg[one] && arm[1 - one]);
            }
        }
        assert!(whole.iter().all(|&count| count > 8) && whole.iter().sum::<usize>() < 55, "{whole:?}");
    }
}
