//! What never moves: turf, table, goals and flags, and the markings as numbers for the shader.

use bytemuck::{Pod, Zeroable};
use glam::Vec2;
use protocol::pitch::{LINE_WIDTH_M, Marking, Pitch};

use super::{Layout, SolidMesh, TURF_THICKNESS_M, goal, primitives::rounded_rectangle};

/// Which surface a ground vertex belongs to; the shader paints by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Material {
    Turf = 0,
    TurfEdge = 1,
    Wood = 2,
    WoodEdge = 3,
}

/// A vertex of turf or table.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GroundVertex {
    /// World metres.
    pub position_m: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// 0 turf, 1 edge of the turf, 2 wood, 3 edge of the table.
    pub material: u32,
}

/// Indexed triangles of [`GroundVertex`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GroundMesh {
    /// The vertices.
    pub vertices: Vec<GroundVertex>,
    /// Three indices per triangle.
    pub indices: Vec<u32>,
}

/// A vertex of a net.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct NetVertex {
    /// World metres.
    pub position_m: [f32; 3],
    /// Metres along the two directions of the threads.
    pub net_m: [f32; 2],
}

/// Indexed triangles of [`NetVertex`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NetMesh {
    /// The vertices.
    pub vertices: Vec<NetVertex>,
    /// Three indices per triangle.
    pub indices: Vec<u32>,
}

/// Everything of a stream's scene that never moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Sizes.
    pub layout: Layout,
    /// Turf and table.
    pub ground: GroundMesh,
    /// Goals and flags.
    pub solids: SolidMesh,
    /// Nets.
    pub nets: NetMesh,
    /// Two vectors per marking, (x, z) in metres, as `ground.wgsl` reads them: a line is `(x0, z0, x1, z1)` and
    /// `(0, half width, 0, 0)`; an arc `(x, z, radius, middle angle)` and `(1, half width, half sweep, 0)`; a spot
    /// `(x, z, radius, 0)` and `(2, 0, 0, 0)`.
    pub markings: Vec<[[f32; 4]; 2]>,
}

impl Stage {
    /// The stage of a pitch.
    #[must_use]
    pub fn new(pitch: Pitch) -> Self {
        let layout = Layout::around(pitch);
        let mut table = GroundMesh::default();
        let table_top_m = -TURF_THICKNESS_M as f32;
        table.add_slab(
            &rounded_rectangle(layout.half_table_m, layout.table_corner_m, 12),
            table_top_m,
            layout.table_thickness_m as f32,
            [Material::Wood, Material::WoodEdge],
        );
        Self::around(pitch, layout, table)
    }

    /// The stage of a pitch that stands on a real table: no table of its own.
    #[must_use]
    pub fn on_real_table(pitch: Pitch) -> Self {
        Self::around(pitch, Layout::around(pitch), GroundMesh::default())
    }

    /// Turf, goals and markings on what is there already.
    fn around(pitch: Pitch, layout: Layout, mut ground: GroundMesh) -> Self {
        ground.add_slab(
            &rounded_rectangle(layout.half_turf_m, layout.turf_corner_m, 10),
            0.0,
            TURF_THICKNESS_M as f32,
            [Material::Turf, Material::TurfEdge],
        );
        let (mut solids, mut nets) = (SolidMesh::default(), NetMesh::default());
        goal::build(&pitch, &mut solids, &mut nets);
        let markings = pitch.markings().iter().map(marking_for_shader).collect();
        Self { layout, ground, solids, nets, markings }
    }
}

fn marking_for_shader(marking: &Marking) -> [[f32; 4]; 2] {
    let half_width = (LINE_WIDTH_M / 2.0) as f32;
    match *marking {
        Marking::Line { from, to } => {
            [[from.x as f32, from.y as f32, to.x as f32, to.y as f32], [0.0, half_width, 0.0, 0.0]]
        }
        Marking::Arc { centre, radius_m, start, sweep } => [
            [centre.x as f32, centre.y as f32, radius_m as f32, (start + sweep / 2.0) as f32],
            [1.0, half_width, (sweep.abs() / 2.0) as f32, 0.0],
        ],
        Marking::Spot { centre, radius_m } => {
            [[centre.x as f32, centre.y as f32, radius_m as f32, 0.0], [2.0, 0.0, 0.0, 0.0]]
        }
    }
}

impl GroundMesh {
    /// A slab with the given outline: its top at height `top_m`, and walls down by `thickness_m`.
    fn add_slab(&mut self, outline: &[Vec2], top_m: f32, thickness_m: f32, [top, edge]: [Material; 2]) {
        let count = outline.len() as u32;
        let centre = self.vertices.len() as u32;
        let mut vertex = |x: f32, y: f32, z: f32, normal: [f32; 3], material: Material| {
            self.vertices.push(GroundVertex { position_m: [x, y, z], normal, material: material as u32 });
        };
        vertex(0.0, top_m, 0.0, [0.0, 1.0, 0.0], top);
        for point in outline {
            vertex(point.x, top_m, point.y, [0.0, 1.0, 0.0], top);
        }
        for (index, point) in outline.iter().enumerate() {
            let before = outline[(index + outline.len() - 1) % outline.len()];
            let after = outline[(index + 1) % outline.len()];
            let along = (after - before).normalize_or(Vec2::X);
            let normal = [along.y, 0.0, -along.x];
            vertex(point.x, top_m, point.y, normal, edge);
            vertex(point.x, top_m - thickness_m, point.y, normal, edge);
        }
        let walls = centre + 1 + count;
        for index in 0..count {
            let next = (index + 1) % count;
            self.indices.extend([centre, centre + 1 + next, centre + 1 + index]);
            let (a, b) = (walls + 2 * index, walls + 2 * next);
            self.indices.extend([a, b, a + 1, b, b + 1, a + 1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn turf_and_table_face_outwards() {
        let ground = Stage::new(Pitch::default()).ground;
        for triangle in ground.indices.chunks_exact(3) {
            let corner = |i: usize| Vec3::from(ground.vertices[triangle[i] as usize].position_m);
            let facing = (corner(1) - corner(0)).cross(corner(2) - corner(0));
            let normal = Vec3::from(ground.vertices[triangle[0] as usize].normal);
            assert!(facing.dot(normal) > 0.0, "triangle {triangle:?} faces {facing}, normal {normal}");
        }
    }

    #[test]
    fn on_a_real_table_nothing_lies_under_the_turf() {
        let stage = Stage::on_real_table(Pitch::default());
        let thickness = TURF_THICKNESS_M as f32;
        assert!(stage.ground.vertices.iter().all(|vertex| vertex.position_m[1] >= -thickness - 1e-6));
        assert!(stage.ground.vertices.iter().all(|vertex| vertex.material <= Material::TurfEdge as u32));
    }

    #[test]
    fn every_marking_reaches_the_shader() {
        let pitch = Pitch { length_m: 100.0, width_m: 64.0 };
        let stage = Stage::new(pitch);
        assert_eq!(stage.markings.len(), pitch.markings().len());
        let circle =
            stage.markings.iter().find(|m| m[1][0] == 1.0 && m[0][2] > 9.0 && m[0][0] == 0.0).unwrap();
        assert!((circle[1][2] - std::f32::consts::PI).abs() < 1e-5, "the centre circle is whole");
    }
}
