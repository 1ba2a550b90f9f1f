//! What becomes of the ball in a generated match: dribbled, passed, crossed, headed, shot, tackled for, out and back.

use glam::{Vec2, Vec3};
use rand::{Rng, seq::IndexedRandom};

use super::{Ball, Game, HALF, STEP_S, attack, flat, people::Person};
use crate::{
    flight::{lofted, rolled},
    props::BALL_RADIUS_M,
    trajectories::Role,
};

impl Game {
    /// Dribbles, then plays on.
    pub(super) fn hold(&mut self, by: usize, until: f32) {
        let person = &self.people[by];
        let ahead = person.velocity.normalize_or(Vec2::new(attack(self.team(by)), 0.0));
        // The ball runs ahead of the foot and is caught up with.
        let touch = 0.5 + 0.07 * person.velocity.length() * (1.0 + (self.time * 6.5).sin());
        let wanted = person.at + ahead * touch;
        let pull = (wanted - flat(self.ball.at)) * 6.0 + person.velocity - flat(self.ball.velocity);
        let velocity = flat(self.ball.velocity) + pull * (9.0 * STEP_S).min(1.0);
        self.ball.velocity = Vec3::new(velocity.x, 0.0, velocity.y);
        self.ball.at += self.ball.velocity * STEP_S;
        self.ball.at.y += (BALL_RADIUS_M - self.ball.at.y) * 0.25;
        if let Some((tackler, moment)) = self.tackler
            && self.time >= moment
        {
            self.tackler = None;
            if self.people[tackler].at.distance(flat(self.ball.at)) < 1.7 {
                self.tackle(tackler, by);
                return;
            }
        }
        let ready = self.time >= until
            && self.ball.at.distance(Vec3::new(person.at.x, BALL_RADIUS_M, person.at.y)) < 1.3;
        if ready && self.tackler.is_none() {
            self.play_on(by);
        }
    }

    /// The tackler slides into the ball, which runs on to a team-mate; the one who had it may go down too.
    fn tackle(&mut self, tackler: usize, by: usize) {
        self.people[tackler].down_until = self.time + 1.9;
        if self.rng.random_bool(0.5) {
            self.people[by].down_until = self.time + 2.4;
        }
        let team = self.team(tackler);
        let at = flat(self.ball.at);
        let free = |who: usize, p: &Person| p.team == Some(team) && who != tackler && self.standing(who);
        let to = self.nearest(at + self.people[tackler].velocity * 1.5, free).unwrap_or(tackler);
        self.send_along_ground(to, 2.0);
    }

    /// Somebody with the ball shoots, passes, or hits it out.
    fn play_on(&mut self, by: usize) {
        let (at, team) = (self.people[by].at, self.team(by));
        let goal = Vec2::new(HALF.x * attack(team), 0.0);
        if at.distance(goal) < 29.0 && self.people[by].role == Role::Player && self.rng.random_bool(0.75) {
            self.shoot(goal);
            return;
        }
        if self.rng.random_bool(if at.y.abs() > 20.0 { 0.14 } else { 0.05 }) {
            // Too long: it runs over the touchline.
            let out = Vec2::new(at.x + self.rng.random_range(4.0..14.0) * attack(team), 40.0 * at.y.signum());
            let nobody = self.nearest(out, |who, p| p.team == Some(team) && who != by).unwrap_or(by);
            let (velocity, seconds) = rolled(flat(self.ball.at), out, 5.0);
            self.ball.velocity = velocity;
            self.state = Ball::Sent { to: nobody, due: self.time + seconds + 3.0, headed: false };
            return;
        }
        let mates: Vec<(usize, f32)> = self
            .people
            .iter()
            .enumerate()
            .filter(|(who, p)| p.team == Some(team) && *who != by && self.standing(*who))
            .map(|(who, p)| {
                let way = p.at - at;
                let fit = (-((way.length() - 15.0) / 11.0).powi(2)).exp();
                let onwards = 1.0 + 0.8 * (way.x * attack(team) / 15.0).clamp(-0.9, 1.8);
                let keeper = if p.role == Role::Goalkeeper { 0.08 } else { 1.0 };
                (who, fit * onwards * keeper + 1e-4)
            })
            .collect();
        let Ok(&(mut to, _)) = mates.choose_weighted(&mut self.rng, |(_, weight)| *weight) else { return };
        let far = self.people[to].at.distance(at);
        if self.rng.random_bool(0.13) {
            // Read by an opponent on the way.
            let lane = at.lerp(self.people[to].at, 0.7);
            to = self.nearest(lane, |who, p| p.team != Some(team) && self.standing(who)).unwrap_or(to);
        }
        let flank = at.y.abs() > 16.0 && (goal.x - at.x).abs() < 35.0;
        let high = far > 24.0 || self.rng.random_bool(if flank { 0.6 } else { 0.1 });
        if high && far > 11.0 {
            self.send_high(to);
        } else {
            self.send_along_ground(to, 3.5);
        }
    }

    fn send_along_ground(&mut self, to: usize, last: f32) {
        let from = flat(self.ball.at);
        let (_, seconds) = rolled(from, self.people[to].at, last);
        let (velocity, seconds) = rolled(from, self.ahead_of(to, 0.6 * seconds.min(1.5)), last);
        self.ball.velocity = velocity;
        self.state = Ball::Sent { to, due: self.time + seconds, headed: false };
    }

    fn send_high(&mut self, to: usize) {
        let headed = self.rng.random_bool(0.6);
        let high = if headed { self.rng.random_range(1.85..2.25) } else { BALL_RADIUS_M };
        let from = self.ball.at;
        let pace = (9.0 + 0.35 * flat(from).distance(self.people[to].at)).min(21.0);
        let (_, seconds) = lofted(from, Vec3::new(self.people[to].at.x, high, self.people[to].at.y), pace);
        let meet = self.ahead_of(to, 0.7 * seconds.min(1.8));
        let (velocity, seconds) = lofted(from, Vec3::new(meet.x, high, meet.y), pace);
        self.ball.velocity = velocity;
        self.state = Ball::Sent { to, due: self.time + seconds, headed };
    }

    fn shoot(&mut self, goal: Vec2) {
        let aim = Vec3::new(
            goal.x,
            self.rng.random_range(0.25..2.3),
            self.rng.random_range(1.2..4.3) * if self.rng.random_bool(0.5) { 1.0 } else { -1.0 },
        );
        let pace = self.rng.random_range(19.0..27.0);
        let (velocity, seconds) = lofted(self.ball.at, aim, pace);
        self.ball.velocity = velocity;
        // The goalkeeper stands a little off the line: it is level with the ball a little earlier.
        self.state = Ball::Shot { side: goal.x.signum(), due: self.time + seconds, reach: aim.z };
    }

    pub(super) fn fly(&mut self, to: usize, due: f32, headed: bool) {
        self.ball.advance(STEP_S);
        if self.leaves() {
            return;
        }
        let (at, place) = (flat(self.ball.at), self.people[to].at);
        let late = self.time - due;
        if headed && late >= 0.0 {
            if place.distance(at) < 1.3 && self.ball.at.y > 1.4 {
                self.head_on(to);
            } else {
                self.state = Ball::Sent { to, due: self.time + 1.0, headed: false };
            }
            return;
        }
        if !headed && self.ball.at.y < 0.75 && place.distance(at) < 0.95 {
            self.receive(to);
            return;
        }
        // A ball that misses its man is anybody's.
        if late > 0.8 && !headed {
            let near = self.nearest(at + flat(self.ball.velocity) * 0.4, |who, _| self.standing(who));
            if let Some(other) = near {
                self.state = Ball::Sent { to: other, due: self.time + 0.6, headed: false };
            }
        }
    }

    fn head_on(&mut self, by: usize) {
        let (team, at) = (self.team(by), self.people[by].at);
        let goal = Vec2::new(HALF.x * attack(team), 0.0);
        if at.distance(goal) < 14.0 {
            let aim = Vec3::new(goal.x, 0.6, self.rng.random_range(-3.4..3.4));
            let (velocity, seconds) = lofted(self.ball.at, aim, 13.5);
            self.ball.velocity = velocity;
            self.state = Ball::Shot { side: goal.x.signum(), due: self.time + seconds, reach: aim.z };
            return;
        }
        let ahead = at + Vec2::new(attack(team) * 8.0, 0.0);
        let to = self
            .nearest(ahead, |who, p| p.team == Some(team) && who != by && self.standing(who))
            .unwrap_or(by);
        let meet = self.ahead_of(to, 0.6);
        let (velocity, seconds) = lofted(self.ball.at, Vec3::new(meet.x, BALL_RADIUS_M, meet.y), 9.5);
        self.ball.velocity = velocity;
        self.state = Ball::Sent { to, due: self.time + seconds, headed: false };
    }

    fn receive(&mut self, by: usize) {
        let until = self.time + self.rng.random_range(0.5..2.2);
        self.state = Ball::Held { by, until };
        let at = self.people[by].at;
        let team = self.team(by);
        let opponent =
            self.nearest(at, |who, p| p.team != Some(team) && p.role == Role::Player && self.standing(who));
        if let Some(opponent) = opponent
            && self.people[by].role == Role::Player
            && (2.5..9.0).contains(&self.people[opponent].at.distance(at))
            && self.rng.random_bool(0.32)
        {
            self.tackler = Some((opponent, self.time + self.people[opponent].at.distance(at) / 4.6 + 0.5));
        }
    }

    pub(super) fn shoot_on(&mut self, side: f32, due: f32, reach: f32) {
        let before = self.ball.at;
        self.ball.advance(STEP_S);
        let Some(keeper) = self.nearest(Vec2::new(side * HALF.x, 0.0), |_, p| p.role == Role::Goalkeeper)
        else {
            return;
        };
        let level = (self.ball.at.x - self.people[keeper].at.x) * side >= 0.0
            && (before.x - self.people[keeper].at.x) * side < 0.0;
        if level
            && self.ball.at.z.abs() < 3.9
            && self.people[keeper].at.y - self.ball.at.z < 2.6
            && self.rng.random_bool(0.7)
        {
            // Parried: round the post, or back into play.
            self.ball.velocity = Vec3::new(side * 5.0, 2.5, reach.signum() * 9.0);
            if (reach - self.people[keeper].at.y).abs() > 0.7 {
                self.people[keeper].down_until = self.time + 1.9;
            }
        }
        // The net holds what goes in.
        if (self.ball.at.x * side) > HALF.x + 1.4 && self.ball.at.z.abs() < 3.7 && self.ball.at.y < 2.5 {
            self.ball.velocity = Vec3::new(0.0, self.ball.velocity.y.min(0.0), 0.0);
        }
        if self.time > due + 1.6 || self.ball.at.x.abs() > HALF.x + 6.0 {
            let at = Vec2::new(side * (HALF.x - 5.0), self.ball.at.z.signum() * 6.0);
            self.state = Ball::Dead { at, by: keeper, again: self.time + 6.5, thrown: false };
        }
    }

    /// Whether the ball has left the pitch; then somebody must bring it back.
    fn leaves(&mut self) -> bool {
        let at = flat(self.ball.at);
        if at.y.abs() > HALF.y + 0.3 {
            let last = match self.state {
                Ball::Sent { to, .. } => self.team(to),
                _ => 0,
            };
            let place = Vec2::new(at.x.clamp(-50.0, 50.0), (HALF.y + 0.35) * at.y.signum());
            let may = |who: usize, p: &Person| {
                p.team == Some(1 - last) && p.role == Role::Player && self.standing(who)
            };
            let by = self.nearest(place, may).unwrap_or(0);
            let walk = self.people[by].at.distance(place) / 3.6;
            self.state = Ball::Dead { at: place, by, again: self.time + (walk + 2.6).max(3.4), thrown: true };
            return true;
        }
        if at.x.abs() > HALF.x + 0.3 {
            let side = at.x.signum();
            let Some(by) = self.nearest(Vec2::new(side * HALF.x, 0.0), |_, p| p.role == Role::Goalkeeper)
            else {
                return false;
            };
            let place = Vec2::new(side * (HALF.x - 5.0), 6.0 * at.y.signum());
            self.state = Ball::Dead { at: place, by, again: self.time + 6.0, thrown: false };
            return true;
        }
        false
    }

    /// Out of play: the ball runs out, is fetched, and put down or taken in both hands.
    pub(super) fn bring_back(&mut self, at: Vec2, by: usize, again: f32, thrown: bool) {
        let left = again - self.time;
        if left > 2.4 {
            // It runs out, to the boards at most.
            self.ball.advance(STEP_S);
            self.ball.velocity *= 0.97;
            let most = HALF + Vec2::splat(3.0);
            self.ball.at.x = self.ball.at.x.clamp(-most.x, most.x);
            self.ball.at.z = self.ball.at.z.clamp(-most.y, most.y);
        } else {
            let person = self.people[by].at;
            let hands = thrown && left < 1.5;
            let wanted = if hands {
                // Both hands go up behind the head and forwards again.
                let high =
                    if left > 0.9 { 1.25 + (1.5 - left) } else { 1.95 + 0.25 * (0.6 - left).clamp(0.0, 0.6) };
                let behind = 0.30 * (left / 0.5 - 0.4).clamp(-1.0, 1.0) * at.y.signum();
                Vec3::new(person.x, high, person.y + behind)
            } else {
                let off = if thrown { Vec2::ZERO } else { Vec2::new(-at.x.signum() * 0.5, 0.0) };
                let place = if thrown { person } else { at + off };
                Vec3::new(place.x, if thrown { 1.1 } else { BALL_RADIUS_M }, place.y)
            };
            let share = (STEP_S / (left - 0.9).clamp(0.12, 1.2) * 1.6).min(0.35);
            let before = self.ball.at;
            self.ball.at = before.lerp(wanted, share);
            self.ball.velocity = (self.ball.at - before) / STEP_S;
        }
        if left > 0.0 {
            return;
        }
        let team = self.team(by);
        if self.people[by].at.distance(at) > 1.2 {
            self.state = Ball::Dead { at, by, again: self.time + 0.6, thrown };
            return;
        }
        if thrown {
            let may = |who: usize, p: &Person| {
                p.team == Some(team)
                    && who != by
                    && (5.0..22.0).contains(&p.at.distance(at))
                    && self.standing(who)
            };
            let to = self.nearest(at - Vec2::new(0.0, 9.0 * at.y.signum()), may).unwrap_or(by);
            let meet = self.ahead_of(to, 0.4);
            let (velocity, seconds) = lofted(self.ball.at, Vec3::new(meet.x, 0.3, meet.y), 8.5);
            self.ball.velocity = velocity;
            self.state = Ball::Sent { to, due: self.time + seconds, headed: false };
        } else {
            let may = |_: usize, p: &Person| p.team == Some(team) && p.at.distance(at) > 24.0;
            let to = self.nearest(Vec2::new(10.0 * attack(team), at.y * 0.5), may).unwrap_or(by);
            self.send_high(to);
        }
    }
}
