//! Frames with something drawn in, for checking results by eye: as numbered pictures or as a video.

use std::path::{Path, PathBuf};

use glam::{DVec2, Vec2};
use image::{Rgb, RgbImage};
use synthesis::{
    lettering,
    video::{Rate, Video},
};
use thiserror::Error;

/// Quality of a video: x264's CRF, good enough to judge a line by.
const QUALITY: u8 = 20;

/// The pictures cannot be written.
#[derive(Debug, Error)]
#[error("cannot write the overlay {}: {reason}", path.display())]
pub struct OverlayError {
    /// The file or folder.
    pub path: PathBuf,
    /// What went wrong.
    pub reason: String,
}

/// Takes drawn-in frames one after the other.
pub struct OverlayWriter {
    out: PathBuf,
    rate: (u32, u32),
    as_video: bool,
    video: Option<Video>,
}

impl OverlayWriter {
    /// Into the folder `out`, or into a video when it is an `.mp4` file (`rate`: frames per second as a fraction; the `ffmpeg` program
    /// is needed for it).
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub fn create(out: &Path, rate: (u32, u32)) -> Result<Self, OverlayError> {
        let as_video = out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mp4"));
        let folder = if as_video { out.parent().filter(|f| !f.as_os_str().is_empty()) } else { Some(out) };
        if let Some(folder) = folder {
            std::fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
        }
        Ok(Self { out: out.into(), rate, as_video, video: None })
    }

    /// The next frame; `number` names its picture. All frames of a video have one size.
    ///
    /// # Errors
    /// When the disk says no, or the `ffmpeg` program is missing.
    pub fn push(&mut self, number: u32, picture: &RgbImage) -> Result<(), OverlayError> {
        if !self.as_video {
            let path = self.out.join(format!("{number:06}.png"));
            return picture.save(&path).map_err(|error| failed(&path, &error));
        }
        let video = match self.video.take() {
            Some(video) => video,
            None => Video::start(&self.out, picture.dimensions(), self.rate, Rate::Quality(QUALITY))
                .map_err(|error| failed(&self.out, &error))?,
        };
        self.video.insert(video).push(picture).map_err(|error| failed(&self.out, &error))
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// When the video cannot be finished.
    pub fn finish(self) -> Result<(), OverlayError> {
        let Self { out, video, .. } = self;
        video.map_or(Ok(()), |video| video.finish().map_err(|error| failed(&out, &error)))
    }
}

fn failed(path: &Path, error: &dyn std::fmt::Display) -> OverlayError {
    OverlayError { path: path.into(), reason: error.to_string() }
}

/// Mixes `colour` into a pixel by `share`, 0..1; pixels outside the picture are left out.
pub(crate) fn mix(picture: &mut RgbImage, x: i32, y: i32, colour: Rgb<u8>, share: f32) {
    let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
    if let Some(pixel) = picture.get_pixel_mut_checked(x, y) {
        for (value, wanted) in pixel.0.iter_mut().zip(colour.0) {
            *value = (f32::from(*value) * (1.0 - share) + f32::from(wanted) * share).round() as u8;
        }
    }
}

/// Writes capitals and digits `height_px` high with a dark rim, their top middle at `top`.
pub(crate) fn label(picture: &mut RgbImage, text: &str, top: DVec2, height_px: f32, colour: Rgb<u8>) {
    let cell_px = height_px / lettering::HEIGHT;
    let (width, height) = (lettering::width(text) * cell_px, height_px);
    if !(top.is_finite() && width < 1000.0 && height < 1000.0 && top.abs().max_element() < 1e6) {
        return;
    }
    let corner = Vec2::new(top.x as f32 - width / 2.0, top.y as f32);
    for row in -2..=height as i32 + 2 {
        for column in -2..=width as i32 + 2 {
            let at = Vec2::new(column as f32, row as f32) / cell_px;
            let (x, y) = (corner.x as i32 + column, corner.y as i32 + row);
            mix(picture, x, y, Rgb([0, 0, 0]), 0.8 * lettering::ink(text, at, 0.7, 1.0 / cell_px));
            mix(picture, x, y, colour, lettering::ink(text, at, 0.25, 1.0 / cell_px));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_where_they_belong_and_stay_inside() {
        let white = Rgb([255, 255, 255]);
        let mut picture = RgbImage::from_pixel(60, 40, Rgb([0, 90, 0]));
        label(&mut picture, "1", DVec2::new(30.0, 10.0), 16.0, white);
        let bright: Vec<(u32, u32)> =
            picture.enumerate_pixels().filter(|(.., p)| p[0] > 200).map(|(x, y, _)| (x, y)).collect();
        assert!(bright.len() > 10, "{} bright pixels", bright.len());
        assert!(bright.iter().all(|(x, y)| x.abs_diff(30) < 9 && (9..28).contains(y)), "{bright:?}");
        for top in
            [DVec2::new(-5.0, -8.0), DVec2::new(59.0, 39.0), DVec2::new(f64::NAN, 0.0), DVec2::splat(1e9)]
        {
            label(&mut picture, "88", top, 16.0, white);
        }
    }

    #[test]
    fn pictures_are_numbered_by_their_frame() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("seen");
        let mut writer = OverlayWriter::create(&out, (25, 1)).unwrap();
        writer.push(7, &RgbImage::new(4, 4)).unwrap();
        writer.finish().unwrap();
        assert!(out.join("000007.png").exists());
        let blocked = folder.path().join("file");
        std::fs::write(&blocked, "").unwrap();
        assert!(OverlayWriter::create(&blocked.join("under"), (25, 1)).is_err());
    }
}
