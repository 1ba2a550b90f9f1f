//! Who does what: reads passes, shots, headers, throw-ins, dives, tackles and falls out of the paths of people and ball,
//! recorded or generated alike. Times are seconds from the first sample; world metres.

use glam::{Vec2, Vec3};
use protocol::pitch::Pitch;

use crate::{
    acts::{Act, Kind},
    trajectories::{Path2, Role},
};

/// Metres per second squared.
pub const GRAVITY: f32 = 9.81;
/// The ball's velocity must change by so much to have been played, m/s.
const TOUCH: f32 = 3.5;
/// As fast as this it was shot or hit long, m/s; slower it was passed.
const SHOT: f32 = 15.0;
/// A ball this high is headed, metres.
const HEAD_M: f32 = 1.35;
/// So far from the ball somebody can play it, metres.
const REACH_M: f32 = 1.6;

/// Something that one person does at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// What.
    pub kind: Kind,
    /// When the ball is played or the ground is met, seconds.
    pub time_s: f32,
    /// Heading that the action asks for; `None` leaves it to the run.
    pub facing: Option<f32>,
    /// Whether it is the mirror image of the written action (left foot, dive to the right); `None` is whichever suits
    /// the step.
    pub mirrored: Option<bool>,
    /// How high the hips rise above standing, metres; headers only.
    pub lift_m: f32,
}

impl Event {
    /// Seconds in the air: up and down again under gravity.
    #[must_use]
    pub fn air_s(&self) -> f32 {
        2.0 * (2.0 * self.lift_m / GRAVITY).sqrt()
    }

    /// Height over the take-off at `since` seconds from the highest point, metres.
    #[must_use]
    pub fn rise_m(&self, since: f32) -> f32 {
        (self.lift_m - GRAVITY * since * since / 2.0).max(0.0)
    }
}

fn flat(p: Vec3) -> Vec2 {
    Vec2::new(p.x, p.z)
}

fn yaw_of(direction: Vec2) -> f32 {
    direction.x.atan2(direction.y)
}

/// The moments at which the ball changes its way, with the velocities before and after.
fn touches(ball: &[Vec3], rate_hz: f32) -> Vec<(usize, Vec3, Vec3)> {
    let span = ((0.08 * rate_hz).round() as usize).max(1);
    let velocity = |from: usize| (ball[from + span] - ball[from]) * rate_hz / span as f32;
    let change: Vec<f32> = (0..ball.len())
        .map(|k| {
            if k < span || k + span >= ball.len() {
                return 0.0;
            }
            let (before, after) = (velocity(k - span), velocity(k));
            // A bounce changes the height only, and friction takes little at once.
            if flat(after - before).length() < TOUCH && ball[k].y < 0.6 {
                0.0
            } else {
                after.distance(before)
            }
        })
        .collect();
    let around = (0.16 * rate_hz).ceil() as usize;
    (span..ball.len().saturating_sub(span))
        .filter(|&k| {
            let near = &change[k.saturating_sub(around)..(k + around + 1).min(change.len())];
            let first = change[k.saturating_sub(around)..k].iter().all(|&c| c < change[k]);
            change[k] > TOUCH && first && near.iter().all(|&c| c <= change[k])
        })
        .map(|k| (k, velocity(k - span), velocity(k)))
        .collect()
}

/// Everything that everybody does, as (person, event), in order of time.
#[must_use]
pub fn events(people: &[Path2], ball: &[Vec3], rate_hz: f32, pitch: &Pitch) -> Vec<(usize, Event)> {
    let mut found: Vec<(usize, Event)> = Vec::new();
    let seconds = |k: usize| k as f32 / rate_hz;
    let speed = |who: usize, k: usize| {
        let (xz, step) = (&people[who].xz, ((0.12 * rate_hz) as usize).max(1));
        let (before, after) = (k.saturating_sub(step), (k + step).min(xz.len() - 1));
        xz[before].distance(xz[after]) * rate_hz / (after - before).max(1) as f32
    };
    let touched = touches(ball, rate_hz);
    for &(k, before, after) in &touched {
        if ball[k].y > 2.6 {
            continue;
        }
        let at = flat(ball[k]);
        let by = people
            .iter()
            .enumerate()
            .filter(|(_, person)| person.team.is_some())
            .map(|(who, person)| (who, person.xz[k].distance(at)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((who, distance)) = by else { continue };
        if distance > REACH_M || after.length() < 4.0 {
            continue;
        }
        let out = flat(after).normalize_or(Vec2::Y);
        let over_line = people[who].xz[k].y.abs() > pitch.width_m as f32 / 2.0 - 0.6;
        let high = ball[k].y > HEAD_M;
        let kind = match () {
            () if over_line && flat(before).length() < 2.0 && (high || ball[k].y > 0.9) => Kind::ThrowIn,
            () if high && people[who].role == Role::Goalkeeper => continue,
            () if high => Kind::Header,
            () if after.length() > SHOT => Kind::Shot,
            () => Kind::Pass,
        };
        let turned = kind == Kind::ThrowIn || speed(who, k) < 2.0;
        let event = Event {
            kind,
            time_s: seconds(k),
            facing: turned.then(|| yaw_of(out)),
            mirrored: None,
            // The forehead of a person of 1.80 m is at 1.68 m.
            lift_m: if kind == Kind::Header { (ball[k].y - 1.66).clamp(0.08, 0.60) } else { 0.0 },
        };
        found.push((who, event));
    }
    found.extend(dives(people, ball, rate_hz, &touched, pitch));
    found.extend(downfalls(people, ball, rate_hz, &touched, &speed));
    without_overlap(found)
}

/// Goalkeepers throw themselves at shots that would pass beside them.
fn dives(
    people: &[Path2],
    ball: &[Vec3],
    rate_hz: f32,
    touched: &[(usize, Vec3, Vec3)],
    pitch: &Pitch,
) -> Vec<(usize, Event)> {
    let line = pitch.length_m as f32 / 2.0;
    let mut found = Vec::new();
    for &(k, _, after) in touched.iter().filter(|(_, _, after)| after.length() > 12.0) {
        let side = after.x.signum();
        let keeper = people.iter().position(|person| {
            person.role == Role::Goalkeeper
                && (person.xz[k].x - side * line).abs() < 14.0
                && person.team.is_some()
        });
        let Some(who) = keeper else { continue };
        if (ball[k].x - side * line).abs() < 3.0 {
            continue; // played by the goalkeeper
        }
        // The moment in which the ball is level with the goalkeeper.
        let until = (k + (1.8 * rate_hz) as usize).min(ball.len());
        let level = (k..until).find(|&j| (ball[j].x - people[who].xz[j].x) * side >= -0.3);
        let Some(j) = level else { continue };
        let aside = ball[j].z - people[who].xz[j].y;
        let from = flat(ball[k]) - people[who].xz[j];
        if !(0.45..4.0).contains(&aside.abs()) || ball[j].z.abs() > 6.0 || ball[j].y > 2.9 {
            continue;
        }
        let facing = yaw_of(Vec2::new(-side, (from.y / from.length().max(1.0)) * 0.5));
        // Looking along -x the left hand is at +z; looking along +x at -z.
        let left = (aside > 0.0) == (side > 0.0);
        found.push((
            who,
            Event {
                kind: Kind::Dive,
                time_s: j as f32 / rate_hz,
                facing: Some(facing),
                mirrored: Some(!left),
                lift_m: 0.0,
            },
        ));
    }
    found
}

/// Somebody who ran at the ball and then hardly moves for a while went down: after playing the ball from a tackle, else
/// from a foul or a trip.
fn downfalls(
    people: &[Path2],
    ball: &[Vec3],
    rate_hz: f32,
    touched: &[(usize, Vec3, Vec3)],
    speed: &impl Fn(usize, usize) -> f32,
) -> Vec<(usize, Event)> {
    let frames = |seconds: f32| (seconds * rate_hz) as usize;
    let mut found = Vec::new();
    for (who, person) in people.iter().enumerate().filter(|(_, p)| p.team.is_some() && p.role == Role::Player)
    {
        let mut k = frames(0.6);
        while k + frames(1.6) < ball.len() {
            let ran = speed(who, k) > 4.2;
            let stopped = (frames(0.75)..frames(1.6))
                .step_by(frames(0.2).max(1))
                .all(|later| speed(who, k + later) < 1.3);
            let at_ball = person.xz[k].distance(flat(ball[k])) < 2.2 && ball[k].y < 1.0;
            let opponent = people.iter().any(|other| {
                other.team.is_some() && other.team != person.team && other.xz[k].distance(person.xz[k]) < 1.9
            });
            if ran && stopped && at_ball && opponent {
                let played = touched
                    .iter()
                    .map(|(t, _, _)| *t)
                    .find(|&t| t.abs_diff(k) < frames(0.5) && person.xz[t].distance(flat(ball[t])) < 2.0);
                let (kind, moment) = match played {
                    Some(touch) => (Kind::Tackle, touch),
                    None => (Kind::Fall, k + frames(0.35)),
                };
                let run = person.xz[k] - person.xz[k - frames(0.2)];
                let facing = Some(yaw_of(run.normalize_or(Vec2::Y)));
                found.push((
                    who,
                    Event { kind, time_s: moment as f32 / rate_hz, facing, mirrored: None, lift_m: 0.0 },
                ));
                k += frames(2.5);
            } else {
                k += frames(0.08).max(1);
            }
        }
    }
    found
}

/// Nobody does two things at once: who goes down does nothing else, and of two other actions the first counts.
fn without_overlap(mut found: Vec<(usize, Event)>) -> Vec<(usize, Event)> {
    let span = |event: &Event| {
        let [first, last] = Act::of(event.kind).map_or([0.0; 2], Act::span_s);
        // Two kicks may follow each other while the swing of the first runs out.
        let shorter = if event.kind.goes_down() { 1.0 } else { 0.55 };
        [event.time_s + first * shorter, event.time_s + last * shorter]
    };
    found.sort_by(|a, b| {
        b.1.kind.goes_down().cmp(&a.1.kind.goes_down()).then(a.1.time_s.total_cmp(&b.1.time_s))
    });
    let mut kept: Vec<(usize, Event)> = Vec::new();
    for (who, event) in found {
        let [first, last] = span(&event);
        let clear = kept.iter().filter(|(other, _)| *other == who).all(|(_, other)| {
            let [from, to] = span(other);
            last < from || first > to
        });
        if clear {
            kept.push((who, event));
        }
    }
    kept.sort_by(|a, b| a.1.time_s.total_cmp(&b.1.time_s).then(a.0.cmp(&b.0)));
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f32 = 25.0;

    fn person(role: Role, team: u8, xz: impl Fn(f32) -> Vec2) -> Path2 {
        Path2 { role, team: Some(team), number: Some(9), xz: (0..100).map(|k| xz(k as f32 / RATE)).collect() }
    }

    /// At rest at `from` until second 2, then off with `velocity`.
    fn played(from: Vec3, velocity: Vec3) -> Vec<Vec3> {
        (0..100)
            .map(|k| {
                let t = (k as f32 / RATE - 2.0).max(0.0);
                let y =
                    from.y + velocity.y * t - GRAVITY * t * t / 2.0 * f32::from(u8::from(velocity.y > 0.0));
                (from + velocity * t).with_y(y.max(0.11))
            })
            .collect()
    }

    fn only(people: &[Path2], ball: &[Vec3]) -> (usize, Event) {
        let found = events(people, ball, RATE, &Pitch::default());
        assert_eq!(found.len(), 1, "{found:?}");
        found[0]
    }

    #[test]
    fn the_pace_of_the_ball_tells_a_pass_from_a_shot() {
        let people =
            [person(Role::Player, 0, |_| Vec2::ZERO), person(Role::Player, 0, |_| Vec2::new(0.0, 9.0))];
        for (pace, kind) in [(8.0, Kind::Pass), (24.0, Kind::Shot)] {
            let (who, event) = only(&people, &played(Vec3::new(0.3, 0.11, 0.2), Vec3::new(-pace, 0.0, 0.0)));
            assert_eq!((who, event.kind), (0, kind));
            assert!((event.time_s - 2.0).abs() < 0.1, "at {} s", event.time_s);
        }
    }

    #[test]
    fn a_high_ball_is_headed_with_a_jump_as_high_as_it_needs() {
        let people = [person(Role::Player, 0, |_| Vec2::ZERO)];
        let ball: Vec<Vec3> = (0..100)
            .map(|k| {
                let t = k as f32 / RATE - 2.0;
                Vec3::new(if t < 0.0 { t * 10.0 } else { -t * 7.0 }, 2.05 - t.abs() * 0.5, 0.0)
            })
            .collect();
        let (_, event) = only(&people, &ball);
        assert_eq!(event.kind, Kind::Header);
        assert!((0.3..0.5).contains(&event.lift_m));
        assert!((event.rise_m(0.0) - event.lift_m).abs() < 1e-6 && event.rise_m(event.air_s() / 2.0) < 1e-3);
    }

    #[test]
    fn a_ball_from_hands_behind_the_line_is_thrown_in() {
        let people = [person(Role::Player, 1, |_| Vec2::new(10.0, 34.3))];
        let (_, event) = only(&people, &played(Vec3::new(10.0, 2.2, 34.1), Vec3::new(4.0, 2.0, -9.0)));
        assert_eq!(event.kind, Kind::ThrowIn);
        assert!(event.facing.unwrap().cos() < 0.0, "faces the pitch, that is −z");
    }

    #[test]
    fn a_goalkeeper_dives_to_the_side_of_the_shot() {
        for (z, right) in [(2.2, false), (-2.2, true)] {
            let people = [
                person(Role::Player, 0, |_| Vec2::new(35.0, 0.0)),
                person(Role::Goalkeeper, 1, |_| Vec2::new(51.0, 0.0)),
            ];
            let ball = played(Vec3::new(35.2, 0.11, 0.0), Vec3::new(22.0, 0.0, 22.0 * z / 16.0));
            let found = events(&people, &ball, RATE, &Pitch::default());
            let dive = found.iter().find(|(_, event)| event.kind == Kind::Dive).unwrap();
            // Looking along −x, +z is to the left; the act is mirrored for the right.
            assert_eq!((dive.0, dive.1.mirrored), (1, Some(right)));
        }
    }

    #[test]
    fn a_bouncing_ball_is_nobody_s() {
        let people = [person(Role::Player, 0, |_| Vec2::ZERO)];
        let ball: Vec<Vec3> = (0..100)
            .map(|k| {
                let t = (k as f32 / RATE).rem_euclid(0.8) - 0.4;
                Vec3::new(k as f32 * 0.02 - 1.0, 0.11 + 4.9 * (0.16 - t * t), 0.0)
            })
            .collect();
        assert_eq!(events(&people, &ball, RATE, &Pitch::default()), vec![]);
    }
}
