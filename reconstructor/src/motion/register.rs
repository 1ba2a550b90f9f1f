//! A surface laid onto another: non-rigid iterative closest points that keep the surface as rigid as possible.
//!
//! Energy and alternation after Sorkine and Alexa, "As-Rigid-As-Possible Surface Modeling" (SGP 2007), with stiffness that falls from
//! step to step as in Amberg et al., "Optimal Step Nonrigid ICP" (CVPR 2007). Both surfaces pull: points of ours to the other, and places of the
//! other to ours, so that nothing of the other is left out.

use glam::{DMat3, DQuat, DVec3};

use super::topology::Topology;
use crate::surface::{MeshPlace, Surface, Triangle, barycentric};

/// Stiffness of the first and of the last step, and how many there are.
const STIFF: f64 = 2.0;
const SOFT: f64 = 0.02;
const STEPS: usize = 10;
/// Sweeps of the linear solver in a step.
const SWEEPS: usize = 12;
/// Nothing farther away than this pulls, metres.
const REACH_M: f64 = 0.25;
/// Surfaces that meet pull only where their normals differ less than this, a cosine.
const FACING: f64 = 0.3;

/// The surface that another one is laid on.
pub(super) struct Target {
    pub(super) surface: Surface,
    /// Places on it, spread evenly, and the normals there.
    pub(super) places: Vec<(DVec3, DVec3)>,
}

impl Target {
    /// `None` without triangles.
    pub(super) fn new(triangles: &[Triangle], places: &[MeshPlace]) -> Option<Self> {
        let at = |place: &MeshPlace| {
            let [a, b, c] = *triangles.get(place.triangle)?;
            let [u, v, w] = place.weights;
            Some((a * u + b * v + c * w, (b - a).cross(c - a).normalize_or_zero()))
        };
        Some(Self { surface: Surface::new(triangles)?, places: places.iter().filter_map(at).collect() })
    }
}

/// Points of the surface `rest` moved onto `target`, beginning at `start`.
pub(super) fn register(
    topology: &Topology,
    rest: &[DVec3],
    start: Vec<DVec3>,
    target: &Target,
) -> Vec<DVec3> {
    let mut points = start;
    let mut turns = vec![DQuat::IDENTITY; rest.len()];
    for step in 0..STEPS {
        let part = step as f64 / (STEPS - 1) as f64;
        let stiffness = STIFF * (SOFT / STIFF).powf(part);
        let goals = goals(topology, &points, target);
        for (index, turn) in turns.iter_mut().enumerate() {
            *turn = turn_of(index, topology, rest, &points, *turn);
        }
        solve(topology, rest, &turns, &goals, stiffness, &mut points);
    }
    points
}

/// Where each point is pulled to, and how strongly.
fn goals(topology: &Topology, points: &[DVec3], target: &Target) -> Vec<(DVec3, f64)> {
    let normals = topology.normals(points);
    let mut goals: Vec<(DVec3, f64)> = points
        .iter()
        .zip(&normals)
        .map(|(point, normal)| match target.surface.nearest_facing(*point, *normal, FACING, REACH_M) {
            Some(near) => (near.point, 1.0),
            None => (DVec3::ZERO, 0.0),
        })
        .collect();
    let triangles = topology.in_space(points);
    let Some(own) = Surface::new(&triangles) else { return goals };
    for (place, normal) in &target.places {
        let Some(near) = own.nearest_facing(*place, *normal, FACING, REACH_M) else { continue };
        let corners = topology.triangles[near.triangle];
        let weights = barycentric(near.point, triangles[near.triangle]);
        for (corner, weight) in corners.into_iter().zip(weights) {
            let (sum, total) = &mut goals[corner as usize];
            *sum += (points[corner as usize] + *place - near.point) * weight;
            *total += weight;
        }
    }
    for (sum, total) in &mut goals {
        if *total > 0.0 {
            *sum /= *total;
            *total = total.min(2.0);
        }
    }
    goals
}

/// How the edges round a point have turned since rest, found from the turn before (Müller et al., "A Robust Method to Extract the
/// Rotational Part of Deformations", MIG 2016).
fn turn_of(index: usize, topology: &Topology, rest: &[DVec3], points: &[DVec3], before: DQuat) -> DQuat {
    let mut spread = DMat3::ZERO;
    for &other in &topology.neighbours[index] {
        let (from, to) = (rest[other as usize] - rest[index], points[other as usize] - points[index]);
        spread += DMat3::from_cols(to * from.x, to * from.y, to * from.z);
    }
    let mut turn = before;
    for _ in 0..4 {
        let now = DMat3::from_quat(turn);
        let (x, y, z) = (now.x_axis, now.y_axis, now.z_axis);
        let twist = x.cross(spread.x_axis) + y.cross(spread.y_axis) + z.cross(spread.z_axis);
        let size = x.dot(spread.x_axis) + y.dot(spread.y_axis) + z.dot(spread.z_axis);
        let omega = twist / (size.abs() + 1e-12);
        let angle = omega.length();
        if angle < 1e-6 {
            break;
        }
        turn = (DQuat::from_axis_angle(omega / angle, angle.min(1.5)) * turn).normalize();
    }
    turn
}

/// Gauss–Seidel sweeps over the energy: the pull of the goals, and edges that keep their turned shape.
fn solve(
    topology: &Topology,
    rest: &[DVec3],
    turns: &[DQuat],
    goals: &[(DVec3, f64)],
    stiffness: f64,
    points: &mut [DVec3],
) {
    let turns: Vec<DMat3> = turns.iter().map(|turn| DMat3::from_quat(*turn)).collect();
    // What the edges of a point would add to its neighbours' sum does not change in the sweeps.
    let shapes: Vec<DVec3> = (0..points.len())
        .map(|index| {
            let edge = |&other: &u32| {
                (turns[index] + turns[other as usize]) * 0.5 * (rest[index] - rest[other as usize])
            };
            topology.neighbours[index].iter().map(edge).sum()
        })
        .collect();
    for _ in 0..SWEEPS {
        for index in 0..points.len() {
            let neighbours = &topology.neighbours[index];
            if neighbours.is_empty() {
                continue;
            }
            let share = stiffness / neighbours.len() as f64;
            let around: DVec3 = neighbours.iter().map(|&other| points[other as usize]).sum();
            let (goal, weight) = goals[index];
            points[index] = (goal * weight + (around + shapes[index]) * share) / (weight + stiffness);
        }
    }
}
