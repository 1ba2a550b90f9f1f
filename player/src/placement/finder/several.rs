//! Finding in several looks at one room: each is searched alone, what they share is joined.

use std::{collections::BTreeMap, time::Duration};

use glam::DVec3;

use super::{Finder, Finding, FoundSurface, Up};
use crate::placement::{PointCloud, Surface, SurfaceId, SurfaceMap};

impl Finder {
    /// Finds the surfaces of a room in several looks at it, all in the room's frame. A surface has the plane and the outline
    /// of all looks at it, and the kind and figures of the look that is trusted most. `None` without any look.
    #[must_use]
    pub fn find_in_all(&self, looks: &[PointCloud]) -> Option<Finding> {
        let mut findings = looks.iter().map(|look| self.find(look));
        let first = findings.next()?;
        if looks.len() == 1 {
            return Some(first);
        }
        let findings: Vec<Finding> = std::iter::once(first).chain(findings).collect();
        let mut map = SurfaceMap::default();
        for finding in &findings {
            let seen: Vec<Surface> = finding.surfaces.iter().map(|found| found.surface.clone()).collect();
            // Looks of a recording are not a watch: nothing is lost because another look does not show it.
            map.update(&seen, Duration::ZERO, |_| false);
        }
        let mut best: BTreeMap<SurfaceId, &FoundSurface> = BTreeMap::new();
        for found in findings.iter().flat_map(|finding| &finding.surfaces) {
            if let Some(id) = map.matching(&found.surface) {
                let trusted = best.entry(id).or_insert(found);
                if found.surface.confidence > trusted.surface.confidence {
                    *trusted = found;
                }
            }
        }
        let surfaces = map.surfaces().filter_map(|surface| {
            let found = best.get(&surface.id)?;
            let kind = found.surface.kind;
            Some(FoundSurface { surface: Surface { kind, ..surface.clone() }, ..(*found).clone() })
        });
        let up: DVec3 = findings.iter().map(|finding| finding.up.direction).sum();
        let source = findings.first().map(|finding| finding.up.source)?;
        let direction =
            up.try_normalize().or_else(|| findings.first().map(|finding| finding.up.direction))?;
        Some(Finding::new(Up { direction, source }, surfaces.collect()))
    }
}
