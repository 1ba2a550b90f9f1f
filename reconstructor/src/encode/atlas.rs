//! All textures of one frame in one picture, so that a player binds one texture per frame.
//!
//! Crops are placed on shelves, tallest first, each with a border that repeats its edge, so that neither filtering nor
//! the blocks of JPEG mix neighbours.

use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::jpeg::JpegEncoder, imageops};
use protocol::chunk::{EncodedImage, ImageFormat};

/// Border round every crop, pixels.
const GUTTER_PX: u32 = 2;
/// Longest side of an atlas, pixels: what the weakest GPUs in use accept.
const SIDE_PX: u32 = 4096;
/// Narrowest atlas tried, pixels.
const NARROWEST_PX: u32 = 128;
/// JPEG quality.
const QUALITY: u8 = 85;

/// Where a crop lies in the atlas, pixels without the border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) x: u32,
    pub(super) y: u32,
    pub(super) width: u32,
    pub(super) height: u32,
}

/// The places of all crops and the size of the picture that holds them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) places: Vec<Place>,
}

/// A frame's picture and where its crops went.
pub(super) struct Atlas {
    pub(super) picture: RgbImage,
    pub(super) layout: Layout,
}

impl Atlas {
    /// Packs the crops; when they do not fit in [`SIDE_PX`] they are all halved until they do.
    pub(super) fn pack(crops: &[&RgbImage], clip_frame: u32) -> Self {
        let sizes: Vec<(u32, u32)> = crops.iter().map(|crop| crop.dimensions()).collect();
        let mut shrink = 0;
        let layout = loop {
            let halved: Vec<(u32, u32)> =
                sizes.iter().map(|(w, h)| ((w >> shrink).max(1), (h >> shrink).max(1))).collect();
            if let Some(layout) = place(&halved) {
                break layout;
            }
            shrink += 1;
        };
        if shrink > 0 {
            tracing::warn!(
                clip_frame,
                "textures are stored at 1/{} size to fit {SIDE_PX} pixels",
                1 << shrink
            );
        }
        let mut picture = RgbImage::new(layout.width, layout.height);
        for (crop, place) in crops.iter().zip(&layout.places) {
            if shrink == 0 {
                draw(&mut picture, crop, *place);
            } else {
                let filter = imageops::FilterType::Triangle;
                draw(&mut picture, &imageops::resize(*crop, place.width, place.height, filter), *place);
            }
        }
        Self { picture, layout }
    }

    /// A texture coordinate of crop `index` as one of the atlas; what lies outside the crop goes to its edge.
    pub(super) fn uv(&self, index: usize, uv: [f32; 2]) -> [f32; 2] {
        let Some(place) = self.layout.places.get(index) else { return uv };
        let along = |start: u32, length: u32, value: f32, whole: u32| {
            (start as f32 + value.clamp(0.0, 1.0) * length as f32) / whole as f32
        };
        [
            along(place.x, place.width, uv[0], self.layout.width),
            along(place.y, place.height, uv[1], self.layout.height),
        ]
    }

    /// The picture as JPEG.
    pub(super) fn jpeg(&self) -> Result<EncodedImage, image::ImageError> {
        let mut bytes = Vec::new();
        let (width, height) = self.picture.dimensions();
        JpegEncoder::new_with_quality(&mut bytes, QUALITY).write_image(
            self.picture.as_raw(),
            width,
            height,
            ExtendedColorType::Rgb8,
        )?;
        Ok(EncodedImage { format: ImageFormat::Jpeg, bytes })
    }
}

/// The smallest of the shelf layouts of widths 128, 256, … pixels, or `None` when none fits.
fn place(sizes: &[(u32, u32)]) -> Option<Layout> {
    let widths = std::iter::successors(Some(NARROWEST_PX), |width| Some(width * 2));
    widths
        .take_while(|width| *width <= SIDE_PX)
        .filter_map(|width| shelves(sizes, width))
        .min_by_key(|layout| (u64::from(layout.width) * u64::from(layout.height), layout.width))
}

/// Tallest first, left to right, shelf under shelf. The height is a multiple of 16, a block of subsampled JPEG.
fn shelves(sizes: &[(u32, u32)], width: u32) -> Option<Layout> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    let size = |index: usize| sizes.get(index).copied().unwrap_or((1, 1));
    order.sort_by_key(|&index| std::cmp::Reverse((size(index).1, size(index).0)));
    let mut places = vec![Place { x: 0, y: 0, width: 1, height: 1 }; sizes.len()];
    let (mut x, mut y, mut shelf) = (0u32, 0u32, 0u32);
    for index in order {
        let (crop_width, crop_height) = size(index);
        let (full_width, full_height) =
            (crop_width.checked_add(2 * GUTTER_PX)?, crop_height.checked_add(2 * GUTTER_PX)?);
        if full_width > width || full_height > SIDE_PX {
            return None;
        }
        if x + full_width > width {
            (x, y, shelf) = (0, y + shelf, 0);
        }
        shelf = shelf.max(full_height);
        if y + shelf > SIDE_PX {
            return None;
        }
        if let Some(place) = places.get_mut(index) {
            *place = Place { x: x + GUTTER_PX, y: y + GUTTER_PX, width: crop_width, height: crop_height };
        }
        x += full_width;
    }
    let height = (y + shelf).max(1).next_multiple_of(16);
    Some(Layout { width, height, places })
}

/// Copies a crop to its place and repeats its edge round it.
fn draw(picture: &mut RgbImage, crop: &RgbImage, place: Place) {
    for y in 0..place.height + 2 * GUTTER_PX {
        for x in 0..place.width + 2 * GUTTER_PX {
            let source_x = x.saturating_sub(GUTTER_PX).min(place.width - 1);
            let source_y = y.saturating_sub(GUTTER_PX).min(place.height - 1);
            let pixel = *crop.get_pixel(source_x, source_y);
            picture.put_pixel(place.x - GUTTER_PX + x, place.y - GUTTER_PX + y, pixel);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn crops_never_overlap_and_stay_inside(
            sizes in proptest::collection::vec((1..300u32, 1..400u32), 1..40),
        ) {
            let layout = place(&sizes).unwrap();
            let bounds = |p: &Place| (p.x - GUTTER_PX, p.y - GUTTER_PX, p.x + p.width + GUTTER_PX, p.y + p.height + GUTTER_PX);
            for (index, a) in layout.places.iter().enumerate() {
                prop_assert_eq!((a.width, a.height), sizes[index]);
                let a = bounds(a);
                prop_assert!(a.2 <= layout.width && a.3 <= layout.height);
                for b in &layout.places[index + 1..] {
                    let b = bounds(b);
                    prop_assert!(a.2 <= b.0 || b.2 <= a.0 || a.3 <= b.1 || b.3 <= a.1);
                }
            }
            prop_assert!(layout.width.max(layout.height) <= SIDE_PX);
        }
    }

    #[test]
    fn a_texture_coordinate_finds_its_colour_again() {
        let crops: Vec<RgbImage> = (0..5u8)
            .map(|index| RgbImage::from_pixel(20 + u32::from(index), 40, image::Rgb([index * 50, 100, 7])))
            .collect();
        let atlas = Atlas::pack(&crops.iter().collect::<Vec<_>>(), 0);
        let (width, height) = atlas.picture.dimensions();
        for (index, crop) in crops.iter().enumerate() {
            for uv in [[0.02, 0.02], [0.5, 0.5], [0.98, 0.98], [3.0, -1.0]] {
                let [u, v] = atlas.uv(index, uv);
                let at = |value: f32, side: u32| ((value * side as f32) as u32).min(side - 1);
                assert_eq!(atlas.picture.get_pixel(at(u, width), at(v, height)), crop.get_pixel(0, 0));
            }
        }
    }

    #[test]
    fn crops_that_are_too_large_are_halved() {
        let crops: Vec<RgbImage> = (0..3).map(|_| RgbImage::new(3000, 4000)).collect();
        let atlas = Atlas::pack(&crops.iter().collect::<Vec<_>>(), 0);
        assert!(atlas.picture.width().max(atlas.picture.height()) <= SIDE_PX);
        assert_eq!(atlas.layout.places[0].width, 1500);
    }
}
