//! Which surface is meant: the first one that a ray meets, as long as a match may stand on it.

use std::collections::BTreeMap;

use glam::DVec3;

use super::Ray;
use crate::placement::{
    Surface, SurfaceId,
    fit::{Chart, can_hold_a_match, polygon},
};

/// The highlighted surface keeps the highlight up to this far beyond its outline, metres: no flicker at the edge.
const STICKY_M: f64 = 0.03;

/// The surface that a ray points at. Walls and the like hide what is behind them.
pub(super) fn pointed_at(
    surfaces: &BTreeMap<SurfaceId, Surface>,
    ray: &Ray,
    highlighted: Option<SurfaceId>,
) -> Option<SurfaceId> {
    let hit = |surface: &Surface| {
        let slack = if highlighted == Some(surface.id) { STICKY_M } else { 0.0 };
        let seen_from_above = surface.plane.normal.dot(ray.direction) < 0.0;
        let along = surface.plane.hit(ray.origin_m, ray.direction).filter(|_| seen_from_above)?;
        let point = ray.origin_m + ray.direction * along;
        (off_outline_m(surface, point) <= slack).then_some(along)
    };
    let hits = surfaces.values().filter_map(|surface| Some((hit(surface)?, surface)));
    let (_, nearest) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    can_hold_a_match(nearest.kind).then_some(nearest.id)
}

/// How far a point of the plane lies outside the outline, metres; 0 inside.
pub(super) fn off_outline_m(surface: &Surface, point_m: DVec3) -> f64 {
    nearest_edge(surface, point_m).map_or(0.0, |edge| edge.distance(point_m))
}

/// The point of the outline's inside nearest to a point of the room.
pub(super) fn clamped(surface: &Surface, point_m: DVec3) -> DVec3 {
    let point_m = surface.plane.project(point_m);
    nearest_edge(surface, point_m).unwrap_or(point_m)
}

/// The point of the outline nearest to a point outside it; `None` for a point inside.
fn nearest_edge(surface: &Surface, point_m: DVec3) -> Option<DVec3> {
    let chart = Chart::new(&surface.plane, point_m, surface.plane.normal.any_orthonormal_vector());
    let outline = chart.flat_all(&surface.outline_m);
    let at = chart.flat(point_m);
    if polygon::contains(&outline, at) {
        return None;
    }
    polygon::nearest_on_sides(&outline, at).map(|nearest| chart.room(nearest))
}
