//! The human body: MakeHuman's base mesh with a few macro morphs, in its rest pose.
//! Frame: metres, y up, the person looks along +z with the left side at +x; the origin is near the hips.

use glam::Vec3;
use serde::Deserialize;

use crate::{SynthesisError, packed::Packed};

const BODY: &[u8] = include_bytes!("../../assets/people/body.bin");

/// The bones of the rig, in the order of the baked file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
#[allow(missing_docs)] // the names say it
pub enum Bone {
    Root,
    Pelvis,
    Spine1,
    Spine2,
    Spine3,
    Neck,
    Head,
    ClavicleL,
    UpperArmL,
    LowerArmL,
    HandL,
    ThighL,
    CalfL,
    FootL,
    BallL,
    ClavicleR,
    UpperArmR,
    LowerArmR,
    HandR,
    ThighR,
    CalfR,
    FootR,
    BallR,
}

/// How many bones the rig has.
pub const BONES: usize = 23;

/// The bones of one arm from the shoulder outwards.
pub const ARMS: [[Bone; 3]; 2] =
    [[Bone::UpperArmL, Bone::LowerArmL, Bone::HandL], [Bone::UpperArmR, Bone::LowerArmR, Bone::HandR]];

/// Which part of the base mesh a triangle belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The naked body.
    Skin,
    /// The close-fitting shell that clothes are cut from.
    Shell,
    /// The eyes.
    Eyes,
}

#[derive(Debug, Deserialize)]
struct Header {
    position_scale: f32,
    bones: Vec<String>,
    parents: Vec<i32>,
    parts: std::collections::BTreeMap<String, [usize; 2]>,
    targets: Vec<Target>,
}

#[derive(Debug, Deserialize)]
struct Target {
    name: String,
    scale: f32,
}

/// One morph: what it adds to every vertex and joint.
#[derive(Debug)]
struct Morph {
    name: String,
    vertices: Vec<Vec3>,
    heads: Vec<Vec3>,
    tails: Vec<Vec3>,
}

/// The base mesh with its morphs.
#[derive(Debug)]
pub struct BaseBody {
    positions: Vec<Vec3>,
    heads: Vec<Vec3>,
    tails: Vec<Vec3>,
    morphs: Vec<Morph>,
    /// Parent of each bone; `None` for the root.
    pub parents: Vec<Option<usize>>,
    /// Triangles of each part.
    parts: [Vec<[u32; 3]>; 3],
    /// Four bones per vertex.
    pub bones: Vec<[u8; 4]>,
    /// Their weights, summing to 1.
    pub weights: Vec<[f32; 4]>,
}

/// What makes one body differ from another. All shares are 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Build {
    /// Share of the woman's shape.
    pub female: f32,
    /// Shares of the three source populations of MakeHuman's morphs, summing to 1.
    pub origin: [f32; 3],
    /// −1 slender … 1 strongly muscled.
    pub muscle: f32,
    /// −1 light … 1 heavy.
    pub weight: f32,
    /// Standing height in metres, barefoot.
    pub height_m: f32,
}

/// A body of one build in its rest pose.
#[derive(Clone, Debug)]
pub struct ShapedBody {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Where each bone starts.
    pub heads: [Vec3; BONES],
    /// Where each bone ends.
    pub tails: [Vec3; BONES],
}

impl ShapedBody {
    /// Where a bone starts.
    #[must_use]
    pub fn head(&self, bone: Bone) -> Vec3 {
        self.heads[bone as usize]
    }

    /// Where a bone ends.
    #[must_use]
    pub fn tail(&self, bone: Bone) -> Vec3 {
        self.tails[bone as usize]
    }

    /// The middle of the hips: half way between the two hip joints.
    #[must_use]
    pub fn hips(&self) -> Vec3 {
        (self.head(Bone::ThighL) + self.head(Bone::ThighR)) / 2.0
    }
}

impl BaseBody {
    /// The body that comes with the program.
    pub fn load() -> Result<Self, SynthesisError> {
        Self::from_bytes(BODY)
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, SynthesisError> {
        let broken = |reason: &str| SynthesisError::Asset { what: "body.bin".into(), reason: reason.into() };
        let packed = Packed::<Header>::read(bytes, b"HPBODY1\0", "body.bin")?;
        let header = &packed.header;
        let floats = |name: &str| -> Result<Vec<Vec3>, SynthesisError> {
            Ok(packed.f32_rows::<3>(name)?.into_iter().map(Vec3::from).collect())
        };
        let scaled = |name: &str, scale: f32| -> Result<Vec<Vec3>, SynthesisError> {
            let rows = packed.i16_rows::<3>(name)?;
            Ok(rows.into_iter().map(|row| Vec3::from(row.map(f32::from)) * scale).collect())
        };
        let positions = scaled("positions", header.position_scale)?;
        let (heads, tails) = (floats("heads")?, floats("tails")?);
        let mut morphs = Vec::with_capacity(header.targets.len());
        for (index, target) in header.targets.iter().enumerate() {
            morphs.push(Morph {
                name: target.name.clone(),
                vertices: scaled(&format!("target{index}"), target.scale)?,
                heads: floats(&format!("target{index}_heads"))?,
                tails: floats(&format!("target{index}_tails"))?,
            });
        }
        let bones = packed.u8_rows::<4>("bones")?;
        let weights: Vec<[f32; 4]> = packed
            .u8_rows::<4>("weights")?
            .into_iter()
            .map(|row| row.map(|w| f32::from(w) / 255.0))
            .collect();
        let triangles: Vec<[u32; 3]> =
            packed.u16_rows::<3>("triangles")?.into_iter().map(|row| row.map(u32::from)).collect();
        let count = positions.len();
        let lengths_agree = bones.len() == count
            && weights.len() == count
            && [heads.len(), tails.len(), header.bones.len(), header.parents.len()]
                .iter()
                .all(|&n| n == BONES)
            && morphs
                .iter()
                .all(|m| m.vertices.len() == count && m.heads.len() == BONES && m.tails.len() == BONES)
            && bones.iter().flatten().all(|&bone| usize::from(bone) < BONES)
            && triangles.iter().flatten().all(|&vertex| (vertex as usize) < count);
        if !lengths_agree {
            return Err(broken("its arrays do not fit together; bake it again"));
        }
        let part = |names: &[&str]| -> Result<Vec<[u32; 3]>, SynthesisError> {
            let mut all = Vec::new();
            for name in names {
                let &[from, to] = header.parts.get(*name).ok_or_else(|| broken("a part is missing"))?;
                all.extend(triangles.get(from..to).ok_or_else(|| broken("a part is out of range"))?);
            }
            Ok(all)
        };
        let parts = [part(&["body"])?, part(&["helper-tights"])?, part(&["helper-l-eye", "helper-r-eye"])?];
        let parents = header.parents.iter().map(|&parent| usize::try_from(parent).ok()).collect();
        Ok(Self { positions, heads, tails, morphs, parents, parts, bones, weights })
    }

    /// The triangles of a part, as indices into the vertices of any [`ShapedBody`].
    #[must_use]
    pub fn triangles(&self, part: Part) -> &[[u32; 3]] {
        &self.parts[part as usize]
    }

    /// The body of a build.
    #[must_use]
    pub fn shape(&self, build: &Build) -> ShapedBody {
        let mut positions = self.positions.clone();
        let (mut heads, mut tails) = ([Vec3::ZERO; BONES], [Vec3::ZERO; BONES]);
        heads.copy_from_slice(&self.heads);
        tails.copy_from_slice(&self.tails);
        let mut add = |name: &str, share: f32| {
            if share.abs() < 1e-4 {
                return;
            }
            for morph in self.morphs.iter().filter(|morph| morph.name == name) {
                for (position, delta) in positions.iter_mut().zip(&morph.vertices) {
                    *position += share * *delta;
                }
                for bone in 0..BONES {
                    heads[bone] += share * morph.heads[bone];
                    tails[bone] += share * morph.tails[bone];
                }
            }
        };
        let [african, asian, caucasian] = build.origin;
        add("african-male-young", african * (1.0 - build.female));
        add("asian-male-young", asian * (1.0 - build.female));
        add("caucasian-male-young", caucasian * (1.0 - build.female));
        add("african-female-young", african * build.female);
        add("caucasian-female-young", (asian + caucasian) * build.female);
        let male = 1.0 - build.female;
        let muscle = if build.muscle > 0.0 { "maxmuscle" } else { "minmuscle" };
        add(&format!("universal-male-young-{muscle}-averageweight"), build.muscle.abs() * male);
        let weight = if build.weight > 0.0 { "maxweight" } else { "minweight" };
        add(&format!("universal-male-young-averagemuscle-{weight}"), build.weight.abs() * male);

        // The rest of the way to the wanted height is a uniform scale, so that the limbs stay in proportion.
        let skin = || self.parts[Part::Skin as usize].iter().flatten().map(|&v| positions[v as usize].y);
        let (low, high) = skin().fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
        let scale = build.height_m / (high - low).max(0.1);
        positions.iter_mut().for_each(|position| *position *= scale);
        heads.iter_mut().chain(&mut tails).for_each(|joint| *joint *= scale);
        ShapedBody { positions, heads, tails }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn average() -> Build {
        Build { female: 0.0, origin: [0.3, 0.3, 0.4], muscle: 0.2, weight: 0.0, height_m: 1.82 }
    }

    #[test]
    fn a_body_has_the_wanted_height_and_looks_along_z() {
        let base = BaseBody::load().unwrap();
        let body = base.shape(&average());
        let skin = base.triangles(Part::Skin).iter().flatten().map(|&v| body.positions[v as usize].y);
        let (low, high) = skin.fold((f32::MAX, f32::MIN), |(a, b), y| (a.min(y), b.max(y)));
        assert!((high - low - 1.82).abs() < 1e-3);
        assert!(body.tail(Bone::BallL).z > body.head(Bone::FootL).z + 0.1, "toes point along z");
        assert!(body.head(Bone::HandL).x > 0.2 && body.head(Bone::HandR).x < -0.2, "left is +x");
        assert!(body.head(Bone::Head).y > body.head(Bone::Neck).y);
    }

    #[test]
    fn weights_sum_to_one() {
        let base = BaseBody::load().unwrap();
        assert!(base.weights.iter().all(|w| (w.iter().sum::<f32>() - 1.0).abs() < 1e-5));
    }

    #[test]
    fn a_truncated_file_is_refused() {
        for length in [0, 7, 11, 100, 5_000, 400_000, BODY.len() - 9] {
            assert!(BaseBody::from_bytes(&BODY[..length]).is_err(), "{length} bytes were accepted");
        }
    }
}
