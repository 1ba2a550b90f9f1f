//! What the match stands on, and how it follows when that is seen better: the same surface refined, its successor, a
//! moved anchor, or the first surface under a match in the air.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};

use super::{Ray, hover};
use crate::placement::{
    Plane, Surface, SurfaceId, SurfaceKind, TabletopPose,
    fit::{self, MOST_LEAN, Wish, can_hold_a_match},
};

/// A refined plane may have moved by this much; more, and it is taken for another thing with the same name.
const MOST_CORRECTION_M: f64 = 0.3;
const MOST_CORRECTION_TILT: f64 = 0.35;
/// A successor of a surface that was merged or renamed is this near, metres and radians.
const SUCCESSOR_M: f64 = 0.05;
const SUCCESSOR_TILT: f64 = 0.17;
/// A match in the air lands on surfaces at most this far above or below it, metres.
const LANDING_REACH_M: f64 = 0.7;

/// What is under the match.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Ground {
    /// A surface as it was last seen; boxed, as it is large.
    Surface(Box<Surface>),
    /// Nothing yet: an imagined level plane.
    Air(Plane),
}

impl Ground {
    pub(super) fn plane(&self) -> &Plane {
        match self {
            Self::Surface(surface) => &surface.plane,
            Self::Air(plane) => plane,
        }
    }

    pub(super) fn surface(&self) -> Option<&Surface> {
        match self {
            Self::Surface(surface) => Some(surface),
            Self::Air(_) => None,
        }
    }

    /// Where the match may stand that is wanted at a point of the room.
    pub(super) fn nearest_place(&self, wanted_m: DVec3) -> DVec3 {
        match self {
            Self::Surface(surface) => hover::clamped(surface, wanted_m),
            Self::Air(plane) => plane.project(wanted_m),
        }
    }

    /// The same place, size and direction, upright on this ground.
    pub(super) fn settle(&self, pose: &TabletopPose) -> TabletopPose {
        let plane = self.plane();
        let along = pose.orientation * DVec3::X;
        TabletopPose::standing_on(plane.project(pose.foot_m()), plane.normal, along, pose.scale)
    }

    /// Moves with the room frame.
    pub(super) fn moved(&mut self, rotation: DQuat, translation_m: DVec3) {
        match self {
            Self::Surface(surface) => move_surface(surface, rotation, translation_m),
            Self::Air(plane) => move_plane(plane, rotation, translation_m),
        }
    }

    /// This ground as the room is known now; `None` when it did not change.
    pub(super) fn renewed(
        &self,
        surfaces: &BTreeMap<SurfaceId, Surface>,
        foot_m: DVec3,
        up: DVec3,
    ) -> Option<(SurfaceId, Self)> {
        let Self::Surface(old) = self else { return None };
        let near = |surface: &Surface, most_m: f64, most_tilt: f64| {
            can_hold_a_match(surface.kind)
                && is_level(surface, up)
                && surface.plane.distance_m(foot_m).abs() <= most_m
                && surface.plane.normal.angle_between(old.plane.normal) <= most_tilt
        };
        let same = surfaces.get(&old.id);
        let new = match same {
            Some(same) => near(same, MOST_CORRECTION_M, MOST_CORRECTION_TILT).then_some(same),
            None => surfaces.values().find(|surface| {
                near(surface, SUCCESSOR_M, SUCCESSOR_TILT)
                    && hover::off_outline_m(surface, surface.plane.project(foot_m)) <= SUCCESSOR_M
            }),
        }?;
        (new != &**old).then(|| (new.id, Self::Surface(Box::new(new.clone()))))
    }
}

fn is_level(surface: &Surface, up: DVec3) -> bool {
    surface.plane.normal.angle_between(up) <= MOST_LEAN
}

/// Turns a surface with its outline and foot prints.
pub(super) fn move_surface(surface: &mut Surface, rotation: DQuat, translation_m: DVec3) {
    move_plane(&mut surface.plane, rotation, translation_m);
    for corner in surface.outline_m.iter_mut().chain(surface.obstacles_m.iter_mut().flatten()) {
        *corner = rotation * *corner + translation_m;
    }
}

fn move_plane(plane: &mut Plane, rotation: DQuat, translation_m: DVec3) {
    plane.normal = (rotation * plane.normal).normalize_or(plane.normal);
    plane.offset_m -= plane.normal.dot(translation_m);
}

/// Where a match in the air lands: on the table or seat that it hides from the viewer, looking as large as before;
/// failing that on the one below or above it. It never drops to the floor by itself: a table may yet be found.
pub(super) fn landing(
    surfaces: &BTreeMap<SurfaceId, Surface>,
    floating: &TabletopPose,
    eye: Option<&Ray>,
    wish: &Wish,
) -> Option<(SurfaceId, TabletopPose)> {
    let foot = floating.foot_m();
    let candidates = surfaces
        .values()
        .filter(|surface| matches!(surface.kind, SurfaceKind::Table | SurfaceKind::Seat))
        .filter(|surface| wish.up.is_none_or(|up| is_level(surface, up)))
        .filter(|surface| surface.plane.distance_m(foot).abs() <= LANDING_REACH_M);
    let lands = candidates.filter_map(|surface| {
        let behind = eye.and_then(|eye| {
            let share = surface.plane.hit(eye.origin_m, foot - eye.origin_m)?;
            let point = eye.origin_m + (foot - eye.origin_m) * share;
            (hover::off_outline_m(surface, point) == 0.0).then_some((point, share))
        });
        let below = surface.plane.project(foot);
        let (place, growth) = match behind {
            Some(found) => found,
            None => (hover::off_outline_m(surface, below) == 0.0).then_some((below, 1.0))?,
        };
        let [least, most] = wish.scale_limits;
        let scale = (floating.scale * growth).clamp(least, most);
        let along = floating.orientation * DVec3::X;
        let same_look = TabletopPose::standing_on(place, surface.plane.normal, along, scale);
        if fit::fits(surface, &same_look, wish.half_turf_m, 0.0) {
            return Some((surface, same_look));
        }
        Some((surface, fit::fit(surface, wish).ok()?))
    });
    lands
        .min_by(|(_, a), (_, b)| a.foot_m().distance(foot).total_cmp(&b.foot_m().distance(foot)))
        .map(|(surface, pose)| (surface.id, pose))
}
