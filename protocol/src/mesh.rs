//! A triangle mesh with texture coordinates.

use std::collections::BTreeMap;

/// Indexed triangles. Positions in metres; texture coordinates 0..1 from the top-left of the picture (glTF's way).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in metres, in the frame that the owner of the mesh says.
    pub positions_m: Vec<[f32; 3]>,
    /// Texture coordinates, one per vertex.
    pub uvs: Vec<[f32; 2]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The points of the mesh: vertices at one place, as those along a seam of the texture are, are one. Returns the point of each vertex and the first
    /// vertex of each point; points are numbered by it.
    #[must_use]
    pub fn points(&self) -> (Vec<u32>, Vec<u32>) {
        let mut known: BTreeMap<[u32; 3], u32> = BTreeMap::new();
        let mut first_vertex = Vec::new();
        let mut of_vertex = Vec::with_capacity(self.positions_m.len());
        for (vertex, position) in self.positions_m.iter().enumerate() {
            let next = first_vertex.len() as u32;
            // Zero has two signs.
            let point = *known.entry(position.map(|value| (value + 0.0).to_bits())).or_insert(next);
            if point == next {
                first_vertex.push(vertex as u32);
            }
            of_vertex.push(point);
        }
        (of_vertex, first_vertex)
    }
}
