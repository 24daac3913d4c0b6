//! Nonlinear least squares: Levenberg-Marquardt (Marquardt 1963) within bounds.

use crate::bounds::Bounds;
use nalgebra::{DMatrix, DVector};

/// Damping at first, relative to the diagonal of the normal equations; what a success and a failure
/// change it by; and the least from which a failure raises it.
const FIRST_DAMPING: f64 = 1e-3;
const DAMPING_AFTER_SUCCESS: f64 = 0.2;
const DAMPING_AFTER_FAILURE: f64 = 5.0;
const MIN_RAISED_DAMPING: f64 = 1e-6;
/// Dampings that are tried for one step.
const TRIES: usize = 6;
/// Keeps a parameter on which nothing depends where it is.
const MIN_CURVATURE: f64 = 1e-9;

/// A cost that is nearly a sum of squares of what is left.
pub trait LeastSquares {
    /// What is to be least.
    fn cost(&self, x: &[f64]) -> f64;

    /// Its normal equations at `x`.
    fn normal_equations(&self, x: &[f64]) -> NormalEquations;
}

/// Half the second derivatives of the cost by Gauss and Newton, J'J, and minus half the first, J'r.
pub struct NormalEquations {
    pub hessian: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

/// How far one parameter may go.
#[derive(Clone, Copy, Debug)]
pub struct ParameterLimits {
    /// Infinite where there is none.
    pub bounds: Bounds,
    /// In one step.
    pub max_step: f64,
}

/// When a fit is done: after so many steps, or one that gains no more than this.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    pub max_steps: usize,
    pub min_gain: f64,
    /// As a share of the cost.
    pub min_relative_gain: f64,
}

impl NormalEquations {
    /// Of nothing, in `n` parameters.
    pub fn zeros(n: usize) -> Self {
        Self {
            hessian: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
        }
    }

    /// Adds `weight` times the square of a parameter's distance from where it is expected, `off`
    /// away.
    pub fn add_prior(&mut self, parameter: usize, off: f64, weight: f64) {
        self.hessian[(parameter, parameter)] += weight;
        self.gradient[parameter] += weight * off;
    }

    /// Standard deviations of the parameters for noise of variance 1; `None` where some are open.
    pub fn deviations(self) -> Option<Vec<f64>> {
        let inverse = self.hessian.cholesky()?.inverse();
        let variances = inverse.diagonal();
        Some(variances.iter().map(|v| v.max(0.0).sqrt()).collect())
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut hessian = self.hessian.clone();
        for k in 0..hessian.nrows() {
            hessian[(k, k)] += damping * hessian[(k, k)] + MIN_CURVATURE;
        }
        Some(hessian.cholesky()?.solve(&self.gradient))
    }
}

/// The parameters near `start` at which the cost is least, within `limits` of each.
pub fn levenberg_marquardt(
    problem: &impl LeastSquares,
    start: Vec<f64>,
    limits: &[ParameterLimits],
    stopping: &Stopping,
) -> Vec<f64> {
    let mut x = start;
    let mut cost = problem.cost(&x);
    let mut damping = FIRST_DAMPING;
    for _ in 0..stopping.max_steps {
        let normal = problem.normal_equations(&x);
        let Some((next, next_cost)) = better(problem, &normal, &x, cost, limits, &mut damping)
        else {
            break;
        };
        let gain = cost - next_cost;
        let enough = stopping.min_gain + stopping.min_relative_gain * cost;
        (x, cost) = (next, next_cost);
        if gain <= enough {
            break;
        }
    }
    x
}

/// A place with less cost than at `x`, and that cost; `None` where no step leads to one.
fn better(
    problem: &impl LeastSquares,
    normal: &NormalEquations,
    x: &[f64],
    cost: f64,
    limits: &[ParameterLimits],
    damping: &mut f64,
) -> Option<(Vec<f64>, f64)> {
    for _ in 0..TRIES {
        if let Some(step) = normal.step(*damping) {
            let next = stepped(x, &step, limits);
            let next_cost = problem.cost(&next);
            if next_cost < cost {
                *damping *= DAMPING_AFTER_SUCCESS;
                return Some((next, next_cost));
            }
        }
        *damping = (*damping * DAMPING_AFTER_FAILURE).max(MIN_RAISED_DAMPING);
    }
    None
}

fn stepped(x: &[f64], step: &DVector<f64>, limits: &[ParameterLimits]) -> Vec<f64> {
    let mut next = x.to_vec();
    for ((x, step), limits) in next.iter_mut().zip(step.iter()).zip(limits) {
        let moved = *x + step.clamp(-limits.max_step, limits.max_step);
        *x = limits.bounds.clamp(moved);
    }
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of 2 a - 3 and exp(b) - 4.
    struct Two;

    impl LeastSquares for Two {
        fn cost(&self, x: &[f64]) -> f64 {
            (2.0 * x[0] - 3.0).powi(2) + (x[1].exp() - 4.0).powi(2)
        }

        fn normal_equations(&self, x: &[f64]) -> NormalEquations {
            let mut out = NormalEquations::zeros(2);
            let slope = x[1].exp();
            out.add_prior(0, (3.0 - 2.0 * x[0]) / 2.0, 4.0);
            out.add_prior(1, (4.0 - slope) / slope, slope * slope);
            out
        }
    }

    #[test]
    fn the_least_place_is_found_and_bounds_hold() {
        let stopping = Stopping {
            max_steps: 50,
            min_gain: 0.0,
            min_relative_gain: 1e-9,
        };
        let free = ParameterLimits {
            bounds: Bounds::new(f64::NEG_INFINITY, f64::INFINITY),
            max_step: 0.5,
        };
        let bounded = ParameterLimits {
            bounds: Bounds::new(-9.0, 1.0),
            ..free
        };
        for (second, wanted) in [(free, 4.0_f64.ln()), (bounded, 1.0)] {
            let x = levenberg_marquardt(&Two, vec![-3.0, 0.0], &[free, second], &stopping);
            assert!(
                (x[0] - 1.5).abs() < 1e-4 && (x[1] - wanted).abs() < 1e-4,
                "{x:?}"
            );
        }
    }
}
