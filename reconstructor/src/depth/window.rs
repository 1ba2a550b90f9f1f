//! The square of the picture that the depth network looks at, of fixed metric size around one player's mask.
//!
//! `training/depth/window.py` does the same arithmetic; a test of this folder compares the two on a rendered player.

use glam::DVec2;
use image::RgbImage;

use crate::geometry::Mask;

/// Samples along one side of the picture that the network sees, and cells along one side of its output.
pub(super) const PICTURE_SIZE: usize = 128;
/// Cells along one side of the painted pose.
pub(super) const GRID: usize = 64;
/// Side of the window at the player, metres: a player with arms stretched fits.
const WINDOW_M: f64 = 2.2;
/// The window is at least this many times the mask's larger side: dives and high kicks fit too.
const WINDOW_SLACK: f64 = 1.15;
/// Samples per cell and axis are at most this many, so that a huge window costs no more than a large one.
const MOST_SAMPLES: f64 = 8.0;

/// A square of the clip's picture, in its pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// The middle, pixels of the clip.
    pub centre_px: DVec2,
    /// Length of a side, pixels of the clip.
    pub side_px: f64,
}

impl Window {
    /// The window around the pixels of `mask` that are at least half covered; `None` when there are none.
    #[must_use]
    pub fn around(mask: &Mask, pixels_per_metre: f64) -> Option<Self> {
        let columns = mask.width.max(1) as usize;
        let mut bounds: Option<(usize, usize, usize, usize)> = None;
        for (i, _) in mask.coverage.iter().enumerate().filter(|&(_, &c)| c >= 128) {
            let (x, y) = (i % columns, i / columns);
            let (x0, y0, x1, y1) = bounds.unwrap_or((x, y, x, y));
            bounds = Some((x0.min(x), y0.min(y), x1.max(x), y1.max(y)));
        }
        let (x0, y0, x1, y1) = bounds?;
        let min = DVec2::new(x0 as f64 + f64::from(mask.x0), y0 as f64 + f64::from(mask.y0));
        let max = DVec2::new(x1 as f64 + f64::from(mask.x0), y1 as f64 + f64::from(mask.y0));
        let slack = WINDOW_SLACK * ((max - min).max_element() + 1.0);
        Some(Self { centre_px: (min + max) / 2.0, side_px: (WINDOW_M * pixels_per_metre).max(slack) })
    }

    /// Where the middle of a cell lies, `size` cells along a side: one coordinate, pixels of the clip.
    pub(super) fn cell(&self, axis: usize, index: usize, size: usize) -> f64 {
        self.centre_px[axis] + ((index as f64 + 0.5) / size as f64 - 0.5) * self.side_px
    }

    /// Where a pixel of the clip lies on a grid of `size` cells along a side; whole numbers are the middles of cells.
    pub(super) fn place(&self, pixel: DVec2, size: usize) -> DVec2 {
        ((pixel - self.centre_px) / self.side_px + 0.5) * size as f64 - 0.5
    }

    /// Red, green, blue and mask, 0..1, as four planes of [`PICTURE_SIZE`]²: bilinear, averaged where the picture shrinks,
    /// the border pixel repeated outside.
    pub(super) fn picture(&self, image: &RgbImage, mask: &Mask) -> Vec<f32> {
        let per_cell = (self.side_px / PICTURE_SIZE as f64 - 1e-6).ceil().clamp(1.0, MOST_SAMPLES) as usize;
        let columns = taps(self, 0, per_cell, image.width());
        let rows = taps(self, 1, per_cell, image.height());
        let plane = PICTURE_SIZE * PICTURE_SIZE;
        let mut sums = vec![0.0f64; 4 * plane];
        for (j, row) in rows.iter().enumerate() {
            for (i, column) in columns.iter().enumerate() {
                let cell = (j / per_cell) * PICTURE_SIZE + i / per_cell;
                let value = bilinear(image, mask, row, column);
                for (sum, value) in sums.iter_mut().skip(cell).step_by(plane).zip(value) {
                    *sum += value;
                }
            }
        }
        let scale = 1.0 / (255.0 * (per_cell * per_cell) as f64);
        sums.into_iter().map(|sum| (sum * scale) as f32).collect()
    }
}

/// Two neighbouring pixels along one axis and the share of the second.
struct Tap {
    low: u32,
    high: u32,
    share: f64,
}

fn taps(window: &Window, axis: usize, per_cell: usize, length: u32) -> Vec<Tap> {
    let last = length.saturating_sub(1);
    let samples = PICTURE_SIZE * per_cell;
    (0..samples)
        .map(|index| {
            let place = window.cell(axis, index, samples).clamp(0.0, f64::from(last));
            let low = place.floor();
            Tap { low: low as u32, high: (low as u32 + 1).min(last), share: place - low }
        })
        .collect()
}

fn bilinear(image: &RgbImage, mask: &Mask, row: &Tap, column: &Tap) -> [f64; 4] {
    let at = |x: u32, y: u32| {
        let [r, g, b] = image.get_pixel_checked(x, y).map_or([0; 3], |p| p.0);
        [r, g, b, mask.at(x as i32, y as i32)].map(f64::from)
    };
    let mix = |a: [f64; 4], b: [f64; 4], t: f64| [0, 1, 2, 3].map(|c| a[c] * (1.0 - t) + b[c] * t);
    let left = mix(at(column.low, row.low), at(column.low, row.high), row.share);
    let right = mix(at(column.high, row.low), at(column.high, row.high), row.share);
    mix(left, right, column.share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(x0: i32, y0: i32, width: u32, height: u32) -> Mask {
        Mask { x0, y0, width, height, coverage: vec![255; (width * height) as usize] }
    }

    #[test]
    fn a_standing_player_gets_the_metric_window_and_a_long_one_a_larger() {
        let window = Window::around(&block(100, 50, 20, 60), 40.0).unwrap();
        assert_eq!(window, Window { centre_px: DVec2::new(109.5, 79.5), side_px: 88.0 });
        let window = Window::around(&block(-10, 0, 100, 30), 40.0).unwrap();
        assert!((window.side_px - 115.0).abs() < 1e-9);
        assert_eq!(window.centre_px.x, 39.5);
    }

    #[test]
    fn an_empty_mask_has_no_window() {
        let faint = Mask { coverage: vec![127; 12], ..block(0, 0, 3, 4) };
        assert_eq!(Window::around(&faint, 40.0), None);
        assert_eq!(Window::around(&Mask::default(), 40.0), None);
    }

    #[test]
    fn place_inverts_cell() {
        let window = Window { centre_px: DVec2::new(31.0, -4.0), side_px: 77.0 };
        let pixel = DVec2::new(window.cell(0, 5, GRID), window.cell(1, 60, GRID));
        assert!((window.place(pixel, GRID) - DVec2::new(5.0, 60.0)).length() < 1e-9);
    }

    #[test]
    fn a_window_of_its_own_size_is_the_picture_and_a_double_one_its_average() {
        let image = RgbImage::from_fn(256, 256, |x, y| image::Rgb([x as u8, y as u8, 7]));
        let mask = block(0, 0, 128, 256);
        let centre_px = DVec2::new(63.5, 63.5);
        let same = Window { centre_px, side_px: 128.0 }.picture(&image, &mask);
        let plane = PICTURE_SIZE * PICTURE_SIZE;
        assert!((same[3 * PICTURE_SIZE + 9] - 9.0 / 255.0).abs() < 1e-6, "red is the column");
        assert!((same[plane + 3 * PICTURE_SIZE + 9] - 3.0 / 255.0).abs() < 1e-6, "green is the row");
        let double = Window { centre_px: DVec2::splat(127.5), side_px: 256.0 }.picture(&image, &mask);
        assert!((double[9] - 18.5 / 255.0).abs() < 1e-6, "two columns averaged");
        assert!(
            (double[3 * plane + 63] - 1.0).abs() < 1e-6 && double[3 * plane + 64] == 0.0,
            "the mask ends at column 128"
        );
    }

    #[test]
    fn outside_the_picture_the_border_is_repeated() {
        let image = RgbImage::from_fn(40, 40, |x, _| image::Rgb([x as u8, 0, 0]));
        let window = Window { centre_px: DVec2::new(0.0, 0.0), side_px: 128.0 };
        let picture = window.picture(&image, &block(0, 0, 4, 4));
        assert_eq!(picture[0], 0.0);
        assert!((picture[127] - 39.0 / 255.0).abs() < 1e-6);
    }
}
