//! Following the ball: the match slides on its table so that the ball comes to the middle, slowly enough to watch.

use std::time::Duration;

use glam::{DVec2, DVec3};

use crate::{placement::TabletopPose, scene::FrameScene};

/// Time in which the match closes two thirds of the way, seconds.
const EASE_S: f64 = 0.8;

/// Whether the ball is followed, and how far the match has been slid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Follow {
    /// Whether it is.
    pub on: bool,
    /// The point of the pitch in the middle, metres along and across.
    middle_m: DVec2,
    at: Option<Duration>,
}

impl Follow {
    /// Lets time pass; without a ball the match stays where it is.
    pub fn advance(&mut self, ball_m: Option<DVec3>, now: Duration) {
        let passed = self.at.map_or(Duration::ZERO, |at| now.saturating_sub(at));
        self.at = Some(now);
        let wanted = if self.on { ball_m.map(|ball| DVec2::new(ball.x, ball.z)) } else { Some(DVec2::ZERO) };
        if let Some(wanted) = wanted.filter(|wanted| wanted.is_finite()) {
            let share = 1.0 - (-passed.as_secs_f64() / EASE_S).exp();
            self.middle_m = self.middle_m.lerp(wanted, share);
        }
    }

    /// How far a match at `pose` is slid in the room, metres.
    #[must_use]
    pub fn slide_m(&self, pose: &TabletopPose) -> DVec3 {
        self.applied(pose).position_m - pose.position_m
    }

    /// A pose with the followed point where the centre mark was.
    #[must_use]
    pub fn applied(&self, pose: &TabletopPose) -> TabletopPose {
        let middle = DVec3::new(self.middle_m.x, 0.0, self.middle_m.y);
        TabletopPose { position_m: pose.position_m * 2.0 - pose.to_room(middle), ..*pose }
    }
}

/// The middle of a frame's ball, metres of the pitch.
#[must_use]
pub fn ball(frame: &FrameScene) -> Option<DVec3> {
    let vertices = &frame.ball.as_ref()?.vertices;
    let sum: DVec3 = vertices.iter().map(|vertex| glam::Vec3::from(vertex.position_m).as_dvec3()).sum();
    (!vertices.is_empty()).then(|| sum / vertices.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ball_comes_to_the_middle_and_the_match_goes_back_afterwards() {
        let pose =
            TabletopPose::upright(DVec3::new(0.0, 0.7, -1.0), DVec3::Y, DVec3::new(1.0, 0.0, 0.3), 0.01);
        let ball_m = DVec3::new(30.0, 0.2, -12.0);
        let mut follow = Follow { on: true, ..Follow::default() };
        for tenth in 0..100 {
            follow.advance(Some(ball_m), Duration::from_millis(100 * tenth));
        }
        let seen = follow.applied(&pose).to_room(DVec3::new(30.0, 0.0, -12.0));
        assert!(seen.distance(pose.position_m) < 1e-3, "{seen}");
        follow.advance(None, Duration::from_secs(20));
        assert!(follow.applied(&pose).to_room(DVec3::new(30.0, 0.0, -12.0)).distance(pose.position_m) < 1e-3);
        follow.on = false;
        follow.advance(Some(ball_m), Duration::from_secs(60));
        assert!(follow.applied(&pose).position_m.distance(pose.position_m) < 1e-6);
    }
}
