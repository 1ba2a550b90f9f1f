//! What a depth sensor measured: points of a room, in rows and columns or without order.

use glam::{DMat4, DVec3, Vec3};

/// Points of a room. Points that were not measured are NaN; their place keeps the rows and columns whole.
#[derive(Clone, Debug)]
pub struct PointCloud {
    points_m: Vec<Vec3>,
    columns: Option<usize>,
    viewpoint_m: DVec3,
    up: Option<DVec3>,
}

impl PointCloud {
    /// Points without order, as a phone gathers them or a mesh holds them; the sensor is taken to be at the origin.
    #[must_use]
    pub fn unorganised(points_m: Vec<Vec3>) -> Self {
        Self { points_m, columns: None, viewpoint_m: DVec3::ZERO, up: None }
    }

    /// Points in rows of `columns`, as a depth camera sees them, top row first; a last row that is not full is dropped.
    /// Points at the origin count as not measured.
    #[must_use]
    pub fn organised(mut points_m: Vec<Vec3>, columns: usize) -> Self {
        if columns == 0 {
            return Self::unorganised(points_m);
        }
        points_m.truncate(points_m.len() / columns * columns);
        for point in &mut points_m {
            if *point == Vec3::ZERO {
                *point = Vec3::NAN;
            }
        }
        Self { points_m, columns: Some(columns), viewpoint_m: DVec3::ZERO, up: None }
    }

    /// The points of a depth picture, in camera axes (x right, y down, z forward).
    #[must_use]
    pub fn from_depth(picture: &DepthPicture, intrinsics: &Intrinsics) -> Self {
        let columns = picture.width;
        let points = picture.depth_m.iter().enumerate().map(|(index, &depth_m)| {
            if !(depth_m > 0.0 && depth_m.is_finite()) {
                return Vec3::NAN;
            }
            let (column, row) = ((index % columns.max(1)) as f64, (index / columns.max(1)) as f64);
            (intrinsics.ray(column, row) * f64::from(depth_m)).as_vec3()
        });
        Self::organised(points.collect(), columns)
    }

    /// The same cloud with the sensor at `viewpoint_m`.
    #[must_use]
    pub fn seen_from(self, viewpoint_m: DVec3) -> Self {
        Self { viewpoint_m, ..self }
    }

    /// The same cloud with a known direction against gravity; any length but zero.
    #[must_use]
    pub fn with_up(self, up: DVec3) -> Self {
        Self { up: up.try_normalize(), ..self }
    }

    /// The same cloud in a room, given where the sensor was: a rigid `room_from_sensor`.
    #[must_use]
    pub fn moved(mut self, room_from_sensor: &DMat4) -> Self {
        let (matrix, turn) = (room_from_sensor.as_mat4(), glam::DMat3::from_mat4(*room_from_sensor));
        for point in &mut self.points_m {
            *point = matrix.transform_point3(*point);
        }
        self.viewpoint_m = room_from_sensor.transform_point3(self.viewpoint_m);
        self.up = self.up.map(|up| turn * up);
        self
    }

    /// All places, measured or not.
    #[must_use]
    pub fn points_m(&self) -> &[Vec3] {
        &self.points_m
    }

    /// Columns and rows of an organised cloud.
    #[must_use]
    pub fn layout(&self) -> Option<(usize, usize)> {
        self.columns.map(|columns| (columns, self.points_m.len() / columns.max(1)))
    }

    /// Where the sensor was.
    #[must_use]
    pub fn viewpoint_m(&self) -> DVec3 {
        self.viewpoint_m
    }

    /// Against gravity, unit length, when it is known.
    #[must_use]
    pub fn up(&self) -> Option<DVec3> {
        self.up
    }
}

/// Distances along the optical axis, row by row; 0 or NaN where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthPicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width × height` metres.
    pub depth_m: Vec<f32>,
}

/// A pinhole camera without distortion; the origin of the picture is the centre of its top-left pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length along x and y.
    pub focal_px: [f64; 2],
    /// Principal point.
    pub centre_px: [f64; 2],
}

impl Intrinsics {
    /// The ray through a pixel, in camera axes, with z = 1.
    #[must_use]
    pub fn ray(&self, column_px: f64, row_px: f64) -> DVec3 {
        let ([fx, fy], [cx, cy]) = (self.focal_px, self.centre_px);
        DVec3::new((column_px - cx) / fx, (row_px - cy) / fy, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depth_picture_becomes_points_with_holes() {
        let picture = DepthPicture { width: 2, height: 2, depth_m: vec![1.0, 0.0, f32::NAN, 2.0] };
        let camera = Intrinsics { focal_px: [1.0, 2.0], centre_px: [0.0, 0.0] };
        let cloud = PointCloud::from_depth(&picture, &camera);
        assert_eq!(cloud.layout(), Some((2, 2)));
        assert_eq!(cloud.points_m()[0], Vec3::Z);
        assert!(cloud.points_m()[1].is_nan() && cloud.points_m()[2].is_nan());
        assert_eq!(cloud.points_m()[3], Vec3::new(2.0, 1.0, 2.0));
        let moved = cloud.with_up(DVec3::NEG_Y * 3.0).moved(&DMat4::from_translation(DVec3::X));
        assert_eq!(moved.viewpoint_m(), DVec3::X);
        assert_eq!(moved.up(), Some(DVec3::NEG_Y));
        assert_eq!(moved.points_m()[0], Vec3::new(1.0, 0.0, 1.0));
    }
}
