//! The finder as a source of surfaces: depth goes in look by look, surfaces with lasting names come out.

use std::time::Duration;

use glam::DVec3;

use super::{Finder, PlaneSource, PointCloud, Surface, SurfaceMap};

/// Share of a surface's corners that the sensor must look past, without finding it, for its absence to count.
const SEEN_SHARE: f64 = 0.5;

/// Half the angle of view within which a surface should have been seen, cosine of 25 degrees.
const VIEW: f64 = 0.906;

/// Farther away a surface is not expected, metres.
const FAR_M: f64 = 4.0;

/// Finds surfaces in the looks of a depth camera whose poses are known.
#[derive(Clone, Debug, Default)]
pub struct Scanner {
    finder: Finder,
    map: SurfaceMap,
    pending: Option<PointCloud>,
}

impl Scanner {
    /// A scanner with a finder's settings.
    #[must_use]
    pub fn new(finder: Finder) -> Self {
        Self { finder, ..Self::default() }
    }

    /// Hands over what the sensor measured, in the room frame with its viewpoint; a look that was not worked on yet is
    /// replaced.
    pub fn look(&mut self, cloud: PointCloud) {
        self.pending = Some(cloud);
    }

    /// What is known.
    #[must_use]
    pub fn map(&self) -> &SurfaceMap {
        &self.map
    }
}

impl PlaneSource for Scanner {
    fn name(&self) -> &str {
        "depth camera"
    }

    fn poll(&mut self, now: Duration) -> Option<Vec<Surface>> {
        let cloud = self.pending.take()?;
        let finding = self.finder.find(&cloud);
        let seen: Vec<Surface> = finding.surfaces.into_iter().map(|found| found.surface).collect();
        let eye = cloud.viewpoint_m();
        let measured = cloud.points_m().iter().step_by(16).filter(|point| point.is_finite());
        let view: DVec3 = measured.map(|point| (point.as_dvec3() - eye).normalize_or_zero()).sum();
        let view = view.normalize_or_zero();
        let in_view = |surface: &Surface| {
            let ahead = surface.outline_m.iter().filter(|corner| {
                let ray = **corner - eye;
                ray.normalize_or_zero().dot(view) > VIEW && ray.length() < FAR_M
            });
            ahead.count() as f64 >= SEEN_SHARE * surface.outline_m.len() as f64
        };
        self.map.update(&seen, now, in_view);
        Some(self.map.surfaces().cloned().collect())
    }
}
