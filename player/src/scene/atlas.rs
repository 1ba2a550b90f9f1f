//! The texture of a frame's bodies: decoded within limits and reduced to the few mip levels the renderer uses.

use std::io::Cursor;

use image::{DynamicImage, ImageReader, RgbaImage, imageops};
use protocol::{
    chunk::{self, EncodedImage, ImageFormat},
    limits::Limits,
};
use thiserror::Error;

/// Mip levels of an atlas, the full size included. More would bleed one body's colours into its neighbour's.
const LEVELS: usize = 3;

/// A decoded atlas, largest level first; sRGB with alpha 255.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Each half as wide and high as the one before, rounded down and at least 1.
    pub levels: Vec<RgbaImage>,
}

/// Why an atlas could not be decoded.
#[derive(Debug, Error)]
pub enum AtlasError {
    /// The picture is larger than the reader allows.
    #[error("the texture is {width_px} × {height_px} px, more than the allowed {limit_px} px a side")]
    TooLarge {
        /// Width said by the file.
        width_px: u32,
        /// Height said by the file.
        height_px: u32,
        /// The most allowed.
        limit_px: u32,
    },
    /// The bytes are not a picture of the format the chunk promised.
    #[error("the texture is not a readable {format:?}: {source}")]
    Undecodable {
        /// Promised format.
        format: ImageFormat,
        /// What the decoder said.
        source: image::ImageError,
    },
}

impl Atlas {
    /// The atlas of a frame, of either profile.
    pub fn of(atlas: &chunk::Atlas, limits: &Limits) -> Result<Self, AtlasError> {
        match atlas {
            chunk::Atlas::Encoded(file) => Self::decode(file, limits),
            chunk::Atlas::Pixels(pixels) => {
                let (width_px, height_px) = (pixels.width_px, pixels.height_px);
                // The decoder made it: its pixels fit its size.
                let picture =
                    RgbaImage::from_raw(width_px, height_px, pixels.rgba.clone()).unwrap_or_default();
                Ok(Self::from_image(DynamicImage::ImageRgba8(picture)))
            }
        }
    }

    /// Decodes an encoded atlas; its size is checked before anything is allocated for its pixels.
    pub fn decode(encoded: &EncodedImage, limits: &Limits) -> Result<Self, AtlasError> {
        let format = match encoded.format {
            ImageFormat::Jpeg => image::ImageFormat::Jpeg,
            ImageFormat::Png => image::ImageFormat::Png,
        };
        let undecodable = |source| AtlasError::Undecodable { format: encoded.format, source };
        let reader = || ImageReader::with_format(Cursor::new(&encoded.bytes), format);
        let (width_px, height_px) = reader().into_dimensions().map_err(undecodable)?;
        let limit_px = limits.texture_side_px;
        if width_px > limit_px || height_px > limit_px {
            return Err(AtlasError::TooLarge { width_px, height_px, limit_px });
        }
        let mut decoder = reader();
        let mut decoder_limits = image::Limits::default();
        decoder_limits.max_image_width = Some(limit_px);
        decoder_limits.max_image_height = Some(limit_px);
        decoder.limits(decoder_limits);
        Ok(Self::from_image(decoder.decode().map_err(undecodable)?))
    }

    /// An atlas of a picture.
    #[must_use]
    pub fn from_image(picture: DynamicImage) -> Self {
        let mut levels = vec![picture.into_rgba8()];
        while levels.len() < LEVELS {
            let Some(last) = levels.last() else { break };
            let (width, height) = (last.width() / 2, last.height() / 2);
            if width == 0 || height == 0 {
                break;
            }
            levels.push(imageops::resize(last, width, height, imageops::FilterType::Triangle));
        }
        Self { levels }
    }

    /// Width and height of the full-size level, pixels.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        self.levels.first().map_or((0, 0), RgbaImage::dimensions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(width: u32, height: u32) -> EncodedImage {
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::new_rgb8(width, height).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        EncodedImage { format: ImageFormat::Png, bytes: bytes.into_inner() }
    }

    #[test]
    fn levels_halve() {
        let atlas = Atlas::decode(&png(64, 33), &Limits::default()).unwrap();
        let sizes: Vec<_> = atlas.levels.iter().map(RgbaImage::dimensions).collect();
        assert_eq!(sizes, [(64, 33), (32, 16), (16, 8)]);
    }

    #[test]
    fn larger_than_allowed_is_refused_by_its_header() {
        let limits = Limits { texture_side_px: 32, ..Limits::default() };
        let error = Atlas::decode(&png(64, 8), &limits).unwrap_err();
        assert!(matches!(error, AtlasError::TooLarge { width_px: 64, .. }), "{error}");
    }

    #[test]
    fn truncated_and_mislabelled_pictures_are_errors() {
        let mut broken = png(16, 16);
        broken.bytes.truncate(40);
        assert!(Atlas::decode(&broken, &Limits::default()).is_err());
        let mislabelled = EncodedImage { format: ImageFormat::Jpeg, ..png(16, 16) };
        let error = Atlas::decode(&mislabelled, &Limits::default()).unwrap_err();
        assert!(error.to_string().contains("Jpeg"), "{error}");
    }
}
