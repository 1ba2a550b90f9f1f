//! The actions of football as keyed poses: pass, shot, header, throw-in, slide tackle, dive, fall.
//! Time is in seconds from the moment the ball is played (or the ground is met); angles are radians. Right foot and
//! left dive are written down, the other side is mirrored. Timings follow what broadcast pictures show.

use std::sync::LazyLock;

use glam::{Quat, Vec4};
use serde::{Deserialize, Serialize};

use crate::{
    gait,
    motion::{JOINTS, Joint, Pose},
    play::GRAVITY,
};

mod keys;

/// While a diving goalkeeper is in the air, seconds from the save.
const DIVE_AIR_S: [f32; 2] = [-0.24, 0.20];

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
        const FEET: [f32; 2] = [0.0, 0.0];
        static ALL: LazyLock<Vec<Act>> = LazyLock::new(|| {
            vec![
                act(Kind::Pass, &keys::PASS, [0.16, 0.20], FEET),
                act(Kind::Shot, &keys::SHOT, [0.18, 0.24], FEET),
                act(Kind::Header, &keys::HEADER, [0.22, 0.30], FEET),
                act(Kind::ThrowIn, &keys::THROW_IN, [0.30, 0.35], FEET),
                act(Kind::Tackle, &keys::TACKLE, [0.22, 0.25], [-0.34, 1.40]),
                act(Kind::Dive, &keys::DIVE, [0.20, 0.30], [-0.24, 1.55]),
                act(Kind::Fall, &keys::FALL, [0.22, 0.30], [-0.34, 1.95]),
            ]
        });
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

/// The pose of a row of the table.
fn pose_of(row: &keys::Row) -> Pose {
    let angle = |column: usize| f32::from(row[column]).to_radians();
    let trunk = |first: usize| {
        Quat::from_rotation_z(-angle(first + 1))
            * Quat::from_rotation_x(angle(first))
            * Quat::from_rotation_y(angle(first + 2))
    };
    let limb = |first: usize, left: bool| {
        let side = if left { 1.0 } else { -1.0 };
        Quat::from_rotation_z(side * angle(first + 1))
            * Quat::from_rotation_x(-angle(first))
            * Quat::from_rotation_y(side * angle(first + 2))
    };
    let mut pose = Pose::default();
    for (joint, rotation) in [
        (Joint::Pelvis, trunk(1)),
        (Joint::Chest, trunk(4)),
        (Joint::Neck, trunk(7)),
        (Joint::ThighL, limb(10, true)),
        (Joint::CalfL, Quat::from_rotation_x(angle(13))),
        (Joint::FootL, Quat::from_rotation_x(angle(14))),
        (Joint::ThighR, limb(15, false)),
        (Joint::CalfR, Quat::from_rotation_x(angle(18))),
        (Joint::FootR, Quat::from_rotation_x(angle(19))),
        (Joint::UpperArmL, limb(20, true)),
        (Joint::LowerArmL, Quat::from_rotation_x(-angle(23))),
        (Joint::UpperArmR, limb(24, false)),
        (Joint::LowerArmR, Quat::from_rotation_x(-angle(27))),
    ] {
        *pose.joint(joint) = rotation;
    }
    pose
}

fn act(kind: Kind, rows: &[keys::Row], fade_s: [f32; 2], loose_s: [f32; 2]) -> Act {
    let key = |row: &keys::Row| {
        let (time, mut pose) = (f32::from(row[0]) / 100.0, pose_of(row));
        if kind == Kind::Dive {
            // Between the push and the ground the body flies: g/2 (t - t0)(t1 - t) is a height under gravity alone.
            pose.clearance_m = (0.5 * GRAVITY * (time - DIVE_AIR_S[0]) * (DIVE_AIR_S[1] - time)).max(0.0);
        }
        Key { time, pose }
    };
    Act { kind, keys: rows.iter().map(key).collect(), fade_s, loose_s }
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
