//! `player place`: what it prints, exit codes, one-line errors.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{
    fmt::Write,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;

fn place(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_player"))
        .arg("place")
        .args(arguments)
        .output()
        .expect("the player starts")
}

/// A table (or only a floor) 0.6 m under a camera that looks down at 45 degrees; beyond the table lies a floor 0.7 m lower.
fn scene(folder: &Path, has_table: bool) -> PathBuf {
    let (columns, rows) = (160_usize, 120_usize);
    let mut text = format!(
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {columns}\nHEIGHT {rows}\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
        columns * rows
    );
    let slope = std::f64::consts::FRAC_1_SQRT_2;
    for index in 0..columns * rows {
        let x = ((index % columns) as f64 - 79.5) / 131.0;
        let y = ((index / columns) as f64 - 59.5) / 131.0;
        // Up is (0, −slope, −slope) in camera axes.
        let sinks = slope * (y + 1.0);
        let at = |height: f64| height / sinks;
        let near = at(0.6);
        let ahead_m = near * slope * (1.0 - y);
        let is_table = has_table && (x * near).abs() < 0.5 && ahead_m < 0.9;
        let depth = if is_table { near } else { at(if has_table { 1.3 } else { 0.6 }) };
        writeln!(text, "{} {} {}", x * depth, y * depth, depth).unwrap();
    }
    let path = folder.join(if has_table { "table.pcd" } else { "floor.pcd" });
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn the_table_is_printed_in_the_axes_of_the_scan() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), true);
    let output = place(&["--cloud", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let table = &report["table"];
    let normal: Vec<f64> = table["normal"].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect();
    let slope = std::f64::consts::FRAC_1_SQRT_2;
    for (found, wanted) in normal.iter().zip([0.0, -slope, -slope]) {
        assert!((found - wanted).abs() < 1e-3, "{normal:?}");
    }
    assert!((table["offset_m"].as_f64().unwrap() - 0.6).abs() < 1e-3, "{table}");
    assert!(table["polygon"].as_array().unwrap().len() >= 4, "{table}");
    assert!(table["confidence"].as_f64().unwrap() > 0.3, "{table}");
    assert!(report["planes"].as_array().unwrap().len() >= 2, "{report}");
    assert!(report["find_ms"].as_f64().unwrap() > 0.0);
}

#[test]
fn no_table_is_no_failure_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene(folder.path(), false);
    let json = folder.path().join("found.json");
    let output = place(&["--cloud", path.to_str().unwrap(), "--json", json.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let report: Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    assert!(report["table"].is_null(), "{report}");
    assert_eq!(report["rejected"][0]["reason"], "not_seen_raised", "{report}");
}

#[test]
fn bad_scans_are_one_line_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(scene(folder.path(), true)).unwrap();
    let cut = folder.path().join("cut.pcd");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let empty = folder.path().join("empty.ply");
    std::fs::write(&empty, "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n").unwrap();
    for path in [cut.as_path(), empty.as_path(), Path::new("no-such-scan.pcd"), Path::new("picture.jpg")] {
        let name = path.to_str().unwrap();
        let output = place(&["--cloud", name]);
        assert_eq!(output.status.code(), Some(1), "{name}");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(text.contains(name), "{text}");
    }
}

#[test]
fn wrong_usage_is_exit_code_2() {
    for arguments in [
        &[][..],
        &["--depth", "depth.png"],
        &["--cloud", "a.pcd", "--depth", "b.png", "--intrinsics", "1,1,1,1"],
        &["--cloud", "a.pcd", "--up", "0,0,0"],
        &["--depth", "a.png", "--intrinsics", "0,1,2,3"],
        &["--depth", "a.png", "--intrinsics", "5,5,5,5", "--depth-scale", "0"],
    ] {
        assert_eq!(place(arguments).status.code(), Some(2), "{arguments:?}");
    }
}
