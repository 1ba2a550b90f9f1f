//! Fewer triangles: a mesh is brought under its budget by edge collapses that keep its shape.

use glam::DVec3;
use meshopt::{SimplifyOptions, simplify_decoder, simplify_sloppy_decoder};

/// The mesh with at most `triangles` triangles; unchanged when it has no more.
pub(super) fn to_budget(
    points_m: &[DVec3],
    faces: &[[u32; 3]],
    triangles: usize,
) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    if faces.len() <= triangles {
        return (points_m.to_vec(), faces.to_vec());
    }
    let indices: Vec<u32> = faces.iter().flatten().copied().collect();
    // Single precision is a hundredth of a millimetre near the body, not on the far side of the pitch.
    let origin = points_m.first().copied().unwrap_or_default();
    let near: Vec<[f32; 3]> = points_m.iter().map(|point| (*point - origin).as_vec3().to_array()).collect();
    let simplified = simplify_decoder(&indices, &near, triangles * 3, 1.0, SimplifyOptions::None, None);
    // Topology can stop the collapses early; clustering never stops.
    let simplified = if simplified.len() > triangles * 3 {
        tracing::debug!(triangles, "a body is simplified by clustering: it may not stay closed");
        simplify_sloppy_decoder(&indices, &near, triangles * 3, 1.0, None)
    } else {
        simplified
    };
    compact(points_m, &simplified)
}

/// The triangles of `indices` and the points they use, in order of first use.
fn compact(points_m: &[DVec3], indices: &[u32]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut new_index = vec![u32::MAX; points_m.len()];
    let mut kept = Vec::new();
    let triangles = indices.chunks_exact(3).map(|triangle| {
        [triangle[0], triangle[1], triangle[2]].map(|old| {
            let old = old as usize;
            if new_index[old] == u32::MAX {
                new_index[old] = kept.len() as u32;
                kept.push(points_m[old]);
            }
            new_index[old]
        })
    });
    let triangles = triangles.collect();
    (kept, triangles)
}
