//! How the points of a mesh move: the share that each point takes of each wave, predicted from the points beside it.

use super::entropy::{Reader, Recorder};
use crate::{chunk::ChunkError, mesh::Mesh};

/// Contexts: five groups of waves, three kinds of neighbourhood.
const KINDS: u8 = 3;
const GROUPS: u8 = 5;
pub(super) const CONTEXTS: u8 = KINDS * GROUPS;
/// Shares beyond this many steps are no motion of a person.
const LARGEST: i32 = 1 << 20;

/// The points of a mesh, those at one place taken as one, in the order of their first vertex; and for each the neighbours that come before it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Points {
    /// The point of each vertex.
    pub(super) of_vertex: Vec<u32>,
    /// The first vertex of each point.
    pub(super) first_vertex: Vec<u32>,
    /// Earlier neighbours of all points, one after the other, and where each point's end.
    earlier: Vec<u32>,
    ends: Vec<u32>,
}

impl Points {
    /// The points of a mesh whose triangles name vertices that it has.
    pub(super) fn of(mesh: &Mesh) -> Self {
        let (of_vertex, first_vertex) = mesh.points();
        let mut points = Self { of_vertex, first_vertex, ..Self::default() };
        let mut edges: Vec<(u32, u32)> = Vec::with_capacity(mesh.triangles.len() * 3);
        for corners in &mesh.triangles {
            let [a, b, c] = corners.map(|vertex| points.of_vertex.get(vertex as usize).copied().unwrap_or(0));
            let later_first = |x: u32, y: u32| (x.max(y), x.min(y));
            edges.extend(
                [(a, b), (b, c), (c, a)].map(|(x, y)| later_first(x, y)).iter().filter(|(x, y)| x != y),
            );
        }
        edges.sort_unstable();
        edges.dedup();
        let mut edges = edges.into_iter().peekable();
        for point in 0..points.first_vertex.len() as u32 {
            while let Some((_, before)) = edges.next_if(|(later, _)| *later == point) {
                points.earlier.push(before);
            }
            points.ends.push(points.earlier.len() as u32);
        }
        points
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.first_vertex.len()
    }

    fn earlier(&self, point: usize) -> &[u32] {
        let end = |point: usize| self.ends.get(point).map_or(0, |end| *end as usize);
        let start = point.checked_sub(1).map_or(0, end);
        self.earlier.get(start..end(point)).unwrap_or(&[])
    }

    /// What the neighbours of a point say of it on each axis, and how much they agree: the context.
    fn predict(&self, shares: &[[i32; 3]], point: usize, wave: usize) -> ([i32; 3], u8) {
        let neighbours = self.earlier(point);
        let group = match wave {
            0 => 0,
            1 => 1,
            2..=3 => 2,
            4..=7 => 3,
            _ => GROUPS - 1,
        };
        let count = neighbours.len() as i32;
        if count == 0 {
            return ([0; 3], group * KINDS + KINDS - 1);
        }
        let (mut sum, mut low, mut high) = ([0i32; 3], [i32::MAX; 3], [i32::MIN; 3]);
        for &neighbour in neighbours {
            let share = shares.get(neighbour as usize).copied().unwrap_or_default();
            for axis in 0..3 {
                sum[axis] += share[axis];
                low[axis] = low[axis].min(share[axis]);
                high[axis] = high[axis].max(share[axis]);
            }
        }
        let spread = (0..3).map(|axis| high[axis] - low[axis]).max().unwrap_or(0);
        let kind = match spread {
            0 => 0,
            1..=2 => 1,
            _ => KINDS - 1,
        };
        (sum.map(|sum| (2 * sum + count).div_euclid(2 * count)), group * KINDS + kind)
    }
}

/// Writes the shares of a wave, one triple per point, in steps.
pub(super) fn write(recorder: &mut Recorder, points: &Points, wave: usize, shares: &[[i32; 3]]) {
    for (point, share) in shares.iter().enumerate() {
        let (predicted, context) = points.predict(shares, point, wave);
        for axis in 0..3 {
            recorder.push_signed(context, share[axis] - predicted[axis]);
        }
    }
}

/// Reads what [`write`] wrote.
///
/// # Errors
/// When the data ends a number in its middle, or a share is no motion of a person.
pub(super) fn read(
    reader: &mut Reader<'_>,
    points: &Points,
    wave: usize,
) -> Result<Vec<[i32; 3]>, ChunkError> {
    let mut shares: Vec<[i32; 3]> = Vec::with_capacity(points.count());
    for point in 0..points.count() {
        let (predicted, context) = points.predict(&shares, point, wave);
        let mut share = [0; 3];
        for axis in 0..3 {
            share[axis] = predicted[axis].saturating_add(reader.signed(context)?);
            if share[axis].abs() > LARGEST {
                return Err(ChunkError::Corrupt { what: "motion" });
            }
        }
        shares.push(share);
    }
    Ok(shares)
}
