//! The largest rectangle of a given shape in a polygon with holes, and the one of almost that size nearest to a point.
//!
//! Stretched so that the rectangle becomes a square, the size that fits around a centre is the maximum-norm distance
//! to the nearest side: the pole of inaccessibility in that norm. It is found by branch and bound over squares as
//! polylabel does for circles (V. Agafonkin, "A new algorithm for finding a visual center of a polygon", 2016); in the
//! maximum norm the bound `distance at the middle + half side` is tight. Containment is exact whatever the search does.

use std::{cmp::Ordering, collections::BinaryHeap};

use glam::DVec2;

use super::polygon;

/// Squares looked at before the search is content with the best so far.
const MOST_CELLS: usize = 20_000;
/// Squares along the longer side of the outline at the start.
const MOST_ACROSS: f64 = 64.0;

/// A polygon with holes, in units of the rectangle's half sides.
pub(super) struct FreeSpace {
    outline: Vec<DVec2>,
    holes: Vec<Vec<DVec2>>,
    /// Kept free all round, in the same units.
    margin: DVec2,
    half_m: DVec2,
}

/// A square of centres; `rank` says how promising it is.
struct Cell {
    middle: DVec2,
    half: f64,
    clearance: f64,
    rank: f64,
}

impl FreeSpace {
    /// For rectangles with half sides in proportion to `half_m`, at least `margin_m` away from every side.
    pub(super) fn new(outline_m: &[DVec2], holes_m: &[Vec<DVec2>], half_m: DVec2, margin_m: f64) -> Self {
        let stretched = |polygon: &[DVec2]| polygon.iter().map(|corner| *corner / half_m).collect();
        Self {
            outline: stretched(outline_m),
            holes: holes_m.iter().map(|hole| stretched(hole)).collect(),
            margin: DVec2::splat(margin_m) / half_m,
            half_m,
        }
    }

    /// The largest scale of the rectangle around a centre (metres); negative where none fits.
    pub(super) fn scale_at(&self, centre_m: DVec2) -> f64 {
        self.clearance(centre_m / self.half_m)
    }

    /// Centre (metres) and scale of the largest rectangle, to `precision` (share of its size); `None` when nothing fits.
    pub(super) fn largest(&self, precision: f64) -> Option<(DVec2, f64)> {
        let mut best = (polygon::centroid(&self.outline), 0.0);
        let mut cells = self.first_cells(|clearance, half, _| clearance + half);
        best.1 = self.clearance(best.0);
        let mut looked_at = 0;
        while let Some(cell) = cells.pop() {
            if cell.clearance > best.1 {
                best = (cell.middle, cell.clearance);
            }
            looked_at += 1;
            if cell.rank <= best.1.max(0.0) * (1.0 + precision) + 1e-9 || looked_at > MOST_CELLS {
                break;
            }
            self.split(&cell, &mut cells, |clearance, half, _| clearance + half);
        }
        (best.1 > 0.0).then(|| (best.0 * self.half_m, best.1))
    }

    /// The centre (metres) nearest to `wanted_m` around which a rectangle of at least `scale` fits, to about
    /// `precision_m`; `known_m` is one such centre.
    pub(super) fn nearest(&self, scale: f64, wanted_m: DVec2, known_m: DVec2, precision_m: f64) -> DVec2 {
        let away = |centre: DVec2| (centre * self.half_m).distance(wanted_m);
        if self.scale_at(wanted_m) >= scale {
            return wanted_m;
        }
        let mut best = (known_m / self.half_m, known_m.distance(wanted_m));
        // The nearer, the more promising; hopeless squares are at infinity.
        let rank = |clearance: f64, half: f64, middle: DVec2| {
            let least = away(middle) - half * self.half_m.length();
            if clearance + half < scale { f64::NEG_INFINITY } else { -least }
        };
        let mut cells = self.first_cells(rank);
        let mut looked_at = 0;
        while let Some(cell) = cells.pop() {
            if -cell.rank > best.1 - precision_m || looked_at > MOST_CELLS {
                break;
            }
            if cell.clearance >= scale && away(cell.middle) < best.1 {
                best = (cell.middle, away(cell.middle));
            }
            looked_at += 1;
            self.split(&cell, &mut cells, rank);
        }
        best.0 * self.half_m
    }

    fn first_cells(&self, rank: impl Fn(f64, f64, DVec2) -> f64) -> BinaryHeap<Cell> {
        let low = self.outline.iter().fold(DVec2::INFINITY, |low, corner| low.min(*corner));
        let high = self.outline.iter().fold(DVec2::NEG_INFINITY, |high, corner| high.max(*corner));
        let size = high - low;
        let half = size.min_element().max(size.max_element() / MOST_ACROSS) / 2.0;
        let mut cells = BinaryHeap::new();
        if !(half > 0.0 && half.is_finite()) {
            return cells;
        }
        let count = (size / (2.0 * half)).ceil().max(DVec2::ONE);
        for row in 0..count.y as u32 {
            for column in 0..count.x as u32 {
                let at = DVec2::new(f64::from(column), f64::from(row));
                cells.push(self.cell(low + (at * 2.0 + 1.0) * half, half, &rank));
            }
        }
        cells
    }

    fn split(&self, cell: &Cell, into: &mut BinaryHeap<Cell>, rank: impl Fn(f64, f64, DVec2) -> f64) {
        let half = cell.half / 2.0;
        for corner in [DVec2::new(-1.0, -1.0), DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0), DVec2::ONE] {
            into.push(self.cell(cell.middle + corner * half, half, &rank));
        }
    }

    fn cell(&self, middle: DVec2, half: f64, rank: &impl Fn(f64, f64, DVec2) -> f64) -> Cell {
        let clearance = self.clearance(middle);
        Cell { middle, half, clearance, rank: rank(clearance, half, middle) }
    }

    /// Half side of the largest free square around a point, margin taken off; negative by the way that is missing.
    fn clearance(&self, centre: DVec2) -> f64 {
        let free = polygon::contains(&self.outline, centre)
            && !self.holes.iter().any(|hole| polygon::contains(hole, centre));
        let rings = std::iter::once(&self.outline).chain(&self.holes);
        let nearest = |margin: DVec2| {
            let all = rings.clone().flat_map(|ring| polygon::sides(ring));
            all.map(|(from, to)| distance(from - centre, to - centre, margin)).fold(f64::INFINITY, f64::min)
        };
        if free { nearest(self.margin) } else { -nearest(DVec2::ZERO) }
    }
}

/// The least of max(|x| − margin.x, |y| − margin.y) along a side. The function is convex and linear between the places
/// where x or y changes its sign or the two terms are equal, so its minimum is at one of those or at an end.
fn distance(from: DVec2, to: DVec2, margin: DVec2) -> f64 {
    let along = to - from;
    let value = |share: f64| {
        let at = (from + along * share).abs() - margin;
        at.x.max(at.y)
    };
    let mut least = value(0.0).min(value(1.0));
    let mut try_at = |share: f64| {
        if share > 0.0 && share < 1.0 {
            least = least.min(value(share));
        }
    };
    try_at(-from.x / along.x);
    try_at(-from.y / along.y);
    let more = margin.x - margin.y;
    for (x, y) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
        try_at((more - x * from.x + y * from.y) / (x * along.x - y * along.y));
    }
    least
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.rank.total_cmp(&other.rank)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_to_a_side_is_the_smallest_along_it() {
        let sides = [
            (DVec2::new(-3.0, 1.0), DVec2::new(2.0, 4.0)),
            (DVec2::new(2.0, -1.0), DVec2::new(2.0, 5.0)),
            (DVec2::new(-0.5, -2.0), DVec2::new(4.0, 0.3)),
            (DVec2::ONE, DVec2::ONE),
        ];
        for (from, to) in sides {
            for margin in [DVec2::ZERO, DVec2::new(0.3, 0.1)] {
                let sampled = (0..=100_000).map(|step| {
                    let at = from.lerp(to, f64::from(step) / 100_000.0).abs() - margin;
                    at.x.max(at.y)
                });
                let sampled = sampled.fold(f64::INFINITY, f64::min);
                let found = distance(from, to, margin);
                assert!((found - sampled).abs() < 1e-4, "{from} {to}: {found}, sampled {sampled}");
                assert!(found <= sampled + 1e-12);
            }
        }
    }

    #[test]
    fn a_long_outline_gives_the_full_width_nearest_to_the_wish() {
        let outline = [(0.0, 0.0), (10.0, 0.0), (10.0, 1.0), (0.0, 1.0)].map(DVec2::from);
        let space = FreeSpace::new(&outline, &[], DVec2::new(2.0, 1.0), 0.0);
        let (known, scale) = space.largest(1e-3).unwrap();
        assert!((scale - 0.5).abs() < 1e-3);
        for (wanted, expected) in [(3.0, 3.0), (9.9, 9.0), (-5.0, 1.0)] {
            let centre = space.nearest(scale * 0.995, DVec2::new(wanted, 0.5), known, 1e-3);
            assert!((centre.x - expected).abs() < 0.02, "{wanted}: {centre}");
        }
    }
}
