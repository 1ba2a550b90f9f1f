//! The chosen stretches fitted together: where one hands over to the next, both are at one place.
//!
//! The system is block-tridiagonal (each stretch meets two others), so means and covariances follow from one sweep each way.

use nalgebra::{Cholesky, SMatrix};

use super::{
    arc::{PARAMETERS, Parameters, Square},
    fit::{self, Fit, Pin, Robust, Stretch},
};

const ROUNDS: usize = 4;
/// Stretches meet within this, metres, besides what the moment of the touch leaves open.
const MEET_SIGMA_M: f64 = 0.05;

/// A stretch of the chain.
pub(super) struct Link<'a> {
    pub(super) stretch: Stretch<'a>,
    pub(super) pins: [Pin; 2],
    pub(super) fit: Fit,
    /// The time between the frames around its end.
    pub(super) slack_s: f64,
}

/// Refines a chain of stretches that follow each other; gives the covariance of each one's parameters, `None` where the
/// system is singular.
pub(super) fn refine(chain: &mut [Link<'_>]) -> Vec<Option<Square>> {
    for _ in 0..ROUNDS {
        let Some(system) = System::of(chain) else { break };
        let steps = system.solve();
        let ok = steps.iter().all(|step| step.as_ref().is_some_and(|(step, _)| step.norm() < 200.0));
        if !ok {
            break;
        }
        for (link, step) in chain.iter_mut().zip(steps) {
            if let Some((step, _)) = step {
                link.fit.parameters -= step;
            }
        }
    }
    match System::of(chain) {
        Some(system) => {
            system.solve().into_iter().map(|step| step.map(|(_, covariance)| covariance)).collect()
        }
        None => chain.iter().map(|link| link.fit.covariance()).collect(),
    }
}

/// Normal equations of a chain.
struct System {
    diagonal: Vec<Square>,
    gradient: Vec<Parameters>,
    /// Between a stretch and the next.
    beside: Vec<Square>,
}

impl System {
    fn of(chain: &[Link<'_>]) -> Option<Self> {
        let mut system = Self {
            diagonal: Vec::with_capacity(chain.len()),
            gradient: Vec::with_capacity(chain.len()),
            beside: vec![Square::zeros(); chain.len().saturating_sub(1)],
        };
        for link in chain {
            let normal =
                fit::normal(link.fit.law, &link.stretch, link.pins, &link.fit.parameters, Robust::Tukey)?;
            system.diagonal.push(normal.information);
            system.gradient.push(normal.gradient);
        }
        for (k, pair) in chain.windows(2).enumerate() {
            let [left, right] = pair else { continue };
            let end = left.fit.states([left.fit.to_s].into_iter()).pop()?;
            let start = right.fit.states([right.fit.from_s].into_iter()).pop()?;
            let change = (start.velocity - end.velocity).norm();
            let sigma = MEET_SIGMA_M + change * left.slack_s / 3.0;
            let apart = (end.position - start.position) / sigma;
            let by_left: SMatrix<f64, 3, PARAMETERS> = end.by_position / sigma;
            let by_right: SMatrix<f64, 3, PARAMETERS> = -start.by_position / sigma;
            system.diagonal[k] += by_left.transpose() * by_left;
            system.diagonal[k + 1] += by_right.transpose() * by_right;
            system.beside[k] = by_left.transpose() * by_right;
            system.gradient[k] += by_left.transpose() * apart;
            system.gradient[k + 1] += by_right.transpose() * apart;
        }
        Some(system)
    }

    /// The step and the covariance of every stretch.
    fn solve(&self) -> Vec<Option<(Parameters, Square)>> {
        let count = self.diagonal.len();
        let (mut forth, mut back) = (self.sweep(false), self.sweep(true));
        (0..count)
            .map(|k| {
                let (ahead, ahead_gradient) = forth.get_mut(k)?.take()?;
                let (behind, behind_gradient) = back.get_mut(k)?.take()?;
                let information = ahead + behind - self.diagonal[k];
                let factor = Cholesky::new(information)?;
                Some((factor.solve(&(ahead_gradient + behind_gradient - self.gradient[k])), factor.inverse()))
            })
            .collect()
    }

    /// Eliminates all stretches before each one (after it when `backward`).
    fn sweep(&self, backward: bool) -> Vec<Option<(Square, Parameters)>> {
        let count = self.diagonal.len();
        let mut swept: Vec<Option<(Square, Parameters)>> = vec![None; count];
        let mut last: Option<(usize, Square, Parameters)> = None;
        for step in 0..count {
            let k = if backward { count - 1 - step } else { step };
            let (mut information, mut gradient) = (self.diagonal[k], self.gradient[k]);
            if let Some((before, square, vector)) = last {
                // Rows of this stretch against columns of the eliminated one.
                let across = if backward { self.beside[k] } else { self.beside[before].transpose() };
                let Some(factor) = Cholesky::new(square) else { return swept };
                information -= across * factor.solve(&across.transpose());
                gradient -= across * factor.solve(&vector);
            }
            swept[k] = Some((information, gradient));
            last = Some((k, information, gradient));
        }
        swept
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    #[test]
    fn sweeps_give_what_the_whole_system_gives() {
        let count = 4;
        let size = count * PARAMETERS;
        let noise = |k: usize| ((k * 7919 % 613) as f64 / 613.0 - 0.5) * 0.2;
        let mut whole = DMatrix::<f64>::zeros(size, size);
        let mut right = DVector::<f64>::zeros(size);
        let (mut diagonal, mut beside, mut gradient) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..count {
            let square =
                Square::from_fn(|r, c| if r == c { 4.0 } else { noise(r.min(c) * 31 + r.max(c) * 17 + k) });
            let vector = Parameters::from_fn(|r, _| noise(r * 5 + k * 101));
            whole.view_mut((k * 9, k * 9), (9, 9)).copy_from(&square);
            right.rows_mut(k * 9, 9).copy_from(&vector);
            diagonal.push(square);
            gradient.push(vector);
            if k + 1 < count {
                let across = Square::from_fn(|r, c| noise(r * 13 + c * 29 + k * 211));
                whole.view_mut((k * 9, k * 9 + 9), (9, 9)).copy_from(&across);
                whole.view_mut((k * 9 + 9, k * 9), (9, 9)).copy_from(&across.transpose());
                beside.push(across);
            }
        }
        let inverse = whole.clone().try_inverse().unwrap();
        let step = &inverse * &right;
        for (k, solved) in (System { diagonal, gradient, beside }).solve().into_iter().enumerate() {
            let (ours, covariance) = solved.unwrap();
            assert!((step.rows(k * 9, 9) - ours).norm() < 1e-9, "step {k}");
            assert!((inverse.view((k * 9, k * 9), (9, 9)) - covariance).norm() < 1e-9, "covariance {k}");
        }
    }
}
