//! Feet that stay where they stand: finds the contacts of a course, plants each foot once per contact, lowers the hips
//! until the legs reach, and bends the legs to the feet. Between contacts a foot follows the pose, drawn over to its
//! next place. Frame: the anchor on the ground is the origin, y up, the body looks along +z.

use glam::{Quat, Vec2, Vec3};

use crate::{
    course::{Course, Sample, TOUCHDOWN, ease, near},
    legs::{Foot, Legs, SIDES},
    limits,
    motion::{Joint, Pose},
};

/// Samples over which the height of the hips is levelled, to each side.
const LEVEL: usize = 5;
/// A swinging foot clears the grass by so much at least, metres.
const CLEAR_M: f32 = 0.015;

/// A stretch of samples in which a foot stands, and where.
#[derive(Clone, Copy, Debug)]
struct Contact {
    /// First sample and the one after the last.
    from: usize,
    to: usize,
    /// Place of the ankle over the ground (x, z) and heading of the foot, in the world.
    at: Vec2,
    yaw: f32,
}

/// What the legs do at one sample before the feet are fixed.
#[derive(Clone, Debug)]
pub(crate) struct Wish {
    /// The pose with gait and actions.
    pub(crate) pose: Pose,
    /// Height of the hips that the pose would have, metres.
    pub(crate) hips_m: f32,
    /// How far an action has taken the left and right leg over; a swinging foot then follows the action alone.
    pub(crate) loose: [f32; 2],
    /// Height added by a jump, metres.
    pub(crate) rise_m: f32,
    /// Half the distance between the feet in a stance, metres.
    pub(crate) half_stance_m: f32,
}

/// The same with feet that stand.
#[derive(Clone, Debug)]
pub(crate) struct Stance {
    pub(crate) pose: Pose,
    pub(crate) hips_m: f32,
}

fn contacts(course: &Course, side: usize, wishes: &[Wish]) -> Vec<Contact> {
    let samples = &course.samples;
    let mut found = Vec::new();
    let mut from = None;
    for k in 0..=samples.len() {
        let down = samples.get(k).is_some_and(|sample| sample.planted[side]);
        match (from, down) {
            (None, true) => from = Some(k),
            (Some(first), false) => {
                found.push(plant(samples, side, wishes, first, k));
                from = None;
            }
            _ => {}
        }
    }
    found
}

/// Where the foot of a contact stands: beside the place that the hips pass half way through it.
fn plant(samples: &[Sample], side: usize, wishes: &[Wish], from: usize, to: usize) -> Contact {
    // Half way along the path, not in time: a person who stops stands over its feet.
    let step = |k: usize| {
        samples[k].at.distance(samples[k - 1].at) + 0.1 * (samples[k].yaw - samples[k - 1].yaw).abs()
    };
    let whole: f32 = (from + 1..to).map(step).sum();
    let mut gone = 0.0;
    let middle = (from + 1..to)
        .find(|&k| {
            gone += step(k);
            gone >= whole * 0.5
        })
        .unwrap_or((from + to) / 2)
        .min(to - 1);
    let sample = &samples[middle];
    let out = if side == 0 { 1.0 } else { -1.0 } * wishes[middle].half_stance_m;
    // Ankles are a little behind the hips; more so the faster one runs, as the heel rises before the foot leaves.
    let back = -0.03 - 0.03 * ease(sample.own.y, 0.5, 2.0);
    let (sin, cos) = sample.yaw.sin_cos();
    let left = Vec2::new(cos, -sin);
    let ahead = Vec2::new(sin, cos);
    // Toes point a little outwards.
    let yaw = sample.yaw + if side == 0 { 0.10 } else { -0.10 };
    Contact { from, to, at: sample.at + left * out + ahead * back, yaw }
}

/// How the standing foot rolls at a sample: positive on the heel, negative on the toes, radians.
fn roll(sample: &Sample, side: usize) -> f32 {
    let turn = if side == 0 { 0.0 } else { 0.5 };
    let gone = ((sample.phase - TOUCHDOWN + turn).rem_euclid(1.0) / sample.duty).min(1.0);
    let ahead = sample.own.y;
    let push = 0.62 * ease(ahead, 0.15, 1.3) + 0.16 * ease(ahead, 2.5, 6.0);
    let aside = 0.25 * ease(sample.own.x.abs(), 0.5, 1.5) * (1.0 - ease(ahead.abs(), 0.5, 1.5));
    let strike = 0.30 * ease(ahead, 0.5, 1.1) * (1.0 - ease(ahead, 2.0, 3.0));
    // Backwards the toes come down first.
    let reach = 0.45 * ease(-ahead, 0.2, 1.0);
    strike * (1.0 - ease(gone, 0.0, 0.18))
        - (push + aside) * ease(gone, 0.52, 1.0)
        - reach * (1.0 - ease(gone, 0.0, 0.35))
}

/// Lets the feet of a course stand. `wishes` has one entry per sample.
pub(crate) fn stand(course: &Course, legs: &Legs, wishes: &[Wish]) -> Vec<Stance> {
    let samples = &course.samples;
    let all = SIDES.map(|side| contacts(course, side, wishes));
    // Planted feet as each body sees them.
    let mut planted: Vec<[Option<(Foot, f32)>; 2]> = vec![[None; 2]; samples.len()];
    for side in SIDES {
        for contact in &all[side] {
            for k in contact.from..contact.to {
                let sample = &samples[k];
                let pitch = roll(sample, side);
                planted[k][side] = Some((seen(legs, sample, side, contact, pitch), pitch));
            }
        }
    }
    let hips = hips_heights(legs, wishes, &planted);
    let mut stances: Vec<Stance> = wishes
        .iter()
        .zip(&hips)
        .map(|(wish, &height)| Stance { pose: wish.pose, hips_m: height + wish.rise_m })
        .collect();
    for side in SIDES {
        let mut next = all[side].iter().peekable();
        let mut before: Option<&Contact> = None;
        for k in 0..samples.len() {
            while next.peek().is_some_and(|contact| contact.to <= k) {
                before = next.next();
            }
            let Stance { pose, hips_m } = &mut stances[k];
            if let Some((foot, pitch)) = planted[k][side] {
                let held = Foot { ankle: foot.ankle - Vec3::Y * *hips_m, turn: foot.turn };
                legs.bend(pose, side, &held);
                pose.toes[side] = (-pitch).max(0.0);
                continue;
            }
            let loose = wishes[k].loose[side];
            let end = |k: usize| End::of(legs, &wishes[k], hips[k], side, planted[k][side]);
            let (from, to) = (before.map(|c| c.to - 1), next.peek().map(|c| c.from));
            let (start, finish) = (from.map(end), to.map(end));
            let (first, last) = (from.unwrap_or(0), to.unwrap_or(samples.len()));
            let gone = (k - first) as f32 / (last - first).max(1) as f32;
            swing(legs, pose, *hips_m, side, [start, finish], gone, loose);
            pose.toes[side] =
                start.map_or(0.0, |start| start.toes) * (1.0 - ease(gone, 0.0, 0.25)) * (1.0 - loose);
        }
    }
    stances
}

/// A planted foot as the body of a sample sees it.
fn seen(legs: &Legs, sample: &Sample, side: usize, contact: &Contact, pitch: f32) -> Foot {
    let off = contact.at - sample.at;
    let (sin, cos) = sample.yaw.sin_cos();
    let ankle = Vec3::new(off.x * cos - off.y * sin, 0.0, off.x * sin + off.y * cos);
    legs.planted(side, ankle, near(contact.yaw - sample.yaw, 0.0), pitch)
}

/// The height of the hips over the ground, jumps apart: as the poses wish, but no higher than the standing legs reach,
/// and level: the least over a few samples, then their mean, never exceeds what any of them allows.
fn hips_heights(legs: &Legs, wishes: &[Wish], planted: &[[Option<(Foot, f32)>; 2]]) -> Vec<f32> {
    let allowed: Vec<f32> = wishes
        .iter()
        .zip(planted)
        .map(|(wish, feet)| {
            let pelvis = wish.pose.rotations[Joint::Pelvis as usize];
            let reach =
                |side: usize| feet[side].map_or(f32::MAX, |(foot, _)| legs.reach_m(pelvis, side, foot.ankle));
            wish.hips_m.min(reach(0)).min(reach(1))
        })
        .collect();
    let around = |values: &[f32], k: usize| k.saturating_sub(LEVEL)..(k + LEVEL + 1).min(values.len());
    let least: Vec<f32> = (0..allowed.len())
        .map(|k| allowed[around(&allowed, k)].iter().copied().fold(f32::MAX, f32::min))
        .collect();
    (0..least.len())
        .map(|k| {
            let near = around(&least, k);
            let count = near.len() as f32;
            least[near].iter().sum::<f32>() / count
        })
        .collect()
}

/// A foot where a contact ends or begins, against what the pose alone would do there.
#[derive(Clone, Copy, Debug)]
struct End {
    /// From the pose's ankle to the planted one.
    off: Vec3,
    turn: Quat,
    toes: f32,
}

impl End {
    fn of(legs: &Legs, wish: &Wish, hips_m: f32, side: usize, planted: Option<(Foot, f32)>) -> Self {
        let own = legs.foot(&wish.pose, side);
        let (foot, pitch) =
            planted.unwrap_or((Foot { ankle: own.ankle + Vec3::Y * hips_m, turn: own.turn }, 0.0));
        Self { off: foot.ankle - own.ankle - Vec3::Y * hips_m, turn: foot.turn, toes: (-pitch).max(0.0) }
    }
}

/// Bends a leg between two contacts, `gone` of the way: the foot goes as the pose has it, drawn towards the place it
/// leaves and the place it comes to.
fn swing(
    legs: &Legs,
    pose: &mut Pose,
    hips_m: f32,
    side: usize,
    [start, finish]: [Option<End>; 2],
    gone: f32,
    loose: f32,
) {
    let own = legs.foot(pose, side);
    let joint = Legs::ankle_joint(side);
    let own_joint = pose.rotations[joint as usize];
    let zero = End { off: Vec3::ZERO, turn: own.turn, toes: 0.0 };
    let (start, finish) = (start.unwrap_or(zero), finish.unwrap_or(zero));
    // The start is left behind quickly: a leg that swings through must not trail.
    let (away, near) = (ease(gone, 0.0, 0.5), ease(gone, 0.35, 1.0));
    let off = (start.off * (1.0 - away) + finish.off * near) * (1.0 - loose);
    let mut ankle = own.ankle + off;
    let clear = CLEAR_M * (gone * (1.0 - gone) * 4.0).clamp(0.0, 1.0) * (1.0 - loose);
    let toes_bent = start.toes * (1.0 - ease(gone, 0.0, 0.25)) > 0.05;
    for _ in 0..2 {
        legs.bend(pose, side, &Foot { ankle, turn: own.turn });
        limits::keep_thigh(pose, Legs::hip_joint(side));
        let back = legs.shank(pose, side).inverse();
        let mut turn = own_joint.slerp(back * start.turn, (1.0 - ease(gone, 0.0, 0.35)) * (1.0 - loose));
        turn = turn.slerp(back * finish.turn, ease(gone, 0.65, 1.0) * (1.0 - loose));
        limits::most(&mut turn, limits::ANKLE_MOST);
        *pose.joint(joint) = turn;
        // No foot goes through the grass on its way.
        let sole = legs.sole_y(&legs.foot(pose, side), side) + hips_m;
        if sole >= clear || toes_bent {
            break;
        }
        ankle.y += clear - sole;
    }
}
