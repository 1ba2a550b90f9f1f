//! A dressed person in the rest pose: one surface cut from skin and shell, every triangle with its material.
//! Hems, sock tops and hairlines are cut through the triangles along signed distances, so they are smooth lines.

use glam::Vec3;
use std::collections::HashMap;

use crate::{
    body::{BaseBody, Bone, Part, ShapedBody},
    landmarks,
    outfit::{Hair, Outfit, Sleeves, Tied},
};

/// What a surface is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum Material {
    Skin,
    Hair,
    Eye,
    Shirt,
    Sleeve,
    Shorts,
    Sock,
    Boot,
    Glove,
}

/// One vertex of a figure.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// Position in the rest pose, metres.
    pub rest: Vec3,
    /// Unit normal in the rest pose.
    pub normal: Vec3,
    /// Distance to the nearest hem of its piece, metres; kept for trims and cuffs.
    pub hem_m: f32,
    /// Bones it follows.
    pub bones: [u8; 4],
    /// How much, summing to 1.
    pub weights: [f32; 4],
}

impl Vertex {
    fn between(&self, other: &Self, share: f32) -> Self {
        let mut influence = [(0u8, 0f32); 8];
        let mut used = 0;
        for (vertex, part) in [(self, 1.0 - share), (other, share)] {
            for (&bone, &weight) in vertex.bones.iter().zip(&vertex.weights) {
                match influence[..used].iter_mut().find(|(b, _)| *b == bone) {
                    Some((_, sum)) => *sum += weight * part,
                    None => {
                        influence[used] = (bone, weight * part);
                        used += 1;
                    }
                }
            }
        }
        influence.sort_by(|a, b| b.1.total_cmp(&a.1));
        let sum: f32 = influence[..4].iter().map(|(_, weight)| weight).sum();
        Self {
            rest: self.rest.lerp(other.rest, share),
            normal: self.normal.lerp(other.normal, share).normalize_or(self.normal),
            hem_m: self.hem_m + (other.hem_m - self.hem_m) * share,
            bones: [0, 1, 2, 3].map(|i| influence[i].0),
            weights: [0, 1, 2, 3].map(|i| influence[i].1 / sum.max(1e-9)),
        }
    }
}

/// A dressed person in the rest pose.
#[derive(Clone, Debug)]
pub struct Figure {
    /// The body it was made from (joints are used to pose it).
    pub body: ShapedBody,
    /// Parent of each bone.
    pub parents: Vec<Option<usize>>,
    /// All vertices.
    pub vertices: Vec<Vertex>,
    /// All triangles, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The material of each triangle.
    pub materials: Vec<Material>,
    /// BlazePose's landmarks as a bone and a rest point.
    pub landmarks: Vec<(Bone, Vec3)>,
    /// What it wears.
    pub outfit: Outfit,
}

/// A piece of surface while it is being cut.
#[derive(Clone, Default)]
struct Piece {
    vertices: Vec<Vertex>,
    triangles: Vec<[u32; 3]>,
}

impl Piece {
    fn of(base: &BaseBody, body: &ShapedBody, normals: &[Vec3], part: Part) -> Self {
        let mut piece = Self::default();
        let mut index = HashMap::new();
        for triangle in base.triangles(part) {
            piece.triangles.push(triangle.map(|v| {
                *index.entry(v).or_insert_with(|| {
                    let v = v as usize;
                    piece.vertices.push(Vertex {
                        rest: body.positions[v],
                        normal: normals[v],
                        hem_m: 1.0,
                        bones: base.bones[v],
                        weights: base.weights[v],
                    });
                    piece.vertices.len() as u32 - 1
                })
            }));
        }
        piece
    }

    /// Fewer triangles where the eye cannot tell: `share` of them, at most `error_m` off.
    fn simplified(mut self, share: f32, error_m: f32) -> Self {
        let positions: Vec<[f32; 3]> = self.vertices.iter().map(|v| v.rest.to_array()).collect();
        let Ok(adapter) = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(&positions), 12, 0) else {
            return self; // an empty piece
        };
        let wanted = ((self.triangles.len() as f32 * share) as usize) * 3;
        let indices = meshopt::simplify(
            bytemuck::cast_slice(&self.triangles),
            &adapter,
            wanted,
            error_m,
            meshopt::SimplifyOptions::ErrorAbsolute,
            None,
        );
        self.triangles = indices.as_chunks::<3>().0.to_vec();
        self
    }

    /// Splits the surface along the zero line of `distance`: first where it is positive, then where it is negative.
    fn split(&self, distance: impl Fn(&Vertex) -> f32) -> [Self; 2] {
        let values: Vec<f32> = self.vertices.iter().map(&distance).collect();
        [1.0, -1.0].map(|side| {
            let mut piece = Self::default();
            let (mut whole, mut cut) = (HashMap::new(), HashMap::new());
            for triangle in &self.triangles {
                let mut outline: Vec<u32> = Vec::with_capacity(4);
                for k in 0..3 {
                    let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                    let (da, db) = (values[a as usize] * side, values[b as usize] * side);
                    if da >= 0.0 {
                        outline.push(*whole.entry(a).or_insert_with(|| {
                            let vertex = self.vertices[a as usize];
                            piece.vertices.push(Vertex { hem_m: vertex.hem_m.min(da), ..vertex });
                            piece.vertices.len() as u32 - 1
                        }));
                    }
                    if (da >= 0.0) != (db >= 0.0) {
                        let (low, high) = (a.min(b), a.max(b));
                        outline.push(*cut.entry((low, high)).or_insert_with(|| {
                            let (dl, dh) = (values[low as usize], values[high as usize]);
                            let (one, two) = (&self.vertices[low as usize], &self.vertices[high as usize]);
                            let vertex = one.between(two, dl / (dl - dh));
                            piece.vertices.push(Vertex { hem_m: 0.0, ..vertex });
                            piece.vertices.len() as u32 - 1
                        }));
                    }
                }
                for k in 2..outline.len() {
                    piece.triangles.push([outline[0], outline[k - 1], outline[k]]);
                }
            }
            piece
        })
    }

    fn inside(&self, distance: impl Fn(&Vertex) -> f32) -> Self {
        let [inside, _] = self.split(distance);
        inside
    }

    /// Moves every vertex along its normal.
    fn inflated(mut self, amount: impl Fn(&Vertex) -> f32) -> Self {
        for vertex in &mut self.vertices {
            vertex.rest += vertex.normal * amount(vertex);
        }
        self
    }
}

/// The lines of a body that clothes are measured from.
struct Lines<'a> {
    body: &'a ShapedBody,
    scale: f32,
}

impl Lines<'_> {
    fn weight(vertex: &Vertex, bones: std::ops::RangeInclusive<usize>) -> f32 {
        let pairs = vertex.bones.iter().zip(&vertex.weights);
        pairs.filter(|(bone, _)| bones.contains(&usize::from(**bone))).map(|(_, weight)| weight).sum()
    }

    fn arm_weight(vertex: &Vertex) -> f32 {
        Self::weight(vertex, Bone::UpperArmL as usize..=Bone::HandL as usize)
            + Self::weight(vertex, Bone::UpperArmR as usize..=Bone::HandR as usize)
    }

    /// Metres along the arm from the shoulder joint; −1 off the arms.
    fn along_arm(&self, vertex: &Vertex) -> f32 {
        if Self::arm_weight(vertex) < 0.3 {
            return -1.0;
        }
        let side = if vertex.rest.x > 0.0 { crate::body::ARMS[0] } else { crate::body::ARMS[1] };
        let [shoulder, elbow, wrist] = side.map(|bone| self.body.head(bone));
        let upper = (elbow - shoulder).normalize_or(Vec3::X);
        let along = (vertex.rest - shoulder).dot(upper);
        let length = shoulder.distance(elbow);
        if along < length {
            along
        } else {
            length + (vertex.rest - elbow).dot((wrist - elbow).normalize_or(Vec3::X)).max(0.0)
        }
    }

    fn shirt(&self, vertex: &Vertex, outfit: &Outfit) -> f32 {
        let arm = self.body.head(Bone::UpperArmL).distance(self.body.head(Bone::LowerArmL));
        let sleeve = match outfit.sleeves {
            Sleeves::Short => outfit.sleeve_share * arm,
            Sleeves::Long => 1.93 * arm,
        };
        let neck = self.body.head(Bone::Neck);
        // The collar slopes down towards the front.
        let collar = neck.y + 0.030 * self.scale - vertex.rest.y - 0.35 * (vertex.rest.z - neck.z).max(0.0);
        let hem = vertex.rest.y - (self.body.hips().y - outfit.shirt_length_m * self.scale);
        let on_arm = Self::arm_weight(vertex) >= 0.3;
        (sleeve - self.along_arm(vertex)).min(if on_arm { 1.0 } else { collar.min(hem) })
    }

    fn shorts(&self, vertex: &Vertex, outfit: &Outfit) -> f32 {
        if Self::arm_weight(vertex) >= 0.3 {
            return -0.1;
        }
        let knee = self.body.head(Bone::CalfL).y;
        let hem = knee + outfit.shorts_above_knee_m * self.scale;
        (vertex.rest.y - hem).min(self.body.head(Bone::Pelvis).y + 0.03 - vertex.rest.y)
    }

    fn sock(&self, vertex: &Vertex, outfit: &Outfit) -> f32 {
        self.body.head(Bone::CalfL).y - outfit.sock_below_knee_m * self.scale - vertex.rest.y
    }

    fn boot(&self, vertex: &Vertex) -> f32 {
        let ankle = self.body.head(Bone::FootL);
        // Low at the heel side of the ankle, a little higher over the instep.
        ankle.y - 0.012 * self.scale + 0.25 * (vertex.rest.z - ankle.z - 0.03).max(0.0) - vertex.rest.y
    }

    /// Gloves reach from a little above the wrist to the finger tips.
    fn glove(&self, vertex: &Vertex) -> f32 {
        let arm = self.body.head(Bone::UpperArmL).distance(self.body.head(Bone::LowerArmL));
        let fore = self.body.head(Bone::LowerArmL).distance(self.body.head(Bone::HandL));
        self.along_arm(vertex) - arm - fore + 0.045 * self.scale
    }

    /// How far inside the hairline a vertex of the head lies.
    fn hair(&self, vertex: &Vertex, hair: &Hair) -> f32 {
        let head = self.body.head(Bone::Head);
        let p = (vertex.rest - head) / self.scale;
        if Self::weight(vertex, Bone::Head as usize..=Bone::Head as usize) < 0.5 {
            return -0.05;
        }
        // A plane that runs from the forehead down to the nape, with the temples cut back.
        let line = hair.forehead_m - 1.05 * (0.105 - p.z).clamp(0.0, 0.2) + 0.3 * (p.x.abs() - 0.05).max(0.0);
        let nape = p.y + 0.035 + hair.nape_m;
        (p.y - line).min(nape).min(0.04)
    }
}

/// A knot or tail at the back of the head: an egg that follows the head.
fn tied_hair(body: &ShapedBody, style: &Hair, scale: f32) -> Piece {
    const RINGS: usize = 6;
    const SECTORS: usize = 10;
    // Centre behind the crown, half axes across, along and away from the head.
    let (centre, half) = match style.tied {
        Tied::No => return Piece::default(),
        Tied::Knot(radius) => (Vec3::new(0.0, 0.13, -0.10 - 0.5 * radius), Vec3::splat(radius)),
        Tied::Tail(length) => {
            (Vec3::new(0.0, 0.09 - length / 2.0, -0.115), Vec3::new(0.028, length / 2.0, 0.026))
        }
    };
    let mut piece = Piece::default();
    for ring in 0..=RINGS {
        let polar = ring as f32 / RINGS as f32 * std::f32::consts::PI;
        for sector in 0..SECTORS {
            let turn = sector as f32 / SECTORS as f32 * std::f32::consts::TAU;
            let normal = Vec3::new(polar.sin() * turn.sin(), polar.cos(), polar.sin() * turn.cos());
            piece.vertices.push(Vertex {
                rest: body.head(Bone::Head) + (centre + normal * half) * scale,
                normal,
                hem_m: 1.0,
                bones: [Bone::Head as u8, 0, 0, 0],
                weights: [1.0, 0.0, 0.0, 0.0],
            });
        }
    }
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let at = |r: usize, s: usize| (r * SECTORS + s % SECTORS) as u32;
            piece.triangles.push([at(ring, sector), at(ring + 1, sector), at(ring, sector + 1)]);
            piece.triangles.push([at(ring, sector + 1), at(ring + 1, sector), at(ring + 1, sector + 1)]);
        }
    }
    piece
}

/// Dresses a body.
#[must_use]
pub fn dress(base: &BaseBody, body: ShapedBody, outfit: Outfit, detail: Detail) -> Figure {
    let normals = rest_normals(base, &body);
    let scale = (body.head(Bone::Head).y - body.head(Bone::FootL).y) / 1.44;
    let (skin_share, error_m) = match detail {
        Detail::Close => (0.35, 0.002),
        Detail::Broadcast => (0.12, 0.004),
    };
    let skin = Piece::of(base, &body, &normals, Part::Skin).simplified(skin_share, error_m * scale);
    let shell = Piece::of(base, &body, &normals, Part::Shell);
    let mut figure = Figure {
        landmarks: landmarks::of(base, &body),
        body: body.clone(),
        parents: base.parents.clone(),
        vertices: Vec::new(),
        triangles: Vec::new(),
        materials: Vec::new(),
        outfit: outfit.clone(),
    };
    let lines = Lines { body: &body, scale };

    let shirt = shell.inside(|v| lines.shirt(v, &outfit));
    let shorts = shell.inside(|v| lines.shorts(v, &outfit));
    let lower = shell.inside(|v| lines.sock(v, &outfit));
    let [boots, socks] = lower.split(|v| lines.boot(v));

    // Skin that lies well under cloth is never seen and is no part of the true surface.
    let bare = skin.inside(|v| 0.02 - lines.shirt(v, &outfit));
    let bare = bare.inside(|v| 0.02 - lines.shorts(v, &outfit));
    let bare = bare.inside(|v| 0.01 - lines.sock(v, &outfit));
    let [hair, bare] = match &outfit.hair {
        Some(style) => bare.split(|v| lines.hair(v, style)),
        None => [Piece::default(), bare],
    };
    let bare = if outfit.gloves.is_some() {
        let [gloves, bare] = bare.split(|v| lines.glove(v));
        figure.add(gloves.inflated(|_| 0.009 * scale), Material::Glove);
        bare
    } else {
        bare
    };
    figure.add(bare, Material::Skin);
    if let Some(style) = &outfit.hair {
        let hair = hair.inflated(|v| style.volume_m * scale * (v.hem_m / 0.03).clamp(0.1, 1.0));
        figure.add(hair, Material::Hair);
        figure.add(tied_hair(&body, style, scale), Material::Hair);
    }
    figure.add(Piece::of(base, &body, &normals, Part::Eyes).simplified(0.3, 0.002), Material::Eye);
    figure.add(socks.inflated(|_| 0.003), Material::Sock);
    figure.add(boots.inflated(|_| 0.009), Material::Boot);
    let loose = outfit.looseness_m;
    let hem = lines.body.hips().y - outfit.shirt_length_m;
    let fold = |v: &Vertex| {
        let p = v.rest * 19.0;
        0.35 * ((p.x * 0.9 + p.y * 0.7).sin() * (p.z * 1.1 - p.y * 0.4).sin())
    };
    figure.add(
        shorts.inflated(|v| 0.007 + loose * (0.6 + fold(v)) * 0.9 * (1.0 - v.hem_m / 0.3).clamp(0.2, 1.0)),
        Material::Shorts,
    );
    let [sleeves, trunk] = shirt.split(|v| Lines::arm_weight(v) - 0.55);
    for (piece, material) in [(trunk, Material::Shirt), (sleeves, Material::Sleeve)] {
        let piece = piece.inflated(|v| {
            // Close at the shoulders, loose at the waist and at short sleeves.
            let low = (1.0 - (v.rest.y - hem) / 0.45).clamp(0.15, 1.0);
            let sleeve = Lines::arm_weight(v) * 0.6;
            0.010 + loose * (1.0 + fold(v)) * low.max(sleeve)
        });
        figure.add(piece, material);
    }
    figure.renew_normals();
    figure
}

/// How finely a figure is tessellated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// For people up to about 100 px tall.
    Broadcast,
    /// For larger ones.
    Close,
}

impl Figure {
    fn add(&mut self, piece: Piece, material: Material) {
        let mut index = HashMap::new();
        for triangle in &piece.triangles {
            if triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0] {
                continue;
            }
            self.triangles.push(triangle.map(|v| {
                *index.entry(v).or_insert_with(|| {
                    self.vertices.push(piece.vertices[v as usize]);
                    self.vertices.len() as u32 - 1
                })
            }));
            self.materials.push(material);
        }
    }

    /// Normals of the cut and inflated surface; pieces keep their own side of a seam.
    fn renew_normals(&mut self) {
        let mut sums = vec![Vec3::ZERO; self.vertices.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| self.vertices[v as usize].rest);
            let normal = (b - a).cross(c - a);
            triangle.iter().for_each(|&v| sums[v as usize] += normal);
        }
        for (vertex, sum) in self.vertices.iter_mut().zip(sums) {
            vertex.normal = sum.normalize_or(vertex.normal);
        }
    }
}

fn rest_normals(base: &BaseBody, body: &ShapedBody) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; body.positions.len()];
    for part in [Part::Skin, Part::Shell, Part::Eyes] {
        for triangle in base.triangles(part) {
            let [a, b, c] = triangle.map(|v| body.positions[v as usize]);
            let normal = (b - a).cross(c - a);
            triangle.iter().for_each(|&v| normals[v as usize] += normal);
        }
    }
    normals.iter_mut().for_each(|normal| *normal = normal.normalize_or(Vec3::Y));
    normals
}
