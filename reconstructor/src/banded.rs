//! Symmetric positive definite matrices that are zero away from the diagonal, solved by Cholesky's factorisation: paths over time
//! ([`trajectory`](crate::trajectory)) and grids of cells ([`segmentation`](crate::segmentation)). The work grows with the length and the
//! square of the band's width.

/// A symmetric matrix that is zero beyond `width` rows below the diagonal.
#[derive(Clone, Debug)]
pub(crate) struct Banded {
    width: usize,
    /// Row after row from `width` left of the diagonal up to it; what lies left of the first column is 0 and not used.
    rows: Vec<f64>,
}

impl Banded {
    /// A diagonal matrix with room for `width` entries beside the diagonal.
    pub(crate) fn diagonal(diagonal: &[f64], width: usize) -> Self {
        let mut rows = vec![0.0; diagonal.len() * (width + 1)];
        for (row, value) in rows.chunks_exact_mut(width + 1).zip(diagonal) {
            row[width] = *value;
        }
        Self { width, rows }
    }

    fn size(&self) -> usize {
        self.rows.len() / (self.width + 1)
    }

    /// Adds `weight · v vᵀ`, where `v` has these values at these places and is zero elsewhere. Places inside the matrix, no two
    /// farther apart than the band is wide.
    pub(crate) fn add_outer(&mut self, v: &[(usize, f64)], weight: f64) {
        for &(row, a) in v {
            for &(column, b) in v.iter().filter(|(column, _)| *column <= row) {
                self.rows[row * (self.width + 1) + column + self.width - row] += weight * a * b;
            }
        }
    }

    /// The factor L of L·Lᵀ, or `None` when the matrix is not positive definite to working precision.
    pub(crate) fn cholesky(mut self) -> Option<Factor> {
        let (width, stride) = (self.width, self.width + 1);
        for row in 0..self.size() {
            let (done, rest) = self.rows.split_at_mut(row * stride);
            let own = &mut rest[..stride];
            for offset in width.saturating_sub(row)..width {
                // The entry at column `row + offset − width`, whose own row ends with its diagonal.
                let column = row + offset - width;
                let other = &done[column * stride..(column + 1) * stride];
                let shared: f64 =
                    own[..offset].iter().zip(&other[width - offset..]).map(|(a, b)| a * b).sum();
                own[offset] = (own[offset] - shared) / other[width];
            }
            let squares: f64 = own[..width].iter().map(|value| value * value).sum();
            let pivot = (own[width] - squares).sqrt();
            if !(pivot.is_finite() && pivot > 1e-9) {
                return None;
            }
            own[width] = pivot;
        }
        Some(Factor { lower: self })
    }
}

/// A lower triangular factor.
#[derive(Clone, Debug)]
pub(crate) struct Factor {
    lower: Banded,
}

impl Factor {
    /// Solves `L·Lᵀ x = right` in place.
    pub(crate) fn solve(&self, right: &mut [f64]) {
        let (width, stride) = (self.lower.width, self.lower.width + 1);
        let size = self.lower.size().min(right.len());
        let row_of = |row: usize| &self.lower.rows[row * stride..(row + 1) * stride];
        for row in 0..size {
            let (own, first) = (row_of(row), row.saturating_sub(width));
            let known = own[width - (row - first)..width].iter().zip(&right[first..row]);
            let sum: f64 = known.map(|(a, x)| a * x).sum();
            right[row] = (right[row] - sum) / own[width];
        }
        for row in (0..size).rev() {
            let (own, first) = (row_of(row), row.saturating_sub(width));
            right[row] /= own[width];
            let value = right[row];
            for (a, x) in own[width - (row - first)..width].iter().zip(&mut right[first..row]) {
                *x -= a * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_solution_is_that_of_the_dense_system(
            diagonal in prop::collection::vec(0.05..4.0_f64, 1..30),
            width in 0usize..7,
            links in prop::collection::vec((0usize..30, 0usize..7, -2.0..2.0_f64, 0.0..3.0_f64), 0..60),
        ) {
            let size = diagonal.len();
            let mut banded = Banded::diagonal(&diagonal, width);
            let mut dense = DMatrix::from_diagonal(&DVector::from_vec(diagonal));
            for (row, back, b, weight) in links {
                if row >= size || back > width || back > row {
                    continue;
                }
                let mut v = vec![(row, 1.0)];
                if back > 0 {
                    v.push((row - back, b));
                }
                banded.add_outer(&v, weight);
                let mut full = DVector::zeros(size);
                v.iter().for_each(|(place, value)| full[*place] = *value);
                dense += &full * full.transpose() * weight;
            }
            let right: Vec<f64> = (0..size).map(|k| (k as f64 * 1.7).sin()).collect();
            let mut ours = right.clone();
            banded.cholesky().unwrap().solve(&mut ours);
            let expected = dense.cholesky().unwrap().solve(&DVector::from_vec(right));
            for (a, b) in ours.iter().zip(expected.iter()) {
                prop_assert!((a - b).abs() < 1e-7 * (1.0 + b.abs()), "{} against {}", a, b);
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        assert!(Banded::diagonal(&[1.0, 0.0], 1).cholesky().is_none());
        assert!(Banded::diagonal(&[1.0, f64::NAN], 1).cholesky().is_none());
        let mut indefinite = Banded::diagonal(&[1.0, 1.0], 1);
        indefinite.add_outer(&[(0, 1.0), (1, 1.0)], -2.0);
        assert!(indefinite.cholesky().is_none());
        assert!(Banded::diagonal(&[], 3).cholesky().is_some());
    }
}
