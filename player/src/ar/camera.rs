//! The camera that took a picture of the room: a pinhole with its own principal point, and where it was.

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};

use crate::{placement::TabletopPose, placement::gesture::Ray, renderer::View};

/// Distance of the near plane, room metres; the far plane is at infinity. With reversed depth a table at 1 m is resolved
/// to a ten-thousandth of a millimetre.
pub const NEAR_M: f64 = 0.05;

/// A pinhole camera in a room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomCamera {
    /// Width and height of the picture, pixels.
    pub size_px: [u32; 2],
    /// Focal lengths across and down, pixels.
    pub focal_px: DVec2,
    /// Principal point, pixels; the origin is the centre of the top-left pixel.
    pub centre_px: DVec2,
    /// Centre of projection, room metres.
    pub position_m: DVec3,
    /// Room to camera (x right, y down, z forward).
    pub rotation: DMat3,
}

impl RoomCamera {
    /// A camera whose own axes are the room's, as scans come: at the origin, looking along +z with y down.
    #[must_use]
    pub fn at_origin(size_px: [u32; 2], focal_px: DVec2, centre_px: DVec2) -> Self {
        Self { size_px, focal_px, centre_px, position_m: DVec3::ZERO, rotation: DMat3::IDENTITY }
    }

    /// The same camera somewhere else, given its rigid `room_from_camera`.
    #[must_use]
    pub fn moved(self, room_from_camera: &DMat4) -> Self {
        let turn = DMat3::from_mat4(*room_from_camera);
        Self {
            position_m: room_from_camera.transform_point3(self.position_m),
            rotation: self.rotation * turn.transpose(),
            ..self
        }
    }

    /// The same camera at `position_m` with `target_m` in the middle of the picture and `up` upwards in it.
    #[must_use]
    pub fn looking_at(self, position_m: DVec3, target_m: DVec3, up: DVec3) -> Self {
        let forward = (target_m - position_m).normalize_or(DVec3::Z);
        let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let down = forward.cross(right);
        Self { position_m, rotation: DMat3::from_cols(right, down, forward).transpose(), ..self }
    }

    /// Where a room point lands, pixels, and its distance along the optical axis, metres; `None` behind the near plane.
    #[must_use]
    pub fn project(&self, room_m: DVec3) -> Option<(DVec2, f64)> {
        let camera = self.rotation * (room_m - self.position_m);
        (camera.z > NEAR_M).then(|| (camera.truncate() / camera.z * self.focal_px + self.centre_px, camera.z))
    }

    /// The half line of a pixel; its direction is as long as one metre along the optical axis needs.
    #[must_use]
    pub fn ray(&self, pixel: DVec2) -> Ray {
        let camera = ((pixel - self.centre_px) / self.focal_px).extend(1.0);
        Ray { origin_m: self.position_m, direction: self.rotation.transpose() * camera }
    }

    /// Room metres to clip space; depth is 1 at the near plane and 0 at infinity, w is metres along the optical axis.
    #[must_use]
    pub fn clip_from_room(&self) -> DMat4 {
        let size = DVec2::new(f64::from(self.size_px[0]), f64::from(self.size_px[1]));
        let scale = 2.0 * self.focal_px / size;
        let shift = 2.0 * (self.centre_px + 0.5) / size - 1.0;
        let clip_from_camera = DMat4::from_cols(
            DVec4::new(scale.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, -scale.y, 0.0, 0.0),
            DVec4::new(shift.x, -shift.y, 0.0, 1.0),
            DVec4::new(0.0, 0.0, NEAR_M, 0.0),
        );
        let camera_from_room = DMat4::from_mat3(self.rotation) * DMat4::from_translation(-self.position_m);
        clip_from_camera * camera_from_room
    }

    /// The pitch as this camera sees it standing at `pose`. The camera is moved to the pitch, not the pitch to the room.
    #[must_use]
    pub fn of_pitch(&self, pose: &TabletopPose) -> View {
        View {
            clip_from_world: (self.clip_from_room() * pose.room_from_pitch()).as_mat4(),
            eye_m: pose.to_pitch(self.position_m).as_vec3(),
        }
    }

    /// The same view with more or fewer pixels.
    #[must_use]
    pub fn resized(self, width_px: u32, height_px: u32) -> Self {
        let size = |[width, height]: [u32; 2]| DVec2::new(f64::from(width), f64::from(height));
        let factor = size([width_px, height_px]) / size(self.size_px);
        Self {
            size_px: [width_px, height_px],
            focal_px: self.focal_px * factor,
            centre_px: (self.centre_px + 0.5) * factor - 0.5,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> RoomCamera {
        RoomCamera::at_origin([640, 480], DVec2::new(518.0, 519.0), DVec2::new(325.5, 253.5)).looking_at(
            DVec3::new(0.3, 1.5, 1.1),
            DVec3::new(0.0, 0.75, 0.0),
            DVec3::Y,
        )
    }

    #[test]
    fn pixels_clip_space_and_rays_agree() {
        let camera = camera();
        for point in [DVec3::new(0.1, 0.75, 0.0), DVec3::new(-0.4, 0.9, -0.3)] {
            let (pixel, depth_m) = camera.project(point).unwrap();
            let clip = camera.clip_from_room() * point.extend(1.0);
            let ndc = clip.truncate() / clip.w;
            let drawn = DVec2::new((ndc.x + 1.0) * 320.0, (1.0 - ndc.y) * 240.0) - 0.5;
            assert!(drawn.distance(pixel) < 1e-9, "{pixel} drawn at {drawn}");
            assert!((clip.w - depth_m).abs() < 1e-12 && (ndc.z - NEAR_M / depth_m).abs() < 1e-12);
            let ray = camera.ray(pixel);
            assert!((ray.origin_m + ray.direction * depth_m).distance(point) < 1e-12);
            let large = camera.resized(1280, 960);
            assert!((large.project(point).unwrap().0 + 0.5).distance((pixel + 0.5) * 2.0) < 1e-9);
        }
        assert_eq!(camera.project(DVec3::new(0.3, 1.5, 5.0)), None, "behind");
    }

    #[test]
    fn depth_tells_a_sheet_of_paper_from_the_table_it_lies_on() {
        // 0.1 mm at 1 m, through the whole chain of single-precision numbers.
        let pose = TabletopPose::standing_on(DVec3::new(0.0, 0.75, 0.0), DVec3::Y, DVec3::X, 0.01);
        let camera = RoomCamera::at_origin([640, 480], DVec2::splat(525.0), DVec2::new(319.5, 239.5))
            .looking_at(DVec3::new(0.0, 1.75, 0.01), DVec3::new(0.0, 0.75, 0.0), DVec3::Y);
        let view = camera.of_pitch(&pose);
        let depth = |height_m: f64| {
            let point = pose.to_pitch(DVec3::new(0.05, 0.75 + height_m, 0.05)).as_vec3();
            let clip = view.clip_from_world * point.extend(1.0);
            clip.z / clip.w
        };
        assert!(depth(1e-4) > depth(0.0), "{} and {}", depth(1e-4), depth(0.0));
        let metres = NEAR_M / f64::from(depth(0.0));
        assert!((metres - 1.0).abs() < 1e-3, "{metres}");
    }

    #[test]
    fn a_moved_camera_sees_the_moved_room() {
        let camera = camera();
        let matrix =
            DMat4::from_rotation_translation(glam::DQuat::from_rotation_y(0.7), DVec3::new(1.0, 2.0, 3.0));
        let point = DVec3::new(0.1, 0.75, 0.0);
        let (before, _) = camera.project(point).unwrap();
        let (after, _) = camera.moved(&matrix).project(matrix.transform_point3(point)).unwrap();
        assert!(before.distance(after) < 1e-9);
    }
}
