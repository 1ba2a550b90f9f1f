//! The plane of a surface among clutter: iterated least squares in which what stands on the surface loses its weight.

use glam::DVec3;

use super::{
    moments::{Fit, Moments},
    noise::Noise,
};
use crate::placement::Plane;

/// Tukey's constant: 95 % efficiency on Gaussian noise.
const TUKEY: f64 = 4.685;

/// The same in units of the noise where only the height is fitted: narrower, against things that lie on the table.
const LEVEL_CUT: f64 = 3.0;

const MOST_ITERATIONS: usize = 12;

/// Refines a plane on the points near it by iterated least squares with Tukey's biweight, on residuals in units of the
/// sensor's noise; the scale is the median absolute deviation of the points that count. Objects that touch the table
/// lie beyond the biweight's reach after the first turns and do not pull the plane. `None` when nothing is left.
pub(super) fn refine(
    points: &[DVec3],
    start: Plane,
    noise: Noise,
    viewpoint: DVec3,
    widest_m: f64,
) -> Option<(Fit, usize)> {
    let mut plane = start;
    let mut scale = f64::INFINITY;
    let mut last = None;
    let mut deviations = Vec::with_capacity(points.len());
    for _ in 0..MOST_ITERATIONS {
        deviations.clear();
        let reach_m = widest_m.min(TUKEY * scale * noise.along_view_m(8.0));
        for point in points {
            let distance = plane.distance_m(*point);
            if distance.abs() < reach_m {
                let sigma = noise.across_m(&plane, *point, viewpoint);
                deviations.push((*point, distance / sigma, sigma));
            }
        }
        if deviations.len() < 8 {
            return None;
        }
        let mut sizes: Vec<f64> = deviations.iter().map(|(_, residual, _)| residual.abs()).collect();
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        // The scale may only shrink: otherwise clutter could win back what it lost.
        scale = scale.min((1.4826 * *median).clamp(0.4, 4.0));
        let cut = TUKEY * scale;
        let mut moments = Moments::default();
        let mut counted = 0;
        for (point, residual, sigma) in &deviations {
            let ratio = residual / cut;
            if ratio.abs() < 1.0 {
                let keep = 1.0 - ratio * ratio;
                moments.add(*point, keep * keep / (sigma * sigma));
                counted += 1;
            }
        }
        let fit = moments.fit(viewpoint)?;
        let turned = fit.plane.normal.distance(plane.normal);
        let shifted = (fit.plane.offset_m - plane.offset_m).abs();
        plane = fit.plane;
        last = Some((fit, counted));
        if turned < 1e-6 && shifted < 1e-6 {
            break;
        }
    }
    last
}

/// The same plane made level: its normal becomes `up` and only its height is fitted, where Tukey's biweight with the
/// noise of the sensor as its scale is largest. The few noisy points of a phone tell the height of a table well and its
/// tilt badly, and gravity is known far better; looking at all heights keeps low things on the table from winning.
pub(super) fn level(points: &[DVec3], start: Fit, up: DVec3, sigma_m: f64) -> Fit {
    let normal = if start.plane.normal.dot(up) < 0.0 { -up } else { up };
    let middle = Plane::through(start.centroid, normal);
    let cut = LEVEL_CUT * sigma_m;
    let heights: Vec<f64> = points
        .iter()
        .map(|point| middle.distance_m(*point))
        .filter(|height| height.abs() < 3.0 * cut)
        .collect();
    let weigh = |at: f64| {
        heights.iter().filter_map(move |height| {
            let ratio = (height - at) / cut;
            (ratio.abs() < 1.0).then(|| (*height, (1.0 - ratio * ratio).powi(2)))
        })
    };
    let trials = (-20..=20).map(|step| f64::from(step) * 0.1 * cut);
    let support = |at: f64| weigh(at).map(|(_, weight)| weight.powf(1.5)).sum::<f64>();
    let best =
        trials.map(|at| (support(at), at)).max_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, at)| at);
    let mut at = best;
    for _ in 0..MOST_ITERATIONS {
        let (sum, weights) =
            weigh(at).fold((0.0, 0.0), |(sum, all), (height, w)| (sum + w * height, all + w));
        if weights > 0.0 {
            at = sum / weights;
        }
    }
    let (squares, weights) =
        weigh(at).fold((0.0, 0.0), |(sum, all), (height, w)| (sum + w * (height - at).powi(2), all + w));
    let rms_m = if weights > 0.0 { f64::sqrt(squares / weights) } else { start.rms_m };
    let plane = Plane { normal, offset_m: middle.offset_m - at };
    Fit { plane, centroid: plane.project(start.centroid), rms_m }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clutter_that_touches_does_not_pull() {
        let mut points = Vec::new();
        for index in 0..6000_u32 {
            let (u, v) = (f64::from(index % 100) * 0.01 - 0.5, f64::from(index / 100) * 0.01 - 0.3);
            // A triangle wave stands for noise of ±2 mm.
            let wave = (f64::from(index * 7919 % 41) / 20.0 - 1.0) * 0.002;
            points.push(DVec3::new(u, wave, v - 1.0));
            // A box on one end, 6 to 60 mm high.
            if u > 0.2 {
                points.push(DVec3::new(u, 0.006 + f64::from(index % 10) * 0.006, v - 1.0));
            }
        }
        let start = Plane { normal: DVec3::new(0.05, 1.0, 0.02).normalize(), offset_m: -0.004 };
        let viewpoint = DVec3::new(0.0, 0.6, 0.0);
        let (fit, counted) = refine(&points, start, Noise::Triangulated(1.0), viewpoint, 0.03).unwrap();
        let degrees = fit.plane.normal.angle_between(DVec3::Y).to_degrees();
        assert!(
            degrees < 0.2 && fit.plane.distance_m(DVec3::new(0.0, 0.0, -1.0)).abs() < 0.001,
            "{fit:?} {degrees}"
        );
        assert!(counted > 5500, "{counted}");
    }

    #[test]
    fn nothing_near_is_no_plane() {
        let plane = Plane { normal: DVec3::Y, offset_m: 0.0 };
        assert!(refine(&[DVec3::ONE; 20], plane, Noise::Even(0.005), DVec3::ZERO, 0.05).is_none());
    }
}
