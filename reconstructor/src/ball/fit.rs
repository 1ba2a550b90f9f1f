//! One stretch of the ball's way fitted to what was seen: least squares over the rays of the pixels, robust against a
//! wrong candidate, with what is known of its two ends.

use glam::DVec3;
use nalgebra::{Cholesky, Matrix3, Vector3};

use super::{
    RADIUS_M,
    arc::{self, ByParameters, Law, Parameters, Square, State},
    sight::{self, Sight},
};

/// Error of a candidate's middle, pixels.
pub(super) const PIXEL_SIGMA: f64 = 1.2;
/// Tukey's constant: a sight farther off than so many standard deviations is of something else.
const TUKEY: f64 = 5.0;
/// What a sight costs that is of something else.
pub(super) const OUTLIER_COST: f64 = TUKEY * TUKEY / 6.0;
/// Huber's constant of the first rounds.
const HUBER: f64 = 3.0;
const ROUNDS: usize = 7;
const HUBER_ROUNDS: usize = 4;

/// Standard deviations before anything is seen: speed in the air, on the grass and upwards (m/s), place (m), and the acceleration
/// that spin and wind give a ball (m/s²).
const SPEED_SIGMA: f64 = 16.0;
const ROLLING_SIGMA: f64 = 9.0;
const RISE_SIGMA: f64 = 9.0;
const PLACE_SIGMA_M: f64 = 45.0;
const HEIGHT_SIGMA_M: f64 = 6.0;
const SPIN_SIGMA: f64 = 0.4;
/// A ball on the grass stays there within this, metres and metres per second.
const GRASS_SIGMA: f64 = 0.02;
/// Height of a ball that is kicked off the grass or comes down on it, at a moment known to half a frame, metres.
const GROUND_PIN_SIGMA_M: f64 = 0.12;
/// No ball is faster, m/s.
const SPEED_MAX: f64 = 38.0;
/// No ball flies higher, metres.
const HEIGHT_MAX_M: f64 = 30.0;

/// What is known of an end of a stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pin {
    /// Nothing.
    Free,
    /// It is on the grass.
    Ground,
    /// It is at somebody's foot, head or hand: a place, with its standard deviation along and across the line of sight.
    At(Contact),
}

/// A place beside a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Contact {
    /// World metres.
    pub(super) point: DVec3,
    /// Standard deviation, metres.
    pub(super) sigma_m: f64,
}

/// What is to be explained.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch<'a> {
    /// Sights in order of time.
    pub(super) sights: &'a [Sight],
    /// Where it starts and ends, seconds from the start of the clip.
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    /// Standard deviation of the steady acceleration on the grass, m/s².
    pub(super) push_sigma: f64,
}

/// The way that explains a stretch best.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub(super) law: Law,
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    pub(super) parameters: Parameters,
    /// Inverse covariance.
    pub(super) information: Square,
    /// Half the weighted sum of squares, robust for sights.
    pub(super) cost: f64,
    /// Sights that it explains.
    pub(super) explained: usize,
}

/// An end of a fit: where and how fast, with covariances.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
    pub(super) position_covariance: Matrix3<f64>,
    pub(super) velocity_covariance: Matrix3<f64>,
}

/// Normal equations under way.
pub(super) struct Normal {
    pub(super) information: Square,
    pub(super) gradient: Parameters,
    pub(super) cost: f64,
    pub(super) explained: usize,
}

impl Normal {
    /// A residual `value` (already over its standard deviation) with its derivative by the parameters.
    fn add(&mut self, value: f64, by: &nalgebra::RowSVector<f64, { arc::PARAMETERS }>, weight: f64) {
        self.information.ger(weight, &by.transpose(), &by.transpose(), 1.0);
        self.gradient.axpy(weight * value, &by.transpose(), 1.0);
    }

    fn pin(&mut self, state: &State, axis: usize, target: f64, sigma: f64) {
        let value = (state.position[axis] - target) / sigma;
        self.add(value, &(state.by_position.row(axis) / sigma), 1.0);
        self.cost += value * value / 2.0;
    }
}

/// Whether sights far off still pull.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Robust {
    Huber,
    Tukey,
}

fn priors(law: Law, push_sigma: f64) -> ([f64; 9], [f64; 9]) {
    let (mean_y, place_y, speed, rise, spin, push_y) = match law {
        Law::Grass => (RADIUS_M, GRASS_SIGMA, ROLLING_SIGMA, GRASS_SIGMA, push_sigma, GRASS_SIGMA),
        Law::Air => (2.0, HEIGHT_SIGMA_M, SPEED_SIGMA, RISE_SIGMA, SPIN_SIGMA, SPIN_SIGMA),
    };
    let mean = [0.0, mean_y, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let sigma = [PLACE_SIGMA_M, place_y, PLACE_SIGMA_M, speed, rise, speed, spin, push_y, spin];
    (mean, sigma)
}

/// Normal equations of a stretch at some parameters; `None` when a place is behind a camera.
pub(super) fn normal(
    law: Law,
    stretch: &Stretch<'_>,
    pins: [Pin; 2],
    parameters: &Parameters,
    robust: Robust,
) -> Option<Normal> {
    let mut normal =
        Normal { information: Square::zeros(), gradient: Parameters::zeros(), cost: 0.0, explained: 0 };
    let (mean, sigma) = priors(law, stretch.push_sigma);
    for k in 0..arc::PARAMETERS {
        let value = (parameters[k] - mean[k]) / sigma[k];
        normal.information[(k, k)] += 1.0 / (sigma[k] * sigma[k]);
        normal.gradient[k] += value / sigma[k];
        normal.cost += value * value / 2.0;
    }
    let since = |seconds: f64| seconds - stretch.from_s;
    let moments = std::iter::once(0.0)
        .chain(stretch.sights.iter().map(|sight| since(sight.seconds)))
        .chain(std::iter::once(since(stretch.to_s)));
    let states = arc::states(law, parameters, moments);
    let (first, rest) = states.split_first()?;
    let (last, seen) = rest.split_last()?;
    for (sight, state) in stretch.sights.iter().zip(seen) {
        let (pixel, by_point) = sight::project(&sight.camera, arc::point(&state.position))?;
        let value = (pixel - nalgebra::Vector2::new(sight.pixel.x, sight.pixel.y)) / PIXEL_SIGMA;
        let size = value.norm();
        let (weight, cost) = match robust {
            Robust::Huber => ((HUBER / size.max(HUBER)), size.min(HUBER) * (size - size.min(HUBER) / 2.0)),
            Robust::Tukey => {
                let inside = (1.0 - (size / TUKEY).powi(2)).max(0.0);
                (inside * inside, OUTLIER_COST * (1.0 - inside.powi(3)))
            }
        };
        normal.cost += cost;
        if size < TUKEY {
            normal.explained += 1;
        }
        let by = by_point * state.by_position / PIXEL_SIGMA;
        for axis in 0..2 {
            normal.add(value[axis], &by.row(axis).into_owned(), weight);
        }
    }
    for (pin, state) in pins.into_iter().zip([first, last]) {
        match pin {
            Pin::Free => {}
            Pin::Ground => normal.pin(state, 1, RADIUS_M, GROUND_PIN_SIGMA_M),
            Pin::At(contact) => {
                for axis in 0..3 {
                    normal.pin(state, axis, contact.point.to_array()[axis], contact.sigma_m);
                }
            }
        }
    }
    Some(normal)
}

/// The best way of a kind through a stretch; `None` when there is none that a ball can take.
pub(super) fn fit(
    law: Law,
    stretch: &Stretch<'_>,
    pins: [Pin; 2],
    start: Option<&Parameters>,
) -> Option<Fit> {
    let mut parameters = match start {
        Some(parameters) => *parameters,
        None => first_guess(law, stretch, pins)?,
    };
    let rounds = if start.is_some() { ROUNDS - 2 } else { ROUNDS };
    for round in 0..rounds {
        let early = round + (ROUNDS - rounds) < HUBER_ROUNDS;
        let robust = if early { Robust::Huber } else { Robust::Tukey };
        let normal = normal(law, stretch, pins, &parameters, robust)?;
        let step = Cholesky::new(normal.information)?.solve(&normal.gradient);
        parameters -= step;
        if !early && step.fixed_rows::<3>(0).norm() < 1e-3 {
            break;
        }
    }
    let end = normal(law, stretch, pins, &parameters, Robust::Tukey)?;
    let fit = Fit {
        law,
        from_s: stretch.from_s,
        to_s: stretch.to_s,
        parameters,
        information: end.information,
        cost: end.cost,
        explained: end.explained,
    };
    fit.possible().then_some(fit)
}

/// From the grass under the first sight to the grass under the last one, or from pin to pin.
fn first_guess(law: Law, stretch: &Stretch<'_>, pins: [Pin; 2]) -> Option<Parameters> {
    let (first, last) = (stretch.sights.first()?, stretch.sights.last()?);
    let at = |sight: &Sight, pin: Pin| match pin {
        Pin::At(contact) => Some(contact.point),
        Pin::Ground | Pin::Free => sight::on_grass(&sight.camera, sight.pixel)
            .or_else(|| Some(sight.camera.ray(sight.pixel)).map(|ray| ray.origin + ray.direction * 60.0)),
    };
    let (from, to) = (at(first, pins[0])?, at(last, pins[1])?);
    let seconds = (last.seconds - first.seconds).max(0.04);
    let velocity = match law {
        Law::Grass => (to - from) / seconds,
        Law::Air => arc::thrown(from, to, seconds),
    };
    let mut parameters = Parameters::zeros();
    parameters.fixed_rows_mut::<3>(0).copy_from(&arc::vector(from));
    parameters.fixed_rows_mut::<3>(3).copy_from(&arc::vector(velocity.clamp_length_max(SPEED_MAX)));
    Some(parameters)
}

impl Fit {
    /// States at moments of the clip, in order.
    pub(super) fn states(&self, seconds: impl Iterator<Item = f64>) -> Vec<State> {
        arc::states(self.law, &self.parameters, seconds.map(|moment| moment - self.from_s))
    }

    /// The covariance of the parameters.
    pub(super) fn covariance(&self) -> Option<Square> {
        Cholesky::new(self.information).map(|factor| factor.inverse())
    }

    /// Start and end.
    pub(super) fn ends(&self) -> Option<[End; 2]> {
        let covariance = self.covariance()?;
        let states = self.states([self.from_s, self.to_s].into_iter());
        let [start, end] = states.as_slice() else { return None };
        Some([start, end].map(|state| End {
            position: state.position,
            velocity: state.velocity,
            position_covariance: spread(&covariance, &state.by_position),
            velocity_covariance: spread(&covariance, &state.by_velocity),
        }))
    }

    /// Whether no ball law is broken: above the grass, not too fast, not too high.
    fn possible(&self) -> bool {
        let middle = (self.from_s + self.to_s) / 2.0;
        let states = self.states([self.from_s, middle, self.to_s].into_iter());
        states.iter().all(|state| {
            let height = state.position.y;
            state.velocity.norm() < SPEED_MAX && height > RADIUS_M - 0.6 && height < HEIGHT_MAX_M
        })
    }
}

/// A covariance of the parameters seen as one of a place.
pub(super) fn spread(covariance: &Square, by: &ByParameters) -> Matrix3<f64> {
    by * covariance * by.transpose()
}
