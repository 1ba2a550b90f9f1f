//! Cylinders, spheres and rounded slabs as triangles.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

/// A vertex with its own colour, lit by the renderer.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct SolidVertex {
    /// World metres.
    pub position_m: [f32; 3],
    /// Unit normal.
    pub normal: [f32; 3],
    /// Linear light, 0..1.
    pub colour: [f32; 3],
}

/// Indexed triangles of [`SolidVertex`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SolidMesh {
    /// The vertices.
    pub vertices: Vec<SolidVertex>,
    /// Three indices per triangle.
    pub indices: Vec<u32>,
}

impl SolidMesh {
    fn push(&mut self, position: Vec3, normal: Vec3, colour: [f32; 3]) -> u32 {
        let index = self.vertices.len() as u32;
        self.vertices.push(SolidVertex { position_m: position.into(), normal: normal.into(), colour });
        index
    }

    /// A closed cylinder from `from` to `to`.
    pub fn add_cylinder(&mut self, from: Vec3, to: Vec3, radius_m: f32, sides: u32, colour: [f32; 3]) {
        let axis = (to - from).normalize_or(Vec3::Y);
        let across = axis.any_orthonormal_vector();
        let beside = axis.cross(across);
        let rim = |side: u32| {
            let (sin, cos) = (std::f32::consts::TAU * side as f32 / sides as f32).sin_cos();
            across * cos + beside * sin
        };
        for side in 0..sides {
            let (n0, n1) = (rim(side), rim(side + 1));
            let a = self.push(from + n0 * radius_m, n0, colour);
            let b = self.push(from + n1 * radius_m, n1, colour);
            let c = self.push(to + n1 * radius_m, n1, colour);
            let d = self.push(to + n0 * radius_m, n0, colour);
            self.indices.extend([a, b, c, a, c, d]);
            for (end, normal) in [(from, -axis), (to, axis)] {
                let a = self.push(end, normal, colour);
                let b = self.push(end + n0 * radius_m, normal, colour);
                let c = self.push(end + n1 * radius_m, normal, colour);
                self.indices.extend([a, b, c]);
            }
        }
    }

    /// A sphere of `rings` by twice as many segments; `colour` may depend on the direction from the middle.
    pub fn add_sphere(&mut self, centre: Vec3, radius_m: f32, rings: u32, colour: impl Fn(Vec3) -> [f32; 3]) {
        let segments = rings * 2;
        let first = self.vertices.len() as u32;
        for ring in 0..=rings {
            let (sin_polar, cos_polar) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
            for segment in 0..=segments {
                let (sin, cos) = (std::f32::consts::TAU * segment as f32 / segments as f32).sin_cos();
                let direction = Vec3::new(sin_polar * cos, cos_polar, sin_polar * sin);
                self.push(centre + direction * radius_m, direction, colour(direction));
            }
        }
        for ring in 0..rings {
            for segment in 0..segments {
                let a = first + ring * (segments + 1) + segment;
                let b = a + segments + 1;
                self.indices.extend([a, a + 1, b, a + 1, b + 1, b]);
            }
        }
    }

    /// A triangle that is seen from both sides.
    pub fn add_triangle(&mut self, corners: [Vec3; 3], colour: [f32; 3]) {
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Y);
        let indices = corners.map(|corner| self.push(corner, normal, colour));
        self.indices.extend(indices);
    }
}

/// The outline of a rectangle with rounded corners, centred on the origin, counter-clockwise in (x, z).
#[must_use]
pub(crate) fn rounded_rectangle(half_m: [f64; 2], radius_m: f64, steps_per_corner: u32) -> Vec<Vec2> {
    let radius = radius_m.min(half_m[0]).min(half_m[1]).max(0.0) as f32;
    let inner = Vec2::new(half_m[0] as f32 - radius, half_m[1] as f32 - radius);
    let corners = [Vec2::new(1.0, 1.0), Vec2::new(-1.0, 1.0), Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0)];
    let mut outline = Vec::new();
    for (quarter, corner) in corners.into_iter().enumerate() {
        for step in 0..=steps_per_corner {
            let turn = quarter as f32 + step as f32 / steps_per_corner as f32;
            outline.push(inner * corner + radius * Vec2::from_angle(turn * std::f32::consts::FRAC_PI_2));
        }
    }
    outline
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_rectangle_touches_its_sides_and_stays_inside() {
        let outline = rounded_rectangle([10.0, 5.0], 2.0, 6);
        let extent = outline.iter().fold(Vec2::ZERO, |most, point| most.max(point.abs()));
        assert!((extent - Vec2::new(10.0, 5.0)).length() < 1e-5, "{extent}");
        assert!(
            !outline.iter().any(|p| p.abs().abs_diff_eq(Vec2::new(10.0, 5.0), 0.1)),
            "a corner is square"
        );
    }

    #[test]
    fn cylinder_and_sphere_have_the_radius_asked_for() {
        let mut mesh = SolidMesh::default();
        mesh.add_cylinder(Vec3::ZERO, Vec3::Y * 3.0, 0.5, 12, [1.0; 3]);
        assert!(mesh.vertices.iter().all(|v| Vec3::from(v.position_m).with_y(0.0).length() <= 0.5 + 1e-5));
        let mut ball = SolidMesh::default();
        ball.add_sphere(Vec3::ONE, 0.11, 8, |_| [1.0; 3]);
        for vertex in &ball.vertices {
            assert!(((Vec3::from(vertex.position_m) - Vec3::ONE).length() - 0.11).abs() < 1e-5);
        }
        assert!(ball.indices.iter().all(|&i| (i as usize) < ball.vertices.len()));
    }
}
