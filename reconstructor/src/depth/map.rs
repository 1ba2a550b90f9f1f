//! The two surfaces of a player on their own grid of cells.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::geometry::Mask;

/// Most cells of a map: the network's output is far smaller, a damaged map does not fill the memory.
const MOST_CELLS: u64 = 1 << 20;
/// Coverage from which a cell is inside.
const INSIDE: u8 = 128;

/// Depth of one player, first and last surface, over square cells of the clip's picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DepthMap {
    /// Pixel of the clip in the middle of the first cell.
    pub first_px: DVec2,
    /// Side of a cell, pixels of the clip.
    pub cell_px: f64,
    /// Cells in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Share of each cell that shows the player, 0..255, row by row.
    pub coverage: Vec<u8>,
    /// Signed distance in millimetres along the camera's optical axis from the upright virtual plane to the surface that is seen,
    /// positive away from the camera; 0 where nothing of the player is.
    pub front_mm: Vec<i16>,
    /// The same to the body's last surface, which the network only guesses. Never smaller than `front_mm`.
    pub back_mm: Vec<i16>,
}

impl DepthMap {
    /// Whether sizes and numbers fit together.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let cells = u64::from(self.width) * u64::from(self.height);
        let lengths = [self.coverage.len(), self.front_mm.len(), self.back_mm.len()];
        cells <= MOST_CELLS
            && lengths.iter().all(|&length| length as u64 == cells)
            && self.first_px.is_finite()
            && self.cell_px.is_finite()
            && self.cell_px > 1e-3
    }

    /// The middle of a cell, pixels of the clip; whole numbers are cells.
    #[must_use]
    pub fn pixel(&self, cell: DVec2) -> DVec2 {
        self.first_px + cell * self.cell_px
    }

    /// Where a pixel of the clip lies on the cells.
    #[must_use]
    pub fn place(&self, pixel: DVec2) -> DVec2 {
        (pixel - self.first_px) / self.cell_px
    }

    /// Coverage of a cell; 0 outside.
    #[must_use]
    pub fn covered(&self, column: i64, row: i64) -> u8 {
        let inside =
            column >= 0 && row >= 0 && column < i64::from(self.width) && row < i64::from(self.height);
        let index = || row as usize * self.width as usize + column as usize;
        if inside { self.coverage.get(index()).copied().unwrap_or(0) } else { 0 }
    }

    /// First and last surface in a cell that is the player's more than not, metres from the upright plane.
    #[must_use]
    pub fn surfaces_m(&self, column: i64, row: i64) -> Option<[f64; 2]> {
        if self.covered(column, row) < INSIDE {
            return None;
        }
        let cell = row as usize * self.width as usize + column as usize;
        let metres = |plane: &[i16]| plane.get(cell).map(|&mm| f64::from(mm) / 1000.0);
        Some([metres(&self.front_mm)?, metres(&self.back_mm)?])
    }

    /// The player's mask on the pixels of the clip.
    #[must_use]
    pub fn mask(&self) -> Mask {
        if !self.is_whole() || self.width == 0 || self.height == 0 {
            return Mask::default();
        }
        let cells = DVec2::new(f64::from(self.width), f64::from(self.height));
        let low = (self.pixel(DVec2::splat(-1.0))).floor();
        let high = (self.pixel(cells)).ceil();
        let (x0, y0) = (low.x as i32, low.y as i32);
        let (width, height) = ((high.x - low.x) as u32 + 1, (high.y - low.y) as u32 + 1);
        // Cells smaller than pixels are averaged.
        let parts = (1.0 / self.cell_px).ceil().clamp(1.0, 8.0) as usize;
        let share = |part: usize| (part as f64 + 0.5) / parts as f64 - 0.5;
        let mut coverage = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                let middle = low + DVec2::new(f64::from(x), f64::from(y));
                let sum: f64 = (0..parts * parts)
                    .map(|k| self.coverage_at(middle + DVec2::new(share(k % parts), share(k / parts))))
                    .sum();
                coverage.push((sum / (parts * parts) as f64).round() as u8);
            }
        }
        Mask { x0, y0, width, height, coverage }
    }

    /// Coverage 0..255 between the middles of cells.
    fn coverage_at(&self, pixel: DVec2) -> f64 {
        self.corners(pixel).map(|([x, y], share)| share * f64::from(self.covered(x, y))).iter().sum()
    }

    /// Both surfaces between the middles of cells, metres from the upright plane, of those cells that are the player's; `None` where most
    /// is not.
    #[must_use]
    pub fn surfaces_at(&self, pixel: DVec2) -> Option<[f64; 2]> {
        let (mut sums, mut weight) = ([0.0; 2], 0.0);
        for ([x, y], share) in self.corners(pixel) {
            if let Some(surfaces_m) = self.surfaces_m(x, y) {
                sums = [0, 1].map(|side| sums[side] + share * surfaces_m[side]);
                weight += share;
            }
        }
        (weight > 0.5).then(|| sums.map(|sum| sum / weight))
    }

    /// The four cells (column, row) around a pixel and the share of each.
    fn corners(&self, pixel: DVec2) -> [([i64; 2], f64); 4] {
        let place = self.place(pixel);
        let low = place.floor();
        let t = place - low;
        let share = |dx: i64, dy: i64| {
            let along = |step: i64, t: f64| if step == 1 { t } else { 1.0 - t };
            along(dx, t.x) * along(dy, t.y)
        };
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
            ([(low.x as i64).saturating_add(dx), (low.y as i64).saturating_add(dy)], share(dx, dy))
        })
    }
}

/// Metres as a map stores them.
pub(super) fn millimetres(metres: f64) -> i16 {
    (1000.0 * metres).round().clamp(-32_000.0, 32_000.0) as i16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mask_covers_the_pixels_that_the_cells_cover() {
        // Cells of half a pixel from pixel 10 on: 8 × 6 of them are pixels 10..14 by 20..23.
        let map = DepthMap {
            first_px: DVec2::new(9.75, 19.75),
            cell_px: 0.5,
            width: 8,
            height: 6,
            coverage: vec![255; 48],
            front_mm: vec![0; 48],
            back_mm: vec![0; 48],
        };
        let mask = map.mask();
        let inside: Vec<(i32, i32)> = (15..28)
            .flat_map(|y| (5..20).map(move |x| (x, y)))
            .filter(|&(x, y)| mask.at(x, y) >= 128)
            .collect();
        let expected: Vec<(i32, i32)> = (20..23).flat_map(|y| (10..14).map(move |x| (x, y))).collect();
        assert_eq!(inside, expected);
        assert_eq!(mask.at(11, 21), 255);
    }

    #[test]
    fn damaged_maps_are_known_and_empty() {
        let map = DepthMap { width: u32::MAX, height: u32::MAX, cell_px: 1.0, ..DepthMap::default() };
        assert!(!map.is_whole());
        assert_eq!(map.mask(), Mask::default());
        assert!(!DepthMap::default().is_whole(), "cells without a side");
    }
}
