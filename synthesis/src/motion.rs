//! Recorded motion: short clips of joint rotations, sampled, blended and mirrored into poses.
//! Frame: the body's own (y up, looking along +z, left at +x); rotations are relative to the parent joint.

use std::path::Path;

use glam::Quat;
use serde::Deserialize;

use crate::{SynthesisError, packed::Packed};

const SHIPPED: &[u8] = include_bytes!("../../assets/people/motions.bin");

/// How many joints a pose rotates.
pub const JOINTS: usize = 13;

/// The joints of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
#[allow(missing_docs)] // the names say it
pub enum Joint {
    Pelvis,
    Chest,
    Neck,
    ThighR,
    CalfR,
    FootR,
    UpperArmR,
    LowerArmR,
    ThighL,
    CalfL,
    FootL,
    UpperArmL,
    LowerArmL,
}

/// Parent of each joint.
pub const PARENTS: [Option<usize>; JOINTS] = [
    None,
    Some(0),
    Some(1),
    Some(0),
    Some(3),
    Some(4),
    Some(1),
    Some(6),
    Some(0),
    Some(8),
    Some(9),
    Some(1),
    Some(11),
];

/// Which joint is on the other side.
const MIRROR: [usize; JOINTS] = [0, 1, 2, 8, 9, 10, 11, 12, 3, 4, 5, 6, 7];

/// A pose of the body, without its place on the pitch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Rotation of each joint relative to its parent.
    pub rotations: [Quat; JOINTS],
    /// How high the lowest point of the body is above the ground, metres; 0 while a foot stands.
    pub clearance_m: f32,
    /// How far the toes of the left and right foot bend up against the foot, radians.
    pub toes: [f32; 2],
}

impl Default for Pose {
    fn default() -> Self {
        Self { rotations: [Quat::IDENTITY; JOINTS], clearance_m: 0.0, toes: [0.0; 2] }
    }
}

impl Pose {
    /// The pose `share` of the way to `other`.
    #[must_use]
    pub fn blend(&self, other: &Self, share: f32) -> Self {
        let mut rotations = self.rotations;
        for (rotation, &end) in rotations.iter_mut().zip(&other.rotations) {
            *rotation = rotation.lerp(end, share);
        }
        let mix = |a: f32, b: f32| a + (b - a) * share;
        Self {
            rotations,
            clearance_m: mix(self.clearance_m, other.clearance_m),
            toes: [0, 1].map(|side| mix(self.toes[side], other.toes[side])),
        }
    }

    /// The same pose with left and right exchanged.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let mut rotations = self.rotations;
        for (joint, &other) in MIRROR.iter().enumerate() {
            let q = self.rotations[other];
            rotations[joint] = Quat::from_xyzw(q.x, -q.y, -q.z, q.w);
        }
        Self { rotations, clearance_m: self.clearance_m, toes: [self.toes[1], self.toes[0]] }
    }

    /// The rotation of a joint, to change.
    pub fn joint(&mut self, joint: Joint) -> &mut Quat {
        &mut self.rotations[joint as usize]
    }

    /// Turns the whole pose so that it faces +z: the clips drift in heading.
    #[must_use]
    pub fn facing_ahead(&self) -> Self {
        let forward = self.rotations[0] * glam::Vec3::Z;
        let mut pose = *self;
        if forward.x.hypot(forward.z) > 0.3 {
            pose.rotations[0] = Quat::from_rotation_y(-forward.x.atan2(forward.z)) * pose.rotations[0];
        }
        pose
    }
}

#[derive(Debug, Deserialize)]
struct Header {
    clips: Vec<ClipHeader>,
}

#[derive(Debug, Deserialize)]
struct ClipHeader {
    name: String,
    first: usize,
    frames: usize,
    frame_seconds: f32,
    loops: bool,
    travel_m: f32,
}

/// One recorded clip.
#[derive(Clone, Debug)]
pub struct Clip {
    /// Its name in the source.
    pub name: String,
    /// Whether the end joins the start; then phase 0 is the left foot furthest ahead.
    pub loops: bool,
    /// How far the body travels in one pass, metres.
    pub travel_m: f32,
    /// How long one pass takes, seconds.
    pub seconds: f32,
    poses: Vec<Pose>,
}

impl Clip {
    /// The pose at a share 0..1 of the pass; a looping clip wraps, another one holds its ends.
    #[must_use]
    pub fn pose(&self, phase: f32) -> Pose {
        let count = self.poses.len();
        let place = if self.loops {
            phase.rem_euclid(1.0) * count as f32
        } else {
            phase.clamp(0.0, 1.0) * (count - 1) as f32
        };
        let first = (place as usize).min(count - 1);
        let next = if self.loops { (first + 1) % count } else { (first + 1).min(count - 1) };
        self.poses[first].blend(&self.poses[next], place - first as f32)
    }
}

/// A set of clips.
#[derive(Clone, Debug)]
pub struct Motions {
    clips: Vec<Clip>,
}

impl Motions {
    /// The clips that come with the program.
    pub fn shipped() -> Result<Self, SynthesisError> {
        Self::from_bytes(SHIPPED, "motions.bin")
    }

    /// The clips of a file that `training/bake_people.py --all-motions` wrote.
    pub fn open(path: &Path) -> Result<Self, SynthesisError> {
        let bytes = std::fs::read(path).map_err(|source| SynthesisError::Io {
            path: path.to_owned(),
            doing: "read",
            source,
        })?;
        Self::from_bytes(&bytes, &path.display().to_string())
    }

    fn from_bytes(bytes: &[u8], what: &str) -> Result<Self, SynthesisError> {
        let broken = |reason: &str| SynthesisError::Asset { what: what.into(), reason: reason.into() };
        let packed = Packed::<Header>::read(bytes, b"HPMOVE1\0", what)?;
        const COLUMNS: usize = JOINTS * 4;
        // The baked shape is (frames, joints, 4); its rows are read as one.
        let rotations = packed.i16_rows::<COLUMNS>("rotations")?;
        let clearances = packed.f32_rows::<1>("clearances")?;
        let mut clips = Vec::new();
        for clip in &packed.header.clips {
            let range = clip.first..clip.first.saturating_add(clip.frames);
            let (Some(rotations), Some(clearances)) = (rotations.get(range.clone()), clearances.get(range))
            else {
                return Err(broken("a clip reaches past the end of the frames"));
            };
            let sensible = clip.frames >= 2 && clip.frame_seconds > 0.0 && clip.travel_m.is_finite();
            if !sensible || clearances.iter().flatten().any(|c| !c.is_finite()) {
                return Err(broken("a clip is empty or holds values that are not finite"));
            }
            let poses = rotations.iter().zip(clearances).map(|(row, &[clearance_m])| {
                let mut pose = Pose { clearance_m, ..Pose::default() };
                for (rotation, q) in pose.rotations.iter_mut().zip(row.as_chunks::<4>().0) {
                    let [w, x, y, z] = q.map(f32::from);
                    let q = Quat::from_xyzw(x, y, z, w);
                    *rotation = if q.length_squared() > 0.0 { q.normalize() } else { Quat::IDENTITY };
                }
                pose
            });
            clips.push(Clip {
                name: clip.name.clone(),
                loops: clip.loops,
                travel_m: clip.travel_m,
                seconds: clip.frame_seconds * (clip.frames - usize::from(!clip.loops)) as f32,
                poses: poses.collect(),
            });
        }
        Ok(Self { clips })
    }

    /// The clip of a name.
    pub fn clip(&self, name: &str) -> Result<&Clip, SynthesisError> {
        self.clips.iter().find(|clip| clip.name == name).ok_or_else(|| SynthesisError::Asset {
            what: "motions".into(),
            reason: format!("the clip `{name}` is missing; bake it again"),
        })
    }

    /// Every clip.
    #[must_use]
    pub fn clips(&self) -> &[Clip] {
        &self.clips
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirroring_twice_changes_nothing() {
        let pose = Motions::shipped().unwrap().clip("run").unwrap().pose(0.3);
        let twice = pose.mirrored().mirrored();
        for (a, b) in pose.rotations.iter().zip(&twice.rotations) {
            assert!(a.angle_between(*b) < 1e-3);
        }
        let swapped = pose.mirrored().rotations[Joint::CalfL as usize];
        assert!(
            swapped.angle_between(pose.rotations[Joint::CalfL as usize]) > 0.05,
            "run is not symmetric at 0.3"
        );
    }

    #[test]
    fn a_looping_clip_is_smooth_where_it_wraps() {
        for name in ["run", "walk"] {
            let motions = Motions::shipped().unwrap();
            let clip = motions.clip(name).unwrap();
            let step = 1.0 / clip.poses.len() as f32;
            let change = |phase: f32| {
                let (a, b) = (clip.pose(phase), clip.pose(phase + step));
                a.rotations.iter().zip(&b.rotations).map(|(a, b)| a.angle_between(*b)).fold(0.0, f32::max)
            };
            let usual = (0..20).map(|i| change(i as f32 / 20.0)).fold(0.0, f32::max);
            assert!(change(1.0 - step) <= usual * 1.5, "{name} jumps at its end");
        }
    }

    #[test]
    fn a_truncated_file_is_refused() {
        for length in [0, 9, 300, SHIPPED.len() / 2, SHIPPED.len() - 9] {
            assert!(Motions::from_bytes(&SHIPPED[..length], "test").is_err(), "{length} bytes were accepted");
        }
    }
}
