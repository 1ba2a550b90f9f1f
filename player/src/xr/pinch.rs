//! Pointing and pinching with a bare hand, from the joints that hand tracking reports.
//!
//! Used where the runtime has no interaction profile for hands. The ray starts between thumb and index finger and runs
//! away from the shoulder, which is steadier than any finger.

use glam::DVec3;

/// Closer than this the pinch begins, metres.
const CLOSES_M: f64 = 0.015;
/// Farther than this it ends.
const OPENS_M: f64 = 0.030;
/// The shoulder from the middle of the eyes: to the side, down, and back a little, metres.
const SHOULDER_M: [f64; 3] = [0.17, -0.22, 0.05];

/// One hand's pinch, with memory so that it does not flicker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pinch {
    closed: bool,
}

impl Pinch {
    /// Whether thumb and index finger, given by their tips in metres, hold something.
    pub fn update(&mut self, thumb_m: DVec3, index_m: DVec3) -> bool {
        let apart_m = thumb_m.distance(index_m);
        self.closed = apart_m < if self.closed { OPENS_M } else { CLOSES_M };
        self.closed
    }

    /// The hand is out of sight: it holds nothing.
    pub fn lost(&mut self) {
        self.closed = false;
    }
}

/// Where a hand points: origin and unit direction. `right_m` is the head's unit right, `side` −1 for the left hand and 1
/// for the right one; everything in room metres with y up.
#[must_use]
pub fn aim(
    head_m: DVec3,
    right_m: DVec3,
    side: f64,
    thumb_m: DVec3,
    index_m: DVec3,
) -> Option<(DVec3, DVec3)> {
    let [aside, down, back] = SHOULDER_M;
    let level_right = DVec3::new(right_m.x, 0.0, right_m.z).normalize_or(DVec3::X);
    let backwards = level_right.cross(DVec3::Y);
    let shoulder_m = head_m + level_right * (side * aside) + DVec3::Y * down + backwards * back;
    let origin_m = thumb_m.midpoint(index_m);
    Some((origin_m, (origin_m - shoulder_m).try_normalize()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pinch_does_not_flicker_between_its_two_bounds() {
        let mut pinch = Pinch::default();
        let at = |m: f64| DVec3::X * m;
        for (apart, closed) in
            [(0.08, false), (0.02, false), (0.01, true), (0.02, true), (0.04, false), (0.02, false)]
        {
            assert_eq!(pinch.update(DVec3::ZERO, at(apart)), closed, "{apart}");
        }
        pinch.update(DVec3::ZERO, DVec3::ZERO);
        pinch.lost();
        assert!(!pinch.update(DVec3::ZERO, at(0.02)));
    }

    #[test]
    fn a_stretched_arm_points_ahead_and_down() {
        let head = DVec3::new(0.0, 1.6, 0.0);
        let hand = DVec3::new(0.17, 1.2, -0.5);
        let (origin, direction) = aim(head, DVec3::X, 1.0, hand, hand).unwrap();
        assert_eq!(origin, hand);
        assert!(direction.z < -0.8 && direction.y < -0.2 && direction.x.abs() < 1e-9, "{direction}");
        assert!(
            aim(
                head,
                DVec3::X,
                1.0,
                head + DVec3::new(0.17, -0.22, 0.05),
                head + DVec3::new(0.17, -0.22, 0.05)
            )
            .is_none()
        );
    }
}
