//! How far a measured point may lie from its surface.

use glam::DVec3;

use crate::placement::Plane;

/// Standard deviation of a measured distance as a function of the distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// Structured light and stereo: 1.2 mm + 1.9 mm/m² · (z − 0.4 m)², Nguyen, Izadi and Lovell, "Modeling Kinect sensor
    /// noise for improved 3D reconstruction and tracking", 3DIMPVT 2012; times a factor.
    Triangulated(f64),
    /// The same everywhere, metres: points that were triangulated over a walk, meshes, laser scans.
    Even(f64),
}

impl Noise {
    /// Along the viewing direction, metres.
    pub(super) fn along_view_m(self, distance_m: f64) -> f64 {
        match self {
            Self::Triangulated(factor) => {
                let far = (distance_m - 0.4).max(0.0);
                factor * (0.0012 + 0.0019 * far * far)
            }
            Self::Even(sigma_m) => sigma_m,
        }
    }

    /// Across a plane, metres: a plane that is seen at a flat angle takes only a part of the error along the view.
    pub(super) fn across_m(self, plane: &Plane, point: DVec3, viewpoint: DVec3) -> f64 {
        let view = point - viewpoint;
        let distance = view.length();
        match self {
            Self::Triangulated(_) => {
                let slant = (plane.normal.dot(view) / distance.max(1e-6)).abs();
                self.along_view_m(distance) * slant.max(0.35)
            }
            Self::Even(sigma_m) => sigma_m,
        }
    }
}
