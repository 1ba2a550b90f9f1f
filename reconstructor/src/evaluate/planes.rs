//! Squared errors of a depth estimate and of the planes it has to beat, on the true pixels of one player.

use glam::DVec2;

/// A true pixel of a player.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where, pixels.
    pub pixel: DVec2,
    /// True distance from the upright plane, metres.
    pub truth_m: f64,
    /// Estimated distance, metres.
    pub estimate_m: f64,
}

/// Sums of squared errors in m², and over how many pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Squares {
    /// Pixels.
    pub pixels: usize,
    /// Of the estimate.
    pub error: f64,
    /// Of the estimate after the best scale and translation.
    pub scaled: f64,
    /// Of the upright plane itself.
    pub flat: f64,
    /// Of the best plane in image x, y.
    pub tilted: f64,
}

impl Squares {
    /// Adds those of another player.
    pub fn add(&mut self, other: Self) {
        self.pixels += other.pixels;
        self.error += other.error;
        self.scaled += other.scaled;
        self.flat += other.flat;
        self.tilted += other.tilted;
    }

    /// The root of the mean of one of the sums, metres; 0 without pixels.
    #[must_use]
    pub fn root_mean(&self, sum: f64) -> f64 {
        if self.pixels == 0 { 0.0 } else { (sum / self.pixels as f64).sqrt() }
    }
}

/// The squared errors of one player.
#[must_use]
pub fn squares(points: &[Point]) -> Squares {
    let count = points.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Point) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (truth, estimate) = (mean(&|p| p.truth_m), mean(&|p| p.estimate_m));
    let (x, y) = (mean(&|p| p.pixel.x), mean(&|p| p.pixel.y));
    let sum = |of: &dyn Fn(&Point) -> f64| points.iter().map(of).sum::<f64>();
    let spread = sum(&|p| (p.truth_m - truth).powi(2));
    let estimate_spread = sum(&|p| (p.estimate_m - estimate).powi(2));
    let together = sum(&|p| (p.truth_m - truth) * (p.estimate_m - estimate));
    // What a least-squares line explains; a constant estimate explains nothing.
    let explained = if estimate_spread > 1e-12 { together.powi(2) / estimate_spread } else { 0.0 };
    let (xx, yy, xy) = (
        sum(&|p| (p.pixel.x - x).powi(2)),
        sum(&|p| (p.pixel.y - y).powi(2)),
        sum(&|p| (p.pixel.x - x) * (p.pixel.y - y)),
    );
    let (xd, yd) =
        (sum(&|p| (p.pixel.x - x) * (p.truth_m - truth)), sum(&|p| (p.pixel.y - y) * (p.truth_m - truth)));
    let determinant = xx * yy - xy * xy;
    // Pixels on one line leave one direction open: then the plane is taken along y or x alone.
    let tilt = if determinant > 1e-9 * xx * yy {
        (xd * (yy * xd - xy * yd) + yd * (xx * yd - xy * xd)) / determinant
    } else if yy > 0.0 {
        yd * yd / yy
    } else if xx > 0.0 {
        xd * xd / xx
    } else {
        0.0
    };
    Squares {
        pixels: points.len(),
        error: sum(&|p| (p.estimate_m - p.truth_m).powi(2)),
        scaled: (spread - explained).max(0.0),
        flat: sum(&|p| p.truth_m.powi(2)),
        tilted: (spread - tilt).max(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(truth: impl Fn(f64, f64) -> f64, estimate: impl Fn(f64) -> f64) -> Vec<Point> {
        (0..100)
            .map(|i| {
                let (x, y) = (f64::from(i % 10), f64::from(i / 10));
                let truth_m = truth(x, y);
                Point { pixel: DVec2::new(x, y), truth_m, estimate_m: estimate(truth_m) }
            })
            .collect()
    }

    #[test]
    fn a_plane_is_explained_by_the_tilted_plane_only() {
        let squares = squares(&points(|x, y| 0.02 * x - 0.03 * y + 0.1, |_| 0.0));
        assert!(squares.tilted < 1e-9);
        assert!(squares.flat > 0.1 && squares.scaled > 0.1);
        assert!((squares.error - squares.flat).abs() < 1e-12);
    }

    #[test]
    fn a_scaled_and_moved_estimate_is_right_up_to_scale_and_translation() {
        let squares = squares(&points(|x, y| (0.3 * x * y).sin(), |truth| 0.5 * truth + 0.2));
        assert!(squares.scaled < 1e-9);
        assert!(squares.error > 1.0);
    }

    #[test]
    fn a_known_error_has_its_root_mean_square() {
        let squares = squares(&points(|x, _| if x < 5.0 { 0.1 } else { -0.1 }, |truth| truth + 0.05));
        assert!((squares.root_mean(squares.error) - 0.05).abs() < 1e-12);
        assert!((squares.root_mean(squares.flat) - 0.1).abs() < 1e-12);
    }

    #[test]
    fn few_pixels_are_no_division_by_zero() {
        assert_eq!(squares(&[]).root_mean(0.0), 0.0);
        let one = Point { pixel: DVec2::ZERO, truth_m: 0.2, estimate_m: 0.1 };
        let both = squares(&[one, Point { pixel: DVec2::new(0.0, 3.0), truth_m: 0.4, ..one }]);
        assert!(both.tilted < 1e-12 && both.scaled.is_finite());
    }
}
