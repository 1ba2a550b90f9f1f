//! The ball: a white sphere of the real size with dark patches, so that it does not pass for a penalty mark.

use glam::Vec3;

use super::SolidMesh;

/// Law 2: circumference 68–70 cm, radius 11 cm.
pub(super) const BALL_RADIUS_M: f32 = 0.11;

const WHITE: [f32; 3] = [0.9, 0.9, 0.9];
const PATCH: [f32; 3] = [0.03, 0.03, 0.035];

/// A ball of the real size around `centre` (world metres).
pub(super) fn build(centre: Vec3) -> SolidMesh {
    let golden = (1.0 + 5.0_f32.sqrt()) / 2.0;
    // The twelve patches sit at the corners of an icosahedron.
    let patches: Vec<Vec3> = [-1.0, 1.0]
        .into_iter()
        .flat_map(|a| [-golden, golden].map(|b| (a, b)))
        .flat_map(|(a, b)| [Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)])
        .map(Vec3::normalize)
        .collect();
    let mut mesh = SolidMesh::default();
    mesh.add_sphere(centre, BALL_RADIUS_M, 20, |direction| {
        if patches.iter().any(|patch| patch.dot(direction) > 0.93) { PATCH } else { WHITE }
    });
    mesh
}
