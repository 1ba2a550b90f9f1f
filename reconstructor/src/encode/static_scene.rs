//! The pitch and the goals as a plain glTF scene: written once per stream, readable by any viewer.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use protocol::{
    glb::GlbError,
    gltf::{Accessor, Attributes, Builder, Material, Mesh, Node, Primitive, Scene, UNLIT, component},
    pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, LINE_WIDTH_M, Marking, Pitch},
};

/// Grass beyond the lines, metres.
const MARGIN_M: f64 = 4.0;
/// Height of the paint above the grass, metres: enough for depth buffers to tell them apart.
const PAINT_M: f64 = 0.01;
/// Chord length of curved paint, metres.
const CHORD_M: f64 = 0.3;
/// Depth of a goal behind the line at its foot, metres.
const GOAL_DEPTH_M: f64 = 2.0;
/// Sides of a post.
const POST_SIDES: usize = 8;
/// glTF's name for vertex data.
const ARRAY_BUFFER: u32 = 34_962;
/// glTF's name for index data.
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;

/// Triangles without texture.
#[derive(Default)]
struct Shape {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
}

/// The pitch of that size as a GLB file: nodes `grass`, `lines` and `goals`.
pub(super) fn glb(pitch: &Pitch) -> Result<Vec<u8>, GlbError> {
    let mut builder = Builder::default();
    builder.document.extensions_used = vec![UNLIT];
    let mut roots = Vec::new();
    let parts = [
        ("grass", grass(pitch), [0.10, 0.26, 0.07, 1.0]),
        ("lines", lines(pitch), [0.85, 0.87, 0.85, 1.0]),
        ("goals", goals(pitch), [0.90, 0.90, 0.90, 1.0]),
    ];
    for (name, shape, colour) in parts {
        let mesh = add(&mut builder, name, &shape, colour);
        builder.document.nodes.push(Node { name: name.to_owned(), mesh: Some(mesh), ..Node::default() });
        roots.push(builder.document.nodes.len() - 1);
    }
    builder.document.scenes = vec![Scene { name: Some("pitch".to_owned()), nodes: roots, extras: None }];
    builder.finish()
}

fn add(builder: &mut Builder, name: &str, shape: &Shape, colour: [f32; 4]) -> usize {
    let positions = builder.view(bytemuck::cast_slice(&shape.positions), Some(ARRAY_BUFFER));
    let indices = builder.view(bytemuck::cast_slice(&shape.indices), Some(ELEMENT_ARRAY_BUFFER));
    let (mut min, mut max) = (vec![f32::INFINITY; 3], vec![f32::NEG_INFINITY; 3]);
    for position in &shape.positions {
        for ((low, high), value) in min.iter_mut().zip(&mut max).zip(position) {
            (*low, *high) = (low.min(*value), high.max(*value));
        }
    }
    let accessor = |view, component_type, count, kind: &str| Accessor {
        buffer_view: Some(view),
        byte_offset: 0,
        component_type,
        count,
        kind: kind.to_owned(),
        min: Vec::new(),
        max: Vec::new(),
    };
    let position =
        Accessor { min, max, ..accessor(positions, component::F32, shape.positions.len(), "VEC3") };
    let position = builder.accessor(position);
    let indices = builder.accessor(accessor(indices, component::U32, shape.indices.len(), "SCALAR"));
    builder.document.materials.push(Material::unlit(name.to_owned(), Some(colour), None));
    let material = Some(builder.document.materials.len() - 1);
    let attributes = Attributes { position, normal: None, uv: None };
    builder.document.meshes.push(Mesh {
        name: name.to_owned(),
        primitives: vec![Primitive { attributes, indices: Some(indices), material, extensions: None }],
    });
    builder.document.meshes.len() - 1
}

impl Shape {
    /// A convex polygon; corners counter-clockwise seen from its front.
    fn polygon(&mut self, corners: &[DVec3]) {
        let base = self.positions.len() as u32;
        self.positions.extend(corners.iter().map(|corner| corner.as_vec3().to_array()));
        for second in 1..(corners.len() as u32).saturating_sub(1) {
            self.indices.extend([base, base + second, base + second + 1]);
        }
    }

    /// A flat piece of paint; corners (world x, z) in any order round the piece.
    fn paint(&mut self, corners: &[DVec2]) {
        let mut lifted: Vec<DVec3> = corners.iter().map(|c| DVec3::new(c.x, PAINT_M, c.y)).collect();
        if let [a, b, c, ..] = lifted.as_slice()
            && (*b - *a).cross(*c - *a).y < 0.0
        {
            lifted.reverse();
        }
        self.polygon(&lifted);
    }

    /// A round bar between two points.
    fn bar(&mut self, from: DVec3, to: DVec3, radius_m: f64) {
        let axis = (to - from).normalize_or(DVec3::Y);
        let side = axis.any_orthonormal_vector();
        let other = axis.cross(side);
        let rim = |step: usize| {
            let angle = TAU * step as f64 / POST_SIDES as f64;
            radius_m * (side * angle.cos() + other * angle.sin())
        };
        for step in 0..POST_SIDES {
            let (a, b) = (rim(step), rim(step + 1));
            self.polygon(&[from + a, from + b, to + b, to + a]);
        }
    }
}

fn grass(pitch: &Pitch) -> Shape {
    let (x, z) = (pitch.length_m / 2.0 + MARGIN_M, pitch.width_m / 2.0 + MARGIN_M);
    let mut shape = Shape::default();
    shape.polygon(&[(-x, z), (x, z), (x, -z), (-x, -z)].map(|(x, z)| DVec3::new(x, 0.0, z)));
    shape
}

fn lines(pitch: &Pitch) -> Shape {
    let mut shape = Shape::default();
    for marking in pitch.markings() {
        match marking {
            Marking::Line { from, to } => {
                let along = (to - from).normalize_or_zero() * LINE_WIDTH_M / 2.0;
                let across = along.perp();
                // Longer by half a width at both ends, so that corners are filled.
                let (from, to) = (from - along, to + along);
                shape.paint(&[from + across, to + across, to - across, from - across]);
            }
            Marking::Arc { centre, .. } => {
                for pair in marking.sample(CHORD_M).windows(2) {
                    if let [a, b] = pair {
                        let edge = |point: DVec2, side: f64| {
                            point + (point - centre).normalize_or_zero() * side * LINE_WIDTH_M / 2.0
                        };
                        shape.paint(&[edge(*a, 1.0), edge(*b, 1.0), edge(*b, -1.0), edge(*a, -1.0)]);
                    }
                }
            }
            Marking::Spot { centre, radius_m } => {
                let rim: Vec<DVec2> = (0..16)
                    .map(|step| centre + radius_m * DVec2::from_angle(TAU * f64::from(step) / 16.0))
                    .collect();
                shape.paint(&rim);
            }
        }
    }
    shape
}

/// Posts, crossbar and the thin frame that holds the net.
fn goals(pitch: &Pitch) -> Shape {
    let mut shape = Shape::default();
    let radius = LINE_WIDTH_M / 2.0; // posts are as wide as the goal line (Law 1)
    for side in [-1.0, 1.0] {
        let x = side * pitch.length_m / 2.0;
        let (post, top) = (GOAL_WIDTH_M / 2.0 + radius, GOAL_HEIGHT_M + radius);
        shape.bar(DVec3::new(x, top, -post - radius), DVec3::new(x, top, post + radius), radius);
        let back = x + side * GOAL_DEPTH_M;
        for z in [-post, post] {
            shape.bar(DVec3::new(x, 0.0, z), DVec3::new(x, top, z), radius);
            shape.bar(DVec3::new(x, 0.0, z), DVec3::new(back, 0.0, z), radius / 3.0);
            shape.bar(DVec3::new(x, top, z), DVec3::new(back, 0.0, z), radius / 3.0);
        }
        shape.bar(DVec3::new(back, 0.0, -post), DVec3::new(back, 0.0, post), radius / 3.0);
    }
    shape
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_paint_faces_up_and_lies_on_the_pitch() {
        let pitch = Pitch { length_m: 100.0, width_m: 64.0 };
        let shape = lines(&pitch);
        let corner = |index: u32| DVec3::from(shape.positions[index as usize].map(f64::from));
        let mut painted_m2 = 0.0;
        for triangle in shape.indices.chunks(3) {
            let [a, b, c] = [corner(triangle[0]), corner(triangle[1]), corner(triangle[2])];
            let normal = (b - a).cross(c - a);
            assert!(normal.y > 0.0, "a piece of paint faces down at {a}");
            painted_m2 += normal.length() / 2.0;
            assert!(a.x.abs() <= 50.07 && a.z.abs() <= 32.07);
        }
        // On 100 × 64 m: 392 m of outline and halfway line, 205 m of areas, 98 m of curves, five small discs.
        assert!((82.0..86.0).contains(&painted_m2), "{painted_m2} m² of paint");
    }

    #[test]
    fn the_goals_stand_outside_their_opening() {
        let shape = goals(&Pitch::default());
        let inside = |p: &[f32; 3]| {
            f64::from(p[2]).abs() < GOAL_WIDTH_M / 2.0 - 1e-4
                && f64::from(p[1]) < GOAL_HEIGHT_M - 1e-4
                && f64::from(p[1]) > 0.1
        };
        let in_the_mouth =
            shape.positions.iter().filter(|p| (f64::from(p[0]).abs() - 52.5).abs() < 0.01 && inside(p));
        assert_eq!(in_the_mouth.count(), 0);
    }
}
