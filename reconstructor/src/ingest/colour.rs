//! Decoded pictures to RGB and to small grey signatures, with the clip's own colour matrix and range.
//!
//! The only module of the stage with `unsafe`: swscale's colour details have no safe wrapper.
#![allow(unsafe_code)]

use ffmpeg_the_third as ffmpeg;

use ffmpeg::{
    color::{Range, Space},
    ffi,
    format::Pixel,
    software::scaling::{Context, Flags},
    util::frame::video::Video,
};

/// Frames of at least this height without a colour tag are taken for BT.709, smaller ones for BT.601, as players do.
const LEAST_HD_HEIGHT_PX: u32 = 576;

/// A swscale conversion to packed RGB or grey at a chosen size.
pub(super) struct Converter {
    context: Context,
    output: Video,
    bytes_per_pixel: usize,
}

impl Converter {
    /// To 8-bit RGB at the picture's own size.
    pub(super) fn rgb(picture: &Video) -> Result<Self, ffmpeg::Error> {
        let flags = Flags::BILINEAR | Flags::ACCURATE_RND | Flags::FULL_CHR_H_INT;
        Self::new(picture, Pixel::RGB24, 3, (picture.width(), picture.height()), flags)
    }

    /// To 8-bit grey at `size`, each pixel the mean of its area.
    pub(super) fn grey(picture: &Video, size: (u32, u32)) -> Result<Self, ffmpeg::Error> {
        Self::new(picture, Pixel::GRAY8, 1, size, Flags::AREA)
    }

    /// To 8-bit RGB at `size`, each pixel the mean of its area.
    pub(super) fn thumbnail(picture: &Video, size: (u32, u32)) -> Result<Self, ffmpeg::Error> {
        Self::new(picture, Pixel::RGB24, 3, size, Flags::AREA)
    }

    fn new(
        picture: &Video,
        format: Pixel,
        bytes_per_pixel: usize,
        size: (u32, u32),
        flags: Flags,
    ) -> Result<Self, ffmpeg::Error> {
        let mut context =
            Context::get(picture.format(), picture.width(), picture.height(), format, size.0, size.1, flags)?;
        let matrix = match picture.color_space() {
            Space::BT709 => ffi::SWS_CS_ITU709,
            Space::BT2020NCL | Space::BT2020CL => ffi::SWS_CS_BT2020,
            Space::SMPTE240M => ffi::SWS_CS_SMPTE240M,
            Space::FCC => ffi::SWS_CS_FCC,
            Space::BT470BG | Space::SMPTE170M => ffi::SWS_CS_ITU601,
            _ if picture.height() > LEAST_HD_HEIGHT_PX => ffi::SWS_CS_ITU709,
            _ => ffi::SWS_CS_ITU601,
        };
        let full_range = picture.color_range() == Range::JPEG
            || matches!(
                picture.format(),
                Pixel::YUVJ420P | Pixel::YUVJ422P | Pixel::YUVJ444P | Pixel::YUVJ440P | Pixel::YUVJ411P
            );
        // Brightness 0, contrast 1, saturation 1 in 16.16 fixed point.
        const ONE: i32 = 1 << 16;
        // Safety: the context comes from sws_getContext and is alive; sws_getCoefficients returns a static table for
        // every argument. Formats without a matrix (RGB, grey input) make the call return −1 and change nothing.
        unsafe {
            let table = ffi::sws_getCoefficients(matrix as _);
            ffi::sws_setColorspaceDetails(
                context.as_mut_ptr(),
                table,
                i32::from(full_range),
                table,
                1,
                0,
                ONE,
                ONE,
            );
        }
        Ok(Self { context, output: Video::empty(), bytes_per_pixel })
    }

    /// Whether the converter was made for pictures of this size and format.
    pub(super) fn fits(&self, picture: &Video) -> bool {
        let input = self.context.input();
        (input.format, input.width, input.height) == (picture.format(), picture.width(), picture.height())
    }

    /// Converts one picture; rows without padding.
    pub(super) fn convert(&mut self, picture: &Video) -> Result<Vec<u8>, ffmpeg::Error> {
        self.context.run(picture, &mut self.output)?;
        let (width, height) = (self.output.width() as usize, self.output.height() as usize);
        let (row, stride) = (width * self.bytes_per_pixel, self.output.stride(0));
        let data = self.output.data(0);
        let mut packed = Vec::with_capacity(row * height);
        for line in data.chunks(stride.max(1)).take(height) {
            packed.extend_from_slice(line.get(..row).ok_or(ffmpeg::Error::InvalidData)?);
        }
        if packed.len() == row * height { Ok(packed) } else { Err(ffmpeg::Error::InvalidData) }
    }
}

/// Whether the decoder had to guess parts of the picture.
pub(super) fn is_damaged(picture: &Video) -> bool {
    // Safety: a plain field of a frame that the wrapper keeps allocated.
    let guessed = unsafe { (*picture.as_ptr()).decode_error_flags } != 0;
    guessed || picture.is_corrupt()
}
