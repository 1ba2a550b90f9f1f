//! How a ball moves between two touches: through the air under gravity and drag, or along the grass.
//!
//! Both laws have the same nine parameters: where it starts, how fast, and a steady acceleration that stands for what the
//! law leaves out (spin and wind in the air; on the grass friction, and the foot that dribbles).

use glam::DVec3;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Place, velocity and extra acceleration at the start, three each.
pub(super) const PARAMETERS: usize = 9;
pub(super) type Parameters = SVector<f64, PARAMETERS>;
pub(super) type Square = SMatrix<f64, PARAMETERS, PARAMETERS>;
pub(super) type ByParameters = SMatrix<f64, 3, PARAMETERS>;

const GRAVITY: f64 = 9.81;
/// Drag per metre, ρ·c·A / 2m: air of 1.2 kg/m³, c = 0.25 at the speeds of passes and shots (Asai et al. 2007, Goff &
/// Carré 2009: 0.2 to 0.3), 0.22 m across, 0.43 kg.
const DRAG_PER_M: f64 = 0.0133;
/// Longest step of the integration, seconds: at 30 m/s its error after two seconds is below a centimetre.
const STEP_S: f64 = 0.04;

/// What the ball obeys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Law {
    /// It lies or rolls on the grass, or is dribbled.
    Grass,
    /// It flies.
    Air,
}

/// A ball at a moment, with the derivatives by the parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) by_position: ByParameters,
    pub(super) by_velocity: ByParameters,
}

impl State {
    fn start(parameters: &Parameters) -> Self {
        let mut by_position = ByParameters::zeros();
        let mut by_velocity = ByParameters::zeros();
        for axis in 0..3 {
            by_position[(axis, axis)] = 1.0;
            by_velocity[(axis, 3 + axis)] = 1.0;
        }
        Self {
            position: parameters.fixed_rows::<3>(0).into(),
            velocity: parameters.fixed_rows::<3>(3).into(),
            by_position,
            by_velocity,
        }
    }

    /// A step by the midpoint rule.
    fn step(&mut self, law: Law, extra: &Vector3<f64>, seconds: f64) {
        let (push, push_by_velocity) = push(law, &self.velocity);
        let half = seconds / 2.0;
        let middle_velocity = self.velocity + (push + extra) * half;
        let mut middle_by_velocity = self.by_velocity + push_by_velocity * self.by_velocity * half;
        for axis in 0..3 {
            middle_by_velocity[(axis, 6 + axis)] += half;
        }
        let (push, push_by_velocity) = self::push(law, &middle_velocity);
        self.position += middle_velocity * seconds;
        self.by_position += middle_by_velocity * seconds;
        self.velocity += (push + extra) * seconds;
        self.by_velocity += push_by_velocity * middle_by_velocity * seconds;
        for axis in 0..3 {
            self.by_velocity[(axis, 6 + axis)] += seconds;
        }
    }
}

/// The acceleration and its derivative by the velocity.
fn push(law: Law, velocity: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    match law {
        Law::Grass => (Vector3::zeros(), Matrix3::zeros()),
        Law::Air => {
            let speed = velocity.norm().max(1e-3);
            let by_velocity =
                (Matrix3::identity() * speed + velocity * velocity.transpose() / speed) * -DRAG_PER_M;
            (velocity * (-DRAG_PER_M * speed) - Vector3::y() * GRAVITY, by_velocity)
        }
    }
}

/// States at `seconds` after the start, which must not fall; negative ones are taken as 0.
pub(super) fn states(law: Law, parameters: &Parameters, seconds: impl Iterator<Item = f64>) -> Vec<State> {
    let mut state = State::start(parameters);
    let extra: Vector3<f64> = parameters.fixed_rows::<3>(6).into();
    let mut now = 0.0;
    seconds
        .map(|moment| {
            let left = moment - now;
            let steps = (left / STEP_S).ceil().clamp(0.0, 10_000.0) as usize;
            for _ in 0..steps {
                state.step(law, &extra, left / steps as f64);
            }
            now = now.max(moment);
            state
        })
        .collect()
}

/// The velocity that takes a ball through the air from one place to another in `seconds`, drag left out.
pub(super) fn thrown(from: DVec3, to: DVec3, seconds: f64) -> DVec3 {
    (to - from) / seconds.max(1e-3) + DVec3::Y * (GRAVITY * seconds / 2.0)
}

pub(super) fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

pub(super) fn point(v: &Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kicked() -> Parameters {
        Parameters::from([1.0, 0.11, -3.0, 21.0, 11.0, -6.0, 0.3, -0.2, 0.1])
    }

    #[test]
    fn a_flight_agrees_with_fine_steps() {
        let coarse = states(Law::Air, &kicked(), [1.9].into_iter())[0];
        let fine = states(Law::Air, &kicked(), (0..=1900).map(|k| f64::from(k) / 1000.0)).pop().unwrap();
        assert!((coarse.position - fine.position).norm() < 0.02, "{}", coarse.position - fine.position);
    }

    #[test]
    fn derivatives_are_those_of_the_path() {
        for law in [Law::Air, Law::Grass] {
            let at = |parameters: &Parameters| states(law, parameters, [0.3, 1.1].into_iter())[1];
            let state = at(&kicked());
            for k in 0..PARAMETERS {
                let mut moved = kicked();
                moved[k] += 1e-5;
                let numeric = (at(&moved).position - state.position) / 1e-5;
                assert!((state.by_position.column(k) - numeric).norm() < 1e-3, "{law:?} {k}");
                let numeric = (at(&moved).velocity - state.velocity) / 1e-5;
                assert!((state.by_velocity.column(k) - numeric).norm() < 1e-3, "{law:?} {k}");
            }
        }
    }

    #[test]
    fn a_throw_without_drag_arrives() {
        let (from, to) = (DVec3::new(0.0, 0.1, 0.0), DVec3::new(3.0, 1.0, -2.0));
        let v = thrown(from, to, 0.8);
        let at = from + v * 0.8 - DVec3::Y * (GRAVITY * 0.32);
        assert!((at - to).length() < 1e-9);
    }
}
