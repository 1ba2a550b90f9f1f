//! The camera of the frame with correspondences: direct linear transform, then Levenberg–Marquardt on the reprojection
//! error with priors, because four points alone leave height, distance and focal length hardly told apart.

use glam::DVec2;
use protocol::camera::Camera;

use super::{
    CalibrationError, homography,
    input::Calibration,
    least_squares::{LOG_FOCAL, Normal, PARAMETERS, POSITION, RADIAL, minimise, project_with_derivatives},
};

/// Main cameras stand this high above the pitch, metres.
const HEIGHT_M: (f64, f64) = (3.0, 60.0);
/// Where main cameras stand, and how much that varies, metres: height and distance from the touchline side's centre mark.
const USUAL_HEIGHT_M: (f64, f64) = (18.0, 12.0);
const USUAL_DISTANCE_M: (f64, f64) = (75.0, 30.0);
/// They stand near the halfway line: usual distance from it, metres.
const USUAL_ASIDE_M: f64 = 15.0;
/// Error of a point found by hand, pixels.
const POINT_SIGMA_PX: f64 = 1.5;
/// Usual size of k1 at broadcast focal lengths.
const RADIAL_SIGMA: f64 = 0.1;
/// Points from which the radial coefficient may be estimated as well.
const LEAST_POINTS_FOR_RADIAL: usize = 8;
/// Worse than this, no camera explains the points: share of the picture's width, root mean square.
const WORST_FIT: f64 = 0.02;
/// Focal lengths tried, in picture widths: broadcast zoom lenses from wide to long.
const FOCAL_WIDTHS: [f64; 6] = [0.7, 1.1, 1.7, 2.6, 4.0, 6.5];

/// Fits the first camera to checked correspondences.
///
/// # Errors
/// When the points cannot be used or no camera above the pitch explains them.
pub(super) fn camera(given: &Calibration, size_px: (u32, u32)) -> Result<Camera, CalibrationError> {
    given.check(size_px.0, size_px.1)?;
    let (world, pixels): (Vec<DVec2>, Vec<DVec2>) = given.on_pitch().unzip();
    let homography =
        homography::fit(&world, &pixels).ok_or(CalibrationError::Collinear { where_: "in the world" })?;
    let seen = world.iter().sum::<DVec2>() / world.len().max(1) as f64;
    let centre_px = DVec2::new(f64::from(size_px.0) - 1.0, f64::from(size_px.1) - 1.0) / 2.0;
    let guesses = homography::focal_length(&homography, centre_px)
        .into_iter()
        .chain(FOCAL_WIDTHS.iter().map(|widths| widths * f64::from(size_px.0)));

    let mut free = [true; PARAMETERS];
    free[RADIAL] = given.points.len() >= LEAST_POINTS_FOR_RADIAL;
    let best = guesses
        .filter_map(|focal| homography::camera(&homography, focal, size_px, seen))
        .map(|start| minimise(start, free, 200, |camera| energy(camera, given)))
        .filter(|(camera, cost)| cost.is_finite() && (HEIGHT_M.0..=HEIGHT_M.1).contains(&camera.position.y))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(camera, _)| camera)
        .ok_or(CalibrationError::NoCamera { rms_px: f64::INFINITY })?;
    let rms_px = reprojection_rms_px(&best, given);
    if rms_px > WORST_FIT * f64::from(size_px.0) {
        return Err(CalibrationError::NoCamera { rms_px });
    }
    tracing::info!(rms_px, focal_px = best.focal_px, position = %best.position, "camera of the correspondences");
    Ok(best)
}

fn energy(camera: &Camera, given: &Calibration) -> Normal {
    let mut normal = Normal::new();
    for point in &given.points {
        let Some((pixel, rows)) = project_with_derivatives(camera, point.world_m) else {
            normal.cost = f64::INFINITY;
            return normal;
        };
        let weight = 1.0 / (POINT_SIGMA_PX * POINT_SIGMA_PX);
        for axis in 0..2 {
            let residual = pixel[axis] - point.pixel[axis];
            normal.add(&rows[axis], residual, weight, weight * residual * residual);
        }
    }
    let position = camera.position;
    normal.expect(POSITION, position.x, USUAL_ASIDE_M);
    normal.expect(POSITION + 1, position.y - USUAL_HEIGHT_M.0, USUAL_HEIGHT_M.1);
    normal.expect(POSITION + 2, position.z - USUAL_DISTANCE_M.0, USUAL_DISTANCE_M.1);
    normal.expect(LOG_FOCAL, (camera.focal_px / f64::from(camera.width_px) / 2.0).ln(), 1.0);
    normal.expect(RADIAL, camera.k1, RADIAL_SIGMA);
    normal
}

fn reprojection_rms_px(camera: &Camera, given: &Calibration) -> f64 {
    let squared: f64 = given
        .points
        .iter()
        .map(|point| camera.project(point.world_m).map_or(f64::INFINITY, |p| p.distance_squared(point.pixel)))
        .sum();
    (squared / given.points.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;
    use protocol::pitch::Pitch;

    use super::{super::Correspondence, *};

    /// Points that a person would click, seen by `camera`, each moved by `noise_px`.
    fn clicked(camera: &Camera, noise_px: f64) -> Calibration {
        let places = [(0.0, -34.0), (0.0, -9.15), (0.0, 9.15), (-9.15, 0.0), (9.15, 0.0), (0.0, 0.0)];
        let points = places.iter().enumerate().filter_map(|(i, &(x, z))| {
            let world_m = DVec3::new(x, 0.0, z);
            let noise = DVec2::from_angle(i as f64 * 2.4) * noise_px;
            let pixel = camera.project(world_m)? + noise;
            camera.contains(pixel).then(|| Correspondence { name: format!("{x} {z}"), pixel, world_m })
        });
        Calibration { frame: 0, pitch: Pitch::default(), points: points.collect() }
    }

    proptest! {
        #[test]
        fn a_broadcast_camera_is_found_from_points_a_pixel_off(
            x in -8.0..8.0_f64, height in 10.0..30.0_f64, z in 60.0..95.0_f64, aim in -4.0..4.0_f64, zoom in 0.9..1.1_f64,
        ) {
            let position = DVec3::new(x, height, z);
            let focal = zoom * 15.5 * position.length();
            let truth = Camera::looking_at((1280, 720), focal, position, DVec3::new(aim, 0.0, -8.0));
            let given = clicked(&truth, 1.0);
            prop_assume!(given.points.len() >= 5);
            let found = camera(&given, (1280, 720)).unwrap();
            for (px, pz) in [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)] {
                let world = DVec3::new(px, 0.0, pz);
                let error = found.project(world).unwrap().distance(truth.project(world).unwrap());
                prop_assert!(error < 6.0, "{error} px at {world}");
            }
        }
    }

    #[test]
    fn mirrored_points_are_refused() {
        let truth =
            Camera::looking_at((1280, 720), 1200.0, DVec3::new(2.0, 18.0, 75.0), DVec3::new(3.0, 0.0, -8.0));
        let mut given = clicked(&truth, 0.0);
        for point in &mut given.points {
            point.world_m.x = -point.world_m.x;
        }
        assert!(matches!(camera(&given, (1280, 720)), Err(CalibrationError::NoCamera { .. })));
    }
}
