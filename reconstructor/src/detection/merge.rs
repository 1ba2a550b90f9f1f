//! One box per person out of the boxes of overlapping tiles.
//!
//! A person cut by a tile's edge is usually whole in the neighbouring tile and gives way to that box; one too large for
//! the overlap is put together from its halves.

use super::{Detection, tiles::Edges};
use crate::geometry::PixelBox;

/// Overlap above which two boxes are the same person.
const SAME_IOU: f64 = 0.5;
/// A cut box that lies this much inside another one is a part of that person.
const PART_OF: f64 = 0.6;
/// Two cut boxes must agree this much along the cut to be halves of one person.
const HALVES_AGREE: f64 = 0.6;

/// A box of one tile, in pixels of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    /// The box.
    pub(super) detection: Detection,
    /// Edges of the tile inside the picture that the box touches.
    pub(super) cut: Edges,
}

/// Boxes that overlap a better one by more than `iou` go; best first.
pub(super) fn suppress(mut boxes: Vec<Detection>, iou: f64) -> Vec<Detection> {
    boxes.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<Detection> = Vec::new();
    for candidate in boxes {
        if kept.iter().all(|better| better.bounds.iou(&candidate.bounds) <= iou) {
            kept.push(candidate);
        }
    }
    kept
}

/// One detection per person from the boxes of all tiles, best first.
pub(super) fn merge(found: Vec<Found>) -> Vec<Detection> {
    let (cut, whole): (Vec<Found>, Vec<Found>) = found.into_iter().partition(|f| f.cut.any());
    let mut kept = suppress(whole.into_iter().map(|f| f.detection).collect(), SAME_IOU);
    let orphans: Vec<Found> =
        cut.into_iter().filter(|f| !kept.iter().any(|w| is_part(&f.detection.bounds, &w.bounds))).collect();
    kept.extend(joined(orphans));
    suppress(kept, SAME_IOU)
}

fn is_part(part: &PixelBox, whole: &PixelBox) -> bool {
    part.iou(whole) > SAME_IOU || intersection(part, whole) > PART_OF * area(part)
}

/// Puts halves together; what finds no other half stays as it is, unless a larger piece covers it.
fn joined(mut pieces: Vec<Found>) -> Vec<Detection> {
    'again: loop {
        for i in 0..pieces.len() {
            for j in i + 1..pieces.len() {
                if are_halves(&pieces[i], &pieces[j]) {
                    let other = pieces.swap_remove(j);
                    pieces[i] = union(&pieces[i], &other);
                    continue 'again;
                }
            }
        }
        break;
    }
    pieces.sort_by(|a, b| area(&b.detection.bounds).total_cmp(&area(&a.detection.bounds)));
    let mut kept: Vec<Detection> = Vec::new();
    for piece in pieces {
        if !kept.iter().any(|larger| is_part(&piece.detection.bounds, &larger.bounds)) {
            kept.push(piece.detection);
        }
    }
    kept
}

/// Whether one box is cut where the other goes on: they overlap, and agree in the direction along the cut.
fn are_halves(a: &Found, b: &Found) -> bool {
    let (p, q) = (&a.detection.bounds, &b.detection.bounds);
    if intersection(p, q) <= 0.0 {
        return false;
    }
    let opposite_x = (a.cut.right && b.cut.left) || (a.cut.left && b.cut.right);
    let opposite_y = (a.cut.bottom && b.cut.top) || (a.cut.top && b.cut.bottom);
    let agree = |p0: f64, p1: f64, q0: f64, q1: f64| {
        let shared = p1.min(q1) - p0.max(q0);
        let total = p1.max(q1) - p0.min(q0);
        total > 0.0 && shared / total > HALVES_AGREE
    };
    (opposite_x && agree(p.min.y, p.max.y, q.min.y, q.max.y))
        || (opposite_y && agree(p.min.x, p.max.x, q.min.x, q.max.x))
}

fn union(a: &Found, b: &Found) -> Found {
    let (p, q) = (&a.detection.bounds, &b.detection.bounds);
    let bounds = PixelBox { min: p.min.min(q.min), max: p.max.max(q.max) };
    let score = a.detection.score.max(b.detection.score);
    // An edge stays cut only where the union ends at it.
    let cut = Edges {
        left: if p.min.x < q.min.x { a.cut.left } else { b.cut.left },
        top: if p.min.y < q.min.y { a.cut.top } else { b.cut.top },
        right: if p.max.x > q.max.x { a.cut.right } else { b.cut.right },
        bottom: if p.max.y > q.max.y { a.cut.bottom } else { b.cut.bottom },
    };
    Found { detection: Detection { bounds, score }, cut }
}

fn area(b: &PixelBox) -> f64 {
    b.size().x * b.size().y
}

fn intersection(a: &PixelBox, b: &PixelBox) -> f64 {
    area(&PixelBox { min: a.min.max(b.min), max: a.max.min(b.max) })
}

#[cfg(test)]
mod tests {
    use glam::DVec2;
    use proptest::prelude::*;

    use super::*;

    fn found(x0: f64, y0: f64, x1: f64, y1: f64, score: f32, cut: Edges) -> Found {
        let bounds = PixelBox { min: DVec2::new(x0, y0), max: DVec2::new(x1, y1) };
        Found { detection: Detection { bounds, score }, cut }
    }

    const WHOLE: Edges = Edges { left: false, top: false, right: false, bottom: false };
    const CUT_RIGHT: Edges = Edges { right: true, ..WHOLE };
    const CUT_LEFT: Edges = Edges { left: true, ..WHOLE };

    #[test]
    fn half_a_person_gives_way_to_the_whole_even_with_a_better_score() {
        let half = found(100.0, 50.0, 112.0, 110.0, 0.9, CUT_RIGHT);
        let whole = found(100.0, 50.0, 125.0, 110.0, 0.4, WHOLE);
        assert_eq!(merge(vec![half, whole]), [whole.detection]);
    }

    #[test]
    fn two_halves_become_one_person() {
        let left = found(100.0, 50.0, 300.0, 400.0, 0.5, CUT_RIGHT);
        let right = found(200.0, 55.0, 420.0, 410.0, 0.7, CUT_LEFT);
        let merged = merge(vec![left, right]);
        assert_eq!(merged.len(), 1);
        assert_eq!(
            merged[0].bounds,
            PixelBox { min: DVec2::new(100.0, 50.0), max: DVec2::new(420.0, 410.0) }
        );
        assert!((merged[0].score - 0.7).abs() < 1e-6);
    }

    #[test]
    fn neighbours_on_both_sides_of_an_edge_stay_two() {
        let left = found(100.0, 50.0, 130.0, 110.0, 0.5, CUT_RIGHT);
        let right = found(128.0, 90.0, 160.0, 170.0, 0.5, CUT_LEFT);
        assert_eq!(merge(vec![left, right]).len(), 2);
    }

    #[test]
    fn the_same_person_seen_whole_in_two_tiles_is_one() {
        let a = found(100.0, 50.0, 130.0, 110.0, 0.5, WHOLE);
        let b = found(101.0, 51.0, 131.0, 112.0, 0.6, WHOLE);
        assert_eq!(merge(vec![a, b]), [b.detection]);
    }

    proptest! {
        #[test]
        fn merging_never_leaves_two_boxes_on_one_person(
            boxes in prop::collection::vec((0.0..300.0, 0.0..300.0, 5.0..80.0, 5.0..80.0, 0.0f32..1.0, 0u8..16), 0..40)
        ) {
            let found: Vec<Found> = boxes.into_iter().map(|(x, y, w, h, score, cut)| {
                let cut = Edges { left: cut & 1 > 0, top: cut & 2 > 0, right: cut & 4 > 0, bottom: cut & 8 > 0 };
                found(x, y, x + w, y + h, score, cut)
            }).collect();
            let any = !found.is_empty();
            let merged = merge(found);
            prop_assert_eq!(any, !merged.is_empty());
            for (i, a) in merged.iter().enumerate() {
                for b in merged.iter().skip(i + 1) {
                    prop_assert!(a.score >= b.score && a.bounds.iou(&b.bounds) <= SAME_IOU);
                }
            }
        }
    }
}
