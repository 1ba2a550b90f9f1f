//! Finding surfaces in what a depth sensor measured: planes by growing or sampling, refined robustly, with outlines,
//! obstacles, kinds, and a reason for each level surface that is not a place to stand on.
//!
//! The order of one [`Finder::find`]: candidate planes (`blocks` for organised clouds, `scattered` for others), each
//! refined on all points near it (`robust`), cut into connected pieces with outlines (`footprint`),
//! refined again on the points of the piece, held against gravity (`gravity`), the picture (`edges`) and each other
//! (`classify`). No clock, thread or generator state: the same cloud gives the same answer.

mod blocks;
mod classify;
mod edges;
mod footprint;
mod gravity;
mod moments;
mod neighbours;
mod noise;
mod robust;
mod scattered;
mod several;

use glam::DVec3;
use serde::Serialize;

use super::{PointCloud, Surface, SurfaceId, SurfaceKind};
use blocks::BlockGrid;
use classify::Piece;
use edges::EdgeView;
use footprint::Survey;
use moments::Fit;

pub use classify::Refusal;
pub use gravity::{Up, UpSource};
pub use noise::Noise;

/// Most points that single points are looked at with; sums over blocks use all of them.
const MOST_POINTS: usize = 40_000;

/// Pieces of one plane that are kept.
const PIECES_OF_A_PLANE: usize = 3;

/// How far above the highest point an eye is put where the scan does not tell, metres.
const OVERHEAD_M: f64 = 1.0;

/// Two fits of nearly the same plane are one: cosine of 4 degrees.
const SAME_PLANE: f64 = 0.9976;

/// Finds surfaces in clouds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Finder {
    /// Noise of the sensor. `None`: triangulated for organised clouds, with a factor that the cloud itself shows; even
    /// with 8 mm for others.
    pub noise: Option<Noise>,
}

/// A surface with what was measured on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundSurface {
    /// The surface.
    #[serde(flatten)]
    pub surface: Surface,
    /// Height over the floor, when a floor was found.
    pub height_m: Option<f64>,
    /// Angle between its normal and up.
    pub tilt_degrees: f64,
    /// Area within the outline.
    pub area_m2: f64,
    /// Share of the area where nothing stands.
    pub free_share: f64,
    /// Root mean square distance of its points, weighted by the robust fit.
    pub rms_m: f64,
    /// Why it is no place to stand on, for surfaces that are level or nearly so.
    pub refusal: Option<Refusal>,
}

/// What was found in one cloud.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The direction against gravity that was used.
    pub up: Up,
    /// All surfaces, with ids that count from 0.
    pub surfaces: Vec<FoundSurface>,
    best: Option<usize>,
}

impl Finding {
    /// The best place to stand on: a table, or else a seat; `None` when there is neither.
    #[must_use]
    pub fn table(&self) -> Option<&FoundSurface> {
        self.best.and_then(|index| self.surfaces.get(index))
    }

    /// Picks the best of surfaces by kind, free area and confidence.
    #[must_use]
    pub fn new(up: Up, surfaces: Vec<FoundSurface>) -> Self {
        let worth = |found: &FoundSurface| found.area_m2 * found.free_share * found.surface.confidence;
        let best = [SurfaceKind::Table, SurfaceKind::Seat].into_iter().find_map(|kind| {
            surfaces
                .iter()
                .enumerate()
                .filter(|(_, found)| found.surface.kind == kind && found.refusal.is_none())
                .max_by(|a, b| worth(a.1).total_cmp(&worth(b.1)))
                .map(|(index, _)| index)
        });
        Self { up, surfaces, best }
    }
}

impl Finder {
    /// Finds the surfaces of a cloud.
    #[must_use]
    pub fn find(&self, cloud: &PointCloud) -> Finding {
        let given = cloud.up().map(|direction| Up { direction, source: UpSource::Given });
        let finding = self.find_with(cloud, given);
        let is_estimated = finding.up.source == UpSource::Planes && cloud.layout().is_none();
        match gravity::near_axis(finding.up.direction).filter(|_| is_estimated) {
            Some(direction) => self.find_with(cloud, Some(Up { direction, source: UpSource::Axis })),
            None => finding,
        }
    }

    fn find_with(&self, cloud: &PointCloud, known_up: Option<Up>) -> Finding {
        let measured =
            || cloud.points_m().iter().filter(|point| point.is_finite()).map(|point| point.as_dvec3());
        let grid = BlockGrid::new(cloud, self.noise);
        let noise = self.noise.or(grid.as_ref().map(|grid| grid.noise)).unwrap_or(Noise::Even(0.008));
        let points = match cloud.layout() {
            Some((columns, rows)) => every_nth(cloud, columns, rows),
            None => neighbours::thinned(measured(), thinning_m(measured().count())),
        };
        let is_dense = grid.is_some();
        let viewpoint = match known_up.filter(|_| !is_dense) {
            Some(up) => eye_above(&points, cloud.viewpoint_m(), up.direction),
            None => cloud.viewpoint_m(),
        };
        let survey = Survey {
            points: &points,
            viewpoint,
            noise,
            least_cell_m: if is_dense { 0.01 } else { 0.02 },
            gap_m: if is_dense { 0.05 } else { 0.08 },
            level_up: known_up.map(|up| up.direction).filter(|_| !is_dense),
        };
        let planes = match &grid {
            Some(grid) => distinct(&survey, grid.planes(viewpoint)),
            None => scattered::planes(&survey, survey.level_up),
        };
        let pieces = pieces(&survey, &planes, grid.as_ref());

        let view: DVec3 = points.iter().map(|point| (*point - viewpoint).normalize_or_zero()).sum();
        let view = view.try_normalize().unwrap_or(DVec3::Z);
        let up = known_up.unwrap_or_else(|| {
            let vertical = grid.as_ref().and_then(|grid| grid.picture_up);
            let votes: Vec<gravity::Vote> = pieces
                .iter()
                .map(|piece| (piece.fit.plane.normal, piece.footprint.measured as f64))
                .collect();
            gravity::estimate(vertical.unwrap_or_else(|| gravity::conventional_vertical(view)), view, &votes)
        });
        let verdicts = classify::classify(&pieces, up, viewpoint);
        let surfaces = pieces.into_iter().zip(verdicts).zip(0..).map(|((piece, verdict), id)| {
            let confidence = classify::confidence(&piece, &verdict, up);
            let Piece { fit, footprint, .. } = piece;
            FoundSurface {
                surface: Surface {
                    id: SurfaceId(id),
                    kind: verdict.kind,
                    plane: fit.plane,
                    outline_m: footprint.outline_m,
                    obstacles_m: footprint.obstacles_m,
                    confidence,
                },
                height_m: verdict.height_m,
                tilt_degrees: verdict.tilt_degrees,
                area_m2: footprint.area_m2,
                free_share: footprint.free_share,
                rms_m: fit.rms_m,
                refusal: verdict.refusal,
            }
        });
        Finding::new(up, surfaces.collect())
    }
}

/// Every n-th point of every n-th row, so that about [`MOST_POINTS`] are left.
fn every_nth(cloud: &PointCloud, columns: usize, rows: usize) -> Vec<DVec3> {
    let step = ((columns * rows) as f64 / MOST_POINTS as f64).sqrt().ceil().max(1.0) as usize;
    let rows = cloud.points_m().chunks_exact(columns).step_by(step);
    rows.flat_map(|row| row.iter().step_by(step))
        .filter(|point| point.is_finite())
        .map(|point| point.as_dvec3())
        .collect()
}

/// Where points without order are taken to be seen from: the given place if it is above most of them, or else one high
/// above their middle. The origin of a scan of a room is often on its floor, where nobody looked from.
fn eye_above(points: &[DVec3], given: DVec3, up: DVec3) -> DVec3 {
    let mut heights: Vec<f64> = points.iter().map(|point| up.dot(*point)).collect();
    if heights.is_empty() {
        return given;
    }
    let place = heights.len() * 4 / 5;
    let (_, high, _) = heights.select_nth_unstable_by(place, f64::total_cmp);
    if up.dot(given) > *high {
        return given;
    }
    let highest = heights.iter().copied().fold(f64::MIN, f64::max);
    let middle = points.iter().sum::<DVec3>() / points.len() as f64;
    middle.reject_from_normalized(up) + up * (highest + OVERHEAD_M)
}

/// Side of the cubes that a cloud without order is thinned to: small clouds keep every point, scans of a room one each 2 cm.
fn thinning_m(count: usize) -> f64 {
    if count <= MOST_POINTS / 2 { 0.002 } else { 0.02 }
}

/// Refines the planes of regions and drops those that came out the same.
fn distinct(survey: &Survey<'_>, regions: Vec<Fit>) -> Vec<Fit> {
    let mut planes: Vec<Fit> = Vec::new();
    let is_known = |planes: &[Fit], fit: &Fit| {
        planes.iter().any(|known| {
            known.plane.normal.dot(fit.plane.normal) > SAME_PLANE
                && known.plane.distance_m(fit.centroid).abs() < survey.reach_m(&known.plane, fit.centroid)
        })
    };
    for region in regions {
        if is_known(&planes, &region) {
            continue;
        }
        let widest_m = 2.0 * survey.reach_m(&region.plane, region.centroid);
        if let Some((fit, _)) =
            robust::refine(survey.points, region.plane, survey.noise, survey.viewpoint, widest_m)
            && !is_known(&planes, &fit)
        {
            planes.push(fit);
        }
    }
    planes
}

/// Cuts planes into connected pieces, each refined on its own points and followed along its edges in the picture. A point
/// belongs to one piece only: a plane whose points mostly belong to larger ones is a slice through other things.
fn pieces(survey: &Survey<'_>, planes: &[Fit], grid: Option<&BlockGrid>) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut claimed = vec![false; survey.points.len()];
    for fit in planes {
        for mut footprint in survey.pieces(fit.plane, PIECES_OF_A_PLANE) {
            if !classify::is_notable(&footprint) {
                continue;
            }
            let near = |point: &DVec3| fit.plane.distance_m(*point).abs() < 0.1 && footprint.covers(*point);
            let own: Vec<DVec3> = survey.points.iter().copied().filter(near).collect();
            let widest_m = 1.5 * survey.reach_m(&fit.plane, fit.centroid);
            let refined = robust::refine(&own, fit.plane, survey.noise, survey.viewpoint, widest_m);
            let refined = refined.map_or(*fit, |(fit, _)| fit);
            let plane = refined.plane;
            let on = |point: &DVec3| {
                plane.distance_m(*point).abs() < survey.reach_m(&plane, *point) && footprint.covers(*point)
            };
            let (mut members, mut fresh) = (Vec::new(), 0);
            for (index, (point, claimed)) in survey.points.iter().zip(&claimed).enumerate() {
                if on(point) {
                    members.push(index);
                    fresh += usize::from(!claimed);
                }
            }
            if 2 * fresh < members.len() {
                continue;
            }
            for index in members {
                if let Some(slot) = claimed.get_mut(index) {
                    *slot = true;
                }
            }
            let tilt = survey.level_up.map(|up| plane.normal.angle_between(up).to_degrees());
            let mut fit = refined;
            if let (Some(up), Some(true)) = (survey.level_up, tilt.map(classify::is_level)) {
                fit = robust::level(&own, fit, up, survey.noise.along_view_m(1.0));
            }
            footprint.lay_on(&fit.plane);
            let mut piece = Piece { fit, footprint, edges: None, measured_normal: plane.normal };
            piece.edges = grid.and_then(|grid| EdgeView::new(grid, &piece, survey));
            pieces.push(piece);
        }
    }
    pieces
}

#[cfg(test)]
mod tests;
