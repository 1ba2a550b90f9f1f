//! The finder in rooms whose truth is known.

use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::placement::synthetic::{Body, Sensor, bare_room, clutter, room_from_camera, seen_plane, table};

const EYE: DVec3 = DVec3::new(0.2, 1.5, 1.3);
const TARGET: DVec3 = DVec3::new(0.0, 0.65, 0.0);

fn with_table() -> Vec<Body> {
    let mut room = bare_room();
    room.push(table());
    room.extend(clutter());
    room
}

fn scan(room: &[Body]) -> Finding {
    Finder::default().find(&Sensor::default().scan(room, &room_from_camera(EYE, TARGET)))
}

fn refusals(finding: &Finding) -> Vec<Refusal> {
    finding.surfaces.iter().filter_map(|found| found.refusal).collect()
}

#[test]
fn a_table_with_things_on_it() {
    let finding = scan(&with_table());
    let found = finding.table().unwrap_or_else(|| panic!("{finding:#?}"));
    let truth = seen_plane(&table().top(), &room_from_camera(EYE, TARGET));
    let degrees = found.surface.plane.normal.angle_between(truth.normal).to_degrees();
    let off_m = (found.surface.plane.offset_m - truth.offset_m).abs();
    assert!(degrees < 0.2 && off_m < 0.002, "{degrees} degrees, {off_m} m");
    assert_eq!(found.surface.kind, SurfaceKind::Table);
    assert!((found.height_m.unwrap() - 0.74).abs() < 0.01, "{found:?}");
    assert!((found.area_m2 - 0.84).abs() < 0.08, "{}", found.area_m2);
    assert_eq!(found.surface.obstacles_m.len(), 3, "{:?}", found.surface.obstacles_m);
    for corner in &found.surface.outline_m {
        assert!(found.surface.plane.distance_m(*corner).abs() < 1e-6);
    }
    let up = room_from_camera(EYE, TARGET).matrix3.transpose() * DVec3::Y;
    assert!(finding.up.direction.angle_between(up).to_degrees() < 0.5);
    assert!(finding.surfaces.iter().any(|found| found.surface.kind == SurfaceKind::Floor));
}

#[test]
fn the_outline_runs_counter_clockwise_from_the_sensors_side() {
    let finding = scan(&with_table());
    for found in &finding.surfaces {
        let corners = &found.surface.outline_m;
        let next = corners.iter().cycle().skip(1);
        let area: DVec3 = corners.iter().zip(next).map(|(a, b)| a.cross(*b)).sum();
        assert!(area.dot(found.surface.plane.normal) > 0.0, "{found:?}");
        assert!(found.surface.plane.offset_m > 0.0, "normals point to the sensor: {found:?}");
    }
}

#[test]
fn a_floor_with_boxes_is_no_table() {
    let mut room = bare_room();
    for x in [-0.6, 0.0, 0.5] {
        room.push(Body::standing(DVec3::new(x, 0.0, -0.3), DVec3::new(0.2, 0.25, 0.15)));
    }
    for eye in [EYE, DVec3::new(0.0, 0.6, 1.0)] {
        let camera = room_from_camera(eye, DVec3::NEG_Z * 0.3);
        let finding = Finder::default().find(&Sensor::default().scan(&room, &camera));
        assert!(finding.table().is_none(), "{finding:#?}");
        let known = refusals(&finding)
            .iter()
            .any(|refusal| matches!(refusal, Refusal::Floor | Refusal::NotSeenRaised { .. }));
        assert!(known, "{finding:#?}");
    }
}

#[test]
fn a_wall_is_no_table() {
    let camera = room_from_camera(DVec3::new(0.0, 1.6, 0.0), DVec3::new(0.3, 1.5, -2.0));
    let finding = Finder::default().find(&Sensor::default().scan(&bare_room(), &camera));
    assert!(finding.table().is_none(), "{finding:#?}");
}

#[test]
fn a_seat_is_taken_when_there_is_no_table() {
    let mut room = bare_room();
    room.push(Body::standing(DVec3::Y * 0.4, DVec3::new(0.5, 0.05, 0.5)));
    let found = scan(&room).table().cloned().unwrap();
    assert_eq!(found.surface.kind, SurfaceKind::Seat);
    room.push(Body::standing(DVec3::new(0.7, 0.7, -0.4), DVec3::new(0.7, 0.04, 0.6)));
    let found = scan(&room).table().cloned().unwrap();
    assert_eq!(found.surface.kind, SurfaceKind::Table, "the table is preferred");
}

#[test]
fn what_is_no_table_says_why() {
    let mut small = bare_room();
    small.push(Body::standing(DVec3::Y * 0.7, DVec3::new(0.2, 0.03, 0.2)));
    let finding = scan(&small);
    assert!(finding.table().is_none());
    assert!(
        refusals(&finding).iter().any(|refusal| matches!(refusal, Refusal::TooSmall { .. })),
        "{finding:#?}"
    );

    let mut full = bare_room();
    full.push(Body::standing(DVec3::Y * 0.7, DVec3::new(0.8, 0.04, 0.5)));
    for place in 0..24 {
        let foot = DVec3::new(f64::from(place % 6) * 0.13 - 0.325, 0.74, f64::from(place / 6) * 0.12 - 0.18);
        full.push(Body::standing(foot, DVec3::new(0.07, 0.05, 0.07)));
    }
    let finding = scan(&full);
    assert!(finding.table().is_none(), "{finding:#?}");
    assert!(
        refusals(&finding).iter().any(|refusal| matches!(refusal, Refusal::TooCluttered { .. })),
        "{finding:#?}"
    );

    let mut leaning = bare_room();
    leaning.push(table().leaning(14.0));
    let finding = scan(&leaning);
    assert!(finding.table().is_none(), "{finding:#?}");
    let tilted = refusals(&finding)
        .iter()
        .any(|refusal| matches!(refusal, Refusal::Tilted { degrees, .. } if (*degrees - 14.0).abs() < 1.0));
    assert!(tilted, "{finding:#?}");
}

#[test]
fn a_phones_few_points_with_gravity() {
    let mut room = bare_room();
    room.push(Body::standing(DVec3::Y * 0.4, DVec3::new(0.5, 0.05, 0.5)));
    room.push(Body::standing(DVec3::new(0.1, 0.45, 0.05), DVec3::new(0.12, 0.1, 0.12)));
    let cloud =
        Sensor { outliers: 0.05, ..Sensor::default() }.gather(&room, EYE, DVec3::Y * 0.4, 4000, 0.008);
    let finding = Finder::default().find(&cloud);
    let found = finding.table().unwrap_or_else(|| panic!("{finding:#?}"));
    assert_eq!(found.surface.kind, SurfaceKind::Seat);
    assert!((found.surface.plane.offset_m + 0.45).abs() < 0.01, "{found:?}");
}

#[test]
fn a_phones_few_points_without_gravity() {
    let sensor = Sensor { outliers: 0.05, ..Sensor::default() };
    let gathered = sensor.gather(&with_table(), EYE, TARGET, 6000, 0.008);
    let cloud = PointCloud::unorganised(gathered.points_m().to_vec()).seen_from(EYE);
    let finding = Finder::default().find(&cloud);
    assert_eq!(finding.up, Up { direction: DVec3::Y, source: UpSource::Axis });
    let found = finding.table().unwrap_or_else(|| panic!("{finding:#?}"));
    assert!((found.surface.plane.offset_m + 0.74).abs() < 0.01, "{found:?}");
}

#[test]
fn a_scan_whose_origin_is_on_the_floor() {
    let gathered = Sensor::default().gather(&with_table(), EYE, TARGET, 8000, 0.005);
    let cloud = PointCloud::unorganised(gathered.points_m().to_vec()).with_up(DVec3::Y);
    let finding = Finder::default().find(&cloud);
    let found = finding.table().unwrap_or_else(|| panic!("{finding:#?}"));
    assert!(found.surface.plane.normal.dot(DVec3::Y) > 0.99, "seen from above: {found:?}");
    assert!((found.surface.plane.offset_m + 0.74).abs() < 0.01, "{found:?}");
    assert_eq!(found.surface.kind, SurfaceKind::Table);
}

#[test]
fn a_room_keeps_its_surfaces_when_the_sensor_moves() {
    use std::time::Duration;

    use crate::placement::{PlaneSource, Scanner};

    let room = with_table();
    let mut scanner = Scanner::default();
    let mut names = Vec::new();
    for step in 0..4_u32 {
        let eye = EYE + DVec3::X * 0.15 * f64::from(step);
        let camera = room_from_camera(eye, TARGET);
        let sensor = Sensor { seed: step.into(), ..Sensor::default() };
        scanner.look(sensor.scan(&room, &camera).moved(&glam::DMat4::from(camera)));
        let surfaces = scanner.poll(Duration::from_millis(100 * u64::from(step))).unwrap();
        let tables: Vec<&Surface> =
            surfaces.iter().filter(|surface| surface.kind == SurfaceKind::Table).collect();
        assert_eq!(tables.len(), 1, "{tables:#?}");
        assert!(tables[0].plane.distance_m(DVec3::Y * 0.74).abs() < 0.003, "{:?}", tables[0].plane);
        names.push(tables[0].id);
    }
    assert!(names.iter().all(|name| *name == names[0]), "{names:?}");
    assert!(scanner.poll(Duration::from_secs(1)).is_none(), "nothing new");
}

#[test]
fn several_looks_make_one_table() {
    let looks: Vec<PointCloud> = [-0.9, 0.9]
        .map(|x| {
            // Each sees an end of the table only.
            let camera = room_from_camera(DVec3::new(x, 1.25, 0.75), DVec3::new(x * 0.8, 0.7, 0.0));
            Sensor::default().scan(&with_table(), &camera).moved(&glam::DMat4::from(camera))
        })
        .into();
    let alone = Finder::default().find(&looks[0]).table().unwrap().area_m2;
    let finding = Finder::default().find_in_all(&looks).unwrap();
    let table = &finding.table().unwrap().surface;
    assert!(table.plane.distance_m(DVec3::Y * 0.74).abs() < 0.003, "{table:?}");
    let across =
        |ends: fn(f64, f64) -> f64| table.outline_m.iter().map(|corner| corner.x).reduce(ends).unwrap();
    assert!(across(f64::max) - across(f64::min) > 1.15, "{table:?}, {alone} m² alone");
    assert!(Finder::default().find_in_all(&[]).is_none());
}

#[test]
fn the_same_cloud_gives_the_same_answer() {
    let cloud = Sensor::default().gather(&with_table(), EYE, TARGET, 3000, 0.01);
    assert_eq!(Finder::default().find(&cloud), Finder::default().find(&cloud));
}

#[test]
fn clouds_without_anything_in_them_are_no_failure() {
    let finder = Finder::default();
    for points in [
        vec![],
        vec![Vec3::NAN; 307_200],
        vec![Vec3::splat(f32::INFINITY); 100],
        vec![Vec3::ONE; 307_200],
        (0..5000).map(|step| Vec3::new(step as f32 * 0.001, 0.0, 1.0)).collect(),
        (0..5000).map(|step| Vec3::splat((step % 7) as f32 * 1e37)).collect(),
        vec![Vec3::splat(-3e38), Vec3::splat(3e38), Vec3::ONE, Vec3::X, Vec3::Y, Vec3::Z],
    ] {
        for columns in [0, 1, 640, 7] {
            let cloud = PointCloud::organised(points.clone(), columns);
            assert!(finder.find(&cloud).table().is_none());
            assert!(finder.find(&cloud.with_up(DVec3::Y)).table().is_none());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_points_give_finite_surfaces(
        points in prop::collection::vec(prop::array::uniform3(-2.0..2.0_f32), 0..600),
        columns in 0_usize..40,
    ) {
        let points = points.into_iter().map(Vec3::from_array).collect();
        let finding = Finder::default().find(&PointCloud::organised(points, columns));
        for found in finding.surfaces {
            prop_assert!(found.surface.plane.normal.is_normalized());
            prop_assert!(found.surface.outline_m.iter().all(|corner| corner.is_finite()));
            prop_assert!((0.0..=1.0).contains(&found.surface.confidence));
        }
    }

    #[test]
    fn the_table_is_found_from_wherever_one_stands(
        angle in -1.2..1.2_f64, height in 1.25..1.7_f64, away in 0.9..1.5_f64, seed in 0_u64..1000,
    ) {
        let eye = DVec3::new(angle.sin() * away, height, angle.cos() * away);
        let camera = room_from_camera(eye, TARGET);
        let cloud = Sensor { seed, ..Sensor::default() }.scan(&with_table(), &camera);
        let finding = Finder::default().find(&cloud);
        let truth = seen_plane(&table().top(), &camera);
        let Some(found) = finding.table() else { return Err(TestCaseError::fail(format!("{finding:#?}"))) };
        let degrees = found.surface.plane.normal.angle_between(truth.normal).to_degrees();
        prop_assert!(degrees < 0.3, "{degrees}");
        prop_assert!((found.surface.plane.offset_m - truth.offset_m).abs() < 0.003, "{found:?}");
    }
}
