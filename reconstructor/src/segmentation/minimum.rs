//! The minimum of an energy on a grid of cells with links to the right and down, as a soft segmentation has it: a sparse symmetric system,
//! solved directly. Its band is as wide as the grid's shorter side.

use crate::banded::Banded;

/// Minimises Σ link · (oₚ − o_q)² + Σ anchor · (oₚ − wanted)² over the cells of a grid.
#[derive(Clone, Debug)]
pub(super) struct GridEnergy {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Strength of the link of each cell with its right neighbour, ≥ 0; that of the last column is not read.
    pub(super) right: Vec<f64>,
    /// With the neighbour below; that of the last row is not read.
    pub(super) down: Vec<f64>,
    /// How strongly each cell is held, ≥ 0; at least one in every part of the grid that is linked must be > 0.
    pub(super) anchor: Vec<f64>,
    /// Where it is held.
    pub(super) wanted: Vec<f64>,
}

impl GridEnergy {
    /// The minimum; `None` when sizes do not fit, something is no number, or there is no single minimum.
    pub(super) fn minimum(&self) -> Option<Vec<f64>> {
        let (width, height) = (self.width, self.height);
        let cells = width.checked_mul(height)?;
        let fields = [&self.right, &self.down, &self.anchor, &self.wanted];
        if cells == 0
            || fields.iter().any(|field| field.len() != cells || field.iter().any(|v| !v.is_finite()))
        {
            return None;
        }
        // Counted along the shorter side, so that neighbours are near each other in the matrix.
        let place = |x: usize, y: usize| if width <= height { y * width + x } else { x * height + y };
        let each = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let (mut anchor, mut right) = (vec![0.0; cells], vec![0.0; cells]);
        for (x, y) in each() {
            let i = y * width + x;
            anchor[place(x, y)] = self.anchor[i];
            right[place(x, y)] = self.anchor[i] * self.wanted[i];
        }
        let mut system = Banded::diagonal(&anchor, width.min(height));
        for (x, y) in each() {
            let i = y * width + x;
            if x + 1 < width {
                system.add_outer(&[(place(x, y), 1.0), (place(x + 1, y), -1.0)], self.right[i]);
            }
            if y + 1 < height {
                system.add_outer(&[(place(x, y), 1.0), (place(x, y + 1), -1.0)], self.down[i]);
            }
        }
        system.cholesky()?.solve(&mut right);
        Some(each().map(|(x, y)| right[place(x, y)]).collect())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    fn dense(energy: &GridEnergy) -> Vec<f64> {
        let cells = energy.width * energy.height;
        let mut matrix = DMatrix::<f64>::from_diagonal(&DVector::from_vec(energy.anchor.clone()));
        let mut link = |i: usize, j: usize, strength: f64| {
            matrix[(i, i)] += strength;
            matrix[(j, j)] += strength;
            matrix[(i, j)] -= strength;
            matrix[(j, i)] -= strength;
        };
        for i in 0..cells {
            if i % energy.width + 1 < energy.width {
                link(i, i + 1, energy.right[i]);
            }
            if i + energy.width < cells {
                link(i, i + energy.width, energy.down[i]);
            }
        }
        let b = DVector::from_iterator(cells, energy.anchor.iter().zip(&energy.wanted).map(|(a, w)| a * w));
        matrix.cholesky().unwrap().solve(&b).iter().copied().collect()
    }

    fn energies() -> impl Strategy<Value = GridEnergy> {
        (1usize..9, 1usize..9).prop_flat_map(|(width, height)| {
            let cells = width * height;
            let links = || prop::collection::vec(0.001..1.0_f64, cells);
            let anchor = prop::collection::vec(prop_oneof![Just(0.001), Just(100.0)], cells);
            (links(), links(), anchor, prop::collection::vec(0.0..2.0_f64, cells)).prop_map(
                move |(right, down, anchor, wanted)| GridEnergy {
                    width,
                    height,
                    right,
                    down,
                    anchor,
                    wanted,
                },
            )
        })
    }

    proptest! {
        #[test]
        fn the_minimum_is_that_of_the_dense_system(energy in energies()) {
            let ours = energy.minimum().unwrap();
            for (a, b) in ours.iter().zip(dense(&energy)) {
                prop_assert!((a - b).abs() < 1e-6, "{a} against {b}");
            }
        }
    }

    #[test]
    fn what_is_no_system_is_refused() {
        let empty = || Vec::<f64>::new();
        let energy = GridEnergy {
            width: 0,
            height: 3,
            right: empty(),
            down: empty(),
            anchor: empty(),
            wanted: empty(),
        };
        assert!(energy.minimum().is_none());
        let one = GridEnergy { width: 1, height: 1, ..energy };
        assert!(one.minimum().is_none());
        let broken = vec![f64::NAN];
        let one = GridEnergy {
            right: broken.clone(),
            down: broken.clone(),
            anchor: vec![1.0],
            wanted: vec![1.0],
            ..one
        };
        assert!(one.minimum().is_none());
        let one = GridEnergy { right: vec![0.0], down: vec![0.0], ..one };
        assert_eq!(one.minimum().unwrap(), [1.0]);
    }
}
