//! A grid of cells over one player: the clip's own pixels for players of a broadcast, coarser for larger ones, or of a fixed size for a
//! network. Pictures and masks are sampled onto it, and what was decided on it goes back to pixels.

use glam::DVec2;
use image::RgbImage;

use crate::geometry::{Mask, PixelBox};

/// Cells along a side at most; a damaged box does not fill the memory.
const SIDE_MAX: f64 = 512.0;

/// Cells of equal size over a part of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Outer corner of the first cell, pixels of the clip (the first pixel begins at −½).
    pub(super) corner: DVec2,
    /// Side of a cell, pixels of the clip.
    pub(super) cell_px: f64,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Grid {
    /// Over a box with a margin (share of its height), on whole pixels and inside the picture; cells grow so that there are no more
    /// than `rows_max` rows. `None` when the box is empty, broken or outside.
    pub(super) fn over(bounds: &PixelBox, margin: f64, rows_max: usize, picture: (u32, u32)) -> Option<Self> {
        let reach = DVec2::splat(margin * bounds.size().y);
        let last = DVec2::new(f64::from(picture.0), f64::from(picture.1)) - 0.5;
        let low = ((bounds.min - reach).round() - 0.5).max(DVec2::splat(-0.5));
        let high = ((bounds.max + reach).round() + 0.5).min(last);
        let size = high - low;
        if !(low.is_finite() && size.is_finite() && size.cmpge(DVec2::ONE).all()) {
            return None;
        }
        let cell_px = (size.y / rows_max.max(1) as f64).max(size.x / SIDE_MAX).max(1.0);
        let cells = (size / cell_px).ceil().clamp(DVec2::ONE, DVec2::splat(SIDE_MAX));
        Some(Self { corner: low, cell_px, width: cells.x as usize, height: cells.y as usize })
    }

    pub(super) fn len(&self) -> usize {
        self.width * self.height
    }

    /// The middle of a cell, pixels of the clip.
    pub(super) fn centre(&self, index: usize) -> DVec2 {
        let width = self.width.max(1);
        let cell = DVec2::new((index % width) as f64, (index / width) as f64);
        self.corner + (cell + 0.5) * self.cell_px
    }

    /// The box of all cells.
    pub(super) fn bounds(&self) -> PixelBox {
        let size = DVec2::new(self.width as f64, self.height as f64) * self.cell_px;
        PixelBox { min: self.corner, max: self.corner + size }
    }

    /// Points inside a cell whose average stands for it: one when cells are no larger than pixels.
    fn samples(&self) -> usize {
        (self.cell_px.ceil() as usize).clamp(1, 16)
    }

    fn average<const N: usize>(&self, index: usize, at: impl Fn(DVec2) -> [f32; N]) -> [f32; N] {
        let n = self.samples();
        let middle = self.centre(index);
        let mut sum = [0.0; N];
        for sub in 0..n * n {
            let part = |k: usize| ((k as f64 + 0.5) / n as f64 - 0.5) * self.cell_px;
            let value = at(middle + DVec2::new(part(sub % n), part(sub / n)));
            sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += value);
        }
        sum.map(|sum| sum / (n * n) as f32)
    }

    /// The picture's colour in every cell, 0..1; beyond the border the nearest pixel.
    pub(super) fn colours(&self, picture: &RgbImage) -> Vec<[f32; 3]> {
        if picture.is_empty() {
            return vec![[0.0; 3]; self.len()];
        }
        let (right, bottom) = (i64::from(picture.width()) - 1, i64::from(picture.height()) - 1);
        let pixel = |x: i64, y: i64| {
            let pixel = picture.get_pixel(x.clamp(0, right) as u32, y.clamp(0, bottom) as u32);
            pixel.0.map(|value| f32::from(value) / 255.0)
        };
        (0..self.len()).map(|i| self.average(i, |at| bilinear(at, pixel))).collect()
    }

    /// A mask's coverage in every cell, 0..1.
    pub(super) fn coverage(&self, mask: &Mask) -> Vec<f32> {
        let pixel = |x: i64, y: i64| {
            let at = i32::try_from(x).ok().zip(i32::try_from(y).ok());
            [f32::from(at.map_or(0, |(x, y)| mask.at(x, y))) / 255.0]
        };
        (0..self.len()).map(|i| self.average(i, |at| bilinear(at, pixel))[0]).collect()
    }

    /// Values of the cells, 0..1, as a mask on the pixels of a picture; what is no number is empty.
    pub(super) fn mask(&self, values: &[f32], picture: (u32, u32)) -> Mask {
        let bounds = self.bounds();
        let last = DVec2::new(f64::from(picture.0) - 1.0, f64::from(picture.1) - 1.0);
        let low = (bounds.min + 0.25).ceil().max(DVec2::ZERO);
        let high = (bounds.max - 0.25).floor().min(last);
        if !(high.cmpge(low).all()) {
            return Mask::default();
        }
        let cell = |x: i64, y: i64| {
            let (x, y) = (x.clamp(0, self.width as i64 - 1), y.clamp(0, self.height as i64 - 1));
            let value = values.get(y as usize * self.width + x as usize).copied().unwrap_or(0.0);
            [if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }]
        };
        let (width, height) = ((high.x - low.x) as u32 + 1, (high.y - low.y) as u32 + 1);
        let mut coverage = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                let pixel = low + DVec2::new(f64::from(x), f64::from(y));
                let at = (pixel - self.corner) / self.cell_px - 0.5;
                let [value] = if self.cell_px < 1.0 { self.over_pixel(at, cell) } else { bilinear(at, cell) };
                coverage.push((255.0 * value).round() as u8);
            }
        }
        Mask { x0: low.x as i32, y0: low.y as i32, width, height, coverage }
    }

    /// The average of the cells that a pixel covers, when cells are smaller than pixels.
    fn over_pixel(&self, at: DVec2, cell: impl Fn(i64, i64) -> [f32; 1]) -> [f32; 1] {
        let n = ((1.0 / self.cell_px).ceil() as usize).clamp(1, 8);
        let mut sum = 0.0;
        for sub in 0..n * n {
            let part = |k: usize| ((k as f64 + 0.5) / n as f64 - 0.5) / self.cell_px;
            sum += bilinear(at + DVec2::new(part(sub % n), part(sub / n)), &cell)[0];
        }
        [sum / (n * n) as f32]
    }
}

/// Between four values at whole numbers.
fn bilinear<const N: usize>(at: DVec2, value: impl Fn(i64, i64) -> [f32; N]) -> [f32; N] {
    let low = at.floor();
    let (fx, fy) = ((at.x - low.x) as f32, (at.y - low.y) as f32);
    let (x, y) = (low.x as i64, low.y as i64);
    if fx == 0.0 && fy == 0.0 {
        return value(x, y);
    }
    let (a, b, c, d) = (value(x, y), value(x + 1, y), value(x, y + 1), value(x + 1, y + 1));
    let mut mixed = [0.0; N];
    for (k, mixed) in mixed.iter_mut().enumerate() {
        let top = a[k] + (b[k] - a[k]) * fx;
        let bottom = c[k] + (d[k] - c[k]) * fx;
        *mixed = top + (bottom - top) * fy;
    }
    mixed
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bounds(low: (f64, f64), size: (f64, f64)) -> PixelBox {
        let min = DVec2::new(low.0, low.1);
        PixelBox { min, max: min + DVec2::new(size.0, size.1) }
    }

    proptest! {
        #[test]
        fn on_the_clips_own_pixels_nothing_changes(
            coverage in prop::collection::vec(any::<u8>(), 12 * 20),
            x0 in -5..60_i32,
            y0 in -5..60_i32,
        ) {
            let mask = Mask { x0, y0, width: 12, height: 20, coverage };
            let around = bounds((f64::from(x0), f64::from(y0)), (11.0, 19.0));
            let Some(grid) = Grid::over(&around, 0.1, 96, (70, 70)) else { return Ok(()) };
            prop_assert_eq!(grid.cell_px, 1.0);
            let back = grid.mask(&grid.coverage(&mask), (70, 70));
            for (x, y) in (0..70).flat_map(|x| (0..70).map(move |y| (x, y))) {
                prop_assert_eq!(back.at(x, y), mask.at(x, y));
            }
        }

        #[test]
        fn whatever_the_box_a_grid_is_bounded(
            x in prop::num::f64::ANY,
            y in -1e4..1e4_f64,
            width in prop::num::f64::ANY,
            height in 0.0..1e5_f64,
        ) {
            if let Some(grid) = Grid::over(&bounds((x, y), (width, height)), 0.1, 96, (1920, 1080)) {
                prop_assert!(grid.height <= 97 && grid.width <= 512 && grid.len() > 0);
                prop_assert_eq!(grid.colours(&RgbImage::new(1, 1)).len(), grid.len());
            }
        }
    }

    #[test]
    fn a_window_of_small_cells_gives_the_area_of_a_disc_back() {
        let grid = Grid { corner: DVec2::new(10.2, 5.7), cell_px: 0.4, width: 64, height: 96 };
        let middle = DVec2::new(23.0, 25.0);
        let inside = |i: usize| f32::from(u8::from(grid.centre(i).distance(middle) < 8.0));
        let values: Vec<f32> = (0..grid.len()).map(inside).collect();
        let area = grid.mask(&values, (100, 100)).area_px() as f64;
        assert!((area - std::f64::consts::PI * 64.0).abs() < 6.0, "{area}");
    }
}
