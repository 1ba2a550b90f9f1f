//! Where each picture of a recording was taken from.
//!
//! Two forms are read, told apart by their first line: one pose a line as `x y z qx qy qz qw`, and the log of Open3D
//! and Redwood (three integers, then four lines of a 4×4 matrix). Both map camera to room.

use std::path::Path;

use glam::{DMat4, DQuat, DVec3, DVec4};

use super::{ScanError, bytes::Reader, error::Problem, read_bytes};

/// Reads the poses of a recording: room from camera (x right, y down, z forward), rigid.
///
/// # Errors
/// [`ScanError`] when the file cannot be read or a line is not a pose.
pub fn read_poses(path: &Path) -> Result<Vec<DMat4>, ScanError> {
    let bytes = read_bytes(path)?;
    parse(&bytes).map_err(|problem| problem.within(&path.display().to_string()))
}

fn parse(bytes: &[u8]) -> Result<Vec<DMat4>, Problem> {
    let mut reader = Reader::new(bytes);
    let mut poses = Vec::new();
    while let Some(line) = reader.line()? {
        if line.trim().is_empty() {
            continue;
        }
        let numbers = numbers(line, &reader)?;
        let pose = match numbers.as_slice() {
            [x, y, z, qx, qy, qz, qw] => {
                let turn = DQuat::from_xyzw(*qx, *qy, *qz, *qw);
                (turn.length() - 1.0)
                    .abs()
                    .lt(&1e-2)
                    .then(|| DMat4::from_rotation_translation(turn.normalize(), DVec3::new(*x, *y, *z)))
            }
            [_, _, _] => {
                let mut rows = [DVec4::ZERO; 4];
                for row in &mut rows {
                    let line = reader.line()?.unwrap_or_default();
                    let [a, b, c, d] = *self::numbers(line, &reader)?.as_slice() else {
                        return Err(Problem::at(reader.here(), "four numbers of a pose's matrix expected"));
                    };
                    *row = DVec4::new(a, b, c, d);
                }
                let [a, b, c, d] = rows;
                Some(DMat4::from_cols(a, b, c, d).transpose())
            }
            _ => None,
        };
        let pose = pose.filter(is_rigid).ok_or_else(|| {
            Problem::at(
                reader.here(),
                "`x y z qx qy qz qw` or a rigid 4×4 matrix after three integers expected",
            )
        })?;
        poses.push(pose);
    }
    Ok(poses)
}

fn is_rigid(pose: &DMat4) -> bool {
    let turn = glam::DMat3::from_mat4(*pose);
    let skew = turn * turn.transpose() - glam::DMat3::IDENTITY;
    pose.is_finite()
        && skew.abs_diff_eq(glam::DMat3::ZERO, 1e-2)
        && turn.determinant() > 0.0
        && pose.row(3).distance(DVec4::W) < 1e-6
}

fn numbers(line: &str, reader: &Reader<'_>) -> Result<Vec<f64>, Problem> {
    line.split([' ', '\t', ','])
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().map_err(|_| Problem::at(reader.here(), format!("`{word}` is not a number"))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_and_nonsense_is_named() {
        let by_turn = parse(b"1 2 3 0 0 0.7071068 0.7071068\n").unwrap();
        let by_matrix = parse(b"0 0 1\n0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n").unwrap();
        assert!(by_turn[0].abs_diff_eq(by_matrix[0], 1e-6), "{by_turn:?} {by_matrix:?}");
        for wrong in [
            "1 2 3\n1 0 0 0\n",
            "1 2 3 0 0 0 0\n",
            "a b c\n",
            "1 2\n",
            "0 0 1\n2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
        ] {
            assert!(parse(wrong.as_bytes()).is_err(), "{wrong}");
        }
    }
}
