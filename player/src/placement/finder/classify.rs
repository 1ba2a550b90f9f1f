//! What each flat piece is, and why a piece that one might take for a table is none.

use glam::DVec3;
use serde::Serialize;

use super::{
    edges::EdgeView,
    footprint::Footprint,
    gravity::{Up, UpSource},
    moments::Fit,
};
use crate::placement::SurfaceKind;

/// Heights over the floor, metres: up to the first a step or a mat, up to the second a seat, up to the third a table.
const HEIGHTS_M: [f64; 3] = [0.25, 0.58, 1.25];

/// A surface that leans further is not level, degrees. Tables do not lean; the rest is measuring error.
const MOST_TILT_DEGREES: f64 = 6.0;

/// Leaning further than this, a surface is no leaning table but something else, degrees.
const SLOPE_DEGREES: f64 = 40.0;

/// Radius of the disc that has to fit on a surface: a match of 20 by 13 cm.
const LEAST_DISC_M: f64 = 0.12;

/// Radius of the disc that has to fit between the things on it: a match of 13 by 9 cm, a little over 1:1000. Small,
/// because the sparse points of a phone make things wider than they are.
const LEAST_FREE_DISC_M: f64 = 0.08;

/// Least share of the surface that has to be free.
const LEAST_FREE_SHARE: f64 = 0.35;

/// Pieces smaller than this are not spoken about, square metres.
const LEAST_AREA_M2: f64 = 0.02;

/// Pieces that are mostly bridged gaps are no surfaces.
const LEAST_MEASURED_SHARE: f64 = 0.15;

/// Without a lower surface in view, a level one is taken for the floor when the sensor is this far above it, metres.
const EYES_OVER_TABLE_M: f64 = 1.1;

/// Least share of the boundary that ends within the picture with nothing rising behind it.
const LEAST_EDGE_SHARE: f64 = 0.2;

/// Points below a surface and beside it, as a share of its own, that show it to be raised.
const LEAST_BELOW_SHARE: f64 = 0.02;

/// Share of the boundary beyond which something flat and lower is seen, with them.
const LEAST_DROPS: f64 = 0.1;

/// Points below as a share for clouds without order, where no picture shows that they lie beyond an edge: more than wild points make up.
const LEAST_BELOW_SHARE_SCATTERED: f64 = 0.08;

/// Why a level or nearly level surface is not claimed as a place to stand on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Refusal {
    /// No disc of the needed size fits into the outline.
    TooSmall {
        /// Radius of the largest that does.
        disc_radius_m: f64,
        /// What is needed.
        needed_m: f64,
    },
    /// Large enough, but too much stands on it.
    TooCluttered {
        /// Share of it that is free.
        free_share: f64,
        /// Radius of the largest free disc.
        free_disc_radius_m: f64,
    },
    /// It leans.
    Tilted {
        /// Angle to level.
        degrees: f64,
        /// Most that is accepted.
        limit_degrees: f64,
    },
    /// The floor of the room, by what is above it or beside it.
    Floor,
    /// A step, a mat, a box on the floor.
    TooLow {
        /// Height over the floor.
        height_m: f64,
    },
    /// A cupboard, a shelf, the ceiling.
    TooHigh {
        /// Height over the floor.
        height_m: f64,
    },
    /// It fills the view: no edge of it and nothing lower is seen, so that nothing says that it is raised.
    NotSeenRaised {
        /// Share of its boundary that ends freely within the picture.
        edge_share: f64,
        /// How far the sensor is above it.
        below_sensor_m: f64,
    },
}

/// A piece of a plane on its way to becoming a surface.
pub(super) struct Piece {
    pub(super) fit: Fit,
    pub(super) footprint: Footprint,
    /// Where its boundary runs in the picture; `None` for points without order.
    pub(super) edges: Option<EdgeView>,
    /// The normal that its points say, where the fit was made level.
    pub(super) measured_normal: DVec3,
}

/// What a piece is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Verdict {
    pub(super) kind: SurfaceKind,
    pub(super) height_m: Option<f64>,
    pub(super) tilt_degrees: f64,
    pub(super) refusal: Option<Refusal>,
}

impl Piece {
    fn tilt_degrees(&self, up: DVec3) -> f64 {
        self.measured_normal.angle_between(up).to_degrees()
    }

    fn level_m(&self, up: DVec3) -> f64 {
        up.dot(self.fit.centroid)
    }

    /// Whether something shows that the piece does not lie on the ground.
    fn is_seen_raised(&self, below_sensor_m: f64) -> bool {
        let is_above_others = match self.edges {
            Some(edges) => self.footprint.below_share > LEAST_BELOW_SHARE && edges.drops > LEAST_DROPS,
            None => self.footprint.below_share > LEAST_BELOW_SHARE_SCATTERED,
        };
        if is_above_others {
            return true;
        }
        match self.edges {
            Some(edges) => edges.free_share() > LEAST_EDGE_SHARE && below_sensor_m < EYES_OVER_TABLE_M,
            None => below_sensor_m < EYES_OVER_TABLE_M / 1.5,
        }
    }
}

/// Says what each piece is.
pub(super) fn classify(pieces: &[Piece], up: Up, viewpoint: DVec3) -> Vec<Verdict> {
    let up_direction = up.direction;
    let eye_m = up_direction.dot(viewpoint);
    let is_level = |piece: &Piece| is_level(piece.tilt_degrees(up_direction));
    // The floor: the lowest large level piece, unless it is seen to be raised.
    let lowest = pieces
        .iter()
        .filter(|piece| is_level(piece) && piece.footprint.disc_m >= LEAST_DISC_M)
        .min_by(|a, b| a.level_m(up_direction).total_cmp(&b.level_m(up_direction)));
    let floor_m = lowest
        .filter(|piece| !piece.is_seen_raised(eye_m - piece.level_m(up_direction)))
        .map(|piece| piece.level_m(up_direction));
    let alone = pieces
        .iter()
        .filter(|piece| is_level(piece))
        .all(|piece| floor_m.is_none_or(|floor_m| piece.level_m(up_direction) < floor_m + HEIGHTS_M[0]));
    pieces
        .iter()
        .map(|piece| {
            let tilt_degrees = piece.tilt_degrees(up_direction);
            let level_m = piece.level_m(up_direction);
            let height_m = floor_m.map(|floor_m| level_m - floor_m);
            let verdict = |kind, refusal| Verdict { kind, height_m, tilt_degrees, refusal };
            if tilt_degrees >= MOST_TILT_DEGREES {
                let is_wall = (75.0..=105.0).contains(&tilt_degrees);
                let kind = if is_wall { SurfaceKind::Wall } else { SurfaceKind::Other };
                let leans = tilt_degrees < SLOPE_DEGREES && piece.footprint.disc_m >= LEAST_DISC_M;
                let refusal = leans
                    .then_some(Refusal::Tilted { degrees: tilt_degrees, limit_degrees: MOST_TILT_DEGREES });
                return verdict(kind, refusal);
            }
            let kind = match height_m {
                Some(height_m) if height_m < 0.08 => {
                    let refusal = if alone
                        && !matches!(up.source, UpSource::Given)
                        && eye_m - level_m < EYES_OVER_TABLE_M
                    {
                        Refusal::NotSeenRaised {
                            edge_share: piece.edges.map_or(0.0, |edges| edges.free_share()),
                            below_sensor_m: eye_m - level_m,
                        }
                    } else {
                        Refusal::Floor
                    };
                    return verdict(SurfaceKind::Floor, Some(refusal));
                }
                Some(height_m) if height_m < HEIGHTS_M[0] => {
                    return verdict(SurfaceKind::Other, Some(Refusal::TooLow { height_m }));
                }
                Some(height_m) if height_m < HEIGHTS_M[1] => SurfaceKind::Seat,
                Some(height_m) if height_m > HEIGHTS_M[2] => {
                    return verdict(SurfaceKind::Other, Some(Refusal::TooHigh { height_m }));
                }
                _ => SurfaceKind::Table,
            };
            match room_on(&piece.footprint) {
                Some(refusal) => verdict(SurfaceKind::Other, Some(refusal)),
                None => verdict(kind, None),
            }
        })
        .collect()
}

fn room_on(footprint: &Footprint) -> Option<Refusal> {
    if footprint.disc_m < LEAST_DISC_M {
        return Some(Refusal::TooSmall { disc_radius_m: footprint.disc_m, needed_m: LEAST_DISC_M });
    }
    let is_free = footprint.free_disc_m >= LEAST_FREE_DISC_M && footprint.free_share >= LEAST_FREE_SHARE;
    (!is_free).then_some(Refusal::TooCluttered {
        free_share: footprint.free_share,
        free_disc_radius_m: footprint.free_disc_m,
    })
}

/// Whether an angle to gravity is that of a level surface.
pub(super) fn is_level(tilt_degrees: f64) -> bool {
    tilt_degrees < MOST_TILT_DEGREES
}

/// Whether a piece is worth a word.
pub(super) fn is_notable(footprint: &Footprint) -> bool {
    footprint.area_m2 >= LEAST_AREA_M2 && footprint.measured_share >= LEAST_MEASURED_SHARE
}

/// How much a surface can be trusted, 0..1: an order, not a probability. Larger, better covered, and with gravity given
/// and its height known, it is safer.
pub(super) fn confidence(piece: &Piece, verdict: &Verdict, up: Up) -> f64 {
    let footprint = &piece.footprint;
    let size = (0.5 * footprint.free_disc_m / LEAST_DISC_M).clamp(0.3, 1.0);
    let cover = (0.5 + 0.5 * footprint.measured_share / footprint.free_share.max(0.1)).clamp(0.0, 1.0);
    let level = match up.source {
        UpSource::Given => 1.0,
        UpSource::Planes | UpSource::Axis => 0.9,
        UpSource::Picture => 0.5,
    };
    let height = if verdict.height_m.is_some() { 1.0 } else { 0.9 };
    size * cover * level * height
}
