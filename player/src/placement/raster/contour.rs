//! From cells to a polygon: the outer boundary of a mask, made straight where it is straight to within a cell.

use glam::DVec2;

use super::mask::Mask;

/// How far a corner may lie off the simplified boundary, in cells.
const TOLERANCE: f64 = 1.0;

/// The outer boundary of the first piece of a mask, corners in cells (x to the right, y down the rows, whole numbers are
/// edges of cells), counter-clockwise when y is drawn upwards. Empty for an empty mask.
pub(in crate::placement) fn outline(mask: &Mask) -> Vec<DVec2> {
    let Some(first) = mask.cells().next() else { return Vec::new() };
    let (column, row) = ((first % mask.columns()) as i64, (first / mask.columns()) as i64);
    // The first cell in order has nothing before it in its row and nothing in the row before: walk to the right along
    // its lower edge, set cells to the left.
    let start = (column, row);
    let (mut at, mut heading) = (start, (1_i64, 0_i64));
    let mut corners = Vec::new();
    loop {
        let next = (at.0 + heading.0, at.1 + heading.1);
        let left = (-heading.1, heading.0);
        let ahead_left = cell_beside(next, heading, left, true);
        let ahead_right = cell_beside(next, heading, left, false);
        let turned = if mask.at(ahead_right.0, ahead_right.1) && mask.at(ahead_left.0, ahead_left.1) {
            (-left.0, -left.1)
        } else if mask.at(ahead_left.0, ahead_left.1) {
            heading
        } else {
            left
        };
        if turned != heading {
            corners.push(DVec2::new(next.0 as f64, next.1 as f64));
        }
        (at, heading) = (next, turned);
        if at == start && heading == (1, 0) {
            break;
        }
    }
    let simple = simplify(&corners);
    // What is thinner than the tolerance would become a line.
    if simple.len() < 3 { corners } else { simple }
}

/// The cell on the left or right of the edge that goes on from a corner.
fn cell_beside(corner: (i64, i64), heading: (i64, i64), left: (i64, i64), is_left: bool) -> (i64, i64) {
    let side = if is_left { left } else { (-left.0, -left.1) };
    let lower = |step: i64, side: i64| if step + side < 0 { -1 } else { 0 };
    (corner.0 + lower(heading.0, side.0), corner.1 + lower(heading.1, side.1))
}

/// Douglas and Peucker's simplification of a closed line, begun at its two most distant corners.
fn simplify(corners: &[DVec2]) -> Vec<DVec2> {
    let Some(first) = corners.first() else { return Vec::new() };
    let farthest = |from: DVec2| {
        let distances = corners.iter().map(|corner| corner.distance_squared(from));
        distances.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
    };
    let one = farthest(*first);
    let other = farthest(corners.get(one).copied().unwrap_or(*first));
    let (low, high) = (one.min(other), one.max(other));
    let mut turned = corners.to_vec();
    turned.rotate_left(low);
    turned.extend(turned.first().copied());
    let mut kept = vec![false; turned.len()];
    for index in [0, high - low] {
        if let Some(slot) = kept.get_mut(index) {
            *slot = true;
        }
    }
    let mut spans = vec![(0, high - low), (high - low, turned.len() - 1)];
    while let Some((from, to)) = spans.pop() {
        let (Some(a), Some(b)) = (turned.get(from), turned.get(to)) else { continue };
        let along = (*b - *a).normalize_or_zero();
        let worst = (from + 1..to)
            .filter_map(|index| turned.get(index).map(|corner| (index, along.perp_dot(*corner - *a).abs())))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((index, off)) = worst
            && off > TOLERANCE
        {
            if let Some(slot) = kept.get_mut(index) {
                *slot = true;
            }
            spans.push((from, index));
            spans.push((index, to));
        }
    }
    let last = turned.len() - 1;
    turned.iter().zip(kept).take(last).filter_map(|(corner, kept)| kept.then_some(*corner)).collect()
}

#[cfg(test)]
mod tests {
    use super::{super::mask::drawn, *};

    fn area(corners: &[DVec2]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| a.perp_dot(*b)).sum::<f64>() / 2.0
    }

    #[test]
    fn a_rectangle_has_four_corners_and_runs_counter_clockwise() {
        let corners = outline(&drawn(&["......", ".####.", ".####.", ".####.", "......"]));
        assert_eq!(corners.len(), 4, "{corners:?}");
        assert_eq!(area(&corners), 12.0);
        assert!(outline(&drawn(&["...", "..."])).is_empty());
        assert_eq!(area(&outline(&drawn(&["#"]))), 1.0);
    }

    #[test]
    fn notches_deeper_than_the_tolerance_stay() {
        let corners = outline(&drawn(&[
            "..........",
            ".########.",
            ".########.",
            ".##....##.",
            ".##....##.",
            ".##....##.",
            "..........",
        ]));
        assert_eq!(corners.len(), 8, "{corners:?}");
        assert_eq!(area(&corners), 28.0);
        // Cells that touch at a corner only do not lead the walk astray.
        let touching = outline(&drawn(&["....", ".#..", "..#.", "...."]));
        assert_eq!(area(&touching), 1.0);
    }
}
