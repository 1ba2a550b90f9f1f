//! A plane in square cells: what outlines are drawn into, joined in and read from.

mod contour;
mod mask;

use glam::{DVec2, DVec3};

use super::{Plane, fit::polygon::sides};

pub(super) use contour::outline;
pub(super) use mask::Mask;

/// Cells along the longer side: bounds the work whatever the cloud holds.
const MOST_CELLS: f64 = 320.0;

/// The axes of a plane and its cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) plane: Plane,
    along: DVec3,
    across: DVec3,
    corner: DVec2,
    pub(super) cell_m: f64,
    pub(super) columns: usize,
    pub(super) rows: usize,
}

impl Frame {
    /// Covers what lies between the outermost of some points of the plane.
    pub(super) fn around<'a>(plane: Plane, points: impl Iterator<Item = &'a DVec3>, cell_m: f64) -> Self {
        let (along, across) = plane_axes(&plane);
        let flat = points.map(|point| DVec2::new(along.dot(*point), across.dot(*point)));
        let (low, high) =
            flat.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        if low.x <= high.x {
            Self::new(plane, low, high, cell_m)
        } else {
            Self::new(plane, DVec2::ZERO, DVec2::ZERO, cell_m)
        }
    }

    /// The cells whose middles lie within a polygon, given in the room.
    pub(super) fn filled(&self, polygon: &[DVec3]) -> Mask {
        let flat: Vec<DVec2> =
            polygon.iter().map(|corner| (self.flat(*corner) - self.corner) / self.cell_m).collect();
        let mut mask = Mask::new(self.columns, self.rows);
        let mut crossings = Vec::new();
        for row in 0..self.rows {
            let y = row as f64 + 0.5;
            crossings.clear();
            for (from, to) in sides(&flat) {
                if (from.y > y) != (to.y > y) {
                    crossings.push(from.x + (y - from.y) / (to.y - from.y) * (to.x - from.x));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.as_chunks::<2>().0 {
                let first = (pair[0] - 0.5).ceil().max(0.0) as usize;
                let last = (pair[1] - 0.5).ceil().clamp(0.0, self.columns as f64) as usize;
                (first..last).for_each(|column| mask.set(row * self.columns + column, true));
            }
        }
        mask
    }

    /// Coordinates on the plane, metres.
    pub(super) fn flat(&self, point: DVec3) -> DVec2 {
        DVec2::new(self.along.dot(point), self.across.dot(point))
    }

    pub(super) fn cell(&self, flat: DVec2) -> Option<usize> {
        let place = (flat - self.corner) / self.cell_m;
        let inside =
            place.x >= 0.0 && place.y >= 0.0 && place.x < self.columns as f64 && place.y < self.rows as f64;
        inside.then(|| place.y as usize * self.columns + place.x as usize)
    }

    /// The cell under a point of the room.
    pub(super) fn cell_of(&self, point: DVec3) -> Option<usize> {
        self.cell(self.flat(point))
    }

    /// The middle of a cell, on the plane.
    pub(super) fn middle_of(&self, cell: usize) -> DVec3 {
        let (column, row) = (cell % self.columns.max(1), cell / self.columns.max(1));
        self.lift(DVec2::new(column as f64 + 0.5, row as f64 + 0.5))
    }

    /// A point of the plane from coordinates in cells.
    pub(super) fn lift(&self, place: DVec2) -> DVec3 {
        let flat = self.corner + place * self.cell_m;
        self.along * flat.x + self.across * flat.y - self.plane.normal * self.plane.offset_m
    }

    /// Covers `low..high` with cells and a rim around them.
    pub(super) fn new(plane: Plane, low: DVec2, high: DVec2, cell_m: f64) -> Self {
        let (along, across) = plane_axes(&plane);
        let cell_m = cell_m.max((high - low).max_element() / MOST_CELLS);
        let rim = 8.0 * cell_m;
        let size = (high - low + DVec2::splat(2.0 * rim)) / cell_m;
        let (columns, rows) = (size.x.ceil().max(1.0) as usize, size.y.ceil().max(1.0) as usize);
        Self { plane, along, across, corner: low - rim, cell_m, columns, rows }
    }
}

/// Two unit vectors on the plane, right-handed with its normal.
pub(super) fn plane_axes(plane: &Plane) -> (DVec3, DVec3) {
    let along = plane.normal.any_orthonormal_vector();
    (along, plane.normal.cross(along))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_comes_back_from_its_cells() {
        let plane = Plane::through(DVec3::new(0.0, 0.7, 0.0), DVec3::Y);
        let (along, across) = plane_axes(&plane);
        let corners: Vec<DVec3> = [(0.0, 0.0), (1.2, 0.0), (1.2, 0.6), (0.0, 0.6)]
            .map(|(u, v)| along * u + across * v + DVec3::Y * 0.7)
            .to_vec();
        let frame = Frame::around(plane, corners.iter(), 0.01);
        let filled = frame.filled(&corners);
        assert_eq!(filled.count(), 120 * 60);
        let back: Vec<DVec3> = outline(&filled).into_iter().map(|corner| frame.lift(corner)).collect();
        assert_eq!(back.len(), 4);
        for corner in corners {
            assert!(back.iter().any(|other| other.distance(corner) < 0.011), "{corner} {back:?}");
        }
    }
}
