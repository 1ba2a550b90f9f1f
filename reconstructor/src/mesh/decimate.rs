//! Fewer triangles: a mesh is brought under its budget by edge collapses that keep its shape.

use meshopt::{SimplifyOptions, simplify_decoder, simplify_sloppy_decoder};
use protocol::mesh::Mesh;

/// The mesh with at most `triangles` triangles; unchanged when it has no more. Vertices that remain keep their texture
/// coordinates. Borders are free to move: a silhouette has more border vertices than the budget.
pub(super) fn to_budget(mesh: Mesh, triangles: usize) -> Mesh {
    if mesh.triangles.len() <= triangles {
        return mesh;
    }
    let indices: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    let simplified =
        simplify_decoder(&indices, &mesh.positions_m, triangles * 3, 1.0, SimplifyOptions::None, None);
    // Topology can stop the collapses early; clustering never stops.
    let simplified = if simplified.len() > triangles * 3 {
        simplify_sloppy_decoder(&indices, &mesh.positions_m, triangles * 3, 1.0, None)
    } else {
        simplified
    };
    compact(&mesh, &simplified)
}

/// The mesh with only the triangles of `indices` and the vertices they use, in order of first use.
fn compact(mesh: &Mesh, indices: &[u32]) -> Mesh {
    let mut new_index = vec![u32::MAX; mesh.positions_m.len()];
    let mut small = Mesh::default();
    for triangle in indices.chunks_exact(3) {
        let triangle = [triangle[0], triangle[1], triangle[2]].map(|old| {
            let old = old as usize;
            if new_index[old] == u32::MAX {
                new_index[old] = small.positions_m.len() as u32;
                small.positions_m.push(mesh.positions_m[old]);
                small.uvs.push(mesh.uvs[old]);
            }
            new_index[old]
        });
        small.triangles.push(triangle);
    }
    small
}
