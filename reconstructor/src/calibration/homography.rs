//! A first camera from points of the pitch plane: plane homography by the normalised direct linear transform (Hartley and
//! Zisserman, section 4.4), then focal length, rotation and position from it.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::{Matrix3, SMatrix};
use protocol::camera::Camera;

/// The homography that takes (world x, world z, 1) to homogeneous pixels; `None` when the points do not fix it.
pub(super) fn fit(world: &[DVec2], pixels: &[DVec2]) -> Option<DMat3> {
    let (from, to) = (normalisation(world)?, normalisation(pixels)?);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (&w, &p) in world.iter().zip(pixels) {
        let (w, p) = ((from * w.extend(1.0)).truncate(), (to * p.extend(1.0)).truncate());
        let rows = [
            [w.x, w.y, 1.0, 0.0, 0.0, 0.0, -p.x * w.x, -p.x * w.y, -p.x],
            [0.0, 0.0, 0.0, w.x, w.y, 1.0, -p.y * w.x, -p.y * w.y, -p.y],
        ];
        for row in rows {
            let row = nalgebra::SVector::<f64, 9>::from(row);
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let (least, second, largest) = (*order.first()?, *order.get(1)?, *order.last()?);
    // Two vanishing eigenvalues: a family of homographies fits, the points do not fix one.
    if eigen.eigenvalues[second] < 1e-10 * eigen.eigenvalues[largest] {
        return None;
    }
    let h = eigen.eigenvectors.column(least);
    let normalised = DMat3::from_cols(
        DVec3::new(h[0], h[3], h[6]),
        DVec3::new(h[1], h[4], h[7]),
        DVec3::new(h[2], h[5], h[8]),
    );
    let homography = to.inverse() * normalised * from;
    homography.is_finite().then_some(homography)
}

/// Moves points to mean zero and mean distance √2, for a well-conditioned system.
fn normalisation(points: &[DVec2]) -> Option<DMat3> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<DVec2>() / n;
    let distance = points.iter().map(|point| point.distance(mean)).sum::<f64>() / n;
    let scale = std::f64::consts::SQRT_2 / distance;
    scale.is_finite().then(|| DMat3::from_scale(DVec2::splat(scale)) * DMat3::from_translation(-mean))
}

/// Focal length in pixels that makes the homography's axes perpendicular and of one length; `None` when none does.
pub(super) fn focal_length(homography: &DMat3, centre_px: DVec2) -> Option<f64> {
    let m = DMat3::from_translation(-centre_px) * *homography;
    let (x, z) = (m.x_axis, m.y_axis);
    let (a1, b1) = (x.x * z.x + x.y * z.y, x.z * z.z);
    let (a2, b2) = (x.truncate().length_squared() - z.truncate().length_squared(), x.z * x.z - z.z * z.z);
    // Both a·u + b = 0 for u = 1/f²: least squares.
    let u = -(a1 * b1 + a2 * b2) / (a1 * a1 + a2 * a2);
    (u > 0.0).then(|| u.sqrt().recip()).filter(|focal| focal.is_finite())
}

/// The camera with a given focal length that has this homography, as nearly as a camera can.
pub(super) fn camera(homography: &DMat3, focal_px: f64, size_px: (u32, u32), seen: DVec2) -> Option<Camera> {
    let blank = Camera {
        width_px: size_px.0,
        height_px: size_px.1,
        focal_px,
        k1: 0.0,
        rotation: DMat3::IDENTITY,
        position: DVec3::ZERO,
    };
    let normalise = DMat3::from_diagonal(DVec3::new(1.0 / focal_px, 1.0 / focal_px, 1.0));
    let m = normalise * DMat3::from_translation(-blank.centre_px()) * *homography;
    let scale = 2.0 / (m.x_axis.length() + m.y_axis.length());
    // The points that were seen are in front of the camera.
    let m = m * if (m * seen.extend(1.0)).z < 0.0 { -scale } else { scale };
    let (x, z) = (m.x_axis, m.y_axis);
    let columns = [x, z.cross(x), z];
    let rough = Matrix3::from_fn(|row, column| columns[column][row]);
    let svd = rough.svd(true, true);
    let near = svd.u? * svd.v_t?;
    let rotation = DMat3::from_cols_array(near.as_slice().try_into().ok()?);
    let position = -(rotation.transpose() * m.z_axis);
    let valid = rotation.determinant() > 0.0 && rotation.is_finite() && position.is_finite();
    valid.then_some(Camera { rotation, position, ..blank })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn arbitrary_camera() -> impl Strategy<Value = Camera> {
        ((-20.0..20.0, 8.0..40.0, 45.0..100.0), (-35.0..35.0, -15.0..15.0), 900.0..4000.0, -0.05..0.05)
            .prop_map(|((x, y, z), (tx, tz), focal, roll): ((f64, f64, f64), (f64, f64), f64, f64)| {
                let mut camera =
                    Camera::looking_at((1280, 720), focal, DVec3::new(x, y, z), DVec3::new(tx, 0.0, tz));
                camera.rotation = DMat3::from_rotation_z(roll) * camera.rotation;
                camera
            })
    }

    proptest! {
        #[test]
        fn exact_points_give_back_the_camera(camera in arbitrary_camera(), extra in -8.0..8.0_f64) {
            let aim = camera.ground_point(camera.centre_px()).unwrap();
            let world: Vec<DVec2> = [(-9.0, -7.0), (10.0, -8.0), (11.0, 6.0), (-8.0, 9.0), (extra, -extra / 2.0)]
                .iter().map(|&(x, z)| DVec2::new(aim.x + x, aim.z + z)).collect();
            let pixels: Vec<DVec2> =
                world.iter().map(|w| camera.project(DVec3::new(w.x, 0.0, w.y)).unwrap()).collect();
            let homography = fit(&world, &pixels).unwrap();
            for (w, p) in world.iter().zip(&pixels) {
                let q = homography * w.extend(1.0);
                prop_assert!((q.truncate() / q.z - *p).length() < 1e-3);
            }
            let focal = focal_length(&homography, camera.centre_px()).unwrap();
            prop_assert!((focal / camera.focal_px - 1.0).abs() < 0.01, "{focal} for {}", camera.focal_px);
            let found = super::camera(&homography, camera.focal_px, (1280, 720), world[0]).unwrap();
            prop_assert!((found.position - camera.position).length() < 0.1);
            prop_assert!((found.rotation - camera.rotation).to_cols_array().iter().all(|v| v.abs() < 1e-3));
        }
    }

    #[test]
    fn points_on_a_line_fix_no_homography() {
        let world: Vec<DVec2> = (0..5).map(|i| DVec2::new(f64::from(i), 0.0)).collect();
        let pixels: Vec<DVec2> = (0..5).map(|i| DVec2::new(f64::from(i) * 10.0, 5.0)).collect();
        assert!(fit(&world, &pixels).is_none());
    }
}
