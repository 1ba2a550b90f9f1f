//! Where the match is drawn while it moves to where it should be: eased, and never faster than the eye follows.

use std::time::Duration;

use crate::placement::TabletopPose;

/// Time in which a small gap closes to a third, seconds.
const EASE_S: f64 = 0.15;
/// The most, metres a second.
pub(super) const MOST_SPEED_M: f64 = 0.5;
/// The most, radians a second.
pub(super) const MOST_TURN: f64 = 1.0;
/// The most, change of the scale's natural logarithm a second.
const MOST_GROWTH: f64 = 1.0;
/// Opacity a second.
const FADE: f64 = 4.0;
/// Gaps that nobody sees are closed: metres, radians, logarithm of the scale.
const CLOSED: f64 = 1e-6;

/// A pose on its way to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blend {
    pub(super) shown: TabletopPose,
    pub(super) target: TabletopPose,
    opacity: f64,
    target_opacity: f64,
}

impl Blend {
    /// There already, still invisible.
    pub(super) fn at(pose: TabletopPose) -> Self {
        Self { shown: pose, target: pose, opacity: 0.0, target_opacity: 1.0 }
    }

    /// The same, on its way somewhere else.
    pub(super) fn towards(self, target: TabletopPose) -> Self {
        Self { target, ..self }
    }

    /// Under a hand: no easing.
    pub(super) fn jump(&mut self, pose: TabletopPose) {
        self.shown = pose;
        self.target = pose;
    }

    pub(super) fn fade_to(&mut self, opacity: f64) {
        self.target_opacity = opacity;
    }

    pub(super) fn opacity(&self) -> f64 {
        self.opacity
    }

    pub(super) fn is_moving(&self) -> bool {
        self.shown != self.target || self.opacity != self.target_opacity
    }

    pub(super) fn advance(&mut self, passed: Duration) {
        let seconds = passed.as_secs_f64();
        let fade = FADE * seconds;
        self.opacity += (self.target_opacity - self.opacity).clamp(-fade, fade);
        if self.shown == self.target {
            return;
        }
        let eased = 1.0 - (-seconds / EASE_S).exp();
        let share = |gap: f64, most: f64| {
            if gap < CLOSED { 1.0 } else { eased.min(most * seconds / gap) }
        };
        let (from, to) = (&self.shown, &self.target);
        let way = to.position_m - from.position_m;
        // The shorter way round: a quaternion and its opposite are the same turn.
        let to_orientation =
            if from.orientation.dot(to.orientation) < 0.0 { -to.orientation } else { to.orientation };
        let angle = from.orientation.angle_between(to_orientation);
        let growth = (to.scale / from.scale).ln();
        let shares =
            [share(way.length(), MOST_SPEED_M), share(angle, MOST_TURN), share(growth.abs(), MOST_GROWTH)];
        if shares == [1.0; 3] {
            self.shown = self.target;
            return;
        }
        self.shown = TabletopPose {
            position_m: from.position_m + way * shares[0],
            orientation: from.orientation.slerp(to_orientation, shares[1]).normalize(),
            scale: from.scale * (growth * shares[2]).exp(),
        };
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn it_arrives_without_haste() {
        let start = TabletopPose::upright(DVec3::ZERO, DVec3::Y, DVec3::X, 0.01);
        let end = TabletopPose::upright(DVec3::new(0.4, 0.1, 0.0), DVec3::Y, DVec3::Z, 0.02);
        let mut blend = Blend::at(start);
        blend.target = end;
        let step = Duration::from_millis(11);
        let mut steps = 0;
        while blend.is_moving() {
            let before = blend.shown;
            blend.advance(step);
            let moved = blend.shown.position_m.distance(before.position_m);
            let turned = blend.shown.orientation.angle_between(before.orientation);
            assert!(moved <= MOST_SPEED_M * 0.011 + 1e-5 && turned <= MOST_TURN * 0.011 + 1e-5);
            steps += 1;
            assert!(steps < 500, "it never arrives: {blend:?}");
        }
        assert_eq!(blend.shown, end);
        let mut slow = Blend::at(start);
        slow.target = end;
        slow.advance(Duration::from_secs(3600));
        slow.advance(Duration::ZERO);
        assert!(slow.shown.position_m.distance(end.position_m) < 1e-6, "an hour is enough: {slow:?}");
    }
}
