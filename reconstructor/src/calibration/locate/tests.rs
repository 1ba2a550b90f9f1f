use glam::{DVec2, DVec3};
use proptest::prelude::*;

use super::{
    evidence::{FoundLine, FoundPoint},
    *,
};

/// What a network that errs by up to `noise_px` would say of a camera's picture.
fn evidence_of(camera: &Camera, named: &Named, noise_px: f64) -> Evidence {
    let wobble = |k: usize| DVec2::from_angle(k as f64 * 2.4) * noise_px;
    let seen = |world: DVec3| camera.project(world).filter(|&pixel| camera.contains(pixel));
    let mut evidence = Evidence { size_px: (camera.width_px, camera.height_px), ..Evidence::default() };
    for (name, &world) in named.points.iter().enumerate() {
        if let Some(pixel) = seen(world) {
            evidence.points.push(FoundPoint { name, pixel: pixel + wobble(name), score: 0.7 });
        }
    }
    for (name, line) in named.lines.iter().enumerate() {
        for (k, pixel) in line.iter().step_by(2).filter_map(|&world| seen(world)).enumerate() {
            evidence.lines.push(FoundLine { name, pixel: pixel + wobble(k) * 0.5, score: 0.8 });
        }
    }
    evidence
}

/// Largest distance between where two cameras see the ground in the middle and towards the corners of the picture, metres.
fn ground_error_m(a: &Camera, b: &Camera) -> f64 {
    let size = DVec2::new(f64::from(a.width_px), f64::from(a.height_px));
    let places = [(0.5, 0.5), (0.2, 0.5), (0.8, 0.5), (0.2, 0.9), (0.8, 0.9)];
    let error = |(x, y)| {
        let pixel = size * DVec2::new(x, y);
        match (a.ground_point(pixel), b.ground_point(pixel)) {
            (Some(p), Some(q)) => p.distance(q),
            _ => f64::INFINITY,
        }
    };
    places.into_iter().map(error).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_main_camera_is_found_from_what_a_network_would_name(
        x in -8.0..8.0_f64, height in 10.0..26.0_f64, z in 46.0..85.0_f64, aim in -44.0..44.0_f64, zoom in 0.8..1.4_f64,
    ) {
        let position = DVec3::new(x, height, z);
        let truth = Camera::looking_at((1280, 720), zoom * 20.0 * position.length(), position, DVec3::new(aim, 0.0, -4.0));
        let (pitch, named) = (Pitch::default(), Named::new(&Pitch::default()));
        let evidence = evidence_of(&truth, &named, 3.0);
        prop_assume!(evidence.points.len() >= 5);
        let (found, _) = explain(&evidence, &named, &pitch, Terms::default()).unwrap();
        let error = ground_error_m(&found, &truth);
        prop_assert!(error < 1.5, "{error} m off: {found:?} instead of {truth:?}");
    }
}

#[test]
fn a_camera_behind_the_goal_is_found_and_wrong_names_do_not_move_it() {
    let (pitch, named) = (Pitch::default(), Named::new(&Pitch::default()));
    let position = DVec3::new(-82.0, 19.0, 2.0);
    let truth = Camera::looking_at((1280, 720), 1500.0, position, DVec3::new(-32.0, 0.0, 1.0));
    let mut evidence = evidence_of(&truth, &named, 2.0);
    for (k, name) in [0, 3].into_iter().enumerate() {
        evidence.points.push(FoundPoint {
            name,
            pixel: DVec2::new(200.0 + 500.0 * k as f64, 600.0),
            score: 0.3,
        });
    }
    let (found, _) = explain(&evidence, &named, &pitch, Terms::default()).unwrap();
    assert!(ground_error_m(&found, &truth) < 1.5, "{found:?}");
}

#[test]
fn two_points_are_no_camera() {
    let evidence = Evidence {
        size_px: (1280, 720),
        points: [0, 1].map(|name| FoundPoint { name, pixel: DVec2::new(600.0, 300.0), score: 0.9 }).to_vec(),
        ..Evidence::default()
    };
    let named = Named::new(&Pitch::default());
    let reason = explain(&evidence, &named, &Pitch::default(), Terms::default()).unwrap_err();
    assert!(reason.contains("2 points"), "{reason}");
}
