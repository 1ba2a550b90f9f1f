//! One frame of the match as triangles: the bodies in world metres, their contact shadows and the ball.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};
use protocol::{
    camera::Camera,
    chunk::{Body, ChunkFrame},
    limits::Limits,
    manifest::Person,
};

use super::{Atlas, AtlasError, SolidMesh, ball};

/// Height below which a vertex counts as part of a standing foot, metres.
const FOOT_HEIGHT_M: f32 = 0.35;
/// Contact shadows: half size around a foot print, and of somebody in the air, metres.
const SHADOW_MARGIN_M: f32 = 0.34;
const SHADOW_AIRBORNE_M: f32 = 0.6;
/// Share of the light that a contact shadow takes in its middle.
const SHADOW_STRENGTH: f32 = 0.7;
/// Shirt of somebody without texture and without known colour: light grey.
const UNKNOWN_SHIRT: [u8; 3] = [190, 190, 190];

/// A vertex of a person.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BodyVertex {
    /// World metres.
    pub position_m: [f32; 3],
    /// Into the frame's atlas, 0..1 from the top-left.
    pub uv: [f32; 2],
    /// Multiplies the texture, sRGB; white leaves it as it is.
    pub tint: [u8; 4],
}

/// A soft dark patch on the grass.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Shadow {
    /// World x and z of its middle, metres.
    pub centre_m: [f32; 2],
    /// Half extent along x and z, metres.
    pub half_m: [f32; 2],
    /// Share of light taken in the middle, 0..1.
    pub strength: f32,
}

/// One frame, ready to be uploaded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameScene {
    /// Index of the frame in the clip it came from.
    pub clip_frame: u32,
    /// The broadcast camera, when the stream has it.
    pub camera: Option<Camera>,
    /// Vertices of all bodies, world metres.
    pub vertices: Vec<BodyVertex>,
    /// Three indices per triangle; first what was seen, then what is guessed.
    pub indices: Vec<u32>,
    /// How many of them are of what was seen.
    pub seen_indices: usize,
    /// How many people have a mesh.
    pub people: usize,
    /// Contact shadows.
    pub shadows: Vec<Shadow>,
    /// The ball, when it is known.
    pub ball: Option<SolidMesh>,
    /// Texture of the bodies; without it they wear their shirt's colour.
    pub atlas: Option<Atlas>,
}

impl FrameScene {
    /// Builds the scene of a decoded frame: world positions, shadows, and the atlas decoded within `limits`.
    pub fn new(frame: &ChunkFrame, people: &[Person], limits: &Limits) -> Result<Self, AtlasError> {
        let atlas = frame.atlas.as_ref().map(|atlas| Atlas::of(atlas, limits)).transpose()?;
        let mut scene = Self {
            clip_frame: frame.clip_frame,
            camera: frame.camera,
            people: frame.bodies.len(),
            ..Self::default()
        };
        let mut guessed = Vec::new();
        for body in &frame.bodies {
            let shirt = people
                .iter()
                .find(|person| person.id == body.person)
                .and_then(|person| person.shirt_rgb)
                .unwrap_or(UNKNOWN_SHIRT);
            scene.add_body(body, atlas.is_none().then_some(shirt), &mut guessed);
        }
        scene.seen_indices = scene.indices.len();
        scene.indices.append(&mut guessed);
        if let Some(ball) = &frame.ball {
            let centre = ball.position_m.as_vec3();
            let above = (centre.y - ball::BALL_RADIUS_M).max(0.0);
            scene.shadows.push(Shadow {
                centre_m: [centre.x, centre.z],
                half_m: [0.16 + above * 0.05; 2],
                strength: SHADOW_STRENGTH / (1.0 + above),
            });
            scene.ball = Some(ball::build(ball));
        }
        scene.atlas = atlas;
        Ok(scene)
    }

    /// Adds a body; with `shirt` it is painted in that colour, shaded by its own normals. Indices of what is guessed go to `guessed`.
    fn add_body(&mut self, body: &Body, shirt: Option<[u8; 3]>, guessed: &mut Vec<u32>) {
        let first = self.vertices.len() as u32;
        let mesh = &body.mesh;
        let count = mesh.positions_m.len() as u32;
        let tints = shirt.map(|shirt| shaded_tints(body, shirt));
        for (index, position) in mesh.positions_m.iter().enumerate() {
            let tint = tints.as_ref().and_then(|tints| tints.get(index)).copied().unwrap_or([255; 4]);
            let uv = mesh.uvs.get(index).copied().unwrap_or_default();
            let position_m = (body.anchor_m + Vec3::from(*position)).into();
            self.vertices.push(BodyVertex { position_m, uv, tint });
        }
        // A triangle that names a vertex that is not there is left out; the decoder refuses such files anyway.
        let triangles = mesh.triangles.iter().filter(|triangle| triangle.iter().all(|&index| index < count));
        for &triangle in triangles {
            let indices = if body.is_guessed(triangle) { &mut *guessed } else { &mut self.indices };
            indices.extend(triangle.map(|index| first + index));
        }
        self.shadows.push(contact_shadow(body));
    }
}

/// A colour per vertex: the shirt's, lit from above and a little from the front.
fn shaded_tints(body: &Body, shirt: [u8; 3]) -> Vec<[u8; 4]> {
    let positions = &body.mesh.positions_m;
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for triangle in &body.mesh.triangles {
        let corners = triangle.map(|index| positions.get(index as usize).map(|p| Vec3::from(*p)));
        if let [Some(a), Some(b), Some(c)] = corners {
            let normal = (b - a).cross(c - a);
            for &index in triangle {
                if let Some(sum) = normals.get_mut(index as usize) {
                    *sum += normal;
                }
            }
        }
    }
    let light = Vec3::new(0.3, 0.8, 0.52);
    let lit = |normal: Vec3| 0.62 + 0.38 * normal.normalize_or_zero().dot(light);
    normals
        .into_iter()
        .map(|normal| {
            let light = lit(normal).clamp(0.0, 1.0);
            let [r, g, b] = shirt.map(|channel| (f32::from(channel) * light).round() as u8);
            [r, g, b, 255]
        })
        .collect()
}

/// The shadow of a body: under its feet where it has some near the grass, wide and faint under a jump.
fn contact_shadow(body: &Body) -> Shadow {
    let world = body.mesh.positions_m.iter().map(|position| body.anchor_m + Vec3::from(*position));
    let feet = world.filter(|point| point.y < FOOT_HEIGHT_M).map(|point| Vec2::new(point.x, point.z));
    let bounds = feet.fold(None, |bounds: Option<(Vec2, Vec2)>, point| {
        Some(bounds.map_or((point, point), |(low, high)| (low.min(point), high.max(point))))
    });
    match bounds {
        Some((low, high)) => {
            let half = (high - low) / 2.0 + SHADOW_MARGIN_M;
            let centre = (low + high) / 2.0;
            Shadow { centre_m: centre.into(), half_m: half.min(Vec2::ONE).into(), strength: SHADOW_STRENGTH }
        }
        None => Shadow {
            centre_m: [body.anchor_m.x, body.anchor_m.z],
            half_m: [SHADOW_AIRBORNE_M; 2],
            strength: SHADOW_STRENGTH / 2.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use protocol::{
        chunk::{Ball, FrameQuality},
        manifest::PersonId,
        mesh::Mesh,
        time::Ticks,
    };

    use super::*;

    fn frame_with(bodies: Vec<Body>) -> ChunkFrame {
        ChunkFrame {
            clip_frame: 7,
            start: Ticks(0),
            duration: Ticks(1),
            camera: None,
            quality: FrameQuality::default(),
            ball: None,
            atlas: None,
            bodies,
        }
    }

    fn triangle_at(x: f32, lowest_m: f32) -> Body {
        Body {
            person: PersonId(3),
            anchor_m: Vec3::new(x, 0.0, 2.0),
            mesh: Mesh {
                positions_m: vec![[0.0, lowest_m, 0.0], [0.5, lowest_m, 0.0], [0.0, 1.8, 0.0]],
                uvs: vec![[0.0; 2]; 3],
                triangles: vec![[0, 1, 2]],
            },
            guessed_from_u: None,
        }
    }

    #[test]
    fn bodies_stand_at_their_anchors_and_keep_their_own_vertices() {
        let frame = frame_with(vec![triangle_at(10.0, 0.0), triangle_at(-4.0, 0.0)]);
        let scene = FrameScene::new(&frame, &[], &Limits::default()).unwrap();
        assert_eq!((scene.people, scene.clip_frame), (2, 7));
        assert_eq!(scene.vertices[3].position_m, [-4.0, 0.0, 2.0]);
        assert_eq!(scene.indices, [0, 1, 2, 3, 4, 5]);
        assert!((scene.shadows[0].centre_m[0] - 10.25).abs() < 1e-5, "{:?}", scene.shadows[0]);
    }

    #[test]
    fn what_is_guessed_comes_last() {
        let mut half = triangle_at(0.0, 0.0);
        half.mesh.uvs = vec![[0.7, 0.0]; 3];
        half.guessed_from_u = Some(0.5);
        let scene =
            FrameScene::new(&frame_with(vec![half, triangle_at(3.0, 0.0)]), &[], &Limits::default()).unwrap();
        assert_eq!((scene.indices.as_slice(), scene.seen_indices), (&[3, 4, 5, 0, 1, 2][..], 3));
    }

    #[test]
    fn somebody_in_the_air_has_a_fainter_shadow() {
        let frame = frame_with(vec![triangle_at(0.0, 0.0), triangle_at(5.0, 0.9)]);
        let scene = FrameScene::new(&frame, &[], &Limits::default()).unwrap();
        assert!(scene.shadows[1].strength < scene.shadows[0].strength);
    }

    #[test]
    fn without_texture_people_wear_their_shirts_colour() {
        let person = Person {
            id: PersonId(3),
            team: None,
            team_confidence: None,
            role: None,
            role_confidence: None,
            number: None,
            number_confidence: None,
            shirt_rgb: Some([200, 10, 20]),
        };
        let frame = frame_with(vec![triangle_at(0.0, 0.0)]);
        let scene = FrameScene::new(&frame, &[person], &Limits::default()).unwrap();
        let [r, g, _, _] = scene.vertices[0].tint;
        assert!(r > 80 && g < 20, "{:?}", scene.vertices[0].tint);
    }

    #[test]
    fn triangles_that_name_missing_vertices_are_left_out() {
        let mut body = triangle_at(0.0, 0.0);
        body.mesh.triangles.push([0, 1, 99]);
        let scene = FrameScene::new(&frame_with(vec![body]), &[], &Limits::default()).unwrap();
        assert_eq!(scene.indices.len(), 3);
    }

    #[test]
    fn a_ball_on_the_grass_touches_it() {
        let mut frame = frame_with(Vec::new());
        frame.ball =
            Some(Ball { position_m: glam::DVec3::new(1.0, 0.0, 2.0), height_known: false, spread: None });
        let scene = FrameScene::new(&frame, &[], &Limits::default()).unwrap();
        let lowest =
            scene.ball.unwrap().vertices.iter().map(|v| v.position_m[1]).fold(f32::INFINITY, f32::min);
        assert!(lowest.abs() < 1e-5);
    }
}
