//! The size of a JPEG or PNG from its header, so that a huge picture is refused before anybody decodes it.

use super::ImageFormat;

/// Width and height in pixels, or `None` when `bytes` is not a file of `format`.
pub(super) fn size_px(format: ImageFormat, bytes: &[u8]) -> Option<(u32, u32)> {
    match format {
        ImageFormat::Png => png(bytes),
        ImageFormat::Jpeg => jpeg(bytes),
    }
}

/// PNG puts the size right after its signature, in the IHDR chunk.
fn png(bytes: &[u8]) -> Option<(u32, u32)> {
    if bytes.get(..8)? != b"\x89PNG\r\n\x1a\n" || bytes.get(12..16)? != b"IHDR" {
        return None;
    }
    let word = |at: usize| Some(u32::from_be_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    Some((word(16)?, word(20)?))
}

/// JPEG puts the size in the start-of-frame segment, some segments in.
fn jpeg(bytes: &[u8]) -> Option<(u32, u32)> {
    let half = |at: usize| Some(u16::from_be_bytes(bytes.get(at..at + 2)?.try_into().ok()?));
    if half(0)? != 0xFFD8 {
        return None;
    }
    let mut at = 2;
    loop {
        if *bytes.get(at)? != 0xFF {
            return None;
        }
        match *bytes.get(at + 1)? {
            // Fill bytes before a marker.
            0xFF => at += 1,
            // Start of frame, all kinds; C4, C8 and CC are tables.
            0xC0..=0xC3 | 0xC5..=0xC7 | 0xC9..=0xCB | 0xCD..=0xCF => {
                return Some((u32::from(half(at + 7)?), u32::from(half(at + 5)?)));
            }
            // Scan data before any frame, or the end.
            0xD9 | 0xDA => return None,
            _ => at += 2 + usize::from(half(at + 2)?),
        }
    }
}

#[cfg(test)]
mod tests {
    use image::{ExtendedColorType, ImageEncoder, codecs};

    use super::*;

    #[test]
    fn sizes_of_real_files_are_read() {
        let pixels = vec![90u8; 37 * 21 * 3];
        let (mut png, mut jpeg) = (Vec::new(), Vec::new());
        codecs::png::PngEncoder::new(&mut png).write_image(&pixels, 37, 21, ExtendedColorType::Rgb8).unwrap();
        codecs::jpeg::JpegEncoder::new(&mut jpeg)
            .write_image(&pixels, 37, 21, ExtendedColorType::Rgb8)
            .unwrap();
        assert_eq!(size_px(ImageFormat::Png, &png), Some((37, 21)));
        assert_eq!(size_px(ImageFormat::Jpeg, &jpeg), Some((37, 21)));
        assert_eq!(size_px(ImageFormat::Png, &jpeg), None);
        assert_eq!(size_px(ImageFormat::Jpeg, &png), None);
        for end in 0..jpeg.len() {
            let _ = size_px(ImageFormat::Jpeg, &jpeg[..end]);
        }
    }
}
