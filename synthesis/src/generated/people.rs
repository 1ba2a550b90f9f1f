//! How people of a generated match run: to their place in the formation, to the ball, to the man, to a tackle.

use glam::Vec2;
use rand::Rng;

use super::{Ball, Game, HALF, STEP_S, attack, flat};
use crate::trajectories::Role;

/// Somebody on the pitch.
pub(super) struct Person {
    pub(super) role: Role,
    pub(super) team: Option<u8>,
    pub(super) number: Option<u8>,
    pub(super) home: Vec2,
    /// How far the place moves with the ball, along and across.
    pub(super) follow: Vec2,
    pub(super) at: Vec2,
    pub(super) velocity: Vec2,
    pub(super) roam: [f32; 2],
    /// Lies or recovers until then.
    pub(super) down_until: f32,
    pub(super) path: Vec<Vec2>,
}

impl Person {
    pub(super) fn new(
        role: Role,
        shirt: Option<(u8, u8)>,
        home: Vec2,
        follow: Vec2,
        rng: &mut impl Rng,
    ) -> Self {
        Self {
            role,
            team: shirt.map(|(team, _)| team),
            number: shirt.map(|(_, number)| number),
            home,
            follow,
            at: home,
            velocity: Vec2::ZERO,
            roam: [rng.random_range(0.0..std::f32::consts::TAU), rng.random_range(0.12..0.4)],
            down_until: 0.0,
            path: Vec::new(),
        }
    }

    /// Runs towards `target`, at `most` m/s: no faster than needed, no harder than legs push.
    pub(super) fn run(&mut self, target: Vec2, most: f32) {
        let way = target - self.at;
        let distance = way.length();
        // Nobody shuffles about for half a step.
        let wanted = if distance < 0.6 { 0.0 } else { (0.75 * distance).min(most) };
        let push = (way.normalize_or(Vec2::ZERO) * wanted - self.velocity) * 2.4;
        let most_push = 3.2 + 1.8 * (-push.dot(self.velocity)).clamp(0.0, 1.0);
        self.velocity += push.clamp_length_max(most_push) * STEP_S;
        self.at += self.velocity * STEP_S;
    }
}

impl Game {
    pub(super) fn move_people(&mut self) {
        let ball = flat(self.ball.at);
        let time = self.time;
        // The nearest of the side without the ball presses.
        let with = match self.state {
            Ball::Held { by, .. } => Some(by),
            Ball::Sent { to, .. } => Some(to),
            Ball::Shot { .. } | Ball::Dead { .. } => None,
        };
        let presser = with.and_then(|who| {
            let team = self.people[who].team;
            self.nearest(ball, |who, p| p.team != team && p.role == Role::Player && self.standing(who))
        });
        let wishes: Vec<(Vec2, f32)> =
            (0..self.people.len()).map(|who| self.wish(who, ball, with, presser)).collect();
        let places: Vec<Vec2> = self.people.iter().map(|p| p.at).collect();
        for (who, person) in self.people.iter_mut().enumerate() {
            let (target, most) = wishes[who];
            if person.down_until > time {
                // Slides to a halt.
                person.velocity *= 1.0 - 3.6 * STEP_S;
                if person.velocity.length() < 0.15 {
                    person.velocity = Vec2::ZERO;
                }
                person.at += person.velocity * STEP_S;
            } else {
                person.run(target, most);
            }
            for (other, place) in places.iter().enumerate() {
                let gap = person.at - *place;
                if other != who && gap.length() < 0.9 {
                    person.at += gap.normalize_or(Vec2::X) * (0.9 - gap.length()) * 0.04;
                }
            }
            person.path.push(person.at);
        }
    }

    /// Where somebody wants to be, and how fast to get there.
    fn wish(&self, who: usize, ball: Vec2, with: Option<usize>, presser: Option<usize>) -> (Vec2, f32) {
        let person = &self.people[who];
        let roam = Vec2::from_angle(person.roam[0] + self.time * person.roam[1]) * 1.8;
        let Some(team) = person.team else {
            let target = person.home + ball * person.follow;
            return if person.role == Role::Assistant {
                let half = if person.home.x > 0.0 { [0.0, 51.0] } else { [-51.0, 0.0] };
                (Vec2::new(target.x.clamp(half[0], half[1]), person.home.y), 6.5)
            } else {
                (target + roam, 6.0)
            };
        };
        if person.role == Role::Goalkeeper {
            match self.state {
                Ball::Shot { side, due, reach } if side == -attack(team) => {
                    let left = due - self.time;
                    // The arms do the last metre.
                    let aside = reach.clamp(-3.4, 3.4) - person.at.y;
                    let aside = aside.signum() * (aside.abs() - 1.0).max(0.0);
                    let target = if left < 0.75 { person.at.y + aside * 1.6 } else { person.at.y };
                    return (Vec2::new(person.at.x, target), 5.5);
                }
                Ball::Dead { at, by, .. } if by == who => {
                    return (at + Vec2::new(-at.x.signum(), 0.0) * 0.1, 2.6);
                }
                Ball::Held { by, .. } if by == who => {
                    return (person.at + Vec2::new(attack(team) * 3.0, 0.0), 2.0);
                }
                Ball::Sent { to, .. } if to == who => return (ball + flat(self.ball.velocity) * 0.4, 5.0),
                _ => {
                    let line = Vec2::new(person.home.x.signum() * 51.0, 0.0);
                    let out =
                        (ball - line).normalize_or(Vec2::X) * (1.5 + 0.05 * ball.distance(line)).min(7.0);
                    return (line + out, 3.2);
                }
            }
        }
        match self.state {
            Ball::Held { by, .. } if by == who => {
                let goal = Vec2::new(HALF.x * attack(team), 0.0);
                let way = (goal - person.at).normalize_or(Vec2::X) + Vec2::from_angle(person.roam[0]) * 0.5;
                let most = if person.at.distance(goal) < 12.0 { 2.0 } else { 3.0 + 2.5 * person.roam[1] };
                return ((person.at + way * 9.0).clamp(-HALF + 2.0, HALF - 2.0), most);
            }
            Ball::Sent { to, due, headed } if to == who => {
                let left = (due - self.time).max(0.15);
                let meet = if headed || self.ball.at.y > 1.0 {
                    ball + flat(self.ball.velocity) * left
                } else {
                    ball + flat(self.ball.velocity) * (person.at.distance(ball) / 11.0).min(left)
                };
                return (meet, 7.5);
            }
            Ball::Dead { at, by, .. } if by == who => return (at, 4.2),
            _ => {}
        }
        if let Some((tackler, moment)) = self.tackler
            && tackler == who
        {
            let left = (moment - self.time).max(0.05);
            let meet = ball + flat(self.ball.velocity) * left.min(0.5);
            // Over the ball, not to it: a tackle does not brake.
            let through = meet + (meet - person.at).normalize_or(Vec2::X) * 4.0;
            return (through, (person.at.distance(meet) / left).clamp(4.8, 7.2));
        }
        let place = (person.home + ball * person.follow + roam).clamp(-HALF + 2.0, HALF - 2.0);
        if presser == Some(who) {
            let goal = Vec2::new(-HALF.x * attack(team), 0.0);
            let off = if with.is_some_and(|w| self.people[w].role == Role::Goalkeeper) { 9.0 } else { 2.3 };
            return (ball + (goal - ball).normalize_or(Vec2::X) * off, 6.2);
        }
        // In front of goal both sides fill the box; otherwise shape is kept at an easy pace.
        let far = person.at.distance(place);
        (
            place,
            if far > 9.0 {
                6.4
            } else if far > 4.0 {
                4.0
            } else {
                2.0
            },
        )
    }
}
