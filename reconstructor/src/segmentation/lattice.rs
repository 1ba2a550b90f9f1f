//! Gaussian filtering of points with many features in linear time: the permutohedral lattice of Adams, Baek & Davis, "Fast
//! High-Dimensional Filtering Using the Permutohedral Lattice" (2010).
//!
//! Each point gives its value to the corners of the simplex it lies in, the corners are blurred along every axis of the lattice, and the
//! point reads its simplex again.

/// The features of points lie within this many standard deviations of 0; what is farther, or no number, is brought back.
const FEATURE_MAX: f32 = 1000.0;
const NONE: u32 = u32::MAX;

/// The lattice around some points of `D` features, in units of the filter's standard deviation.
#[derive(Clone, Debug)]
pub(super) struct Lattice<const D: usize> {
    /// For every point its `D` + 1 corners and their weights, which sum to 1.
    corners: Vec<u32>,
    weights: Vec<f32>,
    /// For every axis and corner the two neighbours along it.
    neighbours: Vec<[u32; 2]>,
    corner_count: usize,
}

impl<const D: usize> Lattice<D> {
    pub(super) fn new(points: &[[f32; D]]) -> Self {
        let mut table = Table::<D>::with_room(points.len().saturating_mul(D + 1) / 2);
        let mut corners = Vec::with_capacity(points.len() * (D + 1));
        let mut weights = Vec::with_capacity(points.len() * (D + 1));
        for point in points {
            let simplex = Simplex::<D>::of(point);
            for remainder in 0..=D {
                corners.push(table.insert(&simplex.key(remainder)));
                weights.push(simplex.weight(remainder));
            }
        }
        let corner_count = table.keys.len();
        let mut neighbours = Vec::with_capacity((D + 1) * corner_count);
        for axis in 0..=D {
            for key in &table.keys {
                // The last coordinate of a key follows from the others, so a step along the last axis changes all that are kept by one.
                let (mut before, mut after) = (*key, *key);
                for (k, (before, after)) in before.iter_mut().zip(&mut after).enumerate() {
                    let step = if k == axis { D as i16 } else { -1 };
                    *before = before.wrapping_add(step);
                    *after = after.wrapping_sub(step);
                }
                neighbours.push([table.find(&before), table.find(&after)]);
            }
        }
        Self { corners, weights, neighbours, corner_count }
    }

    /// Σ over all points of value · exp(−‖difference of features‖² / 2), up to a factor that is the same for all: divide by the
    /// filtered ones. One value per point; more or fewer are taken as 0.
    pub(super) fn filter(&self, values: &[f32]) -> Vec<f32> {
        let corner_of = |k: usize| self.corners.get(k).map_or(0, |c| *c as usize);
        let mut sums = vec![0.0_f32; self.corner_count];
        for (k, weight) in self.weights.iter().enumerate() {
            let value = values.get(k / (D + 1)).copied().unwrap_or(0.0);
            if let Some(sum) = sums.get_mut(corner_of(k)) {
                *sum += weight * value;
            }
        }
        let mut blurred = vec![0.0_f32; self.corner_count];
        for axis in self.neighbours.chunks_exact(self.corner_count.max(1)) {
            let at = |index: u32| sums.get(index as usize).copied().unwrap_or(0.0);
            for ((out, own), [before, after]) in blurred.iter_mut().zip(&sums).zip(axis) {
                *out = 0.5 * own + 0.25 * (at(*before) + at(*after));
            }
            std::mem::swap(&mut sums, &mut blurred);
        }
        self.weights
            .chunks_exact(D + 1)
            .zip(self.corners.chunks_exact(D + 1))
            .map(|(weights, corners)| {
                weights
                    .iter()
                    .zip(corners)
                    .map(|(w, c)| w * sums.get(*c as usize).copied().unwrap_or(0.0))
                    .sum()
            })
            .collect()
    }
}

/// The simplex around a point, by the algorithm of the paper's section 3.
struct Simplex<const D: usize> {
    /// The corner of remainder 0, first `D` coordinates.
    origin: [i16; D],
    /// Rank of each of the first `D` coordinates' residuals.
    rank: [usize; D],
    barycentric: Vec<f32>,
}

impl<const D: usize> Simplex<D> {
    fn of(point: &[f32; D]) -> Self {
        let n = D + 1;
        // Onto the hyperplane of coordinates that sum to 0, scaled so that the lattice's own blur has a standard deviation of 1.
        let scale = (D as f32 + 1.0) * (2.0_f32 / 3.0).sqrt();
        let mut elevated = vec![0.0_f32; n];
        let mut sum = 0.0;
        for i in (1..n).rev() {
            let value = point[i - 1];
            let value = if value.is_nan() { 0.0 } else { value.clamp(-FEATURE_MAX, FEATURE_MAX) };
            let scaled = value * scale / ((i * (i + 1)) as f32).sqrt();
            elevated[i] = sum - i as f32 * scaled;
            sum += scaled;
        }
        elevated[0] = sum;
        let mut corner: Vec<i32> =
            elevated.iter().map(|value| (value / n as f32).round() as i32 * n as i32).collect();
        let residual = |corner: &[i32], i: usize| elevated[i] - corner[i] as f32;
        let mut rank = vec![0_i32; n];
        for i in 0..n {
            for j in i + 1..n {
                if residual(&corner, i) < residual(&corner, j) {
                    rank[i] += 1;
                } else {
                    rank[j] += 1;
                }
            }
        }
        // Rounded coordinates may not sum to 0: the ones with the largest residuals are moved.
        let excess: i32 = corner.iter().sum::<i32>() / n as i32;
        for i in 0..n {
            rank[i] += excess;
            if rank[i] < 0 {
                rank[i] += n as i32;
                corner[i] += n as i32;
            } else if rank[i] > D as i32 {
                rank[i] -= n as i32;
                corner[i] -= n as i32;
            }
        }
        let mut barycentric = vec![0.0_f32; D + 2];
        for (i, rank) in rank.iter().enumerate() {
            let share = residual(&corner, i) / n as f32;
            let place = *rank as usize;
            barycentric[D - place] += share;
            barycentric[D + 1 - place] -= share;
        }
        barycentric[0] += 1.0 + barycentric[D + 1];
        let mut origin = [0; D];
        let mut ranks = [0; D];
        for i in 0..D {
            origin[i] = corner[i] as i16;
            ranks[i] = rank[i] as usize;
        }
        Self { origin, rank: ranks, barycentric }
    }

    fn key(&self, remainder: usize) -> [i16; D] {
        let mut key = self.origin;
        for (coordinate, rank) in key.iter_mut().zip(self.rank) {
            let step =
                if rank > D - remainder { remainder as i16 - (D as i16 + 1) } else { remainder as i16 };
            *coordinate = coordinate.wrapping_add(step);
        }
        key
    }

    fn weight(&self, remainder: usize) -> f32 {
        self.barycentric.get(remainder).copied().unwrap_or(0.0)
    }
}

/// Corners by their keys: open addressing, no deletion.
struct Table<const D: usize> {
    keys: Vec<[i16; D]>,
    slots: Vec<u32>,
}

impl<const D: usize> Table<D> {
    fn with_room(keys: usize) -> Self {
        Self { keys: Vec::new(), slots: vec![NONE; (keys.max(8) * 2).next_power_of_two()] }
    }

    fn hash(key: &[i16; D]) -> usize {
        let mixed = key.iter().fold(0_u64, |hash, k| {
            (hash ^ u64::from(*k as u16)).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23)
        });
        mixed as usize
    }

    /// The slot that holds the key, or the empty one where it belongs.
    fn slot(&self, key: &[i16; D]) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = Self::hash(key) & mask;
        while self.slots[slot] != NONE && self.keys[self.slots[slot] as usize] != *key {
            slot = (slot + 1) & mask;
        }
        slot
    }

    fn find(&self, key: &[i16; D]) -> u32 {
        self.slots[self.slot(key)]
    }

    fn insert(&mut self, key: &[i16; D]) -> u32 {
        let slot = self.slot(key);
        if self.slots[slot] != NONE {
            return self.slots[slot];
        }
        let index = self.keys.len() as u32;
        self.slots[slot] = index;
        self.keys.push(*key);
        if self.keys.len() * 2 > self.slots.len() {
            self.slots = vec![NONE; self.slots.len() * 2];
            for index in 0..self.keys.len() {
                let slot = self.slot(&self.keys[index]);
                self.slots[slot] = index as u32;
            }
        }
        index
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn brute<const D: usize>(points: &[[f32; D]], values: &[f32]) -> Vec<f32> {
        let far = |a: &[f32; D], b: &[f32; D]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        points
            .iter()
            .map(|p| {
                let weights: Vec<f32> = points.iter().map(|q| (-0.5 * far(p, q)).exp()).collect();
                let sum: f32 = weights.iter().zip(values).map(|(w, v)| w * v).sum();
                sum / weights.iter().sum::<f32>()
            })
            .collect()
    }

    fn normalised<const D: usize>(points: &[[f32; D]], values: &[f32]) -> Vec<f32> {
        let lattice = Lattice::new(points);
        let ones = lattice.filter(&vec![1.0; points.len()]);
        lattice.filter(values).iter().zip(ones).map(|(v, one)| v / one).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn near_the_exact_filter(
            points in prop::collection::vec(prop::array::uniform3(0.0..4.0_f32), 150..300),
            split in prop::array::uniform3(-1.0..1.0_f32),
        ) {
            // Values with structure: one side of a plane.
            let side = |p: &[f32; 3]| p.iter().zip(split).map(|(p, s)| (p - 2.0) * s).sum::<f32>();
            let values: Vec<f32> = points.iter().map(|p| f32::from(side(p) > 0.0)).collect();
            let exact = brute(&points, &values);
            let error: f32 =
                normalised(&points, &values).iter().zip(&exact).map(|(a, b)| (a - b).abs()).sum::<f32>() / points.len() as f32;
            prop_assert!(error < 0.04, "{error}");
        }

        #[test]
        fn an_average_stays_between_its_values_and_constants_stay(
            points in prop::collection::vec(prop::array::uniform6(-3.0..3.0_f32), 1..80),
            value in -2.0..2.0_f32,
        ) {
            for filtered in normalised(&points, &vec![value; points.len()]) {
                prop_assert!((filtered - value).abs() < 1e-4);
            }
            let mixed: Vec<f32> = (0..points.len()).map(|i| (i % 2) as f32).collect();
            for filtered in normalised(&points, &mixed) {
                prop_assert!((-1e-4..=1.0001).contains(&filtered));
            }
        }

        #[test]
        fn every_point_gives_all_of_its_value(point in prop::array::uniform6(-50.0..50.0_f32)) {
            let lattice = Lattice::new(&[point]);
            prop_assert!((lattice.weights.iter().sum::<f32>() - 1.0).abs() < 1e-3);
            prop_assert!(lattice.weights.iter().all(|w| *w > -1e-3));
        }
    }

    #[test]
    fn within_a_dense_cloud_the_sum_is_kept() {
        // A grid of points without gaps: what is blurred from the middle stays on the lattice.
        let points: Vec<[f32; 2]> =
            (0..60 * 60).map(|i| [(i % 60) as f32 * 0.25, (i / 60) as f32 * 0.25]).collect();
        let mut values = vec![0.0; points.len()];
        values[30 * 60 + 30] = 1.0;
        let lattice = Lattice::new(&points);
        let filtered = lattice.filter(&values);
        let ones = lattice.filter(&vec![1.0; points.len()])[30 * 60 + 30];
        let sum: f32 = filtered.iter().sum::<f32>() / ones;
        assert!((sum - 1.0).abs() < 0.02, "{sum}");
        // And has the standard deviation of 1 along both axes.
        let spread: f32 = points.iter().zip(&filtered).map(|(p, v)| v * (p[0] - 7.5).powi(2)).sum::<f32>();
        let spread = (spread / filtered.iter().sum::<f32>()).sqrt();
        assert!((spread - 1.0).abs() < 0.15, "{spread}");
    }

    #[test]
    fn nothing_and_what_is_no_number_do_no_harm() {
        assert!(Lattice::<6>::new(&[]).filter(&[]).is_empty());
        let odd = [[f32::NAN; 6], [f32::INFINITY; 6], [0.0; 6]];
        assert!(Lattice::new(&odd).filter(&[1.0; 3]).iter().all(|v| v.is_finite()));
    }
}
