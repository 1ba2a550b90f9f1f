//! A triangle mesh with texture coordinates.

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
