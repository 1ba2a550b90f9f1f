//! Jumps against the truth: how high the reconstructed bodies rise, and how many rise that stand.

use serde::{Deserialize, Serialize};

use crate::report::median;

/// A true jump is a run of frames higher than the first figure that reaches the second, metres.
const OFF_M: f64 = 0.05;
const JUMP_M: f64 = 0.12;
/// Somebody who stands and is higher than this in the stream is lifted wrongly, metres.
const LIFTED_M: f64 = 0.05;
/// Least share of a jump's frames in which the person must be in the stream to be measured.
const MEASURED: f64 = 0.5;

/// One true person in one frame, and the matched body of the stream.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Height {
    /// Frame of the clip.
    pub frame: u32,
    /// Whose.
    pub person: u32,
    /// True height of the lowest point of the body, metres.
    pub true_m: f64,
    /// Whether a foot truly bears on the ground.
    pub stands: bool,
    /// Whether the person goes to the ground on purpose or falls: that is no jump.
    pub goes_down: bool,
    /// Height of the lowest point of the matched body, metres; `None` when the person is not in the stream.
    pub ours_m: Option<f64>,
}

/// The figures of jumps over a clip.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JumpFigures {
    /// True jumps of at least 12 cm by people in view; dives, falls and tackles are none.
    pub jumps_true: usize,
    /// Those whose person is in the stream for at least half of their frames.
    pub jumps_measured: usize,
    /// Share of the measured ones in which the body rises by more than 5 cm.
    pub jumps_recall: Option<f64>,
    /// Difference between the greatest true and reconstructed heights of a jump: median, metres.
    pub jump_height_error_median_m: Option<f64>,
    /// Share of the person-frames with a foot truly on the ground in which the body is higher than 5 cm.
    pub grounded_lifted_share: Option<f64>,
}

/// Measures jumps; heights in order of frame for each person, persons in any order.
#[must_use]
pub fn compare(heights: &[Height]) -> JumpFigures {
    let mut figures = JumpFigures::default();
    let (mut grounded, mut lifted, mut risen) = (0usize, 0usize, 0usize);
    let mut errors = Vec::new();
    let mut of_person = std::collections::BTreeMap::<u32, Vec<&Height>>::new();
    for height in heights {
        of_person.entry(height.person).or_default().push(height);
        if let (true, Some(ours_m)) = (height.stands, height.ours_m) {
            grounded += 1;
            lifted += usize::from(ours_m > LIFTED_M);
        }
    }
    for all in of_person.values() {
        for run in all.chunk_by(|a, b| (a.true_m > OFF_M) == (b.true_m > OFF_M) && b.frame == a.frame + 1) {
            let peak_m = run.iter().map(|height| height.true_m).fold(0.0, f64::max);
            if peak_m < JUMP_M || run.iter().any(|height| height.goes_down) {
                continue;
            }
            figures.jumps_true += 1;
            let ours: Vec<f64> = run.iter().filter_map(|height| height.ours_m).collect();
            if (ours.len() as f64) < MEASURED * run.len() as f64 {
                continue;
            }
            figures.jumps_measured += 1;
            let ours_m = ours.into_iter().fold(0.0, f64::max);
            risen += usize::from(ours_m > OFF_M);
            errors.push((peak_m - ours_m).abs());
        }
    }
    let share = |part: usize, whole: usize| (whole > 0).then(|| part as f64 / whole as f64);
    figures.jumps_recall = share(risen, figures.jumps_measured);
    figures.jump_height_error_median_m = median(&errors);
    figures.grounded_lifted_share = share(lifted, grounded);
    figures
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Somebody who jumps 0.4 m in frames 10 to 20 and is reconstructed with a share of it.
    fn jumper(share: Option<f64>) -> Vec<Height> {
        (0..40)
            .map(|frame| {
                let rise = (0.4 - 0.016 * (f64::from(frame) - 15.0).powi(2)).max(0.0);
                let ours_m = share.map(|share| rise * share);
                Height { frame, person: 3, true_m: rise, stands: rise <= 0.0, goes_down: false, ours_m }
            })
            .collect()
    }

    #[test]
    fn the_peak_counts() {
        let figures = compare(&jumper(Some(0.75)));
        assert_eq!((figures.jumps_true, figures.jumps_measured, figures.jumps_recall), (1, 1, Some(1.0)));
        assert!((figures.jump_height_error_median_m.unwrap() - 0.1).abs() < 1e-9);
        assert_eq!(figures.grounded_lifted_share, Some(0.0));
    }

    #[test]
    fn a_jump_that_stays_on_the_ground_is_missed_and_one_not_in_the_stream_is_not_measured() {
        let figures = compare(&jumper(Some(0.0)));
        assert_eq!((figures.jumps_recall, figures.jump_height_error_median_m), (Some(0.0), Some(0.4)));
        let figures = compare(&jumper(None));
        assert_eq!((figures.jumps_true, figures.jumps_measured, figures.jumps_recall), (1, 0, None));
    }

    #[test]
    fn who_stands_and_floats_is_counted_and_a_dive_is_no_jump() {
        let mut heights = jumper(Some(1.0));
        heights[0].ours_m = Some(0.2);
        let share = compare(&heights).grounded_lifted_share.unwrap();
        assert!((share - 1.0 / 31.0).abs() < 1e-9, "{share}");
        heights.iter_mut().for_each(|height| height.goes_down = true);
        assert_eq!(compare(&heights).jumps_true, 0);
    }
}
