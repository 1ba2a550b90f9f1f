//! The actions of football as keyed poses: pass, shot, header, throw-in, slide tackle, dive, fall.
//! Time is in seconds from the moment the ball is played (or the ground is met); angles are radians. Right foot and
//! left dive are written down, the other side is mirrored. Timings follow what broadcast pictures show.

use std::sync::LazyLock;

use glam::{Quat, Vec4};
use serde::{Deserialize, Serialize};

use crate::{
    gait::{self, Side, assemble},
    motion::{JOINTS, Joint, Pose},
};

/// What somebody does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)] // the names say it
pub enum Kind {
    Stand,
    Walk,
    Jog,
    Sprint,
    Sideways,
    Backwards,
    Turn,
    Pass,
    Shot,
    Header,
    ThrowIn,
    Tackle,
    KeeperSet,
    Dive,
    Fall,
}

impl Kind {
    /// Everything with keyed poses.
    pub const KEYED: [Self; 7] =
        [Self::Pass, Self::Shot, Self::Header, Self::ThrowIn, Self::Tackle, Self::Dive, Self::Fall];

    /// Whether the body goes to the ground.
    #[must_use]
    pub fn goes_down(self) -> bool {
        matches!(self, Self::Tackle | Self::Dive | Self::Fall)
    }
}

/// A pose at a moment.
#[derive(Clone, Debug)]
struct Key {
    time: f32,
    pose: Pose,
}

/// One action.
#[derive(Clone, Debug)]
pub struct Act {
    /// What it is.
    pub kind: Kind,
    keys: Vec<Key>,
    /// Seconds over which it takes over at its start and gives back at its end.
    fade_s: [f32; 2],
    /// While both feet leave the ground (or have nothing to do with it): start and end, seconds.
    pub loose_s: [f32; 2],
}

impl Act {
    /// The keyed action of a kind; `None` for gaits, which are formulas.
    #[must_use]
    pub fn of(kind: Kind) -> Option<&'static Self> {
        static ALL: LazyLock<Vec<Act>> =
            LazyLock::new(|| vec![pass(), shot(), header(), throw_in(), tackle(), dive(), fall()]);
        ALL.iter().find(|act| act.kind == kind)
    }

    /// First and last moment, seconds.
    #[must_use]
    pub fn span_s(&self) -> [f32; 2] {
        [self.keys.first().map_or(0.0, |key| key.time), self.keys.last().map_or(0.0, |key| key.time)]
    }

    /// How far the action has taken over at `time`, 0..1.
    #[must_use]
    pub fn share(&self, time: f32) -> f32 {
        let [first, last] = self.span_s();
        ease((time - first) / self.fade_s[0]) * (1.0 - ease((time - last + self.fade_s[1]) / self.fade_s[1]))
    }

    /// The pose at `time`: a cubic through the keys, without a stop at each of them.
    #[must_use]
    pub fn pose(&self, time: f32) -> Pose {
        let last = self.keys.len() - 1;
        let time = time.clamp(self.keys[0].time, self.keys[last].time);
        let first = self.keys.partition_point(|key| key.time <= time).clamp(1, last) - 1;
        let around =
            [first.saturating_sub(1), first, first + 1, (first + 2).min(last)].map(|k| &self.keys[k]);
        let [before, from, to, after] = around;
        let length = to.time - from.time;
        let t = (time - from.time) / length;
        // Tangents of Catmull and Rom for uneven times.
        let tangent = |a: Vec4, b: Vec4, ta: f32, tb: f32| (b - a) / (tb - ta).max(1e-3) * length;
        let mut pose = Pose::default();
        for joint in 0..JOINTS {
            let middle = from.pose.rotations[joint];
            let [p0, p1, p2, p3] = around.map(|key| {
                let q = key.pose.rotations[joint];
                Vec4::from(if q.dot(middle) < 0.0 { -q } else { q })
            });
            let m1 = tangent(p0, p2, before.time, to.time);
            let m2 = tangent(p1, p3, from.time, after.time);
            pose.rotations[joint] = Quat::from_vec4(hermite(p1, m1, p2, m2, t)).normalize();
        }
        pose.clearance_m = from.pose.clearance_m + (to.pose.clearance_m - from.pose.clearance_m) * t;
        pose
    }

    /// Lays the action over `base` at `time`. Kicks leave the other leg to the gait, headers and throw-ins both legs
    /// as far as they stand.
    #[must_use]
    pub fn over(&self, base: &Pose, time: f32, mirrored: bool) -> Pose {
        let share = self.share(time);
        if share <= 0.0 {
            return *base;
        }
        let act = if mirrored { self.pose(time).mirrored() } else { self.pose(time) };
        let mut pose = *base;
        for joint in JOINT_LIST {
            let part = share * self.part(joint, mirrored);
            let rotation = pose.joint(joint);
            *rotation = rotation.lerp(act.rotations[joint as usize], part);
        }
        pose.clearance_m += (act.clearance_m - pose.clearance_m) * share;
        pose
    }

    fn part(&self, joint: Joint, mirrored: bool) -> f32 {
        use Joint::{CalfL, CalfR, FootL, FootR, Pelvis, ThighL, ThighR};
        let kicking = if mirrored { [ThighL, CalfL, FootL] } else { [ThighR, CalfR, FootR] };
        match self.kind {
            Kind::Pass | Kind::Shot => match joint {
                ThighL | CalfL | FootL | ThighR | CalfR | FootR => {
                    f32::from(u8::from(kicking.contains(&joint)))
                }
                Pelvis => 0.7,
                _ => 0.9,
            },
            Kind::Header if joint == Pelvis => 0.6,
            _ => 1.0,
        }
    }
}

const JOINT_LIST: [Joint; JOINTS] = [
    Joint::Pelvis,
    Joint::Chest,
    Joint::Neck,
    Joint::ThighR,
    Joint::CalfR,
    Joint::FootR,
    Joint::UpperArmR,
    Joint::LowerArmR,
    Joint::ThighL,
    Joint::CalfL,
    Joint::FootL,
    Joint::UpperArmL,
    Joint::LowerArmL,
];

fn ease(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Hermite's cubic from `p1` with slope `m1` to `p2` with slope `m2`.
fn hermite(p1: Vec4, m1: Vec4, p2: Vec4, m2: Vec4, t: f32) -> Vec4 {
    let (t2, t3) = (t * t, t * t * t);
    p1 * (2.0 * t3 - 3.0 * t2 + 1.0) + m1 * (t3 - 2.0 * t2 + t) + p2 * (3.0 * t2 - 2.0 * t3) + m2 * (t3 - t2)
}

fn key(time: f32, pose: Pose) -> Key {
    Key { time, pose }
}

/// The pose with the whole body turned: first pitched forwards, then tipped over to the left, then turned left.
fn lying(mut pose: Pose, pitch: f32, left: f32, turn: f32) -> Pose {
    *pose.joint(Joint::Pelvis) =
        Quat::from_rotation_z(-left) * Quat::from_rotation_x(pitch) * Quat::from_rotation_y(turn);
    pose
}

fn looking(mut pose: Pose, up: f32, left: f32) -> Pose {
    *pose.joint(Joint::Neck) = Quat::from_rotation_y(left) * Quat::from_rotation_x(-up);
    pose
}

fn side(thigh: [f32; 3], knee: f32, ankle: f32, arm: [f32; 3], elbow: f32) -> Side {
    Side { thigh, knee, ankle, arm, elbow }
}

fn upright() -> Side {
    side([0.06, 0.07, 0.1], 0.12, -0.05, [0.05, 0.14, 0.0], 0.35)
}

fn pass() -> Act {
    let left = |flex: f32| side([0.2, 0.05, 0.1], 0.35, -0.15, [flex, 0.55, 0.0], 0.5);
    let right =
        |flex: f32, twist: f32, knee: f32| side([flex, 0.10, twist], knee, 0.05, [-0.25, 0.35, 0.0], 0.6);
    let keys = vec![
        key(-0.42, assemble(left(0.2), right(0.0, 0.1, 0.4), 0.10, 0.0, 0.05)),
        key(-0.22, assemble(left(-0.1), right(-0.50, 0.35, 0.95), 0.12, 0.03, -0.12)),
        key(-0.06, assemble(left(0.25), right(0.05, 0.70, 0.55), 0.16, 0.03, 0.02)),
        key(0.0, assemble(left(0.4), right(0.38, 0.75, 0.28), 0.18, 0.02, 0.10)),
        key(0.14, assemble(left(0.6), right(0.72, 0.60, 0.18), 0.16, 0.0, 0.20)),
        key(0.42, assemble(left(0.2), right(0.25, 0.1, 0.35), 0.10, 0.0, 0.04)),
    ];
    Act { kind: Kind::Pass, keys, fade_s: [0.16, 0.2], loose_s: [0.0, 0.0] }
}

fn shot() -> Act {
    let left = |flex: f32, out: f32| side([0.2, 0.05, 0.1], 0.45, -0.2, [flex, out, 0.0], 0.45);
    let right = |flex: f32, knee: f32, ankle: f32| {
        side([flex, 0.16, 0.1], knee, ankle, [-0.35 - 0.3 * flex, 0.45, 0.0], 0.6)
    };
    let keys = vec![
        key(-0.50, assemble(left(0.3, 0.4), right(0.1, 0.6, 0.2), 0.12, 0.0, 0.05)),
        key(-0.26, assemble(left(-0.5, 1.15), right(-0.70, 1.25, 0.4), 0.02, -0.12, -0.35)),
        key(-0.10, assemble(left(-0.2, 1.2), right(-0.18, 1.62, 0.5), 0.06, -0.14, -0.15)),
        key(0.0, assemble(left(0.5, 0.9), right(0.42, 0.50, 0.55), 0.20, -0.10, 0.15)),
        key(0.12, assemble(left(0.9, 0.7), right(1.10, 0.12, 0.45), 0.28, -0.04, 0.38)),
        key(0.26, assemble(left(0.8, 0.6), right(1.15, 0.45, 0.2), 0.26, 0.0, 0.35)),
        key(0.58, assemble(left(0.2, 0.3), right(0.2, 0.5, 0.0), 0.14, 0.0, 0.05)),
    ];
    Act { kind: Kind::Shot, keys, fade_s: [0.18, 0.24], loose_s: [0.0, 0.0] }
}

fn header() -> Act {
    let limb = |thigh: f32, knee: f32, ankle: f32, arm: f32, out: f32| {
        side([thigh, 0.08, 0.05], knee, ankle, [arm, out, 0.1], 1.35)
    };
    let both = |l: Side, r: Side, lean: f32, nod: f32| {
        let mut pose = assemble(l, r, lean, 0.0, 0.0);
        *pose.joint(Joint::Neck) = Quat::from_rotation_x(nod);
        pose
    };
    let stand = limb(0.15, 0.3, -0.1, 0.0, 0.25);
    let load = limb(0.55, 1.0, -0.45, -0.6, 0.35);
    let rise = limb(-0.05, 0.25, 0.55, 0.6, 0.75);
    let keys = vec![
        key(-0.75, both(stand, stand, 0.08, -0.15)),
        key(-0.48, both(load, load, 0.38, -0.45)),
        key(-0.26, both(rise, limb(0.2, 0.6, 0.5, 0.65, 0.75), -0.05, -0.25)),
        key(-0.10, both(limb(-0.25, 0.7, 0.5, 0.4, 1.0), limb(-0.15, 0.9, 0.5, 0.4, 1.0), -0.34, -0.2)),
        key(0.0, both(limb(0.05, 0.5, 0.5, 0.3, 0.85), limb(0.15, 0.7, 0.5, 0.3, 0.85), 0.18, 0.22)),
        key(0.12, both(limb(0.25, 0.35, 0.35, 0.1, 0.8), limb(0.3, 0.4, 0.35, 0.1, 0.8), 0.42, 0.28)),
        key(0.30, both(limb(0.2, 0.35, 0.1, 0.2, 0.6), limb(0.2, 0.3, 0.1, 0.2, 0.6), 0.3, -0.1)),
        key(0.46, both(limb(0.45, 0.8, -0.3, 0.1, 0.45), limb(0.45, 0.8, -0.3, 0.1, 0.45), 0.3, -0.1)),
        key(0.85, both(stand, stand, 0.08, 0.0)),
    ];
    Act { kind: Kind::Header, keys, fade_s: [0.22, 0.3], loose_s: [0.0, 0.0] }
}

fn throw_in() -> Act {
    // Raised arms: a negative "out" opens them.
    let arms =
        |flex: f32, elbow: f32, out: f32| [flex, out, 0.0].into_iter().chain([elbow]).collect::<Vec<_>>();
    let body = |flex: f32, elbow: f32, out: f32, lean: f32, knee: f32| {
        let a = arms(flex, elbow, out);
        let arm = [a[0], a[1], a[2]];
        let front = side([0.22 + 0.3 * knee, 0.06, 0.1], knee, -0.1, arm, a[3]);
        let back = side([-0.28 + 0.3 * knee, 0.06, 0.1], knee + 0.1, 0.2, arm, a[3]);
        looking(assemble(front, back, lean, 0.0, 0.0), 0.1 - 0.3 * lean.min(0.0), 0.0)
    };
    let keys = vec![
        key(-1.15, body(0.55, 1.45, 0.0, 0.05, 0.12)),
        key(-0.85, body(1.9, 1.6, -0.05, 0.0, 0.15)),
        key(-0.55, body(2.85, 1.95, -0.12, -0.16, 0.3)),
        key(-0.28, body(2.90, 2.05, -0.12, -0.32, 0.42)),
        key(-0.10, body(2.80, 1.2, -0.10, -0.08, 0.25)),
        key(0.0, body(2.45, 0.35, -0.05, 0.14, 0.15)),
        key(0.16, body(1.55, 0.2, 0.0, 0.34, 0.15)),
        key(0.45, body(0.6, 0.4, 0.1, 0.24, 0.2)),
        key(0.85, body(0.1, 0.35, 0.12, 0.08, 0.12)),
    ];
    Act { kind: Kind::ThrowIn, keys, fade_s: [0.3, 0.35], loose_s: [0.0, 0.0] }
}

fn tackle() -> Act {
    let lead = |flex: f32, knee: f32| side([flex, 0.08, 0.0], knee, 0.15, [0.25, 0.9, 0.0], 0.5);
    let tuck = |flex: f32, knee: f32, arm: f32| side([flex, 0.0, 0.55], knee, 0.5, [arm, 0.55, 0.0], 0.9);
    let keys = vec![
        key(-0.50, assemble(tuck(0.5, 1.0, -0.3), lead(0.5, 0.9), 0.15, 0.0, 0.0)),
        key(-0.26, lying(assemble(tuck(0.85, 1.8, -0.7), lead(0.9, 0.9), 0.0, 0.0, 0.0), -0.35, 0.22, 0.0)),
        key(
            -0.08,
            looking(
                lying(assemble(tuck(0.80, 2.2, -0.9), lead(0.55, 0.35), 0.3, 0.0, 0.0), -1.0, 0.42, 0.1),
                -0.5,
                0.0,
            ),
        ),
        key(
            0.10,
            looking(
                lying(assemble(tuck(0.70, 2.3, -0.9), lead(0.40, 0.08), 0.4, 0.0, 0.0), -1.12, 0.50, 0.1),
                -0.6,
                0.0,
            ),
        ),
        key(
            0.55,
            looking(
                lying(assemble(tuck(0.75, 2.2, -0.8), lead(0.45, 0.2), 0.45, 0.0, 0.0), -1.0, 0.45, 0.1),
                -0.5,
                0.0,
            ),
        ),
        key(0.95, lying(assemble(tuck(1.1, 2.1, -0.3), lead(1.15, 1.1), 0.6, 0.0, 0.0), -0.25, 0.35, 0.0)),
        key(
            1.30,
            lying(
                assemble(
                    side([0.25, 0.0, 0.1], 1.75, 0.5, [0.4, 0.3, 0.0], 0.5),
                    side([1.45, 0.1, 0.1], 1.55, -0.1, [0.7, 0.3, 0.0], 0.6),
                    0.35,
                    0.0,
                    0.0,
                ),
                0.35,
                0.05,
                0.0,
            ),
        ),
        key(1.75, assemble(upright(), upright(), 0.15, 0.0, 0.0)),
    ];
    Act { kind: Kind::Tackle, keys, fade_s: [0.22, 0.25], loose_s: [-0.34, 1.40] }
}

fn dive() -> Act {
    let arm = |flex: f32, out: f32, elbow: f32| ([flex, out, 0.0], elbow);
    let limbs = |l: ([f32; 3], f32, f32),
                 r: ([f32; 3], f32, f32),
                 (la, le): ([f32; 3], f32),
                 (ra, re): ([f32; 3], f32)| {
        assemble(side(l.0, l.1, l.2, la, le), side(r.0, r.1, r.2, ra, re), 0.0, 0.0, 0.0)
    };
    let stretched = [arm(2.85, -0.1, 0.15), arm(2.65, 0.05, 0.25)];
    let mut keys = vec![
        key(
            -0.62,
            limbs(
                ([0.55, 0.2, 0.1], 0.85, -0.25),
                ([0.55, 0.2, 0.1], 0.85, -0.25),
                arm(0.5, 0.4, 0.9),
                arm(0.5, 0.4, 0.9),
            ),
        ),
        key(
            -0.36,
            lying(
                limbs(
                    ([0.85, 0.45, 0.2], 1.25, -0.3),
                    ([0.3, 0.4, 0.1], 0.6, 0.1),
                    arm(1.0, 0.5, 0.7),
                    arm(0.9, 0.4, 0.9),
                ),
                0.25,
                0.32,
                0.2,
            ),
        ),
        key(
            -0.18,
            lying(
                limbs(
                    ([0.25, 0.35, 0.1], 0.35, 0.5),
                    ([0.65, 0.3, 0.1], 0.9, 0.2),
                    arm(1.9, 0.3, 0.4),
                    arm(1.8, 0.2, 0.5),
                ),
                0.15,
                0.95,
                0.15,
            ),
        ),
        key(
            0.0,
            looking(
                lying(
                    limbs(
                        ([0.0, 0.15, 0.0], 0.25, 0.5),
                        ([0.55, 0.2, 0.1], 0.95, 0.4),
                        stretched[0],
                        stretched[1],
                    ),
                    0.05,
                    1.38,
                    0.1,
                ),
                0.1,
                0.0,
            ),
        ),
        key(
            0.18,
            looking(
                lying(
                    limbs(
                        ([0.1, 0.1, 0.0], 0.4, 0.4),
                        ([0.5, 0.15, 0.1], 0.8, 0.4),
                        stretched[0],
                        stretched[1],
                    ),
                    0.05,
                    1.52,
                    0.1,
                ),
                0.1,
                0.0,
            ),
        ),
        key(
            0.50,
            lying(
                limbs(
                    ([0.45, 0.05, 0.0], 0.9, 0.3),
                    ([0.75, 0.1, 0.1], 1.2, 0.3),
                    arm(2.2, -0.05, 0.7),
                    arm(1.7, 0.1, 0.9),
                ),
                0.1,
                1.55,
                0.1,
            ),
        ),
        key(
            0.95,
            lying(
                limbs(
                    ([0.9, 0.05, 0.0], 1.5, 0.3),
                    ([1.1, 0.1, 0.1], 1.6, 0.3),
                    arm(1.5, 0.1, 1.2),
                    arm(1.3, 0.1, 1.3),
                ),
                0.25,
                1.35,
                0.1,
            ),
        ),
        key(
            1.45,
            lying(
                limbs(
                    ([0.35, 0.05, 0.1], 1.85, 0.5),
                    ([1.3, 0.15, 0.1], 1.6, -0.1),
                    arm(1.0, 0.25, 0.8),
                    arm(1.0, 0.25, 1.0),
                ),
                0.5,
                0.25,
                0.0,
            ),
        ),
        key(2.0, assemble(upright(), upright(), 0.15, 0.0, 0.0)),
    ];
    // Between the push and the ground the body flies: 0.5 g (t - t0)(t1 - t) is a height under gravity alone.
    let mut flown = Vec::new();
    for key in &keys {
        let height = 0.5 * 9.81 * (key.time + 0.24) * (0.20 - key.time);
        flown.push(height.max(0.0));
    }
    keys.iter_mut().zip(flown).for_each(|(key, height)| key.pose.clearance_m = height);
    Act { kind: Kind::Dive, keys, fade_s: [0.2, 0.3], loose_s: [-0.24, 1.55] }
}

fn fall() -> Act {
    let arm = |flex: f32, out: f32| [flex, out, 0.0];
    let leg = |thigh: f32, knee: f32, ankle: f32, a: [f32; 3], elbow: f32| {
        side([thigh, 0.08, 0.1], knee, ankle, a, elbow)
    };
    let down = |l: Side, r: Side, pitch: f32, up: f32| {
        looking(lying(assemble(l, r, 0.0, 0.0, 0.0), pitch, 0.06, 0.0), up, 0.0)
    };
    let keys = vec![
        key(
            -0.55,
            assemble(
                leg(0.4, 0.6, 0.0, arm(0.2, 0.3), 0.9),
                leg(0.0, 0.7, 0.2, arm(-0.2, 0.3), 0.9),
                0.2,
                0.0,
                0.0,
            ),
        ),
        key(
            -0.30,
            down(
                leg(0.55, 0.8, -0.1, arm(1.0, 0.5), 0.7),
                leg(-0.2, 0.9, 0.4, arm(0.7, 0.6), 0.7),
                0.55,
                0.4,
            ),
        ),
        key(
            -0.10,
            down(
                leg(0.55, 1.3, 0.5, arm(1.7, 0.35), 0.5),
                leg(0.15, 1.2, 0.5, arm(1.6, 0.4), 0.5),
                1.05,
                0.6,
            ),
        ),
        key(
            0.06,
            down(leg(0.15, 0.8, 0.6, arm(2.0, 0.2), 0.9), leg(0.05, 0.7, 0.6, arm(1.9, 0.3), 0.9), 1.40, 0.6),
        ),
        key(
            0.25,
            down(leg(0.0, 0.35, 0.7, arm(2.3, 0.1), 1.3), leg(0.0, 0.3, 0.7, arm(2.2, 0.2), 1.3), 1.50, 0.45),
        ),
        key(
            0.90,
            down(leg(0.05, 0.3, 0.7, arm(2.2, 0.1), 1.4), leg(0.1, 0.4, 0.7, arm(2.1, 0.2), 1.4), 1.50, 0.3),
        ),
        key(
            1.40,
            down(leg(1.25, 1.55, 0.6, arm(1.5, 0.1), 0.3), leg(1.2, 1.5, 0.6, arm(1.5, 0.1), 0.3), 1.15, 0.3),
        ),
        key(
            1.85,
            down(
                leg(0.35, 1.85, 0.5, arm(0.6, 0.3), 0.6),
                leg(1.4, 1.6, -0.1, arm(0.8, 0.3), 0.6),
                0.45,
                0.2,
            ),
        ),
        key(2.4, assemble(upright(), upright(), 0.12, 0.0, 0.0)),
    ];
    Act { kind: Kind::Fall, keys, fade_s: [0.22, 0.3], loose_s: [-0.34, 1.95] }
}

/// The pose of a kind for a training picture: `phase` 0..1 runs through the keyed action.
#[must_use]
pub fn drawn(kind: Kind, phase: f32) -> Pose {
    let Some(act) = Act::of(kind) else { return gait::stand(0.9, phase) };
    let [first, last] = act.span_s();
    let time = first + (last - first) * phase;
    let mut pose = act.pose(time);
    if kind == Kind::Header {
        pose.clearance_m = (0.5 - 4.905 * (time + 0.02).powi(2)).max(0.0);
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_action_passes_through_its_keys_and_starts_and_ends_with_nothing() {
        for kind in Kind::KEYED {
            let act = Act::of(kind).unwrap();
            let [first, last] = act.span_s();
            assert!(first < 0.0 && last > 0.0 && act.keys.windows(2).all(|pair| pair[0].time < pair[1].time));
            assert!(act.share(first) == 0.0 && act.share(last) < 1e-6 && act.share(0.0) > 0.99, "{kind:?}");
            for key in &act.keys {
                let pose = act.pose(key.time);
                for (got, wanted) in pose.rotations.iter().zip(&key.pose.rotations) {
                    assert!(got.angle_between(*wanted) < 0.01, "{kind:?} misses its key at {} s", key.time);
                }
            }
        }
    }

    #[test]
    fn no_action_jerks() {
        for kind in Kind::KEYED {
            let act = Act::of(kind).unwrap();
            let [first, last] = act.span_s();
            let steps = ((last - first) * 100.0) as usize;
            for step in 0..steps {
                let time = first + step as f32 / 100.0;
                let (a, b) = (act.pose(time), act.pose(time + 0.01));
                let most = a
                    .rotations
                    .iter()
                    .zip(&b.rotations)
                    .map(|(a, b)| a.angle_between(*b))
                    .fold(0.0, f32::max);
                // The knee of a shot extends at about 25 rad/s (Kellis & Katis 2007); nothing else is as fast.
                assert!(most < 0.30, "{kind:?} turns a joint by {most} rad in 10 ms at {time} s");
            }
        }
    }

    #[test]
    fn the_left_dive_goes_left_and_its_mirror_right() {
        let act = Act::of(Kind::Dive).unwrap();
        let head = |pose: &Pose| (pose.rotations[Joint::Pelvis as usize] * glam::Vec3::Y).x;
        assert!(head(&act.pose(0.0)) > 0.8 && head(&act.pose(0.0).mirrored()) < -0.8);
    }
}
