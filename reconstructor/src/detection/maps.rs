//! The network's maps read out: boxes of people, one per person, and peaks of the ball. See `assets/models/people.md`.

use glam::DVec2;

use super::{BallCandidate, Detection, RoleChances};
use crate::{geometry::PixelBox, inference::Tensor};

/// Per cell: score; chances of player, goalkeeper, official, bystander; distances to left, top, right, bottom, pixels.
pub(super) const PEOPLE_CHANNELS: usize = 9;
/// Pixels of a cell of people.
pub(super) const PEOPLE_STRIDE: usize = 8;
/// Per cell: score; place in the cell across and down, cells; diameter, pixels.
pub(super) const BALL_CHANNELS: usize = 4;
/// Pixels of a cell of the ball.
pub(super) const BALL_STRIDE: usize = 4;

/// Overlap above which two boxes are the same person. People who cross overlap by more only for moments.
const SAME_IOU: f64 = 0.6;
/// Boxes of a picture that are compared with each other: a bound on the time that a picture of noise can take.
const BOXES_MAX: usize = 4000;
/// People and ball candidates of a picture.
const PEOPLE_MAX: usize = 200;
const BALLS_MAX: usize = 8;
/// A peak is the largest within this many cells.
const PEAK_CELLS: usize = 2;

/// The planes of a tensor 1×channels×rows×columns.
struct Planes<'a> {
    data: &'a [f32],
    rows: usize,
    columns: usize,
}

impl<'a> Planes<'a> {
    fn of(tensor: &'a Tensor) -> Self {
        let side = |index: usize| tensor.shape.get(index).copied().unwrap_or(0);
        Self { data: &tensor.data, rows: side(2), columns: side(3) }
    }

    fn at(&self, channel: usize, row: usize, column: usize) -> f32 {
        self.data.get((channel * self.rows + row) * self.columns + column).copied().unwrap_or(0.0)
    }

    /// Cells whose first channel is at least `least`, best first; no number is below everything.
    fn above(&self, least: f32) -> Vec<(f32, usize, usize)> {
        let scores = self.data.iter().take(self.rows * self.columns).enumerate();
        let mut cells: Vec<(f32, usize, usize)> = scores
            .filter(|(_, score)| **score >= least)
            .map(|(cell, score)| (*score, cell / self.columns, cell % self.columns))
            .collect();
        cells.sort_by(|a, b| b.0.total_cmp(&a.0));
        cells
    }
}

/// The middle of a cell, pixels; pixel centres are whole numbers.
fn middle(row: f64, column: f64, stride: usize) -> DVec2 {
    (DVec2::new(column, row) + 0.5) * stride as f64 - 0.5
}

/// Boxes of people, pixels of the input, best first: of boxes that overlap much, the best.
pub(super) fn people(tensor: &Tensor, score_min: f32) -> Vec<Detection> {
    let maps = Planes::of(tensor);
    let mut kept: Vec<Detection> = Vec::new();
    for (score, row, column) in maps.above(score_min).into_iter().take(BOXES_MAX) {
        let value = |channel: usize| maps.at(channel, row, column);
        let reach = |channel: usize| f64::from(value(channel)).max(0.0);
        let centre = middle(row as f64, column as f64, PEOPLE_STRIDE);
        let bounds = PixelBox {
            min: centre - DVec2::new(reach(5), reach(6)),
            max: centre + DVec2::new(reach(7), reach(8)),
        };
        let is_box = bounds.min.is_finite() && bounds.max.is_finite() && bounds.size().min_element() >= 1.0;
        if is_box && kept.iter().all(|better| better.bounds.iou(&bounds) <= SAME_IOU) {
            let roles = RoleChances {
                player: value(1),
                goalkeeper: value(2),
                official: value(3),
                bystander: value(4),
            };
            kept.push(Detection { bounds, score, roles });
            if kept.len() == PEOPLE_MAX {
                break;
            }
        }
    }
    kept
}

/// Peaks of the ball's map, pixels of the input, best first.
pub(super) fn balls(tensor: &Tensor, score_min: f32) -> Vec<BallCandidate> {
    let maps = Planes::of(tensor);
    let is_peak = |score: f32, row: usize, column: usize| {
        (row.saturating_sub(PEAK_CELLS)..=(row + PEAK_CELLS).min(maps.rows - 1)).all(|y| {
            (column.saturating_sub(PEAK_CELLS)..=(column + PEAK_CELLS).min(maps.columns - 1))
                // Of two equal cells the first in the order of reading is the peak.
                .all(|x| maps.at(0, y, x) < score || (maps.at(0, y, x) == score && (y, x) >= (row, column)))
        })
    };
    let cells = maps.above(score_min).into_iter().filter(|&(score, row, column)| is_peak(score, row, column));
    let candidates = cells.filter_map(|(score, row, column)| {
        let value = |channel: usize| f64::from(maps.at(channel, row, column));
        let centre_px = middle(row as f64 + value(2), column as f64 + value(1), BALL_STRIDE);
        let diameter_px = value(3);
        (centre_px.is_finite() && diameter_px > 0.0).then_some(BallCandidate {
            centre_px,
            diameter_px,
            score,
        })
    });
    candidates.take(BALLS_MAX).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn tensor(channels: usize, rows: usize, columns: usize) -> Tensor {
        let shape = vec![1, channels, rows, columns];
        Tensor { name: String::new(), data: vec![0.0; shape.iter().product()], shape }
    }

    fn put(tensor: &mut Tensor, row: usize, column: usize, values: &[f32]) {
        let (rows, columns) = (tensor.shape[2], tensor.shape[3]);
        for (channel, value) in values.iter().enumerate() {
            tensor.data[(channel * rows + row) * columns + column] = *value;
        }
    }

    #[test]
    fn a_box_lies_round_the_middle_of_its_cell() {
        let mut maps = tensor(PEOPLE_CHANNELS, 4, 6);
        put(&mut maps, 2, 3, &[0.8, 0.1, 0.2, 0.6, 0.1, 6.0, 20.0, 8.0, 22.0]);
        let found = people(&maps, 0.2);
        let centre = DVec2::new(27.5, 19.5);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].bounds.min, centre - DVec2::new(6.0, 20.0));
        assert_eq!(found[0].bounds.max, centre + DVec2::new(8.0, 22.0));
        assert_eq!((found[0].score, found[0].roles.official), (0.8, 0.6));
        assert!(people(&maps, 0.9).is_empty());
    }

    #[test]
    fn neighbouring_cells_of_one_person_are_one_box() {
        let mut maps = tensor(PEOPLE_CHANNELS, 8, 8);
        put(&mut maps, 3, 3, &[0.7, 1.0, 0.0, 0.0, 0.0, 8.0, 20.0, 8.0, 20.0]);
        put(&mut maps, 4, 3, &[0.9, 1.0, 0.0, 0.0, 0.0, 8.0, 28.0, 8.0, 12.0]);
        put(&mut maps, 4, 6, &[0.5, 1.0, 0.0, 0.0, 0.0, 8.0, 28.0, 8.0, 12.0]);
        let scores: Vec<f32> = people(&maps, 0.2).iter().map(|person| person.score).collect();
        assert_eq!(scores, [0.9, 0.5]);
    }

    #[test]
    fn the_ball_is_a_peak_with_its_place_in_the_cell() {
        let mut maps = tensor(BALL_CHANNELS, 10, 10);
        put(&mut maps, 4, 5, &[0.9, 0.25, -0.5, 7.0]);
        put(&mut maps, 4, 6, &[0.6, -0.75, -0.5, 7.0]);
        put(&mut maps, 9, 0, &[0.4, 0.0, 0.0, 6.0]);
        let found = balls(&maps, 0.1);
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].centre_px, DVec2::new(5.75 * 4.0 - 0.5, 4.0 * 4.0 - 0.5));
        assert_eq!((found[0].diameter_px, found[1].score), (7.0, 0.4));
    }

    proptest! {
        #[test]
        fn any_numbers_give_bounded_boxes(data in prop::collection::vec(prop_oneof![any::<f32>(), 0.0f32..1.0], 9 * 6 * 5)) {
            let maps = Tensor { name: String::new(), shape: vec![1, 9, 6, 5], data };
            let found = people(&maps, 0.2);
            for (index, person) in found.iter().enumerate() {
                prop_assert!(person.score >= 0.2 && person.bounds.size().min_element() >= 1.0);
                prop_assert!(found[..index].iter().all(|other| other.bounds.iou(&person.bounds) <= SAME_IOU));
            }
            let maps = Tensor { shape: vec![1, 4, 6, 5], ..maps };
            prop_assert!(balls(&maps, 0.2).iter().all(|ball| ball.centre_px.is_finite() && ball.diameter_px > 0.0));
        }
    }
}
