//! From a path to poses: the gait that speed and direction ask for, the actions laid over it, and feet that stand still.
//! One entry per frame, with what the truth files say about it: action, contacts, height above the ground.

use glam::{Quat, Vec2, Vec3};

use crate::{
    SynthesisError,
    acts::{Act, Kind},
    course::{Course, Played, Sample, TOUCHDOWN, ease, near},
    figure::Figure,
    footing::{self, Wish},
    gait,
    legs::{Legs, SIDES},
    limits,
    motion::{Clip, Joint, Motions, Pose},
    play::Event,
    rig::{Placement, Probes},
    trajectories::{Path2, Role},
};

/// Half the air time that the keyed header is written for, seconds.
const HEADER_HALF_S: f32 = 0.27;
/// A body may sink so far into the grass before it is lifted, metres: cloth and grass give.
const SINK_M: f32 = 0.006;

/// One frame of somebody's movement.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The ground point under the hips, and the heading.
    pub placement: Placement,
    /// The joints.
    pub pose: Pose,
    /// Height of the middle of the hips over the ground, metres.
    pub hips_m: f32,
    /// What the person does.
    pub kind: Kind,
    /// Whether the left and the right foot are on the ground and keep their place.
    pub contacts: [bool; 2],
    /// Height of the lowest sole above the ground, metres; 0 in contact.
    pub clearance_m: f32,
}

/// Where a person is, how it faces and what it does, frame by frame.
#[derive(Clone, Debug)]
pub struct Movement {
    /// One entry per frame.
    pub steps: Vec<Step>,
}

/// What one person's movement is made from.
#[derive(Clone, Copy, Debug)]
pub struct Habits {
    /// Chooses how the person stands and carries the arms, 0..1.
    pub mood: f32,
    /// Offset of the cycle, 0..1.
    pub phase: f32,
    /// Height compared with 1.80 m: taller people take longer steps.
    pub size: f32,
}

/// The recorded gaits, and who uses them.
struct Gaits<'a> {
    walk: &'a Clip,
    run: &'a Clip,
    habits: Habits,
    keeper: bool,
    legs: &'a Legs,
}

impl Movement {
    /// The movement of `figure` along `path`, both it and `ball` at `rate_hz`; `events` are what this person does.
    pub fn along(
        path: &Path2,
        ball: &[Vec3],
        rate_hz: f32,
        motions: &Motions,
        habits: Habits,
        events: &[Event],
        figure: &Figure,
    ) -> Result<Self, SynthesisError> {
        let ground: Vec<Vec2> = ball.iter().map(|ball| Vec2::new(ball.x, ball.z)).collect();
        let course = Course::new(&path.xz, &ground, rate_hz, habits.size, habits.phase, events);
        let (legs, probes) = (Legs::of(figure), Probes::of(figure));
        let gaits = Gaits {
            walk: motions.clip("walk")?,
            run: motions.clip("run")?,
            habits,
            keeper: path.role == Role::Goalkeeper,
            legs: &legs,
        };
        let mut kinds = Vec::with_capacity(course.samples.len());
        let wishes: Vec<Wish> = (0..course.samples.len())
            .map(|k| {
                let frame = (k as f32 / course.per_frame as f32
                    - course.first as f32 / course.per_frame as f32)
                    .max(0.0);
                let to_ball = ground[(frame as usize).min(ground.len() - 1)] - course.samples[k].at;
                let (wish, kind) = gaits.wish(&course, k, to_ball, figure, &probes);
                kinds.push(kind);
                wish
            })
            .collect();
        let stances = footing::stand(&course, &legs, &wishes);
        let steps = (0..path.xz.len()).map(|frame| {
            let k = course.first + frame * course.per_frame;
            let (sample, stance) = (&course.samples[k], &stances[k]);
            let (pose, mut hips_m) = (stance.pose, stance.hips_m);
            let deep = -SINK_M - (probes.lowest_m(figure, &pose) + hips_m);
            hips_m += deep.max(0.0);
            let clearance = |side: usize| match sample.planted[side] {
                true => 0.0,
                false => (legs.sole_y(&legs.foot(&pose, side), side) + hips_m).max(0.0),
            };
            let anchor_m = Vec3::new(path.xz[frame].x, 0.0, path.xz[frame].y);
            Step {
                placement: Placement { anchor_m, yaw: sample.yaw },
                pose,
                hips_m,
                kind: kinds[k],
                contacts: sample.planted,
                clearance_m: clearance(0).min(clearance(1)),
            }
        });
        Ok(Self { steps: steps.collect() })
    }
}

/// The phase of a recorded gait at which its foot has come as far as ours has at `own`: the time on the ground and the
/// time in the air are stretched apart, because the share of each depends on the pace.
fn fitted(own: f32, duty: f32, leave: f32) -> f32 {
    let since = (own - TOUCHDOWN).rem_euclid(1.0);
    let stay = leave - TOUCHDOWN;
    TOUCHDOWN
        + if since < duty { since / duty * stay } else { stay + (since - duty) / (1.0 - duty) * (1.0 - stay) }
}

/// A gait whose trunk and arms are at `phase` and whose legs are each where `leg` puts them.
fn in_step(gait: impl Fn(f32) -> Pose, phase: f32, leg: impl Fn(f32) -> f32) -> Pose {
    let mut pose = gait(phase);
    let (left, right) = (gait(leg(phase)), gait(leg(phase + 0.5) - 0.5));
    for (own, joints) in [
        (left, [Joint::ThighL, Joint::CalfL, Joint::FootL]),
        (right, [Joint::ThighR, Joint::CalfR, Joint::FootR]),
    ] {
        for joint in joints {
            *pose.joint(joint) = own.rotations[joint as usize];
        }
    }
    pose
}

impl Gaits<'_> {
    /// What the legs should do at a sample, before the feet are fixed, and how that is called.
    fn wish(
        &self,
        course: &Course,
        k: usize,
        to_ball: Vec2,
        figure: &Figure,
        probes: &Probes,
    ) -> (Wish, Kind) {
        let sample = &course.samples[k];
        let time = k as f32 / course.rate_hz;
        let (mut pose, half_stance_m, mut kind) = self.gait(sample, time, to_ball);
        limits::keep(&mut pose);
        self.look(&mut pose, sample, to_ball, 1.0);
        let mut wish = Wish { pose, hips_m: 0.0, loose: [0.0; 2], rise_m: 0.0, half_stance_m };
        wish.hips_m = self.hips_over_soles(&wish.pose);
        for played in &course.events {
            let mut since = course.since(played, k);
            let Some(act) = Act::of(played.event.kind) else { continue };
            if act.kind == Kind::Header {
                since *= (HEADER_HALF_S / (played.event.air_s() / 2.0)).clamp(0.7, 1.7);
            }
            let share = act.share(since);
            if share <= 0.0 {
                continue;
            }
            let before = wish.hips_m;
            wish.pose = act.over(&wish.pose, since, played.mirrored);
            limits::keep(&mut wish.pose);
            wish.hips_m = if act.kind.goes_down() {
                let lying = wish.pose.clearance_m - probes.lowest_m(figure, &wish.pose);
                wish.loose = [share; 2];
                before + (lying - before) * share
            } else {
                self.grounded(act, played, &wish.pose, course.since(played, k), share)
            };
            if matches!(act.kind, Kind::Pass | Kind::Shot) {
                wish.loose[usize::from(!played.mirrored)] = share;
            }
            if act.kind == Kind::Header {
                wish.rise_m = played.event.rise_m(course.since(played, k));
            }
            if share > 0.5 {
                kind = act.kind;
            }
        }
        (wish, kind)
    }

    /// Height of the hips in an action on the feet. In the air they keep the height of a stretched take-off, so that the
    /// hips, not the drawn-up feet, fly the parabola.
    fn grounded(&self, act: &Act, played: &Played, pose: &Pose, since: f32, share: f32) -> f32 {
        let own = self.hips_over_soles(pose);
        if act.kind != Kind::Header {
            return own;
        }
        let half = played.event.air_s() / 2.0;
        let stretched = self.legs.standing_m() + 0.03;
        let air = ease(since, -half - 0.06, -half) * (1.0 - ease(since, half, half + 0.06));
        own + (stretched - own) * air * share
    }

    fn hips_over_soles(&self, pose: &Pose) -> f32 {
        let lowest = SIDES.map(|side| self.legs.sole_y(&self.legs.foot(pose, side), side));
        pose.clearance_m - lowest[0].min(lowest[1])
    }

    /// The gait at a sample, half the distance of the feet, and its name.
    fn gait(&self, sample: &Sample, time: f32, to_ball: Vec2) -> (Pose, f32, Kind) {
        let (speed, ahead, phase) = (sample.speed(), sample.ahead(), sample.phase);
        let habits = self.habits;
        let ready = if self.keeper { 1.0 - ease(to_ball.length(), 22.0, 34.0) } else { 0.0 };
        let stand = gait::stand(habits.mood, time * 0.35 + habits.phase);
        let stand = stand.blend(&gait::stand(0.55, time * 0.5 + habits.phase), ready);
        let moving = ease(speed, 0.15, 0.75);
        let (to_jog, to_sprint) = (ease(speed, 1.7, 2.7), ease(speed, 4.2, 7.0));
        let on_feet = |phase: f32| {
            let pose = stand.blend(&self.walk.pose(phase).facing_ahead(), moving);
            let jog = self.run.pose(phase).facing_ahead().blend(&gait::stride(&gait::JOG, phase), 0.4);
            let pose = pose.blend(&jog, to_jog);
            pose.blend(&gait::stride(&gait::SPRINT, phase), 0.75 * to_sprint)
        };
        // The steps of a run backwards are those of one ahead in the other order.
        let backwards = |phase: f32| {
            let steps = gait::stride(&gait::BACKPEDAL, phase);
            stand.blend(&steps.blend(&self.walk.pose(phase).facing_ahead(), 0.3), moving)
        };
        // The clips take a foot off the ground at this phase.
        let leave = 0.58 - 0.12 * to_jog;
        let back = 1.0 - ease(ahead, -0.6, -0.1);
        let side = (1.0 - ease(ahead.abs(), 0.4, 0.75)) * ease(speed, 0.4, 0.9);
        let mut pose = in_step(on_feet, phase, |own| fitted(own, sample.duty, leave));
        if back > 0.0 {
            let turned =
                in_step(backwards, -phase, |own| TOUCHDOWN + leave - fitted(-own, sample.duty, leave));
            pose = pose.blend(&turned, back);
        }
        pose = pose.blend(&gait::stride(&gait::SHUFFLE, phase), side);
        // Arms are carried in each person's own way.
        let out = 0.22 * (habits.mood - 0.4);
        for (joint, sign) in [(Joint::UpperArmL, 1.0), (Joint::UpperArmR, -1.0)] {
            let arm = pose.joint(joint);
            *arm = Quat::from_rotation_z(sign * out * moving) * *arm;
        }
        // The trunk leans against the change of speed: a body of mass m pushed with m·a needs a lean of about a/g.
        let lean = (sample.push * 0.055).clamp_length_max(0.28);
        let pelvis = pose.joint(Joint::Pelvis);
        *pelvis = Quat::from_rotation_x(lean.y) * Quat::from_rotation_z(-lean.x) * *pelvis;
        let width = |still: f32, moved: f32, share: f32| still + (moved - still) * share;
        let half = width(0.115 + 0.05 * habits.mood * habits.mood, 0.19, ready);
        let half = width(width(half, 0.065, moving), 0.045, to_jog);
        let half = width(half, 0.17, side) * habits.size;
        let kind = match () {
            () if speed < 0.45 && sample.turning.abs() > 1.2 => Kind::Turn,
            () if speed < 0.45 => {
                if ready > 0.5 {
                    Kind::KeeperSet
                } else {
                    Kind::Stand
                }
            }
            () if ahead < -0.5 => Kind::Backwards,
            () if ahead < 0.5 => Kind::Sideways,
            () if speed < 2.1 => Kind::Walk,
            () if speed < 5.5 => Kind::Jog,
            () => Kind::Sprint,
        };
        (pose, half, kind)
    }

    /// The head looks for the ball, as far as a neck turns.
    fn look(&self, pose: &mut Pose, sample: &Sample, to_ball: Vec2, share: f32) {
        let look = (near(to_ball.x.atan2(to_ball.y), sample.yaw) - sample.yaw).clamp(-0.9, 0.9);
        let neck = pose.joint(Joint::Neck);
        *neck = Quat::from_rotation_y(0.6 * look * share) * *neck;
        limits::keep(pose);
    }
}

#[cfg(test)]
pub(crate) mod tests;
