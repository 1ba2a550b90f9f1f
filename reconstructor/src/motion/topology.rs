//! A mesh as one surface: vertices that lie on each other, as those along a seam of the texture do, are one point.

use glam::DVec3;
use protocol::mesh::Mesh;

use crate::surface::Triangle;

/// What joins the points of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Topology {
    /// The point that each vertex of the mesh is.
    pub(super) point_of: Vec<u32>,
    /// Triangles over the points, in the mesh's order; some may have lost a corner.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The points joined to each by an edge.
    pub(super) neighbours: Vec<Vec<u32>>,
}

impl Topology {
    /// The topology of a mesh and its points, in the order of their first vertex. `None` when a triangle names a vertex that is
    /// not there, or a vertex has no texture coordinate.
    pub(super) fn of(mesh: &Mesh) -> Option<(Self, Vec<DVec3>)> {
        let (point_of, first_vertex) = mesh.points();
        if mesh.uvs.len() != point_of.len() {
            return None;
        }
        let place = |vertex: &u32| mesh.positions_m.get(*vertex as usize);
        let points: Vec<DVec3> =
            first_vertex.iter().filter_map(place).map(|p| glam::Vec3::from(*p).as_dvec3()).collect();
        let corner = |vertex: u32| point_of.get(vertex as usize).copied();
        let corners = |[a, b, c]: &[u32; 3]| Some([corner(*a)?, corner(*b)?, corner(*c)?]);
        let triangles = mesh.triangles.iter().map(corners).collect::<Option<Vec<_>>>()?;
        let mut neighbours = vec![Vec::new(); points.len()];
        for [a, b, c] in &triangles {
            for (from, to) in [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)] {
                if from != to {
                    neighbours[*from as usize].push(*to);
                }
            }
        }
        for list in &mut neighbours {
            list.sort_unstable();
            list.dedup();
        }
        Some((Self { point_of, triangles, neighbours }, points))
    }

    /// The triangles in space.
    pub(super) fn in_space(&self, points: &[DVec3]) -> Vec<Triangle> {
        self.triangles.iter().map(|corners| corners.map(|corner| points[corner as usize])).collect()
    }

    /// Unit normals of the points; zero where the surface has none.
    pub(super) fn normals(&self, points: &[DVec3]) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; points.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            let normal = (b - a).cross(c - a);
            for corner in corners {
                normals[*corner as usize] += normal;
            }
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }
}
