//! Cleans an instance mask: what is not connected to the skeleton is somebody else, a line, or noise.

use glam::DVec2;
use image::{GrayImage, Luma};
use imageproc::region_labelling::{Connectivity, connected_components};

use super::{Joint, index};
use crate::geometry::{Mask, PixelBox};

/// Coverage from which a pixel belongs to the person.
pub(super) const INSIDE: u8 = 128;
/// A piece that no bone crosses stays when it is at least this part of the largest piece.
const LARGE_PIECE: f64 = 0.25;

/// The bones that lie inside the body: pairs of joints.
const BONES: [(usize, usize); 14] = [
    (index::LEFT_SHOULDER, index::RIGHT_SHOULDER),
    (index::LEFT_HIP, index::RIGHT_HIP),
    (index::LEFT_SHOULDER, index::LEFT_HIP),
    (index::RIGHT_SHOULDER, index::RIGHT_HIP),
    (index::LEFT_SHOULDER, index::LEFT_ELBOW),
    (index::LEFT_ELBOW, index::LEFT_WRIST),
    (index::RIGHT_SHOULDER, index::RIGHT_ELBOW),
    (index::RIGHT_ELBOW, index::RIGHT_WRIST),
    (index::LEFT_HIP, index::LEFT_KNEE),
    (index::LEFT_KNEE, index::LEFT_ANKLE),
    (index::RIGHT_HIP, index::RIGHT_KNEE),
    (index::RIGHT_KNEE, index::RIGHT_ANKLE),
    (index::LEFT_ANKLE, index::LEFT_TOE),
    (index::RIGHT_ANKLE, index::RIGHT_TOE),
];

/// The bones of a pose as pieces of line, pixels of the clip.
pub(crate) fn bones(joints: &[Joint]) -> Vec<(DVec2, DVec2)> {
    BONES.iter().filter_map(|&(a, b)| Some((joints.get(a)?.pixel, joints.get(b)?.pixel))).collect()
}

/// Squared distance of a point from a piece of line, pixels².
pub(crate) fn squared_distance_px(point: DVec2, (from, to): (DVec2, DVec2)) -> f64 {
    let along = to - from;
    let length = along.length_squared();
    let part = if length > 0.0 { ((point - from).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
    point.distance_squared(from + along * part)
}

/// The mask without pieces that neither a bone crosses nor are large, cut to what is left.
pub(super) fn clean(mask: &Mask, joints: &[Joint]) -> Mask {
    let (width, height) = (mask.width as usize, mask.height as usize);
    let (labels, areas) = pieces(mask);
    let mut keep = vec![false; areas.len()];
    for (from, to) in bones(joints) {
        let steps = from.distance(to).clamp(1.0, 4096.0).ceil();
        for step in 0..=steps as usize {
            let at = from.lerp(to, step as f64 / steps).round();
            let (column, row) = (at.x - f64::from(mask.x0), at.y - f64::from(mask.y0));
            if column >= 0.0 && row >= 0.0 && column < width as f64 && row < height as f64 {
                let label = labels.get(row as usize * width + column as usize).copied().flatten();
                if let Some(keep) = label.and_then(|label| keep.get_mut(label)) {
                    *keep = true;
                }
            }
        }
    }
    let largest = areas.iter().copied().max().unwrap_or(0) as f64;
    for (keep, &area) in keep.iter_mut().zip(&areas) {
        *keep |= area as f64 >= LARGE_PIECE * largest;
    }
    let kept = |x: usize, y: usize| {
        labels.get(y * width + x).copied().flatten().is_some_and(|l| keep.get(l).copied().unwrap_or(false))
    };
    let mut cleaned = mask.clone();
    for y in 0..height {
        for x in 0..width {
            // The soft rim, one pixel wide, belongs to the piece it touches.
            let near = (y.saturating_sub(1)..=(y + 1).min(height - 1))
                .any(|v| (x.saturating_sub(1)..=(x + 1).min(width - 1)).any(|u| kept(u, v)));
            if !near && let Some(coverage) = cleaned.coverage.get_mut(y * width + x) {
                *coverage = 0;
            }
        }
    }
    cut(&cleaned)
}

/// Connected pieces of the inside pixels (8 neighbours): a label per pixel, and the area of each piece.
fn pieces(mask: &Mask) -> (Vec<Option<usize>>, Vec<usize>) {
    let inside = mask.coverage.iter().map(|&coverage| u8::from(coverage >= INSIDE)).collect();
    let Some(inside) = GrayImage::from_raw(mask.width, mask.height, inside) else {
        return Default::default();
    };
    let labels = connected_components(&inside, Connectivity::Eight, Luma([0]));
    // The library counts from 1 and gives 0 to the background.
    let labels: Vec<Option<usize>> =
        labels.pixels().map(|label| (label.0[0] as usize).checked_sub(1)).collect();
    let mut areas = vec![0; labels.iter().flatten().max().map_or(0, |last| last + 1)];
    for &label in labels.iter().flatten() {
        areas[label] += 1;
    }
    (labels, areas)
}

/// The same mask on the smallest rectangle that holds every pixel with any coverage.
pub(crate) fn cut(mask: &Mask) -> Mask {
    let width = mask.width as usize;
    let (mut x0, mut y0, mut x1, mut y1) = (usize::MAX, usize::MAX, 0, 0);
    for (i, _) in mask.coverage.iter().enumerate().filter(|(_, c)| **c > 0) {
        let (x, y) = (i % width.max(1), i / width.max(1));
        (x0, y0, x1, y1) = (x0.min(x), y0.min(y), x1.max(x), y1.max(y));
    }
    if x0 == usize::MAX {
        return Mask::default();
    }
    let rows = mask.coverage.chunks_exact(width).skip(y0).take(y1 - y0 + 1);
    let coverage = rows.flat_map(|row| row.iter().skip(x0).take(x1 - x0 + 1).copied()).collect();
    Mask {
        x0: mask.x0 + x0 as i32,
        y0: mask.y0 + y0 as i32,
        width: (x1 - x0 + 1) as u32,
        height: (y1 - y0 + 1) as u32,
        coverage,
    }
}

/// The box of the pixels inside the mask and of the joints that are seen; `None` when there is neither.
pub(super) fn bounds(mask: &Mask, joints: &[Joint]) -> Option<PixelBox> {
    let width = mask.width.max(1) as usize;
    let pixels = mask.coverage.iter().enumerate().filter(|(_, c)| **c >= INSIDE).flat_map(|(i, _)| {
        let corner = DVec2::new(f64::from(mask.x0), f64::from(mask.y0));
        let middle = corner + DVec2::new((i % width) as f64, (i / width) as f64);
        [middle - 0.5, middle + 0.5]
    });
    let seen = joints.iter().filter(|j| j.visibility > 0.5).map(|j| j.pixel);
    let (min, max) = pixels
        .chain(seen)
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(min, max), p| (min.min(p), max.max(p)));
    max.cmpge(min).all().then_some(PixelBox { min, max })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::pose::JOINTS;

    fn painted(width: u32, height: u32, boxes: &[(u32, u32, u32, u32)]) -> Mask {
        let inside = |x: u32, y: u32| boxes.iter().any(|&(l, t, r, b)| x >= l && x < r && y >= t && y < b);
        let coverage =
            (0..width * height).map(|i| if inside(i % width, i / width) { 255 } else { 0 }).collect();
        Mask { x0: 100, y0: 50, width, height, coverage }
    }

    fn standing_at(x: f64, y: f64) -> Vec<Joint> {
        vec![Joint { pixel: DVec2::new(x, y), depth_m: 0.0, visibility: 0.9 }; JOINTS]
    }

    #[test]
    fn islands_go_and_the_piece_with_the_skeleton_stays() {
        let mask = painted(60, 60, &[(20, 10, 35, 50), (50, 2, 55, 6)]);
        let cleaned = clean(&mask, &standing_at(125.0, 80.0));
        assert_eq!(cleaned.area_px(), 15 * 40);
        assert_eq!(cleaned, painted_cut());
    }

    fn painted_cut() -> Mask {
        Mask { x0: 120, y0: 60, width: 15, height: 40, coverage: vec![255; 15 * 40] }
    }

    #[test]
    fn a_small_foot_stays_when_a_bone_ends_in_it() {
        let mask = painted(60, 60, &[(20, 10, 35, 40), (22, 45, 26, 49)]);
        let mut joints = standing_at(125.0, 80.0);
        joints[index::LEFT_ANKLE].pixel = DVec2::new(124.0, 97.0);
        assert_eq!(clean(&mask, &joints).area_px(), 15 * 30 + 16);
    }

    #[test]
    fn the_box_holds_mask_and_seen_joints() {
        let mask = painted(60, 60, &[(20, 10, 35, 40)]);
        let mut joints = standing_at(125.0, 80.0);
        joints[0].pixel = DVec2::new(126.0, 55.0);
        joints[1] = Joint { pixel: DVec2::new(0.0, 0.0), depth_m: 0.0, visibility: 0.1 };
        let found = bounds(&mask, &joints).unwrap();
        assert_eq!(found, PixelBox { min: DVec2::new(119.5, 55.0), max: DVec2::new(134.5, 89.5) });
        assert!(bounds(&Mask::default(), &[]).is_none());
    }

    proptest! {
        #[test]
        fn cutting_changes_no_pixel(coverage in prop::collection::vec(prop_oneof![Just(0u8), any::<u8>()], 63)) {
            let mask = Mask { x0: -3, y0: 5, width: 9, height: 7, coverage };
            let small = cut(&mask);
            for y in 0..20 {
                for x in -10..20 {
                    prop_assert_eq!(small.at(x, y), mask.at(x, y));
                }
            }
        }
    }
}
