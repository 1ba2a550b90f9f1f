//! Poses a dressed figure: forward kinematics of the rig and linear blend skinning.
//! Input is the body's rest frame; output is the person's frame (metres, origin at the anchor on the ground, y up,
//! looking along +z) or, through a [`Placement`], the world.

use glam::{Mat3, Quat, Vec3};

use crate::{
    body::{BONES, Bone, ShapedBody},
    figure::{Figure, Vertex},
    motion::{JOINTS, Joint, PARENTS, Pose},
};

/// Where a person stands and faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The anchor: the ground point under the middle of the hips, world metres.
    pub anchor_m: Vec3,
    /// Heading about the world's y axis: 0 looks along +z, π/2 along +x.
    pub yaw: f32,
}

/// The bones of a pose: how each carries a rest point into the person's frame.
#[derive(Clone, Debug)]
pub struct Skeleton {
    rotations: [Mat3; BONES],
    translations: [Vec3; BONES],
}

/// Which joint turns each bone, and whether its rest direction must first be brought to hang straight down (the
/// recorded limbs rest so; the body rests with arms and legs apart).
const DRIVERS: [(Joint, Option<Bone>); BONES] = [
    (Joint::Pelvis, None),
    (Joint::Pelvis, None),
    (Joint::Pelvis, None), // the first spine bone is half pelvis, half chest: see `Skeleton::new`
    (Joint::Chest, None),
    (Joint::Chest, None),
    (Joint::Neck, None),
    (Joint::Neck, None),
    (Joint::Chest, None),
    (Joint::UpperArmL, Some(Bone::LowerArmL)),
    (Joint::LowerArmL, Some(Bone::HandL)),
    (Joint::LowerArmL, Some(Bone::HandL)),
    (Joint::ThighL, Some(Bone::CalfL)),
    (Joint::CalfL, Some(Bone::FootL)),
    (Joint::FootL, None),
    (Joint::FootL, None),
    (Joint::Chest, None),
    (Joint::UpperArmR, Some(Bone::LowerArmR)),
    (Joint::LowerArmR, Some(Bone::HandR)),
    (Joint::LowerArmR, Some(Bone::HandR)),
    (Joint::ThighR, Some(Bone::CalfR)),
    (Joint::CalfR, Some(Bone::FootR)),
    (Joint::FootR, None),
    (Joint::FootR, None),
];

impl Skeleton {
    /// The bones of `body` in `pose`, hips above the origin, not yet at their height.
    #[must_use]
    pub fn new(body: &ShapedBody, parents: &[Option<usize>], pose: &Pose) -> Self {
        let mut global = [Quat::IDENTITY; JOINTS];
        for joint in 0..JOINTS {
            let parent = PARENTS[joint].map_or(Quat::IDENTITY, |parent| global[parent]);
            global[joint] = parent * pose.rotations[joint];
        }
        let mut rotations = [Mat3::IDENTITY; BONES];
        for (bone, &(joint, hangs_to)) in DRIVERS.iter().enumerate() {
            let mut rotation = global[joint as usize];
            if bone == Bone::Spine1 as usize {
                rotation = rotation.lerp(global[Joint::Chest as usize], 0.5);
            }
            let rest = match hangs_to {
                // The hand keeps the line of its forearm.
                Some(end) if bone == end as usize => {
                    body.heads[bone] - body.heads[parents[bone].unwrap_or(bone)]
                }
                Some(end) => body.head(end) - body.heads[bone],
                None => Vec3::NEG_Y,
            };
            for (toes, bend) in [Bone::BallL, Bone::BallR].into_iter().zip(pose.toes) {
                if bone == toes as usize {
                    rotation *= Quat::from_rotation_x(-bend);
                }
            }
            let hang = Quat::from_rotation_arc(rest.normalize_or(Vec3::NEG_Y), Vec3::NEG_Y);
            rotations[bone] = Mat3::from_quat(rotation * hang);
        }
        let mut places = body.heads;
        for bone in 0..BONES {
            if let Some(parent) = parents[bone] {
                places[bone] = places[parent] + rotations[parent] * (body.heads[bone] - body.heads[parent]);
            }
        }
        let hips = (places[Bone::ThighL as usize] + places[Bone::ThighR as usize]) / 2.0;
        let mut translations = [Vec3::ZERO; BONES];
        for bone in 0..BONES {
            translations[bone] = places[bone] - hips - rotations[bone] * body.heads[bone];
        }
        Self { rotations, translations }
    }

    /// Where a rest point that follows one bone goes.
    #[must_use]
    pub fn carry(&self, bone: Bone, rest: Vec3) -> Vec3 {
        self.rotations[bone as usize] * rest + self.translations[bone as usize]
    }

    fn lift(&mut self, height: f32) {
        self.translations.iter_mut().for_each(|translation| translation.y += height);
    }
}

/// A figure in a pose.
#[derive(Clone, Debug, Default)]
pub struct Posed {
    /// Vertex positions.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals.
    pub normals: Vec<Vec3>,
    /// The 33 landmarks of BlazePose, in its order.
    pub landmarks: Vec<Vec3>,
    /// The middle of the hips.
    pub hips: Vec3,
}

/// Where the skeleton takes one vertex, and how it turns there.
fn carried(skeleton: &Skeleton, vertex: &Vertex) -> (Mat3, Vec3) {
    let (mut rotation, mut translation) = (Mat3::ZERO, Vec3::ZERO);
    for (&bone, &weight) in vertex.bones.iter().zip(&vertex.weights) {
        if weight > 0.0 {
            rotation += skeleton.rotations[usize::from(bone)] * weight;
            translation += skeleton.translations[usize::from(bone)] * weight;
        }
    }
    (rotation, rotation * vertex.rest + translation)
}

/// Skins `figure` in `pose`, standing on the ground (or `pose.clearance_m` above it), in the person's frame.
#[must_use]
pub fn pose(figure: &Figure, pose: &Pose) -> Posed {
    let (skeleton, posed) = skinned(figure, pose);
    let lowest = posed.positions.iter().map(|position| position.y).fold(f32::MAX, f32::min);
    lifted(figure, skeleton, posed, pose.clearance_m - lowest)
}

/// Skins `figure` in `pose` with the middle of its hips `hips_m` above the ground, in the person's frame.
#[must_use]
pub fn pose_at(figure: &Figure, pose: &Pose, hips_m: f32) -> Posed {
    let (skeleton, posed) = skinned(figure, pose);
    lifted(figure, skeleton, posed, hips_m)
}

/// The landmarks alone of [`pose_at`].
#[must_use]
pub fn landmarks_at(figure: &Figure, pose: &Pose, hips_m: f32) -> Vec<Vec3> {
    let mut skeleton = Skeleton::new(&figure.body, &figure.parents, pose);
    skeleton.lift(hips_m);
    figure.landmarks.iter().map(|&(bone, rest)| skeleton.carry(bone, rest)).collect()
}

fn skinned(figure: &Figure, pose: &Pose) -> (Skeleton, Posed) {
    let skeleton = Skeleton::new(&figure.body, &figure.parents, pose);
    let mut posed = Posed {
        positions: Vec::with_capacity(figure.vertices.len()),
        normals: Vec::with_capacity(figure.vertices.len()),
        ..Posed::default()
    };
    for vertex in &figure.vertices {
        let (rotation, position) = carried(&skeleton, vertex);
        posed.positions.push(position);
        posed.normals.push((rotation * vertex.normal).normalize_or(Vec3::Y));
    }
    (skeleton, posed)
}

fn lifted(figure: &Figure, mut skeleton: Skeleton, mut posed: Posed, height: f32) -> Posed {
    skeleton.lift(height);
    posed.positions.iter_mut().for_each(|position| position.y += height);
    posed.hips = Vec3::new(0.0, height, 0.0);
    posed.landmarks = figure.landmarks.iter().map(|&(bone, rest)| skeleton.carry(bone, rest)).collect();
    posed
}

/// The few vertices of a figure that can touch the ground in any pose: the outermost of every bone.
#[derive(Clone, Debug)]
pub struct Probes {
    vertices: Vec<Vertex>,
}

impl Probes {
    /// The outermost vertices along the axes, diagonals and corners of each bone's share of the surface.
    #[must_use]
    pub fn of(figure: &Figure) -> Self {
        let mut chosen = std::collections::BTreeSet::new();
        let steps = [-1.0f32, 0.0, 1.0];
        for bone in 0..BONES as u8 {
            let own: Vec<usize> = (0..figure.vertices.len())
                .filter(|&v| {
                    let vertex = &figure.vertices[v];
                    vertex.bones.iter().zip(&vertex.weights).any(|(&b, &weight)| b == bone && weight > 0.3)
                })
                .collect();
            for x in steps {
                for y in steps {
                    for z in steps {
                        let way = Vec3::new(x, y, z);
                        let reach = |v: &usize| figure.vertices[*v].rest.dot(way);
                        chosen.extend(own.iter().copied().max_by(|a, b| reach(a).total_cmp(&reach(b))));
                    }
                }
            }
        }
        Self { vertices: chosen.into_iter().map(|v| figure.vertices[v]).collect() }
    }

    /// Height of the lowest point of `figure` in `pose`, measured from the middle of the hips.
    #[must_use]
    pub fn lowest_m(&self, figure: &Figure, pose: &Pose) -> f32 {
        let skeleton = Skeleton::new(&figure.body, &figure.parents, pose);
        self.vertices.iter().map(|vertex| carried(&skeleton, vertex).1.y).fold(f32::MAX, f32::min)
    }
}

impl Placement {
    /// A point of the person's frame in the world.
    #[must_use]
    pub fn place(&self, point: Vec3) -> Vec3 {
        Mat3::from_rotation_y(self.yaw) * point + self.anchor_m
    }
}

impl Posed {
    /// The same figure standing at a place of the world.
    #[must_use]
    pub fn placed(mut self, placement: &Placement) -> Self {
        let turn = Mat3::from_rotation_y(placement.yaw);
        let place = |point: Vec3| turn * point + placement.anchor_m;
        self.positions.iter_mut().for_each(|position| *position = place(*position));
        self.normals.iter_mut().for_each(|normal| *normal = turn * *normal);
        self.landmarks.iter_mut().for_each(|landmark| *landmark = place(*landmark));
        self.hips = place(self.hips);
        self
    }
}
