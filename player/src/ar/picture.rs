//! A picture of the room with its depth and the camera that took it.

use glam::{DVec2, DVec3};
use image::RgbaImage;
use thiserror::Error;

use super::{RoomCamera, holes};

/// Fewest measured points from which a camera is worked out.
const LEAST_POINTS: usize = 100;

/// Why there is no picture of the room.
#[derive(Debug, Error, PartialEq)]
pub enum RoomPictureError {
    /// Colour, depth and camera disagree.
    #[error(
        "{what} has {found} pixels where {expected} were expected: picture and depth must cover the same view"
    )]
    Size {
        /// Which of them.
        what: &'static str,
        /// Its pixels.
        found: usize,
        /// Those of the colour picture.
        expected: usize,
    },
    /// The points of a cloud are not in the rows and columns of a pinhole camera.
    #[error(
        "the cloud was not seen by a pinhole camera ({0}): give a cloud in rows and columns in camera axes"
    )]
    NoPinhole(String),
}

/// A picture of the room.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomPicture {
    /// sRGB.
    pub colour: RgbaImage,
    /// Metres along the optical axis, row by row, as many as there are pixels; 0 where it is not known.
    pub depth_m: Vec<f32>,
    /// Where it was taken from.
    pub camera: RoomCamera,
}

impl RoomPicture {
    /// Puts colour and depth together and fills the small holes that depth sensors leave.
    ///
    /// # Errors
    /// [`RoomPictureError::Size`] when their sizes differ.
    pub fn new(
        colour: RgbaImage,
        mut depth_m: Vec<f32>,
        camera: RoomCamera,
    ) -> Result<Self, RoomPictureError> {
        let (width, height) = colour.dimensions();
        let expected = width as usize * height as usize;
        let size = |what, found| Err(RoomPictureError::Size { what, found, expected });
        if depth_m.len() != expected {
            return size("the depth", depth_m.len());
        }
        if camera.size_px != [width, height] {
            return size("the camera", camera.size_px[0] as usize * camera.size_px[1] as usize);
        }
        for depth in &mut depth_m {
            if !holes::is_measured(*depth) {
                *depth = 0.0;
            }
        }
        holes::fill(&mut depth_m, width as usize);
        Ok(Self { colour, depth_m, camera })
    }

    /// From a cloud in rows and columns, in camera axes (x right, y down, z forward): the pinhole follows from the
    /// points themselves, as column = fx·x/z + cx and row = fy·y/z + cy are two straight lines (least squares).
    ///
    /// # Errors
    /// When there are too few points, or they fit no pinhole to half a pixel.
    pub fn from_organised(colour: RgbaImage, points_m: &[glam::Vec3]) -> Result<Self, RoomPictureError> {
        let columns = colour.width() as usize;
        let measured = points_m.iter().enumerate().filter(|(_, p)| p.is_finite() && p.z > 0.0);
        let across =
            measured.clone().map(|(index, p)| (f64::from(p.x / p.z), (index % columns.max(1)) as f64));
        let down = measured.map(|(index, p)| (f64::from(p.y / p.z), (index / columns.max(1)) as f64));
        let (fx, cx) = straight_line(across)?;
        let (fy, cy) = straight_line(down)?;
        let camera =
            RoomCamera::at_origin([colour.width(), colour.height()], DVec2::new(fx, fy), DVec2::new(cx, cy));
        Self::new(colour, points_m.iter().map(|point| point.z).collect(), camera)
    }

    /// The room point of a pixel; `None` where depth is unknown or there is no such pixel.
    #[must_use]
    pub fn point_m(&self, column: u32, row: u32) -> Option<DVec3> {
        if column >= self.colour.width() || row >= self.colour.height() {
            return None;
        }
        let depth = *self.depth_m.get((row * self.colour.width() + column) as usize)?;
        let ray = self.camera.ray(DVec2::new(f64::from(column), f64::from(row)));
        (depth > 0.0).then(|| ray.origin_m + ray.direction * f64::from(depth))
    }
}

/// Slope and offset of y over x, by least squares.
fn straight_line(points: impl Iterator<Item = (f64, f64)> + Clone) -> Result<(f64, f64), RoomPictureError> {
    let (mut count, mut sum, mut squares) = (0.0, DVec2::ZERO, DVec2::ZERO);
    for (x, y) in points.clone() {
        count += 1.0;
        sum += DVec2::new(x, y);
        squares += DVec2::new(x * x, x * y);
    }
    if count < LEAST_POINTS as f64 {
        return Err(RoomPictureError::NoPinhole(format!("{count} measured points")));
    }
    let slope = (squares.y - sum.x * sum.y / count) / (squares.x - sum.x * sum.x / count);
    let offset = (sum.y - slope * sum.x) / count;
    let error_px = points.map(|(x, y)| (slope * x + offset - y).powi(2)).sum::<f64>() / count;
    if slope.is_finite() && slope > 1.0 && error_px.sqrt() < 0.5 {
        return Ok((slope, offset));
    }
    Err(RoomPictureError::NoPinhole(format!("rays miss their pixels by {:.1}", error_px.sqrt())))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn the_pinhole_follows_from_the_points() {
        let camera = RoomCamera::at_origin([64, 48], DVec2::new(52.0, 53.0), DVec2::new(31.0, 25.0));
        let points: Vec<Vec3> = (0..64 * 48_u32)
            .map(|index| {
                let ray = camera.ray(DVec2::new(f64::from(index % 64), f64::from(index / 64)));
                let depth = 0.8 + 0.1 * f64::from(index % 7);
                if index % 11 == 0 { Vec3::NAN } else { (ray.direction * depth).as_vec3() }
            })
            .collect();
        let picture = RoomPicture::from_organised(RgbaImage::new(64, 48), &points).unwrap();
        assert!(picture.camera.focal_px.distance(camera.focal_px) < 1e-3, "{:?}", picture.camera);
        assert!(picture.camera.centre_px.distance(camera.centre_px) < 1e-3);
        let point = picture.point_m(9, 7).unwrap();
        assert!(point.distance(points[7 * 64 + 9].as_dvec3()) < 1e-4);
        assert_eq!(picture.point_m(64, 0), None);
        let shuffled: Vec<Vec3> = points.iter().rev().copied().collect();
        assert!(matches!(
            RoomPicture::from_organised(RgbaImage::new(64, 48), &shuffled),
            Err(RoomPictureError::NoPinhole(_))
        ));
        assert!(RoomPicture::from_organised(RgbaImage::new(0, 0), &[]).is_err());
    }

    #[test]
    fn sizes_must_agree() {
        let camera = RoomCamera::at_origin([4, 3], DVec2::splat(4.0), DVec2::ONE);
        assert!(RoomPicture::new(RgbaImage::new(4, 3), vec![f32::NAN; 12], camera).is_ok());
        assert!(RoomPicture::new(RgbaImage::new(4, 3), vec![1.0; 11], camera).is_err());
        assert!(RoomPicture::new(RgbaImage::new(3, 4), vec![1.0; 12], camera).is_err());
    }
}
