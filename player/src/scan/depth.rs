//! Depth pictures: 16-bit PNG, and 16-bit PGM (Netpbm "P5", the largest byte first).

use std::path::Path;

use super::{ScanError, bytes::Reader, error::Problem, extension, read_bytes};
use crate::placement::DepthPicture;

/// Widest and tallest picture that is read.
const MOST_SIDE_PX: u32 = 8192;

/// Reads a depth picture whose values times `metres_per_unit` are metres along the optical axis; 0 means "not measured".
///
/// # Errors
/// [`ScanError`] when the file cannot be read, is damaged, or is not a 16-bit grey picture.
pub fn read_depth(path: &Path, metres_per_unit: f64) -> Result<DepthPicture, ScanError> {
    let bytes = read_bytes(path)?;
    let file = path.display().to_string();
    let (width, height, values) = match extension(path).as_str() {
        "png" => png(&bytes).map_err(|problem| problem.within(&file))?,
        "pgm" => pgm(&bytes).map_err(|problem| problem.within(&file))?,
        other => {
            return Err(ScanError::Unsupported {
                file,
                what: format!("a depth picture named .{other}"),
                advice: "give a 16-bit .png or .pgm file",
            });
        }
    };
    let depth_m = values.iter().map(|&value| (f64::from(value) * metres_per_unit) as f32).collect();
    Ok(DepthPicture { width, height, depth_m })
}

fn png(bytes: &[u8]) -> Result<(usize, usize, Vec<u16>), Problem> {
    let mut reader = image::ImageReader::with_format(std::io::Cursor::new(bytes), image::ImageFormat::Png);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    reader.limits(limits);
    match reader.decode() {
        Ok(image::DynamicImage::ImageLuma16(picture)) => {
            Ok((picture.width() as usize, picture.height() as usize, picture.into_raw()))
        }
        Ok(other) => Err(Problem::at("header", format!("{:?}: 16-bit grey expected", other.color()))),
        Err(error) => Err(Problem::at("PNG", error.to_string())),
    }
}

fn pgm(bytes: &[u8]) -> Result<(usize, usize, Vec<u16>), Problem> {
    let mut at = 0;
    let mut word = || -> Result<&[u8], Problem> {
        loop {
            match bytes.get(at) {
                Some(b'#') => {
                    at += bytes.get(at..).and_then(|rest| rest.iter().position(|&b| b == b'\n')).unwrap_or(1)
                }
                Some(byte) if byte.is_ascii_whitespace() => at += 1,
                Some(_) => break,
                None => return Err(Problem::at(format!("byte {at}"), "the header is cut short")),
            }
        }
        let start = at;
        while bytes.get(at).is_some_and(|byte| !byte.is_ascii_whitespace()) {
            at += 1;
        }
        Ok(bytes.get(start..at).unwrap_or_default())
    };
    if word()? != b"P5" {
        return Err(Problem::at("byte 0", "`P5` expected: not a binary PGM picture"));
    }
    let mut number = |name: &str, most: u32| -> Result<usize, Problem> {
        std::str::from_utf8(word()?)
            .ok()
            .and_then(|text| text.parse::<u32>().ok())
            .filter(|number| (1..=most).contains(number))
            .map(|number| number as usize)
            .ok_or_else(|| Problem::at("header", format!("{name}: 1 to {most} expected")))
    };
    let (width, height) = (number("width", MOST_SIDE_PX)?, number("height", MOST_SIDE_PX)?);
    if number("largest value", 65535)? < 256 {
        return Err(Problem::at("header", "8 bits a pixel: a depth picture has 16"));
    }
    // One white-space byte ends the header.
    let mut reader = Reader::new(bytes.get(at + 1..).unwrap_or_default());
    let body = reader.take(width * height * 2)?;
    Ok((width, height, body.as_chunks().0.iter().map(|&pair| u16::from_be_bytes(pair)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pgm_is_read_and_its_damage_named() {
        let good = b"P5\n# made here\n2 1 65535\n\x03\xe8\x00\x00";
        assert_eq!(pgm(good).unwrap(), (2, 1, vec![1000, 0]));
        for length in 0..good.len() {
            assert!(pgm(&good[..length]).is_err(), "{length}");
        }
        for wrong in
            [&b"P6 1 1 65535 ab"[..], b"P5 0 1 65535 ab", b"P5 1 1 255 ab", b"P5 99999 99999 65535 ab"]
        {
            assert!(pgm(wrong).is_err());
        }
    }
}
