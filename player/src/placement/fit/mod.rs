//! The largest pitch that fits the free part of a surface, upright, with the main camera's side towards the viewer.
//!
//! The turf with its apron has to lie inside the outline and clear of every foot print; only size, place and the two
//! directions that a person would choose are free.

mod chart;
mod free_space;
pub(crate) mod polygon;

pub(crate) use chart::Chart;

use glam::{DVec2, DVec3};
use protocol::pitch::Pitch;
use thiserror::Error;

use super::{PITCH_SCALE_LIMITS, Surface, SurfaceKind, TabletopPose};
use crate::scene::Layout;
use free_space::FreeSpace;

/// The most that a surface may lean before things slide off it, radians.
pub const MOST_LEAN: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Free space around the turf, metres.
const MARGIN_M: f64 = 0.01;
/// Sizes are found to this share; among those of almost the largest size the middle of the surface is preferred.
const SIZE_PRECISION: f64 = 2e-3;
const SIZE_GIVEN_UP: f64 = 0.995;
const PLACE_PRECISION_M: f64 = 2e-3;
/// Rounds of turning towards the viewer from the place that was found.
const FACING_ROUNDS: usize = 3;

/// Which way the pitch lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Facing {
    /// Along the longer side of the surface.
    #[default]
    LongerSide,
    /// Square to the viewer, like a television.
    Viewer,
}

/// What is to be fitted, and for whom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// Half length and half width of the turf, metres of the pitch.
    pub half_turf_m: [f64; 2],
    /// Which way.
    pub facing: Facing,
    /// Eye of the viewer, room metres; of two equivalent directions the pitch takes the one whose main camera's side
    /// is the viewer's.
    pub viewer_m: Option<DVec3>,
    /// Against gravity, unit length, when known: surfaces that lean too much are refused.
    pub up: Option<DVec3>,
    /// Preferred place among equally large ones; the middle of the surface without one.
    pub near_m: Option<DVec3>,
    /// Free space around the turf, metres.
    pub margin_m: f64,
    /// Room metres per metre of the pitch, least and most.
    pub scale_limits: [f64; 2],
}

impl Wish {
    /// A pitch with its apron along the longer side, one centimetre from the edge, within [`PITCH_SCALE_LIMITS`].
    #[must_use]
    pub fn of(pitch: Pitch) -> Self {
        Self {
            half_turf_m: Layout::around(pitch).half_turf_m,
            facing: Facing::LongerSide,
            viewer_m: None,
            up: None,
            near_m: None,
            margin_m: MARGIN_M,
            scale_limits: PITCH_SCALE_LIMITS,
        }
    }
}

/// Why no pitch stands there.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum Misfit {
    /// A wall or something unknown.
    #[error("nothing can stand on a {}: point at a table", kind_name(*.0))]
    Kind(SurfaceKind),
    /// It leans.
    #[error(
        "the surface leans by {angle_deg:.0}°, the match slides off beyond {most_deg:.0}°: use a level one"
    )]
    Tilted {
        /// Angle to the horizontal.
        angle_deg: f64,
        /// The most.
        most_deg: f64,
    },
    /// Fewer than three corners, or no area, or no number.
    #[error("the outline has {corners} corners and encloses nothing: look at the surface a little longer")]
    Outline {
        /// How many corners it has.
        corners: usize,
    },
    /// Too small even when empty.
    #[error(
        "the surface is too small: a pitch of {length_cm:.0} cm would fit, {least_cm:.0} cm are the least"
    )]
    TooSmall {
        /// Length of the pitch's turf that fits.
        length_cm: f64,
        /// The least.
        least_cm: f64,
    },
    /// Large enough, were it empty.
    #[error(
        "too much stands on the surface: a pitch of {length_cm:.0} cm would fit, {least_cm:.0} cm are the least: \
         clear a part of it"
    )]
    Cluttered {
        /// Length of the turf that fits.
        length_cm: f64,
        /// The least.
        least_cm: f64,
    },
}

fn kind_name(kind: SurfaceKind) -> &'static str {
    match kind {
        SurfaceKind::Table => "table",
        SurfaceKind::Seat => "seat",
        SurfaceKind::Floor => "floor",
        SurfaceKind::Wall => "wall",
        SurfaceKind::Other => "surface of unknown kind",
    }
}

/// Whether a match may stand on surfaces of a kind.
#[must_use]
pub fn can_hold_a_match(kind: SurfaceKind) -> bool {
    matches!(kind, SurfaceKind::Table | SurfaceKind::Seat | SurfaceKind::Floor)
}

/// The largest pitch on the free part of a surface.
///
/// The turf lies inside the outline and outside every foot print, exactly; its size is the largest to half a percent
/// for the direction that [`Wish::facing`] asks for.
///
/// # Errors
/// A [`Misfit`] that a person can act on.
pub fn fit(surface: &Surface, wish: &Wish) -> Result<TabletopPose, Misfit> {
    check(surface, wish)?;
    let level =
        Chart::new(&surface.plane, surface.outline_m[0], surface.plane.normal.any_orthonormal_vector());
    let outline = level.flat_all(&surface.outline_m);
    let bad_outline = Misfit::Outline { corners: outline.len() };
    let middle = level.room(polygon::centroid(&outline));
    let longer = polygon::longer_direction(&outline).ok_or(bad_outline)?;
    let longer = level.along() * longer.x + level.towards() * longer.y;

    let mut centre = wish.near_m.map_or(middle, |near| surface.plane.project(near));
    let mut found = None;
    let rounds = if wish.facing == Facing::Viewer { FACING_ROUNDS } else { 1 };
    for _ in 0..rounds {
        let along = direction(surface, wish, longer, centre);
        let chart = Chart::new(&surface.plane, middle, along);
        let (place, scale) = place(surface, wish, &chart)?;
        centre = chart.room(place);
        found = Some((along, scale));
    }
    let (along, scale) = found.ok_or(bad_outline)?;
    let along = match wish.viewer_m {
        // The equivalent direction with the main camera's side to the viewer.
        Some(viewer) if along.cross(surface.plane.normal).dot(viewer - centre) < 0.0 => -along,
        _ => along,
    };
    Ok(TabletopPose::standing_on(centre, surface.plane.normal, along, scale))
}

/// Whether the turf of a pose lies on the free part of a surface, `margin_m` from every edge.
#[must_use]
pub fn fits(surface: &Surface, pose: &TabletopPose, half_turf_m: [f64; 2], margin_m: f64) -> bool {
    let chart = Chart::new(&surface.plane, pose.foot_m(), pose.orientation * DVec3::X);
    space(surface, &chart, half_turf_m, margin_m, &surface.obstacles_m).scale_at(DVec2::ZERO) >= pose.scale
}

fn check(surface: &Surface, wish: &Wish) -> Result<(), Misfit> {
    if !can_hold_a_match(surface.kind) {
        return Err(Misfit::Kind(surface.kind));
    }
    if let Some(up) = wish.up {
        let lean = surface.plane.normal.dot(up).clamp(-1.0, 1.0).acos();
        if lean > MOST_LEAN {
            return Err(Misfit::Tilted { angle_deg: lean.to_degrees(), most_deg: MOST_LEAN.to_degrees() });
        }
    }
    let corners = &surface.outline_m;
    let sound = surface.plane.normal.is_normalized()
        && surface.plane.offset_m.is_finite()
        && corners.len() >= 3
        && corners.iter().chain(surface.obstacles_m.iter().flatten()).all(|corner| corner.is_finite());
    if sound { Ok(()) } else { Err(Misfit::Outline { corners: corners.len() }) }
}

/// The pitch's x in the room.
fn direction(surface: &Surface, wish: &Wish, longer: DVec3, centre: DVec3) -> DVec3 {
    let towards = wish
        .viewer_m
        .filter(|_| wish.facing == Facing::Viewer)
        .and_then(|viewer| (viewer - centre).reject_from_normalized(surface.plane.normal).try_normalize());
    match towards {
        // z is x × up, so x is up × z.
        Some(z) => surface.plane.normal.cross(z),
        None => longer,
    }
}

/// Where on the chart and how large.
fn place(surface: &Surface, wish: &Wish, chart: &Chart) -> Result<(DVec2, f64), Misfit> {
    let space_with =
        |obstacles: &[Vec<DVec3>]| space(surface, chart, wish.half_turf_m, wish.margin_m, obstacles);
    let [least, most] = wish.scale_limits;
    let free = space_with(&surface.obstacles_m);
    let largest = free.largest(SIZE_PRECISION);
    let (centre, scale) = match largest {
        Some((centre, scale)) if scale >= least => (centre, scale),
        _ => {
            let length_cm = |scale: f64| 200.0 * wish.half_turf_m[0] * scale;
            let (length_cm, least_cm) =
                (length_cm(largest.map_or(0.0, |(_, scale)| scale)), length_cm(least));
            let empty = space_with(&[]).largest(SIZE_PRECISION);
            return Err(if empty.is_some_and(|(_, scale)| scale >= least) {
                Misfit::Cluttered { length_cm, least_cm }
            } else {
                Misfit::TooSmall { length_cm, least_cm }
            });
        }
    };
    let wanted = wish
        .near_m
        .map_or_else(|| polygon::centroid(&chart.flat_all(&surface.outline_m)), |near| chart.flat(near));
    let enough = (scale * SIZE_GIVEN_UP).clamp(least, most);
    let centre = free.nearest(enough, wanted, centre, PLACE_PRECISION_M);
    Ok((centre, free.scale_at(centre).min(most)))
}

fn space(
    surface: &Surface,
    chart: &Chart,
    half_turf_m: [f64; 2],
    margin_m: f64,
    obstacles_m: &[Vec<DVec3>],
) -> FreeSpace {
    let holes: Vec<_> = obstacles_m.iter().map(|obstacle| chart.flat_all(obstacle)).collect();
    FreeSpace::new(&chart.flat_all(&surface.outline_m), &holes, half_turf_m.into(), margin_m)
}

#[cfg(test)]
mod tests;
