//! A picture as the network wants it: scaled down when it is large, in planes, its sides multiples of 32.

use glam::DVec2;
use image::{RgbImage, imageops};

/// Largest picture that is searched, a side: 8K and then some.
pub(super) const SIDE_MAX_PX: u32 = 8192;
/// The network halves its input five times.
const MULTIPLE: u32 = 32;

/// The network's input.
pub(super) struct Input {
    /// Planes red, green, blue, 0..255, row by row; black beyond the picture.
    pub(super) planes: Vec<f32>,
    /// Rows of a plane.
    pub(super) rows: usize,
    /// Columns of a plane.
    pub(super) columns: usize,
    /// Pixels of the input per pixel of the clip, across and down.
    pub(super) scale: DVec2,
}

impl Input {
    /// `None` when the picture is empty or a side is too long.
    pub(super) fn of(picture: &RgbImage, pixels_max: u32) -> Option<Self> {
        let (width, height) = picture.dimensions();
        let sides = 1..=SIDE_MAX_PX;
        if !sides.contains(&width) || !sides.contains(&height) {
            return None;
        }
        let factor = (f64::from(pixels_max) / (f64::from(width) * f64::from(height))).sqrt();
        let small;
        let shown = if factor < 1.0 {
            let side = |side: u32| ((f64::from(side) * factor).round() as u32).max(1);
            // The average over the pixels that fall together: nothing aliases.
            small = imageops::thumbnail(picture, side(width), side(height));
            &small
        } else {
            picture
        };
        let (columns, rows) = (
            shown.width().next_multiple_of(MULTIPLE) as usize,
            shown.height().next_multiple_of(MULTIPLE) as usize,
        );
        let mut planes = vec![0.0; 3 * rows * columns];
        for (channel, plane) in planes.chunks_exact_mut(rows * columns).enumerate() {
            for (line, row) in plane.chunks_exact_mut(columns).zip(shown.rows()) {
                for (value, pixel) in line.iter_mut().zip(row) {
                    *value = f32::from(pixel.0[channel]);
                }
            }
        }
        let scale = DVec2::new(
            f64::from(shown.width()) / f64::from(width),
            f64::from(shown.height()) / f64::from(height),
        );
        Some(Self { planes, rows, columns, scale })
    }

    /// From pixels of the input to pixels of the clip. Pixel centres are whole numbers, so the corner of the picture is
    /// (−½, −½) at every scale.
    pub(super) fn to_clip(&self, pixel: DVec2) -> DVec2 {
        (pixel + 0.5) / self.scale - 0.5
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn colours_lie_in_planes_and_black_beyond_the_picture() {
        let input = Input::of(&RgbImage::from_pixel(40, 30, Rgb([200, 100, 50])), 1 << 20).unwrap();
        assert_eq!((input.columns, input.rows, input.scale), (64, 32, DVec2::ONE));
        let plane = 64 * 32;
        let at = |channel: usize, x: usize, y: usize| input.planes[channel * plane + y * 64 + x];
        assert_eq!([at(0, 39, 29), at(1, 0, 0), at(2, 20, 10)], [200.0, 100.0, 50.0]);
        assert_eq!([at(0, 40, 0), at(1, 0, 30)], [0.0, 0.0]);
    }

    #[test]
    fn large_pictures_shrink_and_their_corners_stay() {
        let input = Input::of(&RgbImage::new(3840, 2160), 1920 * 1080).unwrap();
        assert_eq!((input.columns, input.rows), (1920, 1088));
        assert_eq!(input.to_clip(DVec2::splat(-0.5)), DVec2::splat(-0.5));
        assert_eq!(input.to_clip(DVec2::new(1919.5, 1079.5)), DVec2::new(3839.5, 2159.5));
        assert!(Input::of(&RgbImage::new(0, 5), 100).is_none());
        assert!(Input::of(&RgbImage::new(SIDE_MAX_PX + 1, 1), 100).is_none());
    }
}
