//! How people move on the pitch, and how well one picture tells where they stand.
//!
//! A person's velocity wanders about zero and is forgotten after [`MEMORY_S`] (an Ornstein–Uhlenbeck process), so that predictions over one
//! frame and over ten seconds come from one model, with the right uncertainty. States are Kalman filtered.

use glam::DVec2;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};

/// Standard deviation of a player's velocity along each axis, metres per second.
const SPEED_M_S: f64 = 2.2;
/// A velocity is forgotten after this time, seconds.
const MEMORY_S: f64 = 2.0;
/// Standard deviation of a measured place across the line of sight and along it (on the pitch), metres. Larger than the errors of single
/// pictures, because those of neighbouring pictures are alike (a step lasts many frames).
const ACROSS_M: f64 = 0.2;
const ALONG_M: f64 = 0.5;

/// A measured place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// World x and z, metres.
    pub(super) at: DVec2,
    noise: Matrix2<f64>,
}

impl Place {
    /// A place seen from a camera above `from` (world x and z); without a camera uncertain in all directions.
    pub(super) fn seen(at: DVec2, from: Option<DVec2>) -> Self {
        let sight = from.and_then(|from| (at - from).try_normalize());
        let noise = match sight {
            Some(sight) => {
                let along = Vector2::new(sight.x, sight.y);
                Matrix2::identity() * ACROSS_M.powi(2)
                    + along * along.transpose() * (ALONG_M.powi(2) - ACROSS_M.powi(2))
            }
            None => Matrix2::identity() * ALONG_M.powi(2),
        };
        Self { at, noise }
    }

    /// The same place, surer or less sure: its variance times `factor`.
    #[cfg(test)]
    pub(super) fn times(self, factor: f64) -> Self {
        Self { noise: self.noise * factor, ..self }
    }
}

/// Where somebody is and how fast: x, z in metres, then their velocities in metres per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

fn place_of() -> Matrix2x4<f64> {
    Matrix2x4::identity()
}

/// What becomes of a state in `seconds` ≥ 0, and what that adds to its uncertainty.
fn transition(seconds: f64) -> (Matrix4<f64>, Matrix4<f64>) {
    let kept = (-seconds / MEMORY_S).exp();
    let moved = MEMORY_S * (1.0 - kept);
    let variance = SPEED_M_S.powi(2);
    // Integrals of the process; for short times they are those of a constant velocity with white acceleration.
    let place =
        variance * MEMORY_S.powi(2) * (2.0 * seconds / MEMORY_S - 3.0 + 4.0 * kept - kept * kept).max(0.0);
    let both = variance * MEMORY_S * (1.0 - kept).powi(2);
    let speed = variance * (1.0 - kept * kept);
    let blocks = |a: f64, b: f64, c: f64, d: f64| {
        Matrix4::new(a, 0.0, b, 0.0, 0.0, a, 0.0, b, c, 0.0, d, 0.0, 0.0, c, 0.0, d)
    };
    (blocks(1.0, moved, 0.0, kept), blocks(place, both, both, speed))
}

impl State {
    /// Somebody of whom one place is known.
    pub(super) fn new(place: &Place) -> Self {
        let mut covariance = Matrix4::identity() * SPEED_M_S.powi(2);
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.noise);
        Self { mean: Vector4::new(place.at.x, place.at.y, 0.0, 0.0), covariance }
    }

    /// The state some time later.
    pub(super) fn after(&self, seconds: f64) -> Self {
        let (moves, adds) = transition(seconds.max(0.0));
        Self { mean: moves * self.mean, covariance: moves * self.covariance * moves.transpose() + adds }
    }

    /// The state with one more measured place.
    pub(super) fn with(&self, place: &Place) -> Self {
        let (difference, spread) = self.difference(place);
        let Some(inverse) = spread.try_inverse() else { return *self };
        let gain = self.covariance * place_of().transpose() * inverse;
        let covariance = (Matrix4::identity() - gain * place_of()) * self.covariance;
        Self { mean: self.mean + gain * difference, covariance: (covariance + covariance.transpose()) / 2.0 }
    }

    /// The state as if time ran backwards.
    pub(super) fn reversed(&self) -> Self {
        let turn = Matrix4::from_diagonal(&Vector4::new(1.0, 1.0, -1.0, -1.0));
        Self { mean: turn * self.mean, covariance: turn * self.covariance * turn }
    }

    fn difference(&self, place: &Place) -> (Vector2<f64>, Matrix2<f64>) {
        let difference = Vector2::new(place.at.x, place.at.y) - place_of() * self.mean;
        (difference, place_of() * self.covariance * place_of().transpose() + place.noise)
    }

    /// Where it is, metres.
    pub(super) fn place_m(&self) -> DVec2 {
        DVec2::new(self.mean.x, self.mean.y)
    }

    /// Logarithm of the density of a place in this state, per square metre.
    pub(super) fn log_density(&self, place: &Place) -> f64 {
        let (difference, spread) = self.difference(place);
        let Some(inverse) = spread.try_inverse() else { return f64::NEG_INFINITY };
        let surprise = (difference.transpose() * inverse * difference).x;
        -0.5 * (surprise + spread.determinant().ln()) - std::f64::consts::TAU.ln()
    }

    /// How much likelier it is that `later` is this person `seconds` on than that it is another one who stands there by chance, as a
    /// logarithm: the densities of place and velocity given this state, against `others_per_m2` people with any velocity. `apart_m` is a further
    /// standard deviation between two places, metres.
    pub(super) fn log_same(&self, later: &Self, seconds: f64, others_per_m2: f64, apart_m: f64) -> f64 {
        let predicted = self.after(seconds);
        let mut spread = predicted.covariance + later.covariance;
        for axis in 0..2 {
            spread[(axis, axis)] += apart_m * apart_m;
        }
        let difference = later.mean - predicted.mean;
        let Some(cholesky) = spread.cholesky() else { return f64::NEG_INFINITY };
        let surprise = difference.dot(&cholesky.solve(&difference));
        let log_determinant = 2.0 * cholesky.l().diagonal().map(f64::ln).sum();
        let same = -0.5 * (surprise + log_determinant) - 2.0 * std::f64::consts::TAU.ln();
        // A stranger: anywhere, with a velocity of the whole population.
        let mut velocity: Matrix2<f64> = later.covariance.fixed_view::<2, 2>(2, 2).into();
        velocity += Matrix2::identity() * SPEED_M_S.powi(2);
        let of_later = Vector2::new(later.mean[2], later.mean[3]);
        let Some(inverse) = velocity.try_inverse() else { return f64::NEG_INFINITY };
        let stranger = -0.5 * ((of_later.transpose() * inverse * of_later).x + velocity.determinant().ln())
            - std::f64::consts::TAU.ln()
            + others_per_m2.ln();
        same - stranger
    }
}

/// The states at the end of a run of places (seconds, place), in order of time, and at its start as seen from later.
pub(super) fn ends(places: &[(f64, Place)]) -> Option<(State, State)> {
    let filtered = |places: &mut dyn Iterator<Item = &(f64, Place)>| {
        let &(mut before, ref first) = places.next()?;
        let mut state = State::new(first);
        for (seconds, place) in places {
            state = state.after((seconds - before).abs()).with(place);
            before = *seconds;
        }
        Some(state)
    };
    // Places older than a few memories say nothing more about the end.
    const ENOUGH: usize = 150;
    let from = places.len().saturating_sub(ENOUGH);
    let end = filtered(&mut places.get(from..)?.iter())?;
    let start = filtered(&mut places.iter().take(ENOUGH).rev())?.reversed();
    Some((start, end))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn walk(speed: DVec2, count: usize) -> Vec<(f64, Place)> {
        (0..count)
            .map(|i| (i as f64 * 0.04, Place::seen(speed * (i as f64 * 0.04), None).times(0.01)))
            .collect()
    }

    #[test]
    fn a_runner_is_expected_where_the_run_leads_and_nobody_else_is() {
        let speed = DVec2::new(4.0, -2.0);
        let (start, end) = ends(&walk(speed, 50)).unwrap();
        assert!(start.place_m().length() < 0.1 && (end.place_m() - speed * 1.96).length() < 0.1);
        let (later, _) = ends(
            &walk(speed, 20)
                .iter()
                .map(|(t, p)| (t + 2.96, Place { at: p.at + speed * 2.96, ..*p }))
                .collect::<Vec<_>>(),
        )
        .unwrap();
        let same = end.log_same(&later, 1.0, 0.005, 0.0);
        assert!(same > 3.0, "{same}");
        // The same place, but running the other way: likelier somebody else.
        let back = later.reversed();
        assert!(end.log_same(&back, 1.0, 0.005, 0.0) < 0.0);
    }

    proptest! {
        #[test]
        fn two_steps_are_one_long_step(
            a in 0.0..5.0_f64, b in 0.0..5.0_f64, x in -40.0..40.0_f64, vx in -8.0..8.0_f64, vz in -8.0..8.0_f64,
        ) {
            let state = State { mean: Vector4::new(x, 3.0, vx, vz), ..State::new(&Place::seen(DVec2::ZERO, None)) };
            let (long, short) = (state.after(a + b), state.after(a).after(b));
            prop_assert!((long.mean - short.mean).norm() < 1e-9);
            prop_assert!((long.covariance - short.covariance).norm() < 1e-8);
        }

        #[test]
        fn places_are_less_sure_along_the_line_of_sight(x in -50.0..50.0_f64, z in -30.0..30.0_f64) {
            let (at, camera) = (DVec2::new(x, z), DVec2::new(0.0, 70.0));
            let place = Place::seen(at, Some(camera));
            let state = State::new(&place);
            let sight = (at - camera).normalize();
            let off = |by: DVec2| state.log_density(&Place { at: at + by, ..place });
            prop_assert!(off(sight) > off(sight.perp()));
        }
    }
}
