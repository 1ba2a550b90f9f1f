//! Goals and corner flags: posts, crossbar, stanchions and net (Law 1: 7.32 m × 2.44 m, posts 12 cm).

use glam::{Vec2, Vec3};
use protocol::pitch::{GOAL_HEIGHT_M, GOAL_WIDTH_M, Pitch};

use super::{NetMesh, NetVertex, SolidMesh};

/// Diameter of posts and crossbar, metres.
const POST_M: f32 = 0.12;
/// How far the net reaches back at the top and at the ground, metres.
const NET_DEPTH_TOP_M: f32 = 0.9;
const NET_DEPTH_BOTTOM_M: f32 = 2.0;
const WHITE: [f32; 3] = [0.86, 0.86, 0.84];
const GREY: [f32; 3] = [0.32, 0.33, 0.34];
const FLAG_POLE: [f32; 3] = [0.78, 0.76, 0.7];
const FLAG: [f32; 3] = [0.82, 0.2, 0.03];
/// Law 1: a corner flagpost is not less than 1.5 m high.
const FLAG_HEIGHT_M: f32 = 1.5;

/// Both goals and the four corner flags of a pitch.
pub(super) fn build(pitch: &Pitch, solids: &mut SolidMesh, nets: &mut NetMesh) {
    for side in [-1.0, 1.0] {
        add_goal(side * pitch.length_m as f32 / 2.0, side, solids, nets);
    }
    let (half_length, half_width) = (pitch.length_m as f32 / 2.0, pitch.width_m as f32 / 2.0);
    for (x, z) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0_f32)] {
        let foot = Vec3::new(x * half_length, 0.0, z * half_width);
        let top = foot + Vec3::Y * FLAG_HEIGHT_M;
        solids.add_cylinder(foot, top, 0.03, 8, FLAG_POLE);
        let tip = top + Vec3::new(-x * 0.45, -0.17, -z * 0.12);
        solids.add_triangle([top, top - Vec3::Y * 0.36, tip], FLAG);
    }
}

/// A goal on the line `x = goal_line_m`; `outward` is the sign of x away from the pitch.
fn add_goal(goal_line_m: f32, outward: f32, solids: &mut SolidMesh, nets: &mut NetMesh) {
    let radius = POST_M / 2.0;
    let post_z = GOAL_WIDTH_M as f32 / 2.0 + radius;
    let bar_y = GOAL_HEIGHT_M as f32 + radius;
    let at = |back: f32, y: f32, z: f32| Vec3::new(goal_line_m + outward * back, y, z);

    for z in [-post_z, post_z] {
        solids.add_cylinder(at(0.0, 0.0, z), at(0.0, bar_y, z), radius, 20, WHITE);
        // The joint with the crossbar.
        solids.add_sphere(at(0.0, bar_y, z), radius, 8, |_| WHITE);
        // Stanchions that hold the net.
        solids.add_cylinder(at(0.0, bar_y, z), at(NET_DEPTH_TOP_M, bar_y, z), 0.03, 8, GREY);
        solids.add_cylinder(at(NET_DEPTH_TOP_M, bar_y, z), at(NET_DEPTH_BOTTOM_M, 0.0, z), 0.03, 8, GREY);
    }
    solids.add_cylinder(at(0.0, bar_y, -post_z), at(0.0, bar_y, post_z), radius, 20, WHITE);
    solids.add_cylinder(
        at(NET_DEPTH_BOTTOM_M, 0.03, -post_z),
        at(NET_DEPTH_BOTTOM_M, 0.03, post_z),
        0.03,
        8,
        GREY,
    );

    let slant = Vec2::new(NET_DEPTH_BOTTOM_M - NET_DEPTH_TOP_M, bar_y).length();
    let (left, right) = (-post_z, post_z);
    // Net coordinates are metres along the threads, so that meshes are the same size on every side.
    nets.add_quad([
        (at(0.0, bar_y, left), [left, 0.0]),
        (at(0.0, bar_y, right), [right, 0.0]),
        (at(NET_DEPTH_TOP_M, bar_y, right), [right, NET_DEPTH_TOP_M]),
        (at(NET_DEPTH_TOP_M, bar_y, left), [left, NET_DEPTH_TOP_M]),
    ]);
    nets.add_quad([
        (at(NET_DEPTH_TOP_M, bar_y, left), [left, NET_DEPTH_TOP_M]),
        (at(NET_DEPTH_TOP_M, bar_y, right), [right, NET_DEPTH_TOP_M]),
        (at(NET_DEPTH_BOTTOM_M, 0.0, right), [right, NET_DEPTH_TOP_M + slant]),
        (at(NET_DEPTH_BOTTOM_M, 0.0, left), [left, NET_DEPTH_TOP_M + slant]),
    ]);
    for z in [left, right] {
        nets.add_quad([
            (at(0.0, bar_y, z), [0.0, bar_y]),
            (at(NET_DEPTH_TOP_M, bar_y, z), [NET_DEPTH_TOP_M, bar_y]),
            (at(NET_DEPTH_BOTTOM_M, 0.0, z), [NET_DEPTH_BOTTOM_M, 0.0]),
            (at(0.0, 0.0, z), [0.0, 0.0]),
        ]);
    }
}

impl NetMesh {
    fn add_quad(&mut self, corners: [(Vec3, [f32; 2]); 4]) {
        let first = self.vertices.len() as u32;
        self.vertices
            .extend(corners.map(|(position, net_m)| NetVertex { position_m: position.into(), net_m }));
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ball_fits_between_posts_of_the_right_size() {
        let (mut solids, mut nets) = (SolidMesh::default(), NetMesh::default());
        add_goal(52.5, 1.0, &mut solids, &mut nets);
        // The inner faces of the posts are 7.32 m apart; the lower edge of the bar is at 2.44 m.
        let posts: Vec<Vec3> = solids
            .vertices
            .iter()
            .map(|v| Vec3::from(v.position_m))
            .filter(|p| p.y < 0.01 && (p.x - 52.5).abs() < 0.07)
            .collect();
        let inner = posts.iter().map(|p| p.z.abs()).fold(f32::INFINITY, f32::min);
        assert!((inner - 3.66).abs() < 0.005, "inner face at {inner}");
        let bar = solids.vertices.iter().filter(|v| v.position_m[2].abs() < 3.73 && v.normal[1] < -0.99);
        let lowest = bar.map(|v| v.position_m[1]).filter(|y| *y > 1.0).fold(f32::INFINITY, f32::min);
        assert!((lowest - 2.44).abs() < 0.005, "bar at {lowest}");
        assert!(nets.vertices.iter().all(|v| v.position_m[0] >= 52.5 - 1e-4), "net inside the pitch");
    }
}
