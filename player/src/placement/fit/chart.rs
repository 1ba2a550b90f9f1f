//! Two coordinates on a plane, laid as the pitch has them: x along the touchline, z towards the main camera.

use glam::{DVec2, DVec3};

use crate::placement::Plane;

/// A plane with an origin and a direction on it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chart {
    origin_m: DVec3,
    /// Unit directions of x and z in the room.
    x: DVec3,
    z: DVec3,
}

impl Chart {
    /// The chart whose x runs along `along` as far as the plane allows; any direction on the plane when it is upright.
    pub(crate) fn new(plane: &Plane, origin_m: DVec3, along: DVec3) -> Self {
        let up = plane.normal;
        let x =
            along.reject_from_normalized(up).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        Self { origin_m: plane.project(origin_m), x, z: x.cross(up) }
    }

    /// Direction of x in the room, unit length.
    pub(crate) fn along(&self) -> DVec3 {
        self.x
    }

    /// Direction of z in the room, unit length.
    pub(crate) fn towards(&self) -> DVec3 {
        self.z
    }

    /// Where the foot of the perpendicular from a room point lies, metres.
    pub(crate) fn flat(&self, room_m: DVec3) -> DVec2 {
        let from_origin = room_m - self.origin_m;
        DVec2::new(from_origin.dot(self.x), from_origin.dot(self.z))
    }

    /// A polygon of the room, flattened.
    pub(crate) fn flat_all(&self, corners_m: &[DVec3]) -> Vec<DVec2> {
        corners_m.iter().map(|corner| self.flat(*corner)).collect()
    }

    /// The room point of a place on the plane.
    pub(crate) fn room(&self, flat_m: DVec2) -> DVec3 {
        self.origin_m + self.x * flat_m.x + self.z * flat_m.y
    }
}
