//! Scans of a room on disk: point clouds, depth pictures, the poses they were taken from. Every count is held against
//! the bytes at hand before memory is taken; a damaged file is a [`ScanError`] that names the place.

mod bytes;
mod depth;
mod error;
mod lzf;
mod pcd;
mod ply;
mod poses;
mod room;

use std::path::Path;

use glam::Vec3;

use crate::placement::PointCloud;

pub use depth::read_depth;
pub use error::ScanError;
pub use poses::read_poses;
pub use room::{RecordedRoom, RoomError, SequenceView, read_sequence};

/// Most points of a cloud.
pub const MOST_POINTS: usize = 50_000_000;

/// Most bytes of a file.
const MOST_BYTES: u64 = 2 << 30;

/// Reads a point cloud, PCD or PLY by its name, in the axes of the file.
///
/// # Errors
/// [`ScanError`] when the file cannot be read or is damaged.
pub fn read_cloud(path: &Path) -> Result<PointCloud, ScanError> {
    cloud_of(path, &read_bytes(path)?)
}

/// The cloud in the bytes of a file.
fn cloud_of(path: &Path, bytes: &[u8]) -> Result<PointCloud, ScanError> {
    let read = match extension(path).as_str() {
        "pcd" => pcd::read,
        "ply" => ply::read,
        other => {
            return Err(ScanError::Unsupported {
                file: path.display().to_string(),
                what: format!("a point cloud named .{other}"),
                advice: "give a .pcd or .ply file",
            });
        }
    };
    read(bytes).map_err(|problem| problem.within(&path.display().to_string()))
}

/// All bytes of a file that is not too large.
fn read_bytes(path: &Path) -> Result<Vec<u8>, ScanError> {
    let file = || path.display().to_string();
    let bytes = std::fs::metadata(path).map_err(|problem| ScanError::Read { file: file(), problem })?.len();
    if bytes > MOST_BYTES {
        return Err(ScanError::TooLarge { file: file(), bytes, limit: MOST_BYTES });
    }
    std::fs::read(path).map_err(|problem| ScanError::Read { file: file(), problem })
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

/// The numbers in three columns of a line of text.
fn point_of_line(line: &str, columns: [usize; 3]) -> Result<Vec3, String> {
    let mut point = [f32::NAN; 3];
    let mut found = 0;
    for (index, word) in line.split_whitespace().enumerate() {
        for (column, slot) in columns.iter().zip(&mut point) {
            if *column == index {
                *slot = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
                found += 1;
            }
        }
        if found == 3 {
            return Ok(Vec3::from_array(point));
        }
    }
    Err("fewer numbers than the header announces".into())
}

#[cfg(test)]
mod tests;
