//! Cholesky factorisation of a symmetric positive definite matrix with two bands beside the diagonal: time and memory grow
//! with the length of the path, not with its square or cube.

/// A symmetric matrix that is zero beyond the second band. `bands[b][i]` is the entry in row `i + b`, column `i`.
#[derive(Clone, Debug)]
pub(super) struct Pentadiagonal {
    bands: [Vec<f64>; 3],
}

impl Pentadiagonal {
    /// A diagonal matrix.
    pub(super) fn diagonal(diagonal: Vec<f64>) -> Self {
        let size = diagonal.len();
        Self { bands: [diagonal, vec![0.0; size], vec![0.0; size]] }
    }

    /// Adds `weight · v vᵀ`, where `v` is `coefficients` at rows `first..first + 3` and zero elsewhere.
    pub(super) fn add_outer(&mut self, first: usize, coefficients: [f64; 3], weight: f64) {
        for column in 0..3 {
            for row in column..3 {
                self.bands[row - column][first + column] += weight * coefficients[row] * coefficients[column];
            }
        }
    }

    /// The factor L of L·Lᵀ, or `None` when the matrix is not positive definite to working precision.
    pub(super) fn cholesky(mut self) -> Option<Factor> {
        let size = self.bands[0].len();
        for column in 0..size {
            let pivot = self.bands[0][column].sqrt();
            if !(pivot.is_finite() && pivot > 1e-9) {
                return None;
            }
            self.bands[0][column] = pivot;
            let below = [1, 2].map(|band: usize| {
                if column + band < size {
                    self.bands[band][column] /= pivot;
                    self.bands[band][column]
                } else {
                    0.0
                }
            });
            if column + 1 < size {
                self.bands[0][column + 1] -= below[0] * below[0];
                self.bands[1][column + 1] -= below[0] * below[1];
            }
            if column + 2 < size {
                self.bands[0][column + 2] -= below[1] * below[1];
            }
        }
        Some(Factor { bands: self.bands })
    }
}

/// A lower triangular factor, stored as [`Pentadiagonal`] is.
#[derive(Clone, Debug)]
pub(super) struct Factor {
    bands: [Vec<f64>; 3],
}

impl Factor {
    /// Solves `L·Lᵀ x = right` in place.
    pub(super) fn solve(&self, right: &mut [f64]) {
        let size = self.bands[0].len().min(right.len());
        for row in 0..size {
            let mut value = right[row];
            for band in 1..=2.min(row) {
                value -= self.bands[band][row - band] * right[row - band];
            }
            right[row] = value / self.bands[0][row];
        }
        for row in (0..size).rev() {
            let mut value = right[row];
            for band in (1..=2).filter(|band| row + band < size) {
                value -= self.bands[band][row] * right[row + band];
            }
            right[row] = value / self.bands[0][row];
        }
    }
}
