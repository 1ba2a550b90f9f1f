//! A plane from above, in square cells: where the surface was measured, where something stands on it, and where the
//! sensor saw through to what lies behind. From this follow the outline, the obstacles and the room that is left.

use glam::{DVec2, DVec3};

use super::noise::Noise;
use crate::placement::{
    Plane,
    raster::{Frame, Mask, outline, plane_axes},
};

/// What stands on a surface is not higher than this above it, metres; more is a lamp or a shelf.
const TALLEST_M: f64 = 0.5;

/// Twice as many points stand for a thing on the surface, if they lie together.
const LEAST_THING: i32 = 16;

/// One connected piece of a plane.
pub(super) struct Footprint {
    frame: Frame,
    filled: Mask,
    /// Outer corners on the plane, counter-clockwise seen from the side of the normal.
    pub(super) outline_m: Vec<DVec3>,
    /// The same of what stands on it.
    pub(super) obstacles_m: Vec<Vec<DVec3>>,
    /// Area within the outline.
    pub(super) area_m2: f64,
    /// Share of it where nothing stands.
    pub(super) free_share: f64,
    /// Share of it where the surface itself was measured.
    pub(super) measured_share: f64,
    /// Radius of the largest disc within the outline.
    pub(super) disc_m: f64,
    /// Radius of the largest disc that is free of obstacles too.
    pub(super) free_disc_m: f64,
    /// Number of points of the surface.
    pub(super) measured: usize,
    /// Points that were seen below the plane beside the piece, as a share of its own points.
    pub(super) below_share: f64,
}

impl Footprint {
    /// Moves outline and obstacles along the normal to a plane that lies a little differently.
    pub(super) fn lay_on(&mut self, plane: &Plane) {
        for corner in self.outline_m.iter_mut().chain(self.obstacles_m.iter_mut().flatten()) {
            *corner = plane.project(*corner);
        }
    }

    /// Whether a point of the room stands over or under the piece.
    pub(super) fn covers(&self, point: DVec3) -> bool {
        self.frame.cell(self.frame.flat(point)).is_some_and(|cell| self.filled.get(cell))
    }
}

/// How the cells of a plane are filled from points.
pub(super) struct Survey<'a> {
    /// All points that are looked at.
    pub(super) points: &'a [DVec3],
    pub(super) viewpoint: DVec3,
    pub(super) noise: Noise,
    /// Finest cell, metres.
    pub(super) least_cell_m: f64,
    /// Widest gap between points of one surface, metres.
    pub(super) gap_m: f64,
    /// Up, when level surfaces are to be fitted exactly level: see [`super::robust::level`].
    pub(super) level_up: Option<DVec3>,
}

impl Survey<'_> {
    /// How far from a plane a point may lie and still belong to it.
    pub(super) fn reach_m(&self, plane: &Plane, point: DVec3) -> f64 {
        3.0 * self.noise.across_m(plane, point, self.viewpoint) + 0.002
    }

    /// The connected pieces of a plane, largest first, at most `most`.
    pub(super) fn pieces(&self, plane: Plane, most: usize) -> Vec<Footprint> {
        let (along, across) = plane_axes(&plane);
        let on: Vec<DVec2> = self
            .points
            .iter()
            .filter(|point| plane.distance_m(**point).abs() < self.reach_m(&plane, **point))
            .map(|point| DVec2::new(along.dot(*point), across.dot(*point)))
            .collect();
        if on.len() < 12 {
            return Vec::new();
        }
        // First coarse, over everything on the plane, to find the pieces; then fine, around each.
        let bounds = |points: &mut dyn Iterator<Item = DVec2>| {
            points.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
        };
        let (low, high) = bounds(&mut on.iter().copied());
        let coarse = Frame::new(plane, low, high, 2.0 * self.gap_m.max(self.least_cell_m));
        let mut cells = Mask::new(coarse.columns, coarse.rows);
        let mut counts = vec![0_u32; coarse.columns * coarse.rows];
        for cell in on.iter().filter_map(|flat| coarse.cell(*flat)) {
            cells.set(cell, true);
            if let Some(count) = counts.get_mut(cell) {
                *count += 1;
            }
        }
        let mut pieces: Vec<(u32, Mask)> = cells
            .components(2)
            .into_iter()
            .map(|piece| (piece.cells().map(|cell| counts.get(cell).copied().unwrap_or(0)).sum(), piece))
            .collect();
        pieces.sort_by_key(|entry| std::cmp::Reverse(entry.0));
        pieces
            .into_iter()
            .take(most)
            .filter_map(|(_, piece)| {
                let near = piece.dilated(1);
                let mut own =
                    on.iter().copied().filter(|flat| coarse.cell(*flat).is_some_and(|cell| near.get(cell)));
                let (low, high) = bounds(&mut own);
                // Cells on the rim of a piece are half empty: the spacing is that of the fuller ones.
                let mut filling: Vec<u32> =
                    piece.cells().map(|cell| counts.get(cell).copied().unwrap_or(0)).collect();
                filling.sort_unstable();
                let full = filling.get(filling.len() * 3 / 4).copied().unwrap_or(1).max(1);
                let spacing_m = coarse.cell_m / f64::from(full).sqrt();
                let cell_m =
                    (2.5 * spacing_m).clamp(self.least_cell_m, 2.0 * self.gap_m.max(self.least_cell_m));
                self.piece(Frame::new(plane, low, high, cell_m))
            })
            .collect()
    }

    fn piece(&self, frame: Frame) -> Option<Footprint> {
        let new = || Mask::new(frame.columns, frame.rows);
        let (mut on, mut through) = (new(), new());
        // Points on the surface minus twice the points above it: where something stands, the latter are the more.
        let mut balance = vec![0_i32; frame.columns * frame.rows];
        let mut weigh = |cell: usize, weight: i32| {
            if let Some(slot) = balance.get_mut(cell) {
                *slot += weight;
            }
        };
        let (mut measured, mut below) = (0_usize, 0_usize);
        for point in self.points {
            let distance = frame.plane.distance_m(*point);
            let reach_m = self.reach_m(&frame.plane, *point);
            if distance.abs() < reach_m {
                if let Some(cell) = frame.cell(frame.flat(*point)) {
                    on.set(cell, true);
                    weigh(cell, 1);
                    measured += 1;
                }
            } else if distance < 0.0 {
                // The ray to what lies below went through the plane here.
                let ray = *point - self.viewpoint;
                if let Some(hit) = frame.plane.hit(self.viewpoint, ray)
                    && let Some(cell) = frame.cell(frame.flat(self.viewpoint + ray * hit))
                {
                    through.set(cell, true);
                    below += usize::from(distance < -0.1 - reach_m);
                }
            } else if distance < TALLEST_M
                && let Some(cell) = frame.cell(frame.flat(*point))
            {
                weigh(cell, -2);
            }
        }
        let radius = ((self.gap_m / frame.cell_m).ceil() as usize).clamp(1, 7);
        let mut open = on.inverted();
        open.intersect(&through);
        let mut filled = on.closed(radius);
        filled.subtract(&open);
        // Spurs are where the backs of chairs and the sides of boxes pass through the height of the surface.
        let filled = filled.largest_component().with_holes_filled().opened(radius.div_ceil(2).min(2));
        let filled = filled.largest_component();

        let mut measured_cells = on;
        measured_cells.intersect(&filled);
        let mut above = new();
        for (cell, balance) in balance.iter().enumerate() {
            above.set(cell, *balance < -2);
        }
        let mut standing = above.closed(1);
        standing.intersect(&filled);
        // A few points are outliers, not a thing; a candle is many points over one cell.
        let weight = |thing: &Mask| -> i32 {
            thing.cells().map(|cell| balance.get(cell).map_or(0, |balance| (-balance).max(0))).sum()
        };
        let mut things = standing.components(1);
        things.retain(|thing| weight(thing) >= LEAST_THING);
        let mut free = filled.clone();
        for thing in &things {
            free.subtract(thing);
        }
        let lift = |mask: &Mask| -> Vec<DVec3> {
            outline(mask).into_iter().map(|corner| frame.lift(corner)).collect()
        };
        let cells = filled.count().max(1) as f64;
        let outline_m = lift(&filled);
        (outline_m.len() >= 3).then(|| Footprint {
            outline_m,
            obstacles_m: things.iter().map(lift).filter(|corners| corners.len() >= 3).collect(),
            area_m2: cells * frame.cell_m * frame.cell_m,
            free_share: free.count() as f64 / cells,
            measured_share: measured_cells.count() as f64 / cells,
            disc_m: filled.largest_disc() * frame.cell_m,
            free_disc_m: free.largest_disc() * frame.cell_m,
            measured,
            below_share: below as f64 / measured.max(1) as f64,
            frame,
            filled,
        })
    }
}
