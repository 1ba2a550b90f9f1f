//! A picture without people who were found in it: in a tangle the pose network reads the one whom it sees best, however the square lies, and it
//! reads the other one when the first is gone.

use glam::DVec2;
use image::{Rgb, RgbImage};

use super::{blazepose::Square, silhouette};
use crate::geometry::Mask;

/// Points of the square's rim that the colour behind people is taken from, per side.
const RIM_POINTS: u32 = 24;

/// `picture` with `masks` filled with the colour that the rim of `square` mostly has: grass.
pub(super) fn without<'a>(
    picture: &RgbImage,
    masks: impl Iterator<Item = &'a Mask>,
    square: Square,
) -> RgbImage {
    let colour = rim_colour(picture, square);
    let mut erased = picture.clone();
    for mask in masks {
        let width = mask.width.max(1) as usize;
        for (i, _) in mask.coverage.iter().enumerate().filter(|(_, c)| **c >= silhouette::INSIDE) {
            // A pixel more on all sides: the rim of a body is of two colours.
            let (x, y) = (mask.x0 + (i % width) as i32, mask.y0 + (i / width) as i32);
            for (x, y) in [(x, y), (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)] {
                let place = u32::try_from(x).ok().zip(u32::try_from(y).ok());
                if let Some(pixel) = place.and_then(|(x, y)| erased.get_pixel_mut_checked(x, y)) {
                    *pixel = colour;
                }
            }
        }
    }
    erased
}

/// The median colour, channel by channel, along the rim of a square.
fn rim_colour(picture: &RgbImage, square: Square) -> Rgb<u8> {
    let half = square.side / 2.0;
    let steps = (0..=RIM_POINTS).map(|step| (f64::from(step) / f64::from(RIM_POINTS) * 2.0 - 1.0) * half);
    let rim = steps
        .flat_map(|s| [DVec2::new(s, -half), DVec2::new(s, half), DVec2::new(-half, s), DVec2::new(half, s)]);
    let inside = |at: DVec2| {
        let at = (square.centre + at).round();
        let fits = at.cmpge(DVec2::ZERO).all();
        fits.then(|| picture.get_pixel_checked(at.x as u32, at.y as u32)).flatten()
    };
    let colours: Vec<&Rgb<u8>> = rim.filter_map(inside).collect();
    Rgb([0, 1, 2].map(|channel| {
        let mut values: Vec<u8> = colours.iter().map(|colour| colour.0[channel]).collect();
        values.sort_unstable();
        values.get(values.len() / 2).copied().unwrap_or(0)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_is_erased_is_grass_and_all_else_stays() {
        let (grass, shirt, other) = (Rgb([60, 130, 50]), Rgb([200, 20, 20]), Rgb([20, 20, 200]));
        let mut picture = RgbImage::from_pixel(60, 60, grass);
        for (x, y) in (20..30).flat_map(|x| (20..40).map(move |y| (x, y))) {
            picture.put_pixel(x, y, shirt);
            picture.put_pixel(x + 12, y, other);
        }
        let mask = Mask { x0: 20, y0: 20, width: 10, height: 20, coverage: vec![255; 200] };
        let square = Square { centre: DVec2::splat(30.0), side: 50.0 };
        let erased = without(&picture, std::iter::once(&mask), square);
        assert!(erased.pixels().all(|pixel| *pixel != shirt));
        assert_eq!(erased.pixels().filter(|pixel| **pixel == other).count(), 200);
    }

    #[test]
    fn masks_and_squares_beyond_the_picture_do_no_harm() {
        let picture = RgbImage::from_pixel(8, 8, Rgb([1, 2, 3]));
        let mask = Mask { x0: -3, y0: 6, width: 20, height: 5, coverage: vec![255; 100] };
        let square = Square { centre: DVec2::splat(-500.0), side: 40.0 };
        let erased = without(&picture, std::iter::once(&mask), square);
        assert_eq!(erased.get_pixel(0, 7), &Rgb([0, 0, 0]), "no rim in the picture: black");
        assert_eq!(erased.get_pixel(0, 3), &Rgb([1, 2, 3]));
    }
}
