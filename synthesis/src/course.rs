//! From a path to steps: where a person faces, which gait the speed asks for, and when each foot is on the ground.
//! The phase of the gait is tied to the distance run; a step that has begun is finished even when the person stops.

use std::f32::consts::{PI, TAU};

use glam::Vec2;

use crate::{
    acts::{Act, Kind},
    play::Event,
    trajectories::smooth,
};

/// Seconds that are moved before the first and after the last frame, so that both ends are in full stride.
const MARGIN_S: f32 = 1.0;
/// Samples per second at least: the contact of a sprinter lasts a tenth of a second.
const FINE_HZ: f32 = 100.0;
/// Radians per second that a body turns at most.
const TURN_MOST: f32 = 7.0;
/// Turning on the spot by one radian takes steps as walking this far does, metres.
const TURN_M: f32 = 0.42;
/// A step begun is finished at this rate, cycles per second, however slow the person is.
const FINISH_HZ: f32 = 1.1;
/// A foot is lifted again when the body has gone so far beyond it, metres and radians together, whatever the gait says.
const STRETCH: f32 = 1.05;
/// Seconds for which it is lifted then.
const LIFT_S: f32 = 0.14;
/// No foot is in the air or on the ground for less, seconds.
const LEAST_SWING_S: f32 = 0.10;
const LEAST_CONTACT_S: f32 = 0.05;
/// The left foot comes down at this phase; at 0 it is furthest ahead.
pub(crate) const TOUCHDOWN: f32 = 0.04;

/// One moment of a course.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Place of the hips on the ground (x, z).
    pub(crate) at: Vec2,
    /// Heading: 0 looks along +z, π/2 along +x.
    pub(crate) yaw: f32,
    /// Radians per second to the left.
    pub(crate) turning: f32,
    /// Velocity as the body sees it: x to its left, y ahead.
    pub(crate) own: Vec2,
    /// Acceleration as the body sees it.
    pub(crate) push: Vec2,
    /// Cycles since the start; a cycle is two steps.
    pub(crate) phase: f32,
    /// Share of the cycle for which a foot is on the ground.
    pub(crate) duty: f32,
    /// Left and right foot on the ground.
    pub(crate) planted: [bool; 2],
}

impl Sample {
    /// Metres per second.
    pub(crate) fn speed(&self) -> f32 {
        self.own.length()
    }

    /// Cosine between where the person goes and where it faces; 1 when standing.
    pub(crate) fn ahead(&self) -> f32 {
        if self.speed() > 0.1 { self.own.y / self.speed() } else { 1.0 }
    }
}

/// An event of this person on its own clock, with the side it is played on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Played {
    /// What and where.
    pub(crate) event: Event,
    /// Moment, as an index into the samples.
    pub(crate) sample: f32,
    /// Left foot, or dive to the left; acts are written for the right foot and the left dive.
    pub(crate) mirrored: bool,
}

/// A person's way through the clip, finely sampled.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    pub(crate) samples: Vec<Sample>,
    pub(crate) events: Vec<Played>,
    /// Samples per second.
    pub(crate) rate_hz: f32,
    /// Index of the first frame, and samples per frame.
    pub(crate) first: usize,
    pub(crate) per_frame: usize,
}

/// 0 below `low`, 1 above `high`, smooth between.
pub(crate) fn ease(value: f32, low: f32, high: f32) -> f32 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The nearest turn of `angle` to `reference`.
pub(crate) fn near(angle: f32, reference: f32) -> f32 {
    reference + (angle - reference + PI).rem_euclid(TAU) - PI
}

/// Metres that a whole cycle (two steps) covers at a speed, ahead; as people of 1.80 m walk and run.
fn cycle_m(speed: f32) -> f32 {
    const TABLE: [(f32, f32); 6] = [(0.0, 0.7), (1.0, 1.2), (2.0, 1.75), (3.0, 2.4), (4.0, 3.0), (8.0, 4.5)];
    let last = TABLE[TABLE.len() - 1];
    TABLE.windows(2).find(|pair| speed <= pair[1].0).map_or(last.1, |pair| {
        let share = (speed - pair[0].0) / (pair[1].0 - pair[0].0);
        pair[0].1 + (pair[1].1 - pair[0].1) * share
    })
}

/// Length of the cycle and share of it with a foot on the ground. A foot stays for about 0.9 m of the way ahead; the
/// feet do not cross when going sideways, so those steps are short.
fn stride(own: Vec2, size: f32) -> (f32, f32) {
    let speed = own.length();
    let sideways =
        if speed > 0.1 { ease(own.x.abs() / speed, 0.55, 0.9) } else { 0.0 } * ease(speed, 0.4, 1.0);
    let backwards = ease(-own.y, 0.2, 1.0);
    let cycle = cycle_m(speed) * (1.0 - 0.25 * backwards);
    let cycle = cycle + (0.75 + 0.16 * speed - cycle) * sideways;
    let reach = 0.90 - 0.25 * backwards.max(0.0) - 0.45 * sideways;
    (cycle * size, (reach / cycle).clamp(0.16, 0.62))
}

fn down(phase: f32, duty: f32) -> [bool; 2] {
    [0.0, 0.5].map(|turn| (phase - TOUCHDOWN + turn).rem_euclid(1.0) < duty)
}

impl Course {
    /// The course along `path` (x, z at `rate_hz`) of somebody who looks for the ball on the ground at `ball`.
    pub(crate) fn new(
        path: &[Vec2],
        ball: &[Vec2],
        rate_hz: f32,
        size: f32,
        phase: f32,
        events: &[Event],
    ) -> Self {
        let per_frame = (FINE_HZ / rate_hz).ceil().max(1.0) as usize;
        let fine_hz = rate_hz * per_frame as f32;
        let margin = (MARGIN_S * rate_hz).ceil() as usize;
        let first = margin * per_frame;
        let last = path.len() - 1;
        // Both ends go on as they are.
        let at = |frame: isize| -> Vec2 {
            let (from, to) = (path[0], path[last]);
            if frame < 0 {
                from + (from - path[1.min(last)]) * -frame as f32
            } else if frame as usize > last {
                to + (to - path[last.saturating_sub(1)]) * (frame - last as isize) as f32
            } else {
                path[frame as usize]
            }
        };
        let count = (path.len() - 1 + 2 * margin) * per_frame + 1;
        let place = |k: usize| k as f32 / per_frame as f32 - margin as f32;
        let xz: Vec<Vec2> = (0..count)
            .map(|k| {
                let frame = (k / per_frame) as isize - margin as isize;
                let t = (k % per_frame) as f32 / per_frame as f32;
                let [a, b, c, d] = [-1, 0, 1, 2].map(|step| at(frame + step));
                // Catmull and Rom: passes through every frame's place.
                b + 0.5
                    * t
                    * ((c - a) + t * ((2.0 * a - 5.0 * b + 4.0 * c - d) + t * (3.0 * (b - c) + d - a)))
            })
            .collect();
        let slope = |values: &[Vec2]| -> Vec<Vec2> {
            let last = values.len() - 1;
            (0..values.len())
                .map(|k| {
                    let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
                    (values[after] - values[before]) * fine_hz / (after - before).max(1) as f32
                })
                .collect()
        };
        let velocity = smooth(&slope(&xz), 0.10 * fine_hz);
        let push = smooth(&slope(&velocity), 0.12 * fine_hz);
        let ball_at = |k: usize| ball[(place(k).max(0.0) as usize).min(ball.len() - 1)];
        let played: Vec<Played> = events
            .iter()
            .map(|&event| Played {
                event,
                sample: (event.time_s * rate_hz + margin as f32) * per_frame as f32,
                mirrored: event.mirrored.unwrap_or(false),
            })
            .collect();
        let yaws = headings(&xz, &velocity, ball_at, fine_hz, &played);
        let mut samples: Vec<Sample> = (0..count)
            .map(|k| {
                let (sin, cos) = yaws[k].sin_cos();
                let own = |v: Vec2| Vec2::new(v.x * cos - v.y * sin, v.x * sin + v.y * cos);
                let before = yaws[k.saturating_sub(1)];
                Sample {
                    at: xz[k],
                    yaw: yaws[k],
                    turning: (yaws[k] - before) * fine_hz,
                    own: own(velocity[k]),
                    push: own(push[k]),
                    phase,
                    duty: 0.6,
                    planted: [true; 2],
                }
            })
            .collect();
        let mut all = Self { samples: Vec::new(), events: played, rate_hz: fine_hz, first, per_frame };
        all.events = pace(&mut samples, &all.events, fine_hz, size, phase);
        all.samples = samples;
        all.force_contacts();
        all.settle();
        all.lift_stretched();
        all
    }

    /// Seconds from an event to a sample.
    pub(crate) fn since(&self, event: &Played, sample: usize) -> f32 {
        (sample as f32 - event.sample) / self.rate_hz
    }

    fn window(&self, event: &Played, [from, to]: [f32; 2]) -> std::ops::Range<usize> {
        let at = |seconds: f32| {
            ((event.sample + seconds * self.rate_hz).round().max(0.0) as usize).min(self.samples.len())
        };
        at(from)..at(to)
    }

    /// Where the gait changes quickly a foot neither hops for a moment nor touches for one.
    fn settle(&mut self) {
        for side in [0, 1] {
            for (state, least_s) in [(false, LEAST_SWING_S), (true, LEAST_CONTACT_S)] {
                let least = (least_s * self.rate_hz) as usize;
                let mut from = 0;
                for k in 1..=self.samples.len() {
                    let now = self.samples.get(k).map(|sample| sample.planted[side]);
                    if now == Some(self.samples[from].planted[side]) {
                        continue;
                    }
                    // What is cut off by an end of the course may be longer than it looks.
                    let whole = from > 0 && now.is_some();
                    if whole && self.samples[from].planted[side] == state && k - from < least {
                        self.samples[from..k].iter_mut().for_each(|sample| sample.planted[side] = !state);
                    }
                    from = k;
                }
            }
        }
    }

    /// Sudden stops and turns leave a foot behind: it takes a step of its own.
    fn lift_stretched(&mut self) {
        let lift = (LIFT_S * self.rate_hz) as usize;
        for side in [0, 1] {
            let (mut gone, mut lifted) = (0.0, 0);
            for k in 1..self.samples.len() {
                let (before, now) = (self.samples[k - 1], self.samples[k]);
                gone += now.at.distance(before.at) + 0.8 * (now.yaw - before.yaw).abs();
                if gone > STRETCH && now.planted[side] {
                    lifted = lift;
                }
                if lifted > 0 {
                    lifted -= 1;
                    self.samples[k].planted[side] = false;
                }
                if !self.samples[k].planted[side] {
                    gone = 0.0;
                }
            }
        }
    }

    /// Where an action decides which foot stands, it overrules the gait.
    fn force_contacts(&mut self) {
        for played in self.events.clone() {
            let kind = played.event.kind;
            let middle = (played.sample.round().max(0.0) as usize).min(self.samples.len() - 1);
            let speed = self.samples[middle].speed();
            match kind {
                Kind::Pass | Kind::Shot => {
                    let (kicking, standing) = if played.mirrored { (0, 1) } else { (1, 0) };
                    let free = if kind == Kind::Pass { [-0.28, 0.27] } else { [-0.34, 0.38] };
                    for k in self.window(&played, free) {
                        self.samples[k].planted[kicking] = false;
                    }
                    // As long as the leg reaches while the body goes on.
                    let half = (0.28 / speed.max(0.5)).min(0.30);
                    for k in self.window(&played, [-half, half]) {
                        self.samples[k].planted[standing] = true;
                    }
                }
                Kind::Header => {
                    let half = played.event.air_s() / 2.0;
                    if speed < 1.5 {
                        for window in [[-half - 0.25, -half], [half, half + 0.25]] {
                            for k in self.window(&played, window) {
                                self.samples[k].planted = [true; 2];
                            }
                        }
                    }
                    for k in self.window(&played, [-half, half]) {
                        self.samples[k].planted = [false; 2];
                    }
                }
                Kind::ThrowIn => {
                    for k in self.window(&played, [-0.9, 0.6]) {
                        self.samples[k].planted = [true; 2];
                    }
                }
                _ => {
                    if let Some(act) = Act::of(kind) {
                        for k in self.window(&played, act.loose_s) {
                            self.samples[k].planted = [false; 2];
                        }
                    }
                }
            }
        }
    }
}

/// Heading at every sample: where one runs, but towards the ball when slow or when going backwards at an easy pace, and
/// where an action looks while it lasts.
fn headings(
    xz: &[Vec2],
    velocity: &[Vec2],
    ball_at: impl Fn(usize) -> Vec2,
    rate_hz: f32,
    events: &[Played],
) -> Vec<f32> {
    let angle = |v: Vec2| v.x.atan2(v.y);
    let wanted: Vec<Vec2> = (0..xz.len())
        .map(|k| {
            let to_ball = (ball_at(k) - xz[k]).normalize_or(Vec2::Y);
            let speed = velocity[k].length();
            let course = velocity[k].normalize_or(to_ball);
            let backwards = ease(-course.dot(to_ball), 0.2, 0.8) * (1.0 - ease(speed, 2.2, 3.4));
            // Sideways with the eye on the ball, when it is close and the pace allows.
            let aside = (1.0 - ease(course.dot(to_ball).abs(), 0.3, 0.7)) * (1.0 - ease(speed, 1.6, 2.8));
            let run_share = ease(speed, 0.5, 1.9) * (1.0 - backwards.max(0.85 * aside));
            let mut facing = (to_ball * (1.0 - run_share) + course * run_share).normalize_or(course);
            for played in events {
                let since = (k as f32 - played.sample) / rate_hz;
                let Some(yaw) = played.event.facing else { continue };
                let last = Act::of(played.event.kind).map_or(0.3, |act| act.span_s()[1]);
                let share = ease(since, -1.0, -0.45) * (1.0 - ease(since, last - 0.35, last));
                facing = facing.lerp(Vec2::new(yaw.sin(), yaw.cos()), share).normalize_or(facing);
            }
            facing
        })
        .collect();
    let wanted = smooth(&wanted, 0.06 * rate_hz);
    let mut yaw = angle(wanted[0]);
    let mut rate = 0.0f32;
    wanted
        .iter()
        .enumerate()
        .map(|(k, &facing)| {
            let lies = events.iter().any(|played| {
                let since = (k as f32 - played.sample) / rate_hz;
                played.event.kind.goes_down() && (-0.2..1.2).contains(&since)
            });
            let wish = if lies { 0.0 } else { (near(angle(facing), yaw) - yaw) * 9.0 };
            // A turn starts and ends within a tenth of a second.
            rate += (wish.clamp(-TURN_MOST, TURN_MOST) - rate) * (12.0 / rate_hz).min(1.0);
            yaw += rate / rate_hz;
            yaw
        })
        .collect()
}

/// Runs the phase along the samples and tells the feet; before a kick the steps are fitted so that a foot stands beside
/// the ball. Gives back the events with the side they are played on.
fn pace(samples: &mut [Sample], events: &[Played], rate_hz: f32, size: f32, start: f32) -> Vec<Played> {
    const FIT_S: f32 = 0.9;
    let mut played = events.to_vec();
    let advance = |sample: &Sample, phase: f32, held: bool, extra: f32| {
        let (cycle, duty) = stride(sample.own, size);
        let natural = (sample.speed() + TURN_M * sample.turning.abs()) / cycle;
        let stepping = down(phase, duty) != [true; 2];
        let rate = if held {
            natural
        } else if stepping {
            natural.max(FINISH_HZ)
        } else {
            natural
        };
        (phase + (rate + extra).max(0.0) / rate_hz, duty)
    };
    let kick = |played: &Played| matches!(played.event.kind, Kind::Pass | Kind::Shot | Kind::Header);
    let held = |played: &[Played], k: usize| {
        played.iter().any(|p| kick(p) && ((k as f32 - p.sample) / rate_hz).abs() < 0.3)
    };
    let mut phase = start;
    let mut extra: Option<(f32, f32)> = None; // cycles per second, until this sample
    for k in 0..samples.len() {
        if let Some(next) = (0..played.len())
            .find(|&i| kick(&played[i]) && (played[i].sample - FIT_S * rate_hz).ceil().max(0.0) as usize == k)
        {
            // Look ahead: which foot would stand when the ball is there?
            let end = (played[next].sample as usize).min(samples.len() - 1);
            let mut then = phase;
            let mut duty = 0.6;
            for (j, sample) in samples.iter().enumerate().take(end).skip(k) {
                (then, duty) = advance(sample, then, held(&played, j), 0.0);
            }
            let gap = |turn: f32| {
                let middle = TOUCHDOWN + duty * 0.5 + turn;
                (middle - then + 0.5).rem_euclid(1.0) - 0.5
            };
            // Turn 0: the left foot stands and the right one kicks.
            let choices: &[(f32, bool)] = match played[next].event.mirrored {
                Some(true) => &[(0.5, true)],
                Some(false) => &[(0.0, false)],
                None => &[(0.0, false), (0.5, true)],
            };
            let best = choices.iter().map(|&(turn, left)| (gap(turn), left));
            if let Some((gap, left)) = best.min_by(|a, b| a.0.abs().total_cmp(&b.0.abs())) {
                played[next].mirrored = left;
                extra = Some((gap / FIT_S, played[next].sample));
            }
        }
        let fit = extra.filter(|(_, until)| (k as f32) < *until).map_or(0.0, |(rate, _)| rate);
        let duty;
        samples[k].phase = phase;
        (phase, duty) = advance(&samples[k], phase, held(&played, k), fit);
        samples[k].duty = duty;
        samples[k].planted = down(samples[k].phase, duty);
    }
    played
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight(speed: f32) -> Course {
        let path: Vec<Vec2> = (0..75).map(|k| Vec2::new(k as f32 * speed / 25.0, 3.0)).collect();
        Course::new(&path, &[Vec2::new(300.0, 3.0)], 25.0, 1.0, 0.0, &[])
    }

    #[test]
    fn feet_are_on_the_ground_as_long_as_people_s_are() {
        // Walking about 0.62 of the cycle, running 0.35, sprinting 0.2 to 0.25 (Novacheck 1998, figure 1).
        for (speed, low, high) in [(1.3, 0.55, 0.66), (3.2, 0.28, 0.42), (8.0, 0.16, 0.27)] {
            let course = straight(speed);
            // Whole cycles: the share of a part of one would depend on where it begins.
            let cycles =
                |s: &&Sample| (1.0..1.0 + ((course.samples[350].phase - 1.0).floor())).contains(&s.phase);
            let middle: Vec<&Sample> = course.samples.iter().filter(cycles).collect();
            let share = middle.iter().filter(|s| s.planted[0]).count() as f32 / middle.len() as f32;
            assert!((low..high).contains(&share), "{share} at {speed} m/s");
        }
    }

    #[test]
    fn somebody_who_stops_ends_on_both_feet() {
        for start in 0..8 {
            let path: Vec<Vec2> =
                (0..100).map(|k| Vec2::new((k as f32 / 25.0 * 1.5).min(2.0), 0.0)).collect();
            let course = Course::new(&path, &[Vec2::new(300.0, 0.0)], 25.0, 1.0, start as f32 / 8.0, &[]);
            assert_eq!(course.samples[course.samples.len() - 120].planted, [true; 2]);
        }
    }

    #[test]
    fn the_heading_follows_a_turn_within_a_second_and_never_spins() {
        let path: Vec<Vec2> = (0..100)
            .map(|k| {
                if k < 50 { Vec2::new(k as f32 * 0.16, 0.0) } else { Vec2::new(7.84, (k - 49) as f32 * 0.16) }
            })
            .collect();
        let course = Course::new(&path, &[Vec2::new(0.0, -300.0)], 25.0, 1.0, 0.0, &[]);
        assert!(course.samples.iter().all(|s| s.turning.abs() <= TURN_MOST + 1e-3));
        let after = &course.samples[course.first + 75 * course.per_frame];
        assert!(near(after.yaw, 0.0).abs() < 0.15, "faces {} a second after the turn", after.yaw);
    }
}
