//! Flat surfaces of a room, as a finder or a headset's runtime sees them.

use glam::DVec3;
use serde::Serialize;

/// A plane of the room: the points p with `normal · p + offset_m = 0`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Plane {
    /// Unit length, towards the side from which it was seen.
    pub normal: DVec3,
    /// Metres; positive when the origin lies on the side of the normal.
    pub offset_m: f64,
}

impl Plane {
    /// The plane through `point` with a normal of unit length.
    #[must_use]
    pub fn through(point: DVec3, normal: DVec3) -> Self {
        Self { normal, offset_m: -normal.dot(point) }
    }

    /// Distance of a point, metres; positive on the side of the normal.
    #[must_use]
    pub fn distance_m(&self, point: DVec3) -> f64 {
        self.normal.dot(point) + self.offset_m
    }

    /// The point of the plane nearest to `point`.
    #[must_use]
    pub fn project(&self, point: DVec3) -> DVec3 {
        point - self.normal * self.distance_m(point)
    }

    /// Where a ray meets the plane, as a multiple of `direction`; `None` when it runs beside it or away from it.
    #[must_use]
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let along = -self.distance_m(origin) / self.normal.dot(direction);
        (along.is_finite() && along > 0.0).then_some(along)
    }
}

/// A surface's name for as long as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct SurfaceId(pub u32);

/// What a surface is to somebody who wants to put something on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceKind {
    /// Level, raised, large enough.
    Table,
    /// Level and raised like a chair or a sofa: a match can stand there when there is no table.
    Seat,
    /// The lowest level surface of the room.
    Floor,
    /// Upright.
    Wall,
    /// Anything else: tilted, overhead, or not known.
    Other,
}

/// A flat surface with its outline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Surface {
    /// The same from one update to the next.
    pub id: SurfaceId,
    /// What it is.
    pub kind: SurfaceKind,
    /// The plane that it lies in.
    pub plane: Plane,
    /// Corners on the plane, metres, counter-clockwise seen from the side of the normal, not closed; need not be convex.
    pub outline_m: Vec<DVec3>,
    /// Foot prints of what stands on it: polygons on the plane as `outline_m`.
    pub obstacles_m: Vec<Vec<DVec3>>,
    /// How much it can be trusted, 0..1.
    pub confidence: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_hits_only_what_is_ahead() {
        let table = Plane::through(DVec3::new(0.0, 0.75, 0.0), DVec3::Y);
        let eye = DVec3::new(0.0, 1.75, 0.0);
        assert_eq!(table.hit(eye, DVec3::NEG_Y), Some(1.0));
        assert_eq!(table.hit(eye, DVec3::Y), None);
        assert_eq!(table.hit(eye, DVec3::X), None);
        assert_eq!(table.project(eye), DVec3::new(0.0, 0.75, 0.0));
    }
}
