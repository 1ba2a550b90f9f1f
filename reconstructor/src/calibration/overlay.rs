//! Pictures for checking a camera by eye: the painted lines as the camera sees them, drawn over the frame.

use std::path::Path;

use glam::DVec3;
use image::{Rgb, RgbImage};
use imageproc::drawing::draw_line_segment_mut;
use protocol::{
    camera::Camera,
    pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, Pitch},
};

use super::{CalibrationError, CameraEstimate};
use crate::overlay::OverlayWriter;

const MARKINGS: Rgb<u8> = Rgb([255, 30, 30]);
const GOALS: Rgb<u8> = Rgb([255, 200, 0]);
/// Length of the straight pieces that lines are drawn in, metres: short, so that distortion shows.
const PIECE_M: f64 = 0.5;

/// Writes frames with the pitch of their camera drawn in: as numbered pictures into the folder `out`, or as a video when it is an
/// `.mp4` file (`rate`: frames per second as a fraction; the `ffmpeg` program is needed for it). Frames without a camera stay
/// as they are.
///
/// # Errors
/// When a frame cannot be read, the disk says no, or the `ffmpeg` program is missing.
pub fn write(
    out: &Path,
    rate: (u32, u32),
    pictures: impl Iterator<Item = Result<RgbImage, CalibrationError>>,
    numbers: &[u32],
    estimates: &[CameraEstimate],
    pitch: &Pitch,
) -> Result<(), CalibrationError> {
    let failed = |error: crate::overlay::OverlayError| CalibrationError::Write {
        path: error.path,
        reason: error.reason,
    };
    let mut writer = OverlayWriter::create(out, rate).map_err(failed)?;
    for ((picture, number), estimate) in pictures.zip(numbers).zip(estimates) {
        let mut picture = picture?;
        if let Some(camera) = &estimate.camera {
            draw(&mut picture, camera, pitch);
        }
        writer.push(*number, &picture).map_err(failed)?;
    }
    writer.finish().map_err(failed)
}

/// Draws markings and goal frames of a pitch over a frame.
pub fn draw(image: &mut RgbImage, camera: &Camera, pitch: &Pitch) {
    for marking in pitch.markings() {
        let points: Vec<DVec3> = marking.sample(PIECE_M).iter().map(|p| DVec3::new(p.x, 0.0, p.y)).collect();
        draw_path(image, camera, &points, MARKINGS);
    }
    for side in [-1.0, 1.0] {
        let (x, half) = (side * pitch.length_m / 2.0, GOAL_WIDTH_M / 2.0);
        let frame = [(0.0, -half), (GOAL_HEIGHT_M, -half), (GOAL_HEIGHT_M, half), (0.0, half)];
        draw_path(image, camera, &frame.map(|(y, z)| DVec3::new(x, y, z)), GOALS);
    }
}

fn draw_path(image: &mut RgbImage, camera: &Camera, points: &[DVec3], colour: Rgb<u8>) {
    for pair in points.windows(2) {
        let [a, b] = pair else { continue };
        let (Some(a), Some(b)) = (camera.project(*a), camera.project(*b)) else { continue };
        // A piece that starts or ends far outside would take long to draw and is not seen.
        if camera.contains(a) || camera.contains(b) {
            let near = |v: f64| v.round().clamp(-1e4, 1e4) as f32;
            draw_line_segment_mut(image, (near(a.x), near(a.y)), (near(b.x), near(b.y)), colour);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_halfway_line_is_drawn_where_it_is() {
        let camera =
            Camera::looking_at((640, 360), 800.0, DVec3::new(4.0, 18.0, 75.0), DVec3::new(0.0, 0.0, -5.0));
        let mut image = RgbImage::new(640, 360);
        draw(&mut image, &camera, &Pitch::default());
        let pixel = camera.project(DVec3::new(0.0, 0.0, -20.0)).unwrap().round();
        assert_eq!(*image.get_pixel(pixel.x as u32, pixel.y as u32), MARKINGS);
        assert_eq!(*image.get_pixel(40, 40), Rgb([0, 0, 0]));
    }
}
