//! The surfaces of a room over time: the same table keeps its name from one look to the next, pieces of one surface grow
//! together, and what is gone is forgotten.

use std::{collections::BTreeMap, time::Duration};

use glam::DVec3;

use super::{
    Plane, Surface, SurfaceId,
    raster::{Frame, outline},
};

/// Two looks at one plane differ by less than this angle (cosine of 6 degrees) …
const SAME_NORMAL: f64 = 0.9945;

/// … and by less than this distance where they overlap, metres.
const SAME_HEIGHT_M: f64 = 0.025;

/// Looks that count in the mean of a plane, as many times its area: older ones fade, so that a table that is pushed is
/// followed.
const MOST_LOOKS: f64 = 20.0;

/// Cells of joined outlines, metres.
const CELL_M: f64 = 0.01;

/// Gaps up to twice as many cells between two pieces of one surface are bridged.
const BRIDGED_CELLS: usize = 3;

/// A surface that was not seen where it should be is kept for so many looks …
const LEAST_MISSED: u32 = 3;

/// … and for so long.
const KEPT: Duration = Duration::from_millis(1500);

/// What an update did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Seen for the first time.
    Added(SurfaceId),
    /// Seen again: its plane or outline may differ.
    Updated(SurfaceId),
    /// Turned out to be a part of another, whose name stays: what stood on the first stands on the second.
    Merged {
        /// The name that is gone.
        from: SurfaceId,
        /// The name that stays: the older one.
        into: SurfaceId,
    },
    /// Not seen any more where it should be.
    Lost(SurfaceId),
}

#[derive(Clone, Debug)]
struct Known {
    surface: Surface,
    /// Areas of the looks that are in the plane's mean, in cells: a book's cover does not lift the table.
    weight: f64,
    last_seen: Duration,
    missed: u32,
}

/// The surfaces that are known.
#[derive(Clone, Debug, Default)]
pub struct SurfaceMap {
    known: BTreeMap<SurfaceId, Known>,
    next: u32,
}

impl SurfaceMap {
    /// All surfaces, in the order in which they became known.
    pub fn surfaces(&self) -> impl Iterator<Item = &Surface> {
        self.known.values().map(|known| &known.surface)
    }

    /// A surface by its name.
    #[must_use]
    pub fn get(&self, id: SurfaceId) -> Option<&Surface> {
        self.known.get(&id).map(|known| &known.surface)
    }

    /// The known surface that a surface of the room frame is a part of: the one with which it shares most.
    #[must_use]
    pub fn matching(&self, surface: &Surface) -> Option<SurfaceId> {
        self.known
            .iter()
            .filter_map(|(id, known)| shared_cells(&known.surface, surface).map(|cells| (cells, *id)))
            .max_by(|a, b| a.0.cmp(&b.0).then(b.1.cmp(&a.1)))
            .map(|(_, id)| id)
    }

    /// Takes in what one look at `now` showed, in the room frame; the ids of `seen` do not matter. `in_view` says whether a
    /// known surface should have been seen: only then does its absence count.
    pub fn update(
        &mut self,
        seen: &[Surface],
        now: Duration,
        in_view: impl Fn(&Surface) -> bool,
    ) -> Vec<Change> {
        let mut changes = Vec::new();
        let mut updated: Vec<SurfaceId> = Vec::new();
        for surface in seen.iter().filter(|surface| surface.outline_m.len() >= 3) {
            let best = self.matching(surface);
            if let Some(id) = best
                && let Some(known) = self.known.get_mut(&id)
            {
                known.take_in(surface, cells(&surface.plane, &surface.outline_m), now);
                if !updated.contains(&id) {
                    updated.push(id);
                }
            } else {
                let id = SurfaceId(self.next);
                self.next += 1;
                let surface = Surface { id, ..surface.clone() };
                let weight = cells(&surface.plane, &surface.outline_m);
                self.known.insert(id, Known { surface, weight, last_seen: now, missed: 0 });
                changes.push(Change::Added(id));
            }
        }
        changes.extend(updated.into_iter().map(Change::Updated));
        self.merge(&mut changes);
        self.forget(now, in_view, &mut changes);
        changes
    }

    /// Joins known surfaces that have grown into each other.
    fn merge(&mut self, changes: &mut Vec<Change>) {
        while let Some((into, from)) = self.overlapping() {
            let Some(gone) = self.known.remove(&from) else { break };
            if let Some(known) = self.known.get_mut(&into) {
                known.take_in(&gone.surface, gone.weight, gone.last_seen);
            }
            changes.retain(|change| !matches!(change, Change::Updated(id) if *id == from));
            if changes.contains(&Change::Added(from)) {
                changes.retain(|change| *change != Change::Added(from));
            } else {
                changes.push(Change::Merged { from, into });
            }
        }
    }

    fn overlapping(&self) -> Option<(SurfaceId, SurfaceId)> {
        let mut rest = self.known.iter();
        while let Some((id, known)) = rest.next() {
            let other =
                rest.clone().find(|(_, other)| shared_cells(&known.surface, &other.surface).is_some());
            if let Some((other, _)) = other {
                return Some((*id, *other));
            }
        }
        None
    }

    fn forget(&mut self, now: Duration, in_view: impl Fn(&Surface) -> bool, changes: &mut Vec<Change>) {
        self.known.retain(|id, known| {
            if known.last_seen < now && in_view(&known.surface) {
                known.missed += 1;
            }
            let is_kept = known.missed < LEAST_MISSED || now.saturating_sub(known.last_seen) < KEPT;
            if !is_kept {
                changes.push(Change::Lost(*id));
            }
            is_kept
        });
    }
}

impl Known {
    fn take_in(&mut self, seen: &Surface, weight: f64, now: Duration) {
        let own = &mut self.surface;
        let share = weight / (self.weight + weight);
        // The mean of the two planes, in the middle of what is seen now, where the new one is best known.
        let middle = mean(&seen.outline_m);
        let normal =
            own.plane.normal.lerp(seen.plane.normal, share).try_normalize().unwrap_or(own.plane.normal);
        let point = own.plane.project(middle).lerp(seen.plane.project(middle), share);
        own.plane = Plane::through(point, normal);
        let corners = own.outline_m.iter().chain(&seen.outline_m);
        let frame = Frame::around(own.plane, corners, CELL_M);
        let now_seen = frame.filled(&seen.outline_m);
        let mut joined = frame.filled(&own.outline_m);
        joined.join(&now_seen);
        let joined = joined.closed(BRIDGED_CELLS).largest_component().with_holes_filled();
        let corners: Vec<DVec3> = outline(&joined).into_iter().map(|corner| frame.lift(corner)).collect();
        if corners.len() >= 3 {
            own.outline_m = corners;
        }
        // What stood where one looks now has been seen again or is gone.
        own.obstacles_m
            .retain(|corners| !frame.cell_of(mean(corners)).is_some_and(|cell| now_seen.get(cell)));
        own.obstacles_m.extend(seen.obstacles_m.iter().cloned());
        for corner in own.obstacles_m.iter_mut().flatten() {
            *corner = own.plane.project(*corner);
        }
        if seen.confidence >= own.confidence {
            own.kind = seen.kind;
        }
        own.confidence = own.confidence.max(seen.confidence);
        self.weight = (self.weight + weight).min(MOST_LOOKS * joined.count() as f64);
        self.last_seen = self.last_seen.max(now);
        self.missed = 0;
    }
}

fn mean(corners: &[DVec3]) -> DVec3 {
    corners.iter().sum::<DVec3>() / corners.len().max(1) as f64
}

/// Area of a polygon in cells, at least one.
fn cells(plane: &Plane, corners: &[DVec3]) -> f64 {
    Frame::around(*plane, corners.iter(), CELL_M).filled(corners).count().max(1) as f64
}

/// Cells that two surfaces share; `None` when they are not parts of one.
fn shared_cells(one: &Surface, other: &Surface) -> Option<usize> {
    if one.plane.normal.dot(other.plane.normal) < SAME_NORMAL {
        return None;
    }
    let frame = Frame::around(one.plane, one.outline_m.iter(), 2.0 * CELL_M);
    let mut both = frame.filled(&one.outline_m);
    both.intersect(&frame.filled(&other.outline_m));
    let first = both.cells().next()?;
    let apart_m = other.plane.distance_m(frame.middle_of(first)).abs();
    (apart_m < SAME_HEIGHT_M).then(|| both.count())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::SurfaceKind;

    fn table(left: f64, right: f64, height: f64) -> Surface {
        let corner = |x: f64, z: f64| DVec3::new(x, height, z);
        Surface {
            id: SurfaceId(99),
            kind: SurfaceKind::Table,
            plane: Plane::through(DVec3::Y * height, DVec3::Y),
            outline_m: vec![corner(left, 0.3), corner(right, 0.3), corner(right, -0.3), corner(left, -0.3)],
            obstacles_m: Vec::new(),
            confidence: 0.8,
        }
    }

    fn width(surface: &Surface) -> f64 {
        let xs = || surface.outline_m.iter().map(|corner| corner.x);
        xs().fold(f64::MIN, f64::max) - xs().fold(f64::MAX, f64::min)
    }

    const ALWAYS: fn(&Surface) -> bool = |_| true;

    #[test]
    fn a_table_keeps_its_name_and_grows() {
        let mut map = SurfaceMap::default();
        let id = SurfaceId(0);
        assert_eq!(map.update(&[table(0.0, 0.6, 0.7)], Duration::ZERO, ALWAYS), [Change::Added(id)]);
        let seen = [table(0.4, 1.2, 0.706), table(0.0, 0.5, 1.1)];
        let changes = map.update(&seen, Duration::from_millis(100), ALWAYS);
        assert_eq!(changes, [Change::Added(SurfaceId(1)), Change::Updated(id)]);
        let known = map.get(id).unwrap();
        assert!((width(known) - 1.2).abs() < 0.03, "{known:?}");
        // 0.6 m of it were seen at 0.7 m, then 0.8 m at 0.706 m.
        assert!((known.plane.offset_m + 0.7034).abs() < 1e-4, "{known:?}");
        assert!(known.outline_m.iter().all(|corner| known.plane.distance_m(*corner).abs() < 1e-9));
    }

    #[test]
    fn two_pieces_become_one_and_the_older_name_stays() {
        let mut map = SurfaceMap::default();
        map.update(&[table(0.0, 0.4, 0.7), table(0.8, 1.2, 0.7)], Duration::ZERO, ALWAYS);
        assert_eq!(map.surfaces().count(), 2);
        let changes = map.update(&[table(0.3, 0.9, 0.7)], Duration::from_millis(50), ALWAYS);
        let (from, into) = (SurfaceId(1), SurfaceId(0));
        assert!(changes.contains(&Change::Merged { from, into }), "{changes:?}");
        assert_eq!(map.surfaces().count(), 1);
        assert!((width(map.get(into).unwrap()) - 1.2).abs() < 0.03);
    }

    #[test]
    fn only_what_should_be_seen_is_lost() {
        let mut map = SurfaceMap::default();
        map.update(&[table(0.0, 0.6, 0.7)], Duration::ZERO, ALWAYS);
        for step in 1..40 {
            assert!(map.update(&[], Duration::from_millis(100 * step), |_| false).is_empty());
        }
        let lost: Vec<Change> =
            (40..80).flat_map(|step| map.update(&[], Duration::from_millis(100 * step), ALWAYS)).collect();
        assert_eq!(lost, [Change::Lost(SurfaceId(0))]);
        let again = map.update(&[table(0.0, 0.6, 0.7)], Duration::from_secs(9), ALWAYS);
        assert_eq!(again, [Change::Added(SurfaceId(1))], "a name is never given twice");
    }

    #[test]
    fn what_stood_there_is_forgotten_when_one_looks_again() {
        let mut map = SurfaceMap::default();
        let mut cluttered = table(0.0, 1.0, 0.7);
        cluttered.obstacles_m = vec![table(0.2, 0.3, 0.7).outline_m];
        map.update(&[cluttered], Duration::ZERO, ALWAYS);
        map.update(&[table(0.6, 1.0, 0.7)], Duration::from_millis(100), ALWAYS);
        assert_eq!(map.get(SurfaceId(0)).unwrap().obstacles_m.len(), 1);
        map.update(&[table(0.0, 1.0, 0.7)], Duration::from_millis(200), ALWAYS);
        assert!(map.get(SurfaceId(0)).unwrap().obstacles_m.is_empty());
    }
}
