//! The texture of a body: its piece of the frame, with the body's own colours bled outward so that no grass shows at the
//! outline.

use glam::DVec2;
use image::{Rgb, RgbImage};

use crate::geometry::Mask;

/// Pixels kept round the body, so that filtering at the outline finds body colours.
const PADDING_PX: i32 = 3;
/// A body pixel this near to a safe one takes over the safe one's colour when it touches the outside; farther ones (thin
/// limbs, that are all outline) keep their own.
const SAFE_REACH: usize = 1;

/// A piece of a frame.
pub(super) struct CutOut {
    /// The piece.
    pub(super) image: RgbImage,
    /// Pixel of the frame that its first pixel is.
    pub(super) x0: i32,
    pub(super) y0: i32,
}

impl CutOut {
    /// Texture coordinates of a pixel of the frame: 0..1 from the top-left corner of the piece.
    pub(super) fn uv(&self, pixel: DVec2) -> [f32; 2] {
        let corner = DVec2::new(f64::from(self.x0), f64::from(self.y0)) - 0.5;
        let size = DVec2::new(f64::from(self.image.width()), f64::from(self.image.height()));
        ((pixel - corner) / size).clamp(DVec2::ZERO, DVec2::ONE).as_vec2().to_array()
    }
}

/// Cuts the body out of the frame: the box of `pixels` with a little room, everything outside the mask filled from it.
pub(super) fn cut_out(image: &RgbImage, mask: &Mask, pixels: &[DVec2]) -> CutOut {
    let low =
        pixels.iter().fold(DVec2::splat(f64::INFINITY), |low, p| low.min(*p)).floor().as_ivec2() - PADDING_PX;
    let high = pixels.iter().fold(DVec2::splat(f64::NEG_INFINITY), |high, p| high.max(*p)).ceil().as_ivec2()
        + PADDING_PX;
    let (width, height) = ((high.x - low.x + 1).max(1) as usize, (high.y - low.y + 1).max(1) as usize);
    let body = |x: i32, y: i32| mask.at(x, y) >= 128;
    let mut colours = vec![Rgb([0, 0, 0]); width * height];
    let mut own = vec![false; width * height];
    let mut safe = vec![false; width * height];
    for row in 0..height {
        for column in 0..width {
            let (x, y) = (low.x + column as i32, low.y + row as i32);
            let clamp = |value: i32, size: u32| value.clamp(0, size.max(1) as i32 - 1) as u32;
            let index = row * width + column;
            if let Some(pixel) = image.get_pixel_checked(clamp(x, image.width()), clamp(y, image.height())) {
                colours[index] = *pixel;
            }
            own[index] = body(x, y);
            safe[index] = own[index] && body(x - 1, y) && body(x + 1, y) && body(x, y - 1) && body(x, y + 1);
        }
    }
    let mut filled = safe;
    for _ in 0..SAFE_REACH {
        bleed(&mut colours, &mut filled, width, |index| own[index]);
    }
    for (filled, own) in filled.iter_mut().zip(&own) {
        *filled |= own;
    }
    while bleed(&mut colours, &mut filled, width, |_| true) > 0 {}
    let image =
        RgbImage::from_fn(width as u32, height as u32, |x, y| colours[y as usize * width + x as usize]);
    CutOut { image, x0: low.x, y0: low.y }
}

/// Two pictures of one size as one.
pub(super) fn side_by_side(left: &RgbImage, right: &RgbImage) -> RgbImage {
    let mut both = RgbImage::new(left.width() + right.width(), left.height().max(right.height()));
    image::imageops::replace(&mut both, left, 0, 0);
    image::imageops::replace(&mut both, right, i64::from(left.width()), 0);
    both
}

/// Gives every unfilled pixel that `may` change the mean colour of its filled neighbours; returns how many it filled.
fn bleed(colours: &mut [Rgb<u8>], filled: &mut [bool], width: usize, may: impl Fn(usize) -> bool) -> usize {
    let height = filled.len() / width.max(1);
    let mut changes = Vec::new();
    for row in 0..height {
        for column in 0..width {
            let index = row * width + column;
            if filled[index] || !may(index) {
                continue;
            }
            let (mut sum, mut count) = ([0_u32; 3], 0);
            for y in row.saturating_sub(1)..(row + 2).min(height) {
                for x in column.saturating_sub(1)..(column + 2).min(width) {
                    let neighbour = y * width + x;
                    if filled[neighbour] {
                        let Rgb(colour) = colours[neighbour];
                        sum = std::array::from_fn(|i| sum[i] + u32::from(colour[i]));
                        count += 1;
                    }
                }
            }
            if count > 0 {
                changes.push((index, Rgb(sum.map(|channel| ((channel + count / 2) / count) as u8))));
            }
        }
    }
    for &(index, colour) in &changes {
        colours[index] = colour;
        filled[index] = true;
    }
    changes.len()
}
