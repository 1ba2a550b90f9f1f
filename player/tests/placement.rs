//! The finder on recordings that other people made, where they are at hand (`../shared`): accuracy, choice, speed, and
//! rooms in which there is no table. The figures of the finder's constants were set while looking at these recordings;
//! the rooms of `placement::synthetic` are the independent measure.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use glam::{DMat4, DVec3};
use player::{
    placement::{
        Finder, Finding, Intrinsics, PlaneSource, PointCloud, Refusal, Scanner, Surface, SurfaceKind,
    },
    scan::{read_cloud, read_depth, read_poses},
};

/// The recordings, or `None` with the reason printed.
fn recordings(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/planes").join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: {} is not there", folder.display());
    None
}

fn find(cloud: &PointCloud) -> Finding {
    Finder::default().find(cloud)
}

#[test]
fn the_table_under_clutter_is_found_to_half_a_degree_and_3_mm() {
    let Some(folder) = recordings("mosd") else { return };
    let text = std::fs::read_to_string(folder.join("planes.json")).unwrap();
    let truth: serde_json::Map<String, serde_json::Value> = serde_json::from_str(&text).unwrap();
    for (name, plane) in truth {
        let file = folder.join(Path::new(&name).file_name().unwrap());
        if !file.is_file() {
            println!("skipped: {} is not there", file.display());
            continue;
        }
        let finding = find(&read_cloud(&file).unwrap());
        let found = finding.table().unwrap_or_else(|| panic!("{name}: {finding:#?}"));
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let normal = DVec3::from_array(std::array::from_fn(|axis| number(&plane["n"][axis])));
        let angle_deg = found.surface.plane.normal.angle_between(normal).to_degrees();
        let offset_mm = (found.surface.plane.offset_m - number(&plane["d"])).abs() * 1e3;
        println!("{name}: angle_deg {angle_deg:.3}, offset_mm {offset_mm:.2}");
        assert!(angle_deg <= 0.5 && offset_mm <= 3.0, "{name}: {angle_deg} degrees, {offset_mm} mm");
    }
}

#[test]
fn the_seat_is_chosen_over_the_floor() {
    let Some(folder) = recordings("arcore") else { return };
    for (name, seat_m, floor_m) in [("input1_pc.ply", -0.823, -1.259), ("input2_pc.ply", -0.596, -1.063)] {
        let cloud = read_cloud(&folder.join("pointcloud").join(name)).unwrap();
        // The phone's frame is level with y up; the finder sees that for itself.
        assert!(find(&cloud).table().is_some(), "{name}");
        let finding = find(&cloud.with_up(DVec3::Y));
        let found = finding.table().unwrap_or_else(|| panic!("{name}: {finding:#?}"));
        let height_m = -found.surface.plane.offset_m;
        println!("{name}: {height_m:.4} m, {seat_m} expected");
        assert_eq!(found.surface.kind, SurfaceKind::Seat, "{name}");
        assert!((height_m - seat_m).abs() < 0.02, "{name}: {height_m}");
        let floor = |surface: &Surface| {
            surface.kind == SurfaceKind::Floor && (surface.plane.offset_m + floor_m).abs() < 0.03
        };
        assert!(finding.surfaces.iter().any(|found| floor(&found.surface)), "{name}: {finding:#?}");
    }
}

#[test]
fn cartons_on_the_floor_are_no_table() {
    let Some(folder) = recordings("pcl") else { return };
    let finding = find(&read_cloud(&folder.join("milk_cartoon_all_small_clorox.pcd")).unwrap());
    assert!(finding.table().is_none(), "{finding:#?}");
    let why = finding.surfaces.iter().find_map(|found| found.refusal);
    assert!(matches!(why, Some(Refusal::NotSeenRaised { .. })), "{why:?}");
}

#[test]
fn a_chair_on_a_floor_is_no_table() {
    let Some(folder) = recordings("rgbd/open3d/redwood") else { return };
    let camera = Intrinsics { focal_px: [525.0; 2], centre_px: [319.5, 239.5] };
    for view in 0..5 {
        let picture = read_depth(&folder.join(format!("depth/0000{view}.png")), 1e-3).unwrap();
        let finding = find(&PointCloud::from_depth(&picture, &camera));
        assert!(finding.table().is_none(), "view {view}: {finding:#?}");
    }
}

/// The five views of the dining room, in the frame of its poses.
fn dining_room() -> Option<Vec<PointCloud>> {
    let folder = recordings("rgbd/slambook/dining")?;
    let camera = Intrinsics { focal_px: [518.0, 519.0], centre_px: [325.5, 253.5] };
    let poses: Vec<DMat4> = read_poses(&folder.join("pose.txt")).unwrap();
    let views = poses.iter().enumerate().map(|(view, pose)| {
        let picture = read_depth(&folder.join(format!("depth/{}.pgm", view + 1)), 1e-3).unwrap();
        PointCloud::from_depth(&picture, &camera).moved(pose)
    });
    Some(views.collect())
}

#[test]
fn the_dining_table_keeps_its_name_while_the_camera_turns_away() {
    let Some(views) = dining_room() else { return };
    let found = find(&views[0]).table().cloned().unwrap();
    assert_eq!(found.surface.kind, SurfaceKind::Table);
    assert!((found.height_m.unwrap() - 0.75).abs() < 0.02, "{found:?}");
    let mut scanner = Scanner::default();
    let mut table: Option<Surface> = None;
    for (view, cloud) in views.into_iter().enumerate() {
        scanner.look(cloud);
        let surfaces = scanner.poll(Duration::from_millis(200 * view as u64)).unwrap();
        let wanted = found.surface.plane.project(found.surface.outline_m[0]);
        let here = |surface: &&Surface| {
            surface.kind == SurfaceKind::Table && surface.plane.distance_m(wanted).abs() < 0.06
        };
        let seen = surfaces.iter().filter(here).max_by(|a, b| a.confidence.total_cmp(&b.confidence));
        let seen = seen.unwrap_or_else(|| panic!("view {view}: {surfaces:#?}"));
        let named = table.get_or_insert_with(|| seen.clone());
        assert_eq!(named.id, seen.id, "view {view}");
    }
}
