//! The Karhunen–Loève transform over time: how a set of values moves over the frames of a run, as few waves that each value takes a share of.
//!
//! For trajectories of mesh points this is the idea of Váša and Skala, "CoDDyaC: Connectivity Driven Dynamic Mesh Compression" (3DTV-CON 2007).

use nalgebra::{DMatrix, SymmetricEigen};

/// One part in this many of a wave's value.
pub(super) const BASIS_SCALE: f32 = 32_767.0;

/// Waves over the frames of a run, strongest first; each has one value per frame, in [`BASIS_SCALE`]ths.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Basis {
    pub(super) frames: usize,
    pub(super) values: Vec<i16>,
}

impl Basis {
    /// The waves of `series`, a list of values per frame, all of one length.
    pub(super) fn of(series: &[Vec<f32>]) -> Self {
        let frames = series.len();
        let mut gram = DMatrix::<f64>::zeros(frames, frames);
        for row in 0..frames {
            for column in 0..=row {
                let product = dot(&series[row], &series[column]);
                gram[(row, column)] = product;
                gram[(column, row)] = product;
            }
        }
        if frames == 0 {
            return Self::default();
        }
        let eigen = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..frames).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let mut values = Vec::with_capacity(frames * frames);
        for wave in order {
            let column = eigen.eigenvectors.column(wave);
            // Either sign is right; the one with a positive sum is nearer to a mean.
            let sign = if column.sum() < 0.0 { -1.0 } else { 1.0 };
            values.extend(column.iter().map(|value| (sign * value * f64::from(BASIS_SCALE)).round() as i16));
        }
        Self { frames, values }
    }

    /// How many waves there are.
    pub(super) fn waves(&self) -> usize {
        self.values.len().checked_div(self.frames).unwrap_or(0)
    }

    /// The first waves.
    pub(super) fn first(&self, waves: usize) -> Self {
        Self { frames: self.frames, values: self.values[..waves * self.frames].to_vec() }
    }

    /// Value of a wave in a frame.
    pub(super) fn at(&self, wave: usize, frame: usize) -> f32 {
        f32::from(self.values.get(wave * self.frames + frame).copied().unwrap_or(0)) / BASIS_SCALE
    }

    /// The share that each value of `series` takes of a wave.
    pub(super) fn shares(&self, wave: usize, series: &[Vec<f32>]) -> Vec<f32> {
        let mut shares = vec![0.0; series.first().map_or(0, Vec::len)];
        for (frame, values) in series.iter().enumerate() {
            let weight = self.at(wave, frame);
            for (share, value) in shares.iter_mut().zip(values) {
                *share += weight * value;
            }
        }
        shares
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_in_two_ways_has_two_waves() {
        let series: Vec<Vec<f32>> = (0..12)
            .map(|t| {
                let (a, b) = ((0.5 * t as f32).sin(), 0.1 * t as f32);
                (0..40).map(|i| a * (i % 7) as f32 + b * (i % 5) as f32).collect()
            })
            .collect();
        let basis = Basis::of(&series).first(2);
        let shares = [basis.shares(0, &series), basis.shares(1, &series)];
        for (frame, values) in series.iter().enumerate() {
            for (index, value) in values.iter().enumerate() {
                let back = basis.at(0, frame) * shares[0][index] + basis.at(1, frame) * shares[1][index];
                assert!((back - value).abs() < 2e-3, "{back} for {value}");
            }
        }
        assert_eq!(Basis::of(&[]).waves(), 0);
    }
}
