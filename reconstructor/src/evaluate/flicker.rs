//! How quietly a surface moves (DESIGN §6, Time): what shakes between frames that does not shake in truth.
//!
//! Points of the true body that keep their place on it are followed; where the reconstruction lies before or behind each, along
//! the true normal, is a number per frame. Its second difference over three frames is the shaking.

use std::collections::BTreeMap;

use glam::DVec3;
use protocol::{
    chunk::{Body, ChunkFrame},
    time::Timescale,
};
use serde::{Deserialize, Serialize};

use super::matches::pairs;
use crate::surface::{Surface, body_triangles};

/// Points followed on a body.
const POINTS: usize = 150;
/// Bodies whose points move slower than this in the mean stand, metres per second.
const STANDING_M_S: f64 = 0.5;
/// Faster ones move; those between count for neither.
const MOVING_M_S: f64 = 1.0;
/// A point is followed where the reconstruction is within this of it, metres, and faces the same way but for this much (a cosine): farther
/// off, a limb is elsewhere or two limbs are one, and the nearest surface is another one.
const REACH_M: f64 = 0.2;
const FACING: f64 = 0.0;

/// The figures of a match.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlickerFigures {
    /// Standing people: spread of the noise, independent from frame to frame, that would shake the surface as much, metres.
    pub jitter_m: Option<f64>,
    /// Three frames of standing people that were compared.
    pub standing: usize,
    /// Moving people: root mean square of the second differences of our surface by those of the true one.
    pub second_difference_ratio: Option<f64>,
    /// Three frames of moving people that were compared.
    pub moving: usize,
    /// Share of the points of these people that could be followed: the reconstruction was near in all three frames and faced the same way.
    pub followed_share: f64,
}

/// Compares streams given by their frames; both in order of time, `timescale` that of the true one.
#[must_use]
pub fn flicker(truth: &[ChunkFrame], ours: &[ChunkFrame], timescale: Timescale) -> FlickerFigures {
    let ours_by_frame: BTreeMap<u32, &ChunkFrame> = ours.iter().map(|f| (f.clip_frame, f)).collect();
    let mut tally = Tally::default();
    let mut before: [BTreeMap<u32, Followed>; 2] = Default::default();
    for frame in truth {
        let mut now = BTreeMap::new();
        if let Some(our_frame) = ours_by_frame.get(&frame.clip_frame) {
            for (true_index, our_index) in pairs(&frame.bodies, &our_frame.bodies) {
                let (body, our_body) = (&frame.bodies[true_index], &our_frame.bodies[our_index]);
                now.extend(
                    Followed::new(frame, body, our_body, timescale).map(|followed| (body.person.0, followed)),
                );
            }
        }
        for (person, followed) in &now {
            if let (Some(first), Some(second)) = (before[0].get(person), before[1].get(person)) {
                tally.add([first, second, followed]);
            }
        }
        let [_, last] = before;
        before = [last, now];
    }
    tally.figures()
}

/// Points of a true body in one frame, and where the reconstruction is there.
struct Followed {
    /// Of the clip.
    frame: u32,
    /// Seconds.
    start_s: f64,
    ours: u32,
    triangles: usize,
    /// World metres: the true point, ours on its normal; `None` where ours is elsewhere.
    points: Vec<(DVec3, Option<DVec3>)>,
}

impl Followed {
    fn new(frame: &ChunkFrame, body: &Body, ours: &Body, timescale: Timescale) -> Option<Self> {
        let surface = Surface::new(&body_triangles(ours))?;
        let triangles = body_triangles(body);
        let step = triangles.len().div_ceil(POINTS).max(1);
        let points = triangles.iter().step_by(step).map(|&[a, b, c]| {
            let point = (a + b + c) / 3.0;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let near = surface
                .nearest(point)
                .filter(|near| near.point.distance(point) <= REACH_M && near.normal.dot(normal) >= FACING);
            (point, near.map(|near| point + normal * (near.point - point).dot(normal)))
        });
        Some(Self {
            frame: frame.clip_frame,
            start_s: timescale.seconds(frame.start),
            ours: ours.person.0,
            triangles: triangles.len(),
            points: points.collect(),
        })
    }
}

#[derive(Default)]
struct Tally {
    standing: usize,
    moving: usize,
    /// Sums of squares: how ours shakes against the truth, standing; second differences of ours and of the truth, moving.
    points: usize,
    followed: usize,
    shaking: Mean,
    ours: Mean,
    truth: Mean,
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, square: f64) {
        self.sum += square;
        self.count += 1;
    }

    fn root(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).sqrt())
    }
}

impl Tally {
    /// Three frames one after the other of one person, when both streams show the same one.
    fn add(&mut self, three: [&Followed; 3]) {
        let [a, b, c] = three;
        let same =
            a.ours == b.ours && b.ours == c.ours && a.triangles == b.triangles && b.triangles == c.triangles;
        if !same || b.frame != a.frame + 1 || c.frame != b.frame + 1 || c.start_s <= a.start_s {
            return;
        }
        let both = a.points.iter().zip(&b.points).zip(&c.points);
        let travelled: f64 = both.clone().map(|((a, _), c)| a.0.distance(c.0)).sum();
        let speed_m_s = travelled / a.points.len().max(1) as f64 / (c.start_s - a.start_s);
        let (standing, moving) = (speed_m_s < STANDING_M_S, speed_m_s > MOVING_M_S);
        self.standing += usize::from(standing);
        self.moving += usize::from(moving);
        if standing || moving {
            self.points += b.points.len();
        }
        for ((a, b), c) in both {
            let (Some(ours_a), Some(ours_b), Some(ours_c)) = (a.1, b.1, c.1) else { continue };
            let ours = ours_a - 2.0 * ours_b + ours_c;
            let truth = a.0 - 2.0 * b.0 + c.0;
            self.followed += usize::from(standing || moving);
            if standing {
                self.shaking.add((ours - truth).length_squared());
            } else if moving {
                self.ours.add(ours.length_squared());
                self.truth.add(truth.length_squared());
            }
        }
    }

    fn figures(&self) -> FlickerFigures {
        // Noise of spread 1 in each frame has second differences of spread √(1 + 4 + 1).
        let jitter_m = self.shaking.root().map(|shaking| shaking / 6f64.sqrt());
        let ratio = self.ours.root().zip(self.truth.root()).filter(|(_, truth)| *truth > 0.0);
        FlickerFigures {
            jitter_m,
            standing: self.standing,
            second_difference_ratio: ratio.map(|(ours, truth)| ours / truth),
            moving: self.moving,
            followed_share: self.followed as f64 / self.points.max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::matches::tests::{box_at, frame},
        *,
    };

    const FRAMES: Timescale = Timescale { numerator: 25, denominator: 1 };

    /// Frames of a box that moves with `speed` metres per frame and shakes by `shake(frame)` to the side.
    fn film(speed: f32, shake: impl Fn(u32) -> f32) -> Vec<ChunkFrame> {
        (0..12).map(|index| frame(index, vec![box_at(3, speed * index as f32, shake(index))])).collect()
    }

    #[test]
    fn noise_of_a_standing_body_is_measured() {
        let noise = [0.01, -0.01, -0.01, 0.01, 0.01, -0.01, 0.01, -0.01, -0.01, -0.01, 0.01, 0.01];
        let figures = flicker(&film(0.0, |_| 0.0), &film(0.0, |i| noise[i as usize]), FRAMES);
        assert_eq!((figures.standing, figures.moving), (10, 0));
        // Two of the six faces move along their normal.
        let squares =
            noise.windows(3).map(|w| f64::from(w[0] - 2.0 * w[1] + w[2]).powi(2)).sum::<f64>() / 10.0;
        let (jitter_m, expected) = (figures.jitter_m.unwrap(), (squares / 3.0 / 6.0).sqrt());
        assert!((jitter_m / expected - 1.0).abs() < 1e-3, "{jitter_m} of {expected}");
        assert_eq!(
            flicker(&film(0.0, |_| 0.0), &film(0.0, |_| 0.02), FRAMES).jitter_m.map(|j| j < 1e-6),
            Some(true)
        );
    }

    #[test]
    fn a_moving_body_that_follows_the_truth_has_its_second_differences() {
        let sway = |index: u32| 0.05 * (f64::from(index) * 0.8).sin() as f32;
        let truth = film(0.1, sway);
        let ratio = |ours: &[ChunkFrame]| flicker(&truth, ours, FRAMES).second_difference_ratio.unwrap();
        assert!((ratio(&truth) - 1.0).abs() < 1e-3);
        let shaken = film(0.1, |index| sway(index) + if index % 2 == 0 { 0.03 } else { -0.03 });
        assert!(ratio(&shaken) > 1.5, "{}", ratio(&shaken));
    }

    #[test]
    fn gaps_and_changes_of_identity_are_not_compared() {
        let truth = film(0.0, |_| 0.0);
        let mut ours = truth.clone();
        ours.remove(6);
        for late in &mut ours[9..] {
            late.bodies[0].person.0 = 8;
        }
        assert_eq!(flicker(&truth, &ours, FRAMES).standing, 4 + 1);
        assert_eq!(flicker(&[], &ours, FRAMES), FlickerFigures::default());
    }
}
