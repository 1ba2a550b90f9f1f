//! All textures of one frame in one picture, so that a player binds one texture per frame.
//!
//! Crops are placed on shelves, tallest first, each with a border that repeats its edge, so that neither filtering nor
//! the blocks of JPEG mix neighbours.

use image::{ExtendedColorType, ImageEncoder, RgbImage, codecs::jpeg::JpegEncoder, imageops};
use protocol::{
    atlas::{Layout, Place, place},
    chunk::{EncodedImage, ImageFormat},
};

/// Border round every crop, pixels.
const GUTTER_PX: u32 = 2;
/// Longest side of an atlas, pixels: what the weakest GPUs in use accept.
const SIDE_PX: u32 = 4096;

/// A frame's picture and where its crops went.
pub(crate) struct Atlas {
    pub(crate) picture: RgbImage,
    pub(crate) layout: Layout,
}

impl Atlas {
    /// Packs the crops; when they do not fit in [`SIDE_PX`] they are all halved until they do.
    pub(crate) fn pack(crops: &[&RgbImage], clip_frame: u32) -> Self {
        let sizes: Vec<(u32, u32)> = crops.iter().map(|crop| crop.dimensions()).collect();
        let mut shrink = 0;
        let layout = loop {
            let halved: Vec<(u32, u32)> =
                sizes.iter().map(|(w, h)| ((w >> shrink).max(1), (h >> shrink).max(1))).collect();
            if let Some(layout) = place(&halved, GUTTER_PX, SIDE_PX) {
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
    pub(crate) fn uv(&self, index: usize, uv: [f32; 2]) -> [f32; 2] {
        let Some(place) = self.layout.places.get(index) else { return uv };
        let along = |start: u32, length: u32, value: f32, whole: u32| {
            (start as f32 + value.clamp(0.0, 1.0) * length as f32) / whole as f32
        };
        [
            along(place.x, place.width, uv[0], self.layout.width),
            along(place.y, place.height, uv[1], self.layout.height),
        ]
    }

    /// The picture as JPEG of a quality of 1 to 100.
    pub(crate) fn jpeg(&self, quality: u8) -> Result<EncodedImage, image::ImageError> {
        let mut bytes = Vec::new();
        let (width, height) = self.picture.dimensions();
        JpegEncoder::new_with_quality(&mut bytes, quality).write_image(
            self.picture.as_raw(),
            width,
            height,
            ExtendedColorType::Rgb8,
        )?;
        Ok(EncodedImage { format: ImageFormat::Jpeg, bytes })
    }
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
    use super::*;

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
