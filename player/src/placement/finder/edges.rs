//! Where a surface ends in the picture: at the picture's border, at something that rises from it, or freely.

use super::{blocks::BlockGrid, classify::Piece, footprint::Survey};

/// Blocks along the border that depth cameras often leave empty, as a share of the picture's width.
const BORDER_SHARE: f64 = 0.075;

/// How far beyond the boundary to look for a measurement, blocks.
const LOOK_AHEAD: usize = 4;

/// Shares of a surface's outer boundary in the picture; they sum to one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct EdgeView {
    /// Cut by the border of the picture.
    pub(super) cut: f64,
    /// Something stands there, higher than the surface.
    pub(super) rises: f64,
    /// What is seen beyond lies lower: the surface ends here.
    pub(super) drops: f64,
    /// Nothing was measured beyond.
    pub(super) open: f64,
}

impl EdgeView {
    /// Share that ends within the picture with nothing rising behind.
    pub(super) fn free_share(self) -> f64 {
        self.drops + self.open
    }

    /// Follows the boundary of a piece through the blocks of the picture; `None` when it covers no block.
    pub(super) fn new(grid: &BlockGrid, piece: &Piece, survey: &Survey<'_>) -> Option<Self> {
        let plane = piece.fit.plane;
        let count = grid.columns * grid.rows;
        let distance =
            |index: usize| grid.mean(index).map(|mean| plane.distance_m(mean) / survey.reach_m(&plane, mean));
        let member: Vec<bool> = (0..count)
            .map(|index| {
                distance(index).is_some_and(|distance| distance.abs() < 1.0)
                    && grid.mean(index).is_some_and(|mean| piece.footprint.covers(mean))
            })
            .collect();
        let is_member = |index: usize| member.get(index).copied().unwrap_or(false);
        // What lies inside, such as an object and its shadow, is not reached from the border.
        let mut outside = vec![false; count];
        let mut stack: Vec<usize> =
            (0..count).filter(|index| grid.is_at_border(*index, 1) && !is_member(*index)).collect();
        while let Some(index) = stack.pop() {
            if let Some(slot) = outside.get_mut(index).filter(|slot| !**slot) {
                *slot = true;
                stack.extend(grid.neighbours(index).filter(|neighbour| !is_member(*neighbour)));
            }
        }
        let border = ((grid.columns.max(grid.rows) as f64 * BORDER_SHARE) as usize).max(1);
        let mut view = Self::default();
        for index in (0..count).filter(|index| is_member(*index)) {
            if grid.is_at_border(index, border) {
                view.cut += f64::from(u8::from(
                    grid.is_at_border(index, 1)
                        || grid.neighbours(index).any(|next| outside.get(next).copied().unwrap_or(false)),
                ));
                continue;
            }
            for neighbour in grid.neighbours(index) {
                if outside.get(neighbour).copied().unwrap_or(false) {
                    let next = grid.beyond(index, neighbour, LOOK_AHEAD);
                    match next.and_then(|next| distance(next).map(|distance| (next, distance))) {
                        // Wild points lie behind the surface too, but not on a plane.
                        Some((next, distance)) if distance < -1.0 && grid.is_flat(next) => view.drops += 1.0,
                        Some((_, distance)) if distance > -1.0 => view.rises += 1.0,
                        _ => view.open += 1.0,
                    }
                }
            }
        }
        let sum = view.cut + view.rises + view.drops + view.open;
        (sum > 0.0).then(|| Self {
            cut: view.cut / sum,
            rises: view.rises / sum,
            drops: view.drops / sum,
            open: view.open / sum,
        })
    }
}
