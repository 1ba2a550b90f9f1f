//! Fitting on outlines drawn by hand and by chance.

use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use protocol::pitch::Pitch;

use super::*;
use crate::placement::{Plane, SurfaceId};

const UP: DVec3 = DVec3::Y;

fn surface(outline: &[(f64, f64)], obstacles: &[&[(f64, f64)]], turn: DQuat) -> Surface {
    let ring = |corners: &[(f64, f64)]| {
        corners.iter().map(|&(x, z)| turn * DVec3::new(x, 0.75, z)).collect::<Vec<_>>()
    };
    Surface {
        id: SurfaceId(1),
        kind: SurfaceKind::Table,
        plane: Plane::through(turn * (UP * 0.75), turn * UP),
        outline_m: ring(outline),
        obstacles_m: obstacles.iter().map(|corners| ring(corners)).collect(),
        confidence: 1.0,
    }
}

fn table(length: f64, width: f64) -> Surface {
    let (x, z) = (length / 2.0, width / 2.0);
    surface(&[(-x, -z), (-x, z), (x, z), (x, -z)], &[], DQuat::IDENTITY)
}

/// The corners of the turf on the table, in order.
fn turf(pose: &TabletopPose, wish: &Wish) -> [DVec3; 4] {
    let [x, z] = wish.half_turf_m;
    [(x, z), (x, -z), (-x, -z), (-x, z)]
        .map(|(x, z)| pose.foot_m() + pose.orientation * (DVec3::new(x, 0.0, z) * pose.scale))
}

/// The turf lies on the plane, inside the outline, and meets no foot print: corners, and crossings of sides.
fn assert_contained(surface: &Surface, pose: &TabletopPose, wish: &Wish) {
    let chart = Chart::new(&surface.plane, surface.outline_m[0], DVec3::X);
    let corners = turf(pose, wish);
    for corner in corners {
        assert!(surface.plane.distance_m(corner).abs() < 1e-9, "a corner is off the plane");
    }
    // A hair smaller, so that touching is not crossing.
    let middle = chart.flat(pose.foot_m());
    let flat = corners.map(|corner| middle + (chart.flat(corner) - middle) * (1.0 - 1e-9));
    let outline = chart.flat_all(&surface.outline_m);
    let obstacles: Vec<_> = surface.obstacles_m.iter().map(|o| chart.flat_all(o)).collect();
    for corner in flat {
        assert!(polygon::contains(&outline, corner), "a corner is outside the outline");
        assert!(!obstacles.iter().any(|o| polygon::contains(o, corner)), "a corner is in an obstacle");
    }
    for ring in std::iter::once(&outline).chain(&obstacles) {
        for side in polygon::sides(ring) {
            for edge in polygon::sides(&flat) {
                assert!(!crosses(side, edge), "{edge:?} crosses {side:?}");
            }
            assert!(!polygon::contains(&flat, side.0), "a corner of the surroundings lies on the turf");
        }
    }
}

fn crosses((a, b): (DVec2, DVec2), (c, d): (DVec2, DVec2)) -> bool {
    let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[test]
fn a_plain_table_is_filled_along_its_longer_side() {
    let wish = Wish { margin_m: 0.0, ..Wish::of(Pitch::default()) };
    let aspect = wish.half_turf_m[0] / wish.half_turf_m[1];
    for (length, width) in [(1.4, 0.5), (0.5, 1.4), (1.0, 1.0)] {
        let pose = fit(&table(length, width), &wish).unwrap();
        let (longer, shorter) = (f64::max(length, width), f64::min(length, width));
        let expected = (longer / 2.0 / wish.half_turf_m[0]).min(shorter / 2.0 / wish.half_turf_m[1]);
        assert!(
            (pose.scale / expected - 1.0).abs() < 6e-3,
            "{length} × {width}: {} of {expected}",
            pose.scale
        );
        assert!(pose.foot_m().distance(UP * 0.75) < 0.01 + longer * 0.01, "not in the middle: {pose:?}");
        assert!((pose.up() - UP).length() < 1e-12);
        let along = (pose.orientation * DVec3::X).abs();
        if longer > shorter * aspect {
            assert!((along.x > 0.99) == (length > width), "{along}");
        }
    }
}

#[test]
fn the_main_camera_side_faces_the_viewer() {
    let table = table(1.6, 0.9);
    for angle in 0..12 {
        let (sin, cos) = (f64::from(angle) * std::f64::consts::FRAC_PI_6 + 0.1).sin_cos();
        let viewer = DVec3::new(2.0 * cos, 1.6, 2.0 * sin);
        let wish = Wish { viewer_m: Some(viewer), ..Wish::of(Pitch::default()) };
        let pose = fit(&table, &wish).unwrap();
        assert!((pose.orientation * DVec3::Z).dot(viewer - pose.position_m) > 0.0);
        let facing = fit(&table, &Wish { facing: Facing::Viewer, ..wish }).unwrap();
        let towards = (viewer - facing.position_m).reject_from_normalized(UP).normalize();
        let off = (facing.orientation * DVec3::Z).angle_between(towards);
        assert!(off < 0.03, "turned away by {off} rad");
        assert_contained(&table, &facing, &wish);
        assert!(
            facing.scale <= pose.scale * 1.01,
            "square to the viewer is not larger than along the table here"
        );
    }
}

#[test]
fn obstacles_are_avoided_and_the_larger_free_half_is_taken() {
    let cup: &[(f64, f64)] = &[(-0.1, -0.05), (-0.1, 0.05), (0.0, 0.05), (0.0, -0.05)];
    let (x, z) = (0.8, 0.4);
    let outline = [(-x, -z), (-x, z), (x, z), (x, -z)];
    let cluttered = surface(&outline, &[cup], DQuat::from_rotation_z(0.1));
    let wish = Wish::of(Pitch::default());
    let pose = fit(&cluttered, &wish).unwrap();
    assert_contained(&cluttered, &pose, &wish);
    let empty = fit(&surface(&outline, &[], DQuat::IDENTITY), &wish).unwrap();
    assert!(pose.scale < empty.scale && pose.scale > 0.4 * empty.scale, "{} of {}", pose.scale, empty.scale);
    let away = DQuat::from_rotation_z(0.1).inverse() * pose.foot_m();
    assert!(away.x > 0.2, "the right half is larger: {away}");
}

#[test]
fn a_wish_for_a_place_is_followed_where_it_costs_nothing() {
    let long = table(4.0, 0.6);
    let near = DVec3::new(1.2, 0.9, 0.2);
    let pose = fit(&long, &Wish { near_m: Some(near), ..Wish::of(Pitch::default()) }).unwrap();
    assert!((pose.foot_m().x - 1.2).abs() < 0.02, "{pose:?}");
}

#[test]
fn what_does_not_fit_says_why() {
    let wish = Wish { up: Some(UP), ..Wish::of(Pitch::default()) };
    let refused = |surface: &Surface| fit(surface, &wish).unwrap_err();
    assert!(matches!(refused(&table(0.11, 0.05)), Misfit::TooSmall { .. }));
    let wall = Surface { kind: SurfaceKind::Wall, ..table(3.0, 2.0) };
    assert_eq!(refused(&wall), Misfit::Kind(SurfaceKind::Wall));
    let (x, z) = (0.8, 0.4);
    let outline = [(-x, -z), (-x, z), (x, z), (x, -z)];
    let tilted = surface(&outline, &[], DQuat::from_rotation_x(0.4));
    assert!(matches!(refused(&tilted), Misfit::Tilted { angle_deg, .. } if (angle_deg - 22.9).abs() < 0.1));
    let whole: &[(f64, f64)] = &outline;
    let covered = surface(&outline, &[whole], DQuat::IDENTITY);
    assert!(matches!(refused(&covered), Misfit::Cluttered { .. }));
    for corners in [0, 1, 2] {
        let mut broken = table(1.0, 1.0);
        broken.outline_m.truncate(corners);
        assert_eq!(refused(&broken), Misfit::Outline { corners });
    }
    for broken in [DVec3::NAN, DVec3::INFINITY] {
        let mut table = table(1.0, 1.0);
        table.outline_m[2] = broken;
        assert_eq!(refused(&table), Misfit::Outline { corners: 4 });
    }
    let point = surface(&[(0.3, 0.2); 5], &[], DQuat::IDENTITY);
    assert!(fit(&point, &wish).is_err());
    let line = surface(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)], &[], DQuat::IDENTITY);
    assert!(fit(&line, &wish).is_err());
    for error in [refused(&wall), refused(&tilted), refused(&covered)] {
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}

/// A preview is fitted anew whenever a surface is refined: it must not cost a headset its frames.
#[test]
fn a_fit_takes_a_few_milliseconds() {
    let corner = |index: i32| {
        let (sin, cos) = (f64::from(index) * std::f64::consts::TAU / 40.0).sin_cos();
        let radius = 1.0 + 0.05 * f64::from(index % 3);
        (0.9 * radius * cos, 0.5 * radius * sin)
    };
    let outline: Vec<_> = (0..40).map(corner).collect();
    let thing = |x: f64, z: f64| {
        let around = |index: i32| {
            let (sin, cos) = (f64::from(index) * std::f64::consts::TAU / 16.0).sin_cos();
            (x + 0.06 * cos, z + 0.06 * sin)
        };
        (0..16).map(around).collect::<Vec<_>>()
    };
    let things = [thing(0.5, 0.2), thing(-0.5, -0.2), thing(0.1, 0.4), thing(-0.7, 0.1), thing(0.3, -0.3)];
    let holes: Vec<&[(f64, f64)]> = things.iter().map(Vec::as_slice).collect();
    let table = surface(&outline, &holes, DQuat::IDENTITY);
    let wish = Wish { viewer_m: Some(DVec3::new(0.0, 1.6, 1.5)), ..Wish::of(Pitch::default()) };
    let started = std::time::Instant::now();
    for _ in 0..20 {
        assert!(fit(&table, &wish).is_ok());
    }
    let each_ms = started.elapsed().as_secs_f64() * 1e3 / 20.0;
    println!("40 corners and five things of 16: {each_ms:.1} ms a fit");
    assert!(each_ms < 200.0, "{each_ms} ms");
}

#[test]
fn huge_floors_stop_at_the_limit() {
    let floor = Surface { kind: SurfaceKind::Floor, ..table(40.0, 30.0) };
    let pose = fit(&floor, &Wish::of(Pitch::default())).unwrap();
    assert!((pose.scale - PITCH_SCALE_LIMITS[1]).abs() < 1e-12 && pose.foot_m().distance(UP * 0.75) < 1e-6);
}

/// A star-shaped outline: corners at angles in order with radii of their own.
fn outlines() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec(0.25..1.5_f64, 3..12).prop_map(|radii| {
        let step = std::f64::consts::TAU / radii.len() as f64;
        let corner = |(index, radius): (usize, &f64)| {
            let (sin, cos) = (index as f64 * step).sin_cos();
            (radius * cos * 1.4, radius * sin)
        };
        radii.iter().enumerate().map(corner).collect()
    })
}

fn obstacles() -> impl Strategy<Value = Vec<Vec<(f64, f64)>>> {
    let obstacle = (-1.2..1.2_f64, -1.0..1.0_f64, 0.02..0.3_f64, 3..7_usize, 0.0..6.0_f64);
    let polygon = obstacle.prop_map(|(x, z, radius, corners, turn)| {
        let corner = |index: usize| {
            let (sin, cos) = (turn + index as f64 * std::f64::consts::TAU / corners as f64).sin_cos();
            (x + radius * cos, z + radius * sin)
        };
        (0..corners).map(corner).collect()
    });
    prop::collection::vec(polygon, 0..5)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, rng_seed: prop::test_runner::RngSeed::Fixed(3), ..Default::default() })]

    #[test]
    fn the_turf_is_contained_exactly(
        outline in outlines(), obstacles in obstacles(), lean in -0.15..0.15_f64, yaw in 0.0..6.2_f64,
        viewer in (-3.0..3.0_f64, 1.0..2.0_f64, -3.0..3.0_f64), square in any::<bool>(), margin in 0.0..0.03_f64,
    ) {
        let turn = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_x(lean);
        let holes: Vec<&[(f64, f64)]> = obstacles.iter().map(Vec::as_slice).collect();
        let surface = surface(&outline, &holes, turn);
        let wish = Wish {
            facing: if square { Facing::Viewer } else { Facing::LongerSide },
            viewer_m: Some(viewer.into()),
            up: Some(UP),
            margin_m: margin,
            ..Wish::of(Pitch::default())
        };
        match fit(&surface, &wish) {
            Ok(pose) => {
                assert_contained(&surface, &pose, &wish);
                prop_assert!(pose.scale >= wish.scale_limits[0] && pose.scale <= wish.scale_limits[1]);
                prop_assert!((pose.up() - surface.plane.normal).length() < 1e-9);
                prop_assert!(fits(&surface, &pose, wish.half_turf_m, margin - 1e-9));
                // No place of a coarse grid holds a pitch that is more than a percent larger.
                let chart = Chart::new(&surface.plane, pose.foot_m(), pose.orientation * DVec3::X);
                let free = space(&surface, &chart, wish.half_turf_m, margin, &surface.obstacles_m);
                let better = (-20..=20).flat_map(|x| (-20..=20).map(move |z| DVec2::new(f64::from(x), f64::from(z)) * 0.1));
                if wish.facing == Facing::LongerSide {
                    for place in better {
                        prop_assert!(free.scale_at(place) <= pose.scale * 1.01, "{place} holds more");
                    }
                }
            }
            Err(error) => prop_assert!(matches!(error, Misfit::Cluttered { .. } | Misfit::TooSmall { .. }), "{error}"),
        }
    }
}
