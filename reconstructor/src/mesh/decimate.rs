//! Fewer triangles: a mesh is brought under its budget by edge collapses that keep its shape.

use glam::DVec3;
use meshopt::{SimplifyOptions, simplify_decoder, simplify_sloppy_decoder};

/// What is left of a mesh.
pub(super) struct Simplified {
    /// Triangles over the given points.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Points were clustered, because collapses alone left too many: the mesh may not be closed any more.
    pub(super) clustered: bool,
}

/// The mesh with at most `triangles` triangles; unchanged when it has no more.
pub(super) fn to_budget(points_m: &[DVec3], faces: &[[u32; 3]], triangles: usize) -> Simplified {
    if faces.len() <= triangles {
        return Simplified { triangles: faces.to_vec(), clustered: false };
    }
    let indices: Vec<u32> = faces.iter().flatten().copied().collect();
    // Single precision is a hundredth of a millimetre near the body, not on the far side of the pitch.
    let origin = points_m.first().copied().unwrap_or_default();
    let near: Vec<[f32; 3]> = points_m.iter().map(|point| (*point - origin).as_vec3().to_array()).collect();
    let mut kept = simplify_decoder(&indices, &near, triangles * 3, 1.0, SimplifyOptions::None, None);
    // Topology can stop the collapses early; clustering never stops.
    let clustered = kept.len() > triangles * 3;
    if clustered {
        kept = simplify_sloppy_decoder(&indices, &near, triangles * 3, 1.0, None);
    }
    Simplified { triangles: kept.as_chunks::<3>().0.to_vec(), clustered }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_touch_only_at_corners_are_clustered_and_it_says_so() {
        // Every inner point joins three triangles without a common edge: no edge may be collapsed.
        let point = |k: u32| DVec3::new(f64::from(k % 8), f64::from(k / 8), 0.2 * f64::from(k % 3));
        let points: Vec<DVec3> = (0..64).map(point).collect();
        let faces: Vec<[u32; 3]> = (0..56).filter(|k| k % 8 < 7).map(|k| [k, k + 1, k + 8]).collect();
        let whole = to_budget(&points, &faces, faces.len());
        assert!(!whole.clustered && whole.triangles == faces);
        let few = to_budget(&points, &faces, 12);
        assert!(few.clustered && few.triangles.len() <= 12, "{} triangles", few.triangles.len());
    }
}
