//! How a football flies, bounces and rolls, and how it must be struck to come down somewhere. World metres and seconds.

use glam::{Vec2, Vec3};

use crate::{play::GRAVITY, props::BALL_RADIUS_M};

/// Drag per metre: ρ·c·A / 2m with air of 1.2 kg/m³, c = 0.25 (Asai et al. 2007, above 15 m/s), 0.22 m across, 0.43 kg.
const DRAG: f32 = 0.0133;
/// Share of the upward speed kept in a bounce on grass (a ball dropped from 2 m comes back to 0.6–1.0 m: FIFA's test).
const BOUNCE: f32 = 0.62;
/// Share of the speed along the ground kept in a bounce.
const GRIP: f32 = 0.80;
/// Deceleration of a rolling ball on grass, m/s².
const ROLL: f32 = 1.7;

/// A ball in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Middle of the ball.
    pub at: Vec3,
    /// Metres per second.
    pub velocity: Vec3,
}

impl Flight {
    /// The ball a moment later.
    pub fn advance(&mut self, seconds: f32) {
        let rolling = self.at.y < BALL_RADIUS_M + 0.005 && self.velocity.y.abs() < 0.6;
        let mut push = -self.velocity * self.velocity.length() * DRAG;
        if rolling {
            self.velocity.y = 0.0;
            let speed = self.velocity.length();
            let slower = (speed - ROLL * seconds).max(0.0);
            self.velocity *= slower / speed.max(1e-6);
        } else {
            push.y -= GRAVITY;
        }
        self.at += self.velocity * seconds + push * (seconds * seconds / 2.0);
        self.velocity += push * seconds;
        if self.at.y < BALL_RADIUS_M {
            self.at.y = BALL_RADIUS_M;
            if self.velocity.y < 0.0 {
                let down = -self.velocity.y;
                self.velocity *= if down > 0.6 { GRIP } else { 1.0 };
                self.velocity.y = if down > 0.6 { down * BOUNCE } else { 0.0 };
            }
        }
    }
}

/// The velocity that rolls a ball from `from` to `to`, so that it still has `last` m/s there, and the seconds it takes.
#[must_use]
pub fn rolled(from: Vec2, to: Vec2, last: f32) -> (Vec3, f32) {
    let way = to - from;
    let first = (last * last + 2.0 * ROLL * way.length() * 1.15).sqrt();
    let velocity = way.normalize_or(Vec2::X) * first;
    (Vec3::new(velocity.x, 0.0, velocity.y), 2.0 * way.length() / (first + last))
}

/// The velocity that takes a ball from `from` to `to` in the air at `pace` metres per second along the ground, drag
/// included, and the seconds it takes.
#[must_use]
pub fn lofted(from: Vec3, to: Vec3, pace: f32) -> (Vec3, f32) {
    const STEP: f32 = 0.01;
    let way = Vec2::new(to.x - from.x, to.z - from.z);
    let ahead = way.normalize_or(Vec2::X) * pace;
    let distance = way.length();
    let mut up = 0.0;
    let mut seconds = 0.0;
    // The upward speed that is missing is the miss over the time: a few rounds settle it.
    for _ in 0..8 {
        let start = Vec3::new(ahead.x, up, ahead.y);
        let (mut at, mut velocity) = (from, start);
        seconds = 0.0;
        while Vec2::new(at.x - from.x, at.z - from.z).length() < distance && seconds < 6.0 {
            let push = -velocity * velocity.length() * DRAG - Vec3::Y * GRAVITY;
            at += velocity * STEP;
            velocity += push * STEP;
            seconds += STEP;
        }
        up += (to.y - at.y) / seconds.max(STEP);
    }
    (Vec3::new(ahead.x, up, ahead.y), seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lofted_ball_comes_down_where_it_should() {
        let (from, to) = (Vec3::new(-10.0, 0.2, 3.0), Vec3::new(22.0, 2.0, -6.0));
        for pace in [14.0, 18.0, 25.0] {
            let (velocity, seconds) = lofted(from, to, pace);
            let mut ball = Flight { at: from, velocity };
            for _ in 0..(seconds / 0.005) as usize {
                ball.advance(0.005);
            }
            assert!(ball.at.distance(to) < 0.5, "{} for {to} at {pace} m/s", ball.at);
        }
    }

    #[test]
    fn a_rolled_ball_arrives_and_a_dropped_one_bounces_as_the_laws_of_the_game_s_tests_want() {
        let (velocity, seconds) = rolled(Vec2::ZERO, Vec2::new(15.0, 0.0), 4.0);
        let mut ball = Flight { at: Vec3::Y * 0.11, velocity };
        for _ in 0..(seconds / 0.01) as usize {
            ball.advance(0.01);
        }
        assert!((ball.at.x - 15.0).abs() < 1.2 && ball.velocity.length() < 6.0, "{ball:?}");
        let mut ball = Flight { at: Vec3::Y * 2.11, velocity: Vec3::ZERO };
        let mut bounced = false;
        let mut highest = 0.0f32;
        for _ in 0..200 {
            ball.advance(0.005);
            bounced |= ball.velocity.y > 0.0;
            highest = highest.max(if bounced { ball.at.y - 0.11 } else { 0.0 });
        }
        assert!((0.6..1.0).contains(&highest), "bounces {highest} m high");
    }
}
