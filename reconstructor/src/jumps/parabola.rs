//! Finds parabolas of gravity in how far away somebody seems to be and how high the hips are.
//!
//! For every possible take-off and landing the apparent distance is fitted by a smooth run (a parabola over about a second
//! and a half) plus what a jump of that length adds. Its strength is free: one is what gravity says. The hips are fitted
//! likewise.

use glam::DVec2;
use nalgebra::{Cholesky, SMatrix, SVector};

const GRAVITY: f64 = 9.81;
/// Time in the air, seconds: 0.24 s are 7 cm, 0.84 s are 87 cm.
const AIR_S: std::ops::RangeInclusive<f64> = 0.24..=0.84;
/// The run before and after that is looked at, seconds, and the sightings that must lie in it on either side.
const BESIDE_S: f64 = 0.5;
const BESIDE_SIGHTINGS: usize = 4;
/// Least share of the air time's frames with a sighting.
const SEEN: f64 = 0.5;
/// Strengths that a jump may have by the feet (which may be drawn up) and by the hips (which rise before the feet do).
const BY_FEET: std::ops::RangeInclusive<f64> = 0.75..=1.7;
const BY_HIPS: std::ops::RangeInclusive<f64> = 0.6..=1.8;
/// Least strengths in standard deviations.
const SURE_BY_FEET: f64 = 5.0;
const SURE_BY_HIPS: f64 = 3.0;
/// A jump is at least so high, metres.
const HEIGHT_MIN_M: f64 = 0.12;
/// Error of a foot's or hip's height at most sights, metres, and pixels: no fit is believed to be better.
const HEIGHT_SIGMA_M: f64 = 0.03;
const HEIGHT_SIGMA_PX: f64 = 0.8;
/// Huber's constant, and rounds of reweighting.
const HUBER: f64 = 1.5;
const ROUNDS: usize = 4;

/// One sighting.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// From the start of the clip.
    pub(super) seconds: f64,
    /// Horizontal distance from the camera to where the lower foot would stand, metres.
    pub(super) away_m: f64,
    /// Height that a metre of apparent distance stands for.
    pub(super) rise_per_m: f64,
    /// Height of the camera, metres.
    pub(super) camera_m: f64,
    /// Rise of the line of sight to the hips per metre along the ground, and its direction on the ground.
    pub(super) hips_slope: f64,
    pub(super) hips_towards: DVec2,
    /// Pixels per metre.
    pub(super) size_px: f64,
}

/// A jump.
#[derive(Clone, Copy, Debug)]
pub(super) struct Jump {
    take_off_s: f64,
    landing_s: f64,
    strength: f64,
    /// The true distance over time since the middle of the jump.
    run: [f64; 3],
    gain: f64,
}

impl Jump {
    /// Height of the feet above the ground, metres.
    pub(super) fn height_m(&self, seconds: f64) -> f64 {
        self.strength * rise_m(seconds, self.take_off_s, self.landing_s)
    }

    /// Horizontal distance from the camera, metres.
    pub(super) fn away_m(&self, seconds: f64) -> f64 {
        let since = seconds - (self.take_off_s + self.landing_s) / 2.0;
        self.run[0] + self.run[1] * since + self.run[2] * since * since
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.take_off_s < other.landing_s && other.take_off_s < self.landing_s
    }
}

/// Height of something thrown up at one moment that comes down at another, metres.
fn rise_m(seconds: f64, take_off_s: f64, landing_s: f64) -> f64 {
    (GRAVITY / 2.0 * (seconds - take_off_s) * (landing_s - seconds)).max(0.0)
}

/// The jumps of one person, the clearest first; samples in order of time.
pub(super) fn jumps(samples: &[Sample]) -> Vec<Jump> {
    let mut found: Vec<Jump> = Vec::new();
    for (number, first) in samples.iter().enumerate() {
        let Some(next) = samples.get(number + 1) else { break };
        // A take-off lies between two sightings.
        let take_off_s = (first.seconds + next.seconds) / 2.0;
        if !promising(samples, number) {
            continue;
        }
        for last in samples.iter().skip(number + 3) {
            let landing_s = last.seconds + (next.seconds - first.seconds).min(0.1) / 2.0;
            let air_s = landing_s - take_off_s;
            if air_s > *AIR_S.end() {
                break;
            }
            if air_s >= *AIR_S.start() {
                found.extend(fit(samples, take_off_s, landing_s));
            }
        }
    }
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut kept: Vec<Jump> = Vec::new();
    for jump in found {
        if kept.iter().all(|other| !jump.overlaps(other)) {
            kept.push(jump);
        }
    }
    kept
}

/// Whether somebody seems to move away faster after a sighting than anybody runs, for at least an instant of the next frames.
fn promising(samples: &[Sample], number: usize) -> bool {
    let after = samples.get(number..(number + 8).min(samples.len())).unwrap_or_default();
    let Some(first) = after.first() else { return false };
    after.iter().any(|sample| (sample.away_m - first.away_m) * first.rise_per_m > HEIGHT_MIN_M / 2.0)
}

fn fit(samples: &[Sample], take_off_s: f64, landing_s: f64) -> Option<Jump> {
    let start = samples.partition_point(|sample| sample.seconds < take_off_s - BESIDE_S);
    let end = samples.partition_point(|sample| sample.seconds <= landing_s + BESIDE_S);
    let around = samples.get(start..end)?;
    let before = around.iter().filter(|sample| sample.seconds <= take_off_s).count();
    let after = around.iter().filter(|sample| sample.seconds >= landing_s).count();
    let inside = around.len() - before - after;
    let frame_s =
        around.windows(2).map(|pair| pair[1].seconds - pair[0].seconds).fold(f64::INFINITY, f64::min);
    let enough = before.min(after) >= BESIDE_SIGHTINGS
        && inside as f64 >= SEEN * (landing_s - take_off_s) / frame_s.max(1e-3);
    if !enough {
        return None;
    }
    let middle_s = (take_off_s + landing_s) / 2.0;
    let rise = |sample: &Sample| rise_m(sample.seconds, take_off_s, landing_s);
    let sigma_m = |sample: &Sample| HEIGHT_SIGMA_M.hypot(HEIGHT_SIGMA_PX / sample.size_px.max(1.0));
    // In units of height, so that near and far count alike.
    let feet: Vec<Row> = around
        .iter()
        .map(|sample| {
            let since = sample.seconds - middle_s;
            let scale = sample.rise_per_m / sigma_m(sample);
            Row {
                by: [scale, scale * since, scale * since * since, rise(sample) / sigma_m(sample)],
                value: scale * sample.away_m,
            }
        })
        .collect();
    let by_feet = regress(&feet)?;
    let peak_m = by_feet.strength * GRAVITY * (landing_s - take_off_s).powi(2) / 8.0;
    let likely = BY_FEET.contains(&by_feet.strength)
        && by_feet.strength > SURE_BY_FEET * by_feet.sigma
        && peak_m > HEIGHT_MIN_M;
    if !likely {
        return None;
    }
    let jump =
        Jump { take_off_s, landing_s, strength: by_feet.strength, run: by_feet.run, gain: by_feet.gain };
    let hips: Vec<Row> = around
        .iter()
        .map(|sample| {
            let since = sample.seconds - middle_s;
            let height_m = sample.camera_m + jump.away_m(sample.seconds) * sample.hips_slope;
            let scale = 1.0 / sigma_m(sample);
            Row {
                by: [scale, scale * since, scale * since * since, rise(sample) * scale],
                value: scale * height_m,
            }
        })
        .collect();
    let by_hips = regress(&hips)?;
    let sure = BY_HIPS.contains(&by_hips.strength) && by_hips.strength > SURE_BY_HIPS * by_hips.sigma;
    sure.then_some(jump)
}

/// One equation of a regression, over its standard deviation.
struct Row {
    by: [f64; 4],
    value: f64,
}

struct Regression {
    run: [f64; 3],
    strength: f64,
    sigma: f64,
    /// How much better than without a jump, as half the sum of squares.
    gain: f64,
}

/// Robust least squares.
fn regress(rows: &[Row]) -> Option<Regression> {
    let mut weights = vec![1.0; rows.len()];
    let mut solution = SVector::<f64, 4>::zeros();
    let mut covariance = SMatrix::<f64, 4, 4>::zeros();
    for _ in 0..ROUNDS {
        let mut normal = SMatrix::<f64, 4, 4>::zeros();
        let mut right = SVector::<f64, 4>::zeros();
        for (row, &weight) in rows.iter().zip(&weights) {
            let by = SVector::from(row.by);
            normal += by * by.transpose() * weight;
            right += by * (row.value * weight);
        }
        let factor = Cholesky::new(normal)?;
        solution = factor.solve(&right);
        covariance = factor.inverse();
        for (row, weight) in rows.iter().zip(&mut weights) {
            let off = (row.value - SVector::from(row.by).dot(&solution)).abs();
            *weight = (HUBER / off.max(HUBER)).min(1.0);
        }
    }
    let squares: f64 = rows
        .iter()
        .zip(&weights)
        .map(|(row, weight)| weight * (row.value - SVector::from(row.by).dot(&solution)).powi(2))
        .sum();
    let scatter = (squares / (rows.len() as f64 - 4.0).max(1.0)).max(1.0);
    let sigma = (covariance[(3, 3)] * scatter).sqrt();
    let strength = solution[3];
    Some(Regression {
        run: [solution[0], solution[1], solution[2]],
        strength,
        sigma,
        gain: (strength / sigma).powi(2) / 2.0,
    })
}
