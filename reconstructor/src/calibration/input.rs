//! The correspondences of one frame: read from a file, and checked before anything is solved from them.

use std::{io::Read, path::Path};

use glam::{DVec2, DVec3};
use protocol::pitch::Pitch;
use serde::{Deserialize, Serialize};

use super::CalibrationError;

/// Most bytes of a correspondence file.
const MAX_FILE_BYTES: u64 = 1 << 20;
/// Farther than this from the centre mark, a point is a mistake.
const FARTHEST_M: f64 = 200.0;
/// A point within this height of the pitch counts as on it.
pub(super) const ON_PITCH_M: f64 = 1e-3;
/// Points closer than this to one line, root mean square, count as on it.
const LEAST_SPREAD_M: f64 = 0.5;
/// The same in the picture.
const LEAST_SPREAD_PX: f64 = 3.0;

/// A point of the pitch or the goals that was found in a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Correspondence {
    /// For messages; free text.
    #[serde(default)]
    pub name: String,
    /// Where it is in the picture, pixels.
    pub pixel: DVec2,
    /// Where it is in the world, metres.
    pub world_m: DVec3,
}

/// What is given by hand: points of one frame and the size of the pitch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Index of the frame in the whole clip.
    #[serde(default)]
    pub frame: u32,
    /// Size of the pitch; 105 × 68 m when not given.
    #[serde(default)]
    pub pitch: Pitch,
    /// The points, 4 or more of them on the pitch plane.
    pub points: Vec<Correspondence>,
}

/// Whether a match can be played on a pitch of this size: length 40 to 150 m, width 30 to 110 m.
#[must_use]
pub fn is_possible(pitch: &Pitch) -> bool {
    (40.0..=150.0).contains(&pitch.length_m) && (30.0..=110.0).contains(&pitch.width_m)
}

/// A file of at most `limit_bytes`.
pub(super) fn read_file(path: &Path, limit_bytes: u64) -> Result<Vec<u8>, CalibrationError> {
    let read = |source| CalibrationError::Read { path: path.into(), source };
    let file = std::fs::File::open(path).map_err(read)?;
    let mut bytes = Vec::new();
    file.take(limit_bytes + 1).read_to_end(&mut bytes).map_err(read)?;
    if bytes.len() as u64 > limit_bytes {
        return Err(CalibrationError::TooLarge { path: path.into(), limit_bytes });
    }
    Ok(bytes)
}

impl Calibration {
    /// Reads a `--calibration` file.
    ///
    /// # Errors
    /// When it cannot be read or is not a correspondence file. The points are checked when they are used.
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        Self::parse(path, &read_file(path, MAX_FILE_BYTES)?)
    }

    /// As [`read`](Self::read), of a file's bytes.
    pub(super) fn parse(path: &Path, text: &[u8]) -> Result<Self, CalibrationError> {
        serde_json::from_slice(text).map_err(|source| CalibrationError::Parse { path: path.into(), source })
    }

    /// Whether the points can fix a camera of pictures of this size.
    ///
    /// # Errors
    /// Names the first thing that is wrong with them.
    pub fn check(&self, width_px: u32, height_px: u32) -> Result<(), CalibrationError> {
        let Pitch { length_m, width_m } = self.pitch;
        if !is_possible(&self.pitch) {
            return Err(CalibrationError::BadPitch { length_m, width_m });
        }
        for (index, point) in self.points.iter().enumerate() {
            let name = point.name.clone();
            if !point.pixel.is_finite() || !point.world_m.is_finite() || point.world_m.length() > FARTHEST_M {
                return Err(CalibrationError::BadPoint { index, name });
            }
            let DVec2 { x, y } = point.pixel;
            let inside = |value: f64, side: u32| value >= -0.5 && value <= f64::from(side) - 0.5;
            if !inside(x, width_px) || !inside(y, height_px) {
                let (width, height) = (width_px, height_px);
                return Err(CalibrationError::OutsidePicture { index, name, x, y, width, height });
            }
        }
        let (world, pixels): (Vec<DVec2>, Vec<DVec2>) = self.on_pitch().unzip();
        if world.len() < 4 {
            return Err(CalibrationError::TooFewPoints { given: world.len() });
        }
        if nearly_on_one_line(&world, LEAST_SPREAD_M) {
            return Err(CalibrationError::Collinear { where_: "in the world" });
        }
        if nearly_on_one_line(&pixels, LEAST_SPREAD_PX) {
            return Err(CalibrationError::Collinear { where_: "in the picture" });
        }
        Ok(())
    }

    /// The points of the pitch plane: (world x, world z) and pixel.
    pub(super) fn on_pitch(&self) -> impl Iterator<Item = (DVec2, DVec2)> {
        let flat = self.points.iter().filter(|point| point.world_m.y.abs() <= ON_PITCH_M);
        flat.map(|point| (DVec2::new(point.world_m.x, point.world_m.z), point.pixel))
    }
}

/// Whether the points, after taking away the one that helps most, are within `tolerance` of a line.
fn nearly_on_one_line(points: &[DVec2], tolerance: f64) -> bool {
    (0..points.len()).any(|left_out| {
        let rest: Vec<DVec2> =
            points.iter().enumerate().filter(|&(i, _)| i != left_out).map(|(_, &point)| point).collect();
        spread_across(&rest) < tolerance
    })
}

/// Root mean square distance of the points from their best line.
fn spread_across(points: &[DVec2]) -> f64 {
    let n = points.len().max(1) as f64;
    let mean = points.iter().sum::<DVec2>() / n;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for d in points.iter().map(|&point| point - mean) {
        xx += d.x * d.x / n;
        xy += d.x * d.y / n;
        yy += d.y * d.y / n;
    }
    let (half_trace, determinant) = ((xx + yy) / 2.0, xx * yy - xy * xy);
    let least = half_trace - (half_trace * half_trace - determinant).max(0.0).sqrt();
    least.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(points: &[(f64, f64, f64, f64)]) -> Calibration {
        let points = points
            .iter()
            .map(|&(px, py, x, z)| Correspondence {
                name: String::new(),
                pixel: DVec2::new(px, py),
                world_m: DVec3::new(x, 0.0, z),
            })
            .collect();
        Calibration { frame: 0, pitch: Pitch::default(), points }
    }

    const GOOD: [(f64, f64, f64, f64); 4] = [
        (500.0, 200.0, 0.0, -34.0),
        (510.0, 500.0, 0.0, 9.15),
        (200.0, 400.0, -9.15, 0.0),
        (800.0, 390.0, 9.15, 0.0),
    ];

    #[test]
    fn four_points_in_general_position_are_enough() {
        given(&GOOD).check(1280, 720).unwrap();
    }

    #[test]
    fn too_few_collinear_and_outside_points_are_told_apart() {
        let check = |points: &[_]| given(points).check(1280, 720).unwrap_err();
        assert!(matches!(check(&GOOD[..3]), CalibrationError::TooFewPoints { given: 3 }));
        let mut line = GOOD;
        line[2].2 = 0.0;
        assert!(matches!(check(&line), CalibrationError::Collinear { where_: "in the world" }));
        let mut twice = GOOD;
        twice[3] = twice[2];
        assert!(matches!(check(&twice), CalibrationError::Collinear { .. }));
        let mut flat = GOOD;
        for point in &mut flat {
            point.1 = 300.0;
        }
        assert!(matches!(check(&flat), CalibrationError::Collinear { where_: "in the picture" }));
        let mut outside = GOOD;
        outside[1].0 = 1280.0;
        assert!(matches!(check(&outside), CalibrationError::OutsidePicture { index: 1, .. }));
        let mut wild = GOOD;
        wild[0].3 = f64::NAN;
        assert!(matches!(check(&wild), CalibrationError::BadPoint { index: 0, .. }));
        let mut pitch = given(&GOOD);
        pitch.pitch.width_m = -3.0;
        assert!(matches!(pitch.check(1280, 720), Err(CalibrationError::BadPitch { .. })));
    }

    #[test]
    fn files_are_read_and_bad_ones_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.json");
        assert!(matches!(Calibration::read(&path), Err(CalibrationError::Read { .. })));
        std::fs::write(&path, r#"{"frame":7,"points":[{"pixel":[1,2],"world_m":[0,0,-34]}]}"#).unwrap();
        let read = Calibration::read(&path).unwrap();
        assert_eq!((read.frame, read.pitch, read.points.len()), (7, Pitch::default(), 1));
        for bad in
            ["", "[]", r#"{"points":[{"pixel":[1],"world_m":[0,0,0]}]}"#, r#"{"points":[{"pixel":["a",2]}]}"#]
        {
            std::fs::write(&path, bad).unwrap();
            assert!(matches!(Calibration::read(&path), Err(CalibrationError::Parse { .. })), "{bad}");
        }
        std::fs::write(&path, vec![b' '; 2 << 20]).unwrap();
        assert!(matches!(Calibration::read(&path), Err(CalibrationError::TooLarge { .. })));
    }
}
