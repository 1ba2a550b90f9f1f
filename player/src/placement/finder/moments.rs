//! Sums over points from which a least-squares plane follows at once; sums of parts add up to the sum of the whole.

use glam::{DMat3, DVec3};

use crate::placement::Plane;

/// Weighted first and second moments of points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    /// Sum of the weights.
    pub(super) weight: f64,
    sum: DVec3,
    squares: DVec3,
    /// Sums of yz, zx, xy.
    mixed: DVec3,
}

/// A plane through points, with how well they lie in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Normal towards the viewpoint that was given.
    pub(super) plane: Plane,
    /// Weighted mean of the points.
    pub(super) centroid: DVec3,
    /// Root mean square distance from the plane, metres.
    pub(super) rms_m: f64,
}

impl Moments {
    pub(super) fn add(&mut self, point: DVec3, weight: f64) {
        let weighted = point * weight;
        self.weight += weight;
        self.sum += weighted;
        self.squares += weighted * point;
        self.mixed += DVec3::new(weighted.y * point.z, weighted.z * point.x, weighted.x * point.y);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.weight += other.weight;
        self.sum += other.sum;
        self.squares += other.squares;
        self.mixed += other.mixed;
    }

    pub(super) fn mean(&self) -> DVec3 {
        self.sum / self.weight
    }

    /// The total-least-squares plane; `None` for too few points or points on a line.
    pub(super) fn fit(&self, viewpoint: DVec3) -> Option<Fit> {
        if self.weight <= 0.0 {
            return None;
        }
        let mean = self.mean();
        let squares = self.squares / self.weight - mean * mean;
        let mixed = self.mixed / self.weight - DVec3::new(mean.y * mean.z, mean.z * mean.x, mean.x * mean.y);
        let covariance = DMat3::from_cols(
            DVec3::new(squares.x, mixed.z, mixed.y),
            DVec3::new(mixed.z, squares.y, mixed.x),
            DVec3::new(mixed.y, mixed.x, squares.z),
        );
        let (variance, normal) = smallest_eigenpair(&covariance)?;
        let normal = if normal.dot(viewpoint - mean) < 0.0 { -normal } else { normal };
        let plane = Plane::through(mean, normal);
        Some(Fit { plane, centroid: mean, rms_m: variance.max(0.0).sqrt() })
    }
}

/// The smallest eigenvalue of a symmetric matrix with its unit eigenvector, without iteration (Smith, "Eigenvalues of
/// a symmetric 3 × 3 matrix", CACM 1961); `None` when two eigenvalues are as small, so that no direction stands out.
pub(super) fn smallest_eigenpair(matrix: &DMat3) -> Option<(f64, DVec3)> {
    let middle = (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z) / 3.0;
    let centred = *matrix - DMat3::from_diagonal(DVec3::splat(middle));
    let spread = centred.to_cols_array().iter().map(|value| value * value).sum::<f64>() / 6.0;
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let radius = spread.sqrt();
    let half_determinant = (centred * (1.0 / radius)).determinant() / 2.0;
    let angle = half_determinant.clamp(-1.0, 1.0).acos() / 3.0;
    let smallest = middle + 2.0 * radius * (angle + std::f64::consts::TAU / 3.0).cos();
    // The eigenvector is orthogonal to every row of (matrix − smallest): the longest cross product is the safest.
    let rows = *matrix - DMat3::from_diagonal(DVec3::splat(smallest));
    let crosses =
        [rows.x_axis.cross(rows.y_axis), rows.y_axis.cross(rows.z_axis), rows.z_axis.cross(rows.x_axis)];
    let longest = crosses.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let isolated = longest.length() > 1e-6 * spread;
    isolated.then(|| longest.try_normalize()).flatten().map(|normal| (smallest, normal))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn points_on_a_line_have_no_plane() {
        let mut moments = Moments::default();
        assert!(moments.fit(DVec3::ZERO).is_none());
        for step in 0..10 {
            moments.add(DVec3::new(1.0, 2.0, 3.0) * f64::from(step), 1.0);
        }
        assert!(moments.fit(DVec3::ZERO).is_none());
    }

    proptest! {
        #[test]
        fn a_plane_comes_back(x in -1.0..1.0, y in -1.0..1.0, z in 0.1..1.0, distance in 0.1..8.0_f64) {
            let normal = DVec3::new(x, y, z).normalize();
            let (along, across) = normal.any_orthonormal_pair();
            let (mut all, mut half, mut rest) = (Moments::default(), Moments::default(), Moments::default());
            for index in 0..200 {
                let (u, v) = (f64::from(index % 20) * 0.03, f64::from(index / 20) * 0.05);
                let point = -normal * distance + along * u + across * v;
                all.add(point, 1.0);
                if index % 2 == 0 { half.add(point, 1.0) } else { rest.add(point, 1.0) }
            }
            half.merge(&rest);
            for moments in [all, half] {
                let fit = moments.fit(DVec3::ZERO).unwrap();
                prop_assert!(fit.plane.normal.distance(normal) < 1e-6, "{fit:?}");
                prop_assert!((fit.plane.offset_m - distance).abs() < 1e-6);
                prop_assert!(fit.rms_m < 1e-6);
            }
        }
    }
}
