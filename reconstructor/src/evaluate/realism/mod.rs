//! How like real broadcasts the synthesized ones are: the same measures on labelled pictures of both, side by side.
//!
//! What training pictures cannot show, a network does not learn; so the worst line of this table says what to render better.
//! The detector and the pose network have never seen a rendered picture: that they do as well on ours is a measure, too.

mod looks;
mod sheet;
mod statistics;
mod surroundings;

use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use super::labelled::{self, LabelError, LabelledPicture};
use crate::{detection::DetectionError, pose::PoseError, report::Progress};

pub use sheet::{SheetError, sheet};

/// Every picture is brought to this size: sets of real pictures are often stretched to squares.
const SIZE_PX: (u32, u32) = (1280, 720);

/// Figures of one measure over all pictures, or over all people of all pictures.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spread {
    /// How many values there are.
    pub count: usize,
    /// A tenth of the values lie below.
    pub p10: f64,
    /// The median.
    pub p50: f64,
    /// A tenth of the values lie above.
    pub p90: f64,
}

/// One measure on both sides.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// What is measured, with its unit.
    pub measure: &'static str,
    /// On the real pictures.
    pub real: Spread,
    /// On ours.
    pub ours: Spread,
    /// Kolmogorov–Smirnov distance of both distributions: 0 is the same, 1 says they do not overlap.
    pub distance: f64,
}

/// How the networks do on one side.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct NetworkFigures {
    /// Share of the people that the detector finds at IoU 0.5.
    pub detector_recall: f64,
    /// Confidence of the pose network on the labelled boxes.
    pub pose_score: Spread,
    /// Share of the labelled boxes that the pose network's test rejects.
    pub pose_rejected: f64,
}

/// What `evaluate realism` prints.
#[derive(Clone, Debug, Serialize)]
pub struct RealismFigures {
    /// Real pictures.
    pub real_pictures: usize,
    /// Our pictures.
    pub our_pictures: usize,
    /// The measures, worst first.
    pub measures: Vec<Comparison>,
    /// Median of the distances.
    pub distance_median: f64,
    /// The networks on the real pictures.
    pub networks_real: NetworkFigures,
    /// The networks on ours.
    pub networks_ours: NetworkFigures,
    /// Recall on ours minus recall on the real pictures.
    pub recall_difference: f64,
    /// Kolmogorov–Smirnov distance of the pose network's confidences.
    pub pose_score_distance: f64,
}

/// Why realism could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum RealismError {
    /// The labelled pictures could not be read.
    #[error(transparent)]
    Labels(#[from] LabelError),
    /// The detector failed.
    #[error(transparent)]
    Detection(#[from] DetectionError),
    /// The pose network failed.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Compares labelled pictures: folders with `images/` and `labels/` in the YOLO form, classes ball, goalkeeper, player, referee.
///
/// # Errors
/// When a folder holds no labelled pictures or a network cannot run.
pub fn evaluate(real: &Path, ours: &Path, progress: &Progress) -> Result<RealismFigures, RealismError> {
    let [real, ours] = [labelled::read(real, Some(SIZE_PX))?, labelled::read(ours, Some(SIZE_PX))?];
    // Each measure with its values over all pictures.
    let measure = |pictures: &[LabelledPicture]| -> Vec<(&'static str, Vec<f64>)> {
        let measured: Vec<_> = pictures
            .par_iter()
            .map(|picture| {
                progress.advance(1);
                statistics::measure(picture)
            })
            .collect();
        let mut all: Vec<(&'static str, Vec<f64>)> = Vec::new();
        for (place, (name, values)) in measured.into_iter().flat_map(|one| one.into_iter().enumerate()) {
            match all.get_mut(place) {
                Some((_, before)) => before.extend(values),
                None => all.push((name, values)),
            }
        }
        all
    };
    let mut measures: Vec<Comparison> = measure(&real)
        .into_iter()
        .zip(measure(&ours))
        .map(|((name, real), (_, ours))| compare(name, real, ours))
        .collect();
    measures.sort_by(|a, b| b.distance.total_cmp(&a.distance));
    let distances: Vec<f64> = measures.iter().map(|m| m.distance).collect();
    let [looked_real, looked_ours] = [looks::look(&real, progress)?, looks::look(&ours, progress)?];
    Ok(RealismFigures {
        real_pictures: real.len(),
        our_pictures: ours.len(),
        distance_median: spread(distances).p50,
        measures,
        recall_difference: looked_ours.recall - looked_real.recall,
        pose_score_distance: distance(&mut looked_real.scores.clone(), &mut looked_ours.scores.clone()),
        networks_real: looked_real.figures(),
        networks_ours: looked_ours.figures(),
    })
}

fn compare(measure: &'static str, mut real: Vec<f64>, mut ours: Vec<f64>) -> Comparison {
    let distance = distance(&mut real, &mut ours);
    Comparison { measure, real: spread(real), ours: spread(ours), distance }
}

/// Quantiles of values; all zero when there are none.
fn spread(mut values: Vec<f64>) -> Spread {
    values.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
        values.get(index).copied().unwrap_or(0.0)
    };
    Spread { count: values.len(), p10: at(0.1), p50: at(0.5), p90: at(0.9) }
}

/// The largest difference of the two empirical distribution functions; 1 when a side is empty.
fn distance(a: &mut [f64], b: &mut [f64]) -> f64 {
    if a.is_empty() || b.is_empty() {
        return 1.0;
    }
    a.sort_by(f64::total_cmp);
    b.sort_by(f64::total_cmp);
    let share =
        |values: &[f64], limit: f64| values.partition_point(|&v| v <= limit) as f64 / values.len() as f64;
    a.iter().chain(b.iter()).map(|&limit| (share(a, limit) - share(b, limit)).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_tells_equal_shifted_and_disjoint_apart() {
        let values = |from: f64| -> Vec<f64> { (0..100).map(|k| from + f64::from(k)).collect() };
        assert!(distance(&mut values(0.0), &mut values(0.0)) < 1e-12);
        assert!((distance(&mut values(0.0), &mut values(25.0)) - 0.25).abs() < 1e-9);
        assert!((distance(&mut values(0.0), &mut values(1000.0)) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn quantiles_of_a_row_of_numbers() {
        let row = spread((0..=100).rev().map(f64::from).collect());
        assert_eq!((row.count, row.p10, row.p50, row.p90), (101, 10.0, 50.0, 90.0));
        assert_eq!(spread(Vec::new()).count, 0);
    }
}
