//! Clouds written here, whole and damaged.

use std::path::PathBuf;

use glam::Vec3;

use super::*;

const PCD_HEADER: &str = "# .PCD v0.7\nVERSION 0.7\nFIELDS label x y z\nSIZE 4 4 4 4\nTYPE U F F F\nCOUNT 1 1 1 1\n\
                          WIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 1 1 0 0 0\nPOINTS 4\n";

fn points() -> [Vec3; 4] {
    [Vec3::new(1.0, 2.0, 3.0), Vec3::new(-1.0, 0.5, 2.0), Vec3::new(0.25, 0.0, 1.0), Vec3::new(4.0, 5.0, 6.0)]
}

fn pcd_binary() -> Vec<u8> {
    let mut bytes = format!("{PCD_HEADER}DATA binary\n").into_bytes();
    for (index, point) in points().iter().enumerate() {
        bytes.extend((index as u32).to_le_bytes());
        bytes.extend(point.to_array().iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

fn pcd_compressed() -> Vec<u8> {
    let mut body: Vec<u8> = (0_u32..4).flat_map(u32::to_le_bytes).collect();
    for axis in 0..3 {
        body.extend(points().iter().flat_map(|point| point[axis].to_le_bytes()));
    }
    // Literal runs only: valid LZF.
    let packed: Vec<u8> = body
        .chunks(32)
        .flat_map(|run| std::iter::once(run.len() as u8 - 1).chain(run.iter().copied()))
        .collect();
    let mut bytes = format!("{PCD_HEADER}DATA binary_compressed\n").into_bytes();
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend((body.len() as u32).to_le_bytes());
    bytes.extend(packed);
    bytes
}

fn pcd_ascii() -> Vec<u8> {
    let lines: String = points().iter().map(|p| format!("7 {} {} {}\n", p.x, p.y, p.z)).collect();
    format!("{PCD_HEADER}DATA ascii\n{lines}").into_bytes()
}

fn ply(format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment by hand\nelement camera 1\nproperty list uchar float k\nelement vertex 4\n\
         property double x\nproperty uchar red\nproperty float y\nproperty float z\nend_header\n"
    )
    .into_bytes();
    let big = format.ends_with("big_endian");
    let float = |value: f32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
    let double = |value: f64| if big { value.to_be_bytes() } else { value.to_le_bytes() };
    if format == "ascii" {
        bytes.extend(b"2 0.5 0.5\n");
        for point in points() {
            // 303 does not fit its type; phones write it all the same.
            bytes.extend(format!("{} 303 {} {}\n", point.x, point.y, point.z).into_bytes());
        }
    } else {
        bytes.push(2);
        bytes.extend(float(0.5));
        bytes.extend(float(0.5));
        for point in points() {
            bytes.extend(double(point.x.into()));
            bytes.push(200);
            bytes.extend(float(point.y));
            bytes.extend(float(point.z));
        }
    }
    bytes
}

fn write(folder: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn all_files() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("binary.pcd", pcd_binary()),
        ("compressed.pcd", pcd_compressed()),
        ("ascii.pcd", pcd_ascii()),
        ("ascii.ply", ply("ascii")),
        ("little.ply", ply("binary_little_endian")),
        ("big.ply", ply("binary_big_endian")),
    ]
}

#[test]
fn every_form_gives_the_same_points() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in all_files() {
        let cloud = read_cloud(&write(&folder, name, &bytes)).unwrap();
        assert_eq!(cloud.points_m(), points(), "{name}");
        assert_eq!(cloud.layout(), name.ends_with("pcd").then_some((2, 2)), "{name}");
    }
}

#[test]
fn every_cut_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in all_files() {
        // The last number of an ascii file may lose digits unnoticed.
        let lost = if name.starts_with("ascii") { 3 } else { 1 };
        for length in 0..=bytes.len() - lost {
            let path = write(&folder, name, &bytes[..length]);
            let error = read_cloud(&path).expect_err(&format!("{name} cut to {length}"));
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}

#[test]
fn every_changed_byte_is_read_or_refused_without_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in all_files() {
        for at in 0..bytes.len() {
            for value in [0_u8, b'9', 255] {
                let mut changed = bytes.clone();
                changed[at] = value;
                let _ = read_cloud(&write(&folder, name, &changed));
            }
        }
    }
}

#[test]
fn counts_beyond_the_bytes_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let text = String::from_utf8(pcd_ascii()).unwrap();
    let huge = text.replace("WIDTH 2", "WIDTH 25000000").replace("POINTS 4", "POINTS 50000000");
    assert!(read_cloud(&write(&folder, "a.pcd", huge.as_bytes())).is_err());
    let huge = "ply\nformat ascii 1.0\nelement nothing 50000000\nelement vertex 1\nend_header\n";
    assert!(read_cloud(&write(&folder, "a.ply", huge.as_bytes())).is_err());
    assert!(read_cloud(&write(&folder, "a.xyz", b"0 0 0")).unwrap_err().to_string().contains(".pcd or .ply"));
}
