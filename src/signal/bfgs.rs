//! The minimum of a smooth function of a few numbers, and how sharp it is.

use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use nalgebra::{DMatrix, DVector};

const MAX_STEPS: usize = 60;
/// Ever shorter steps in one direction that are tried, each this share of the one before.
const TRIES: usize = 12;
const SHORTER: f64 = 0.4;
/// Inverse of the curvature that is assumed at first.
const FIRST_INVERSE: f64 = 0.1;
/// Step of the differences: the functions are logarithms of likelihoods, which are known to some
/// 1e-9.
const DIFFERENCE: f64 = 1e-4;
/// Change of the function at which it is done.
const MIN_GAIN: f64 = 1e-2;
/// Step of the second differences.
const SECOND_DIFFERENCE: f64 = 1e-2;

/// Minimum of `f` near `from` within `bounds`, by BFGS (Broyden, Fletcher, Goldfarb and Shanno
/// 1970) with differences: the place and the value, or how far it has come when `cancel` ends it.
pub fn minimum(
    f: impl Fn(&[f64]) -> f64,
    from: &[f64],
    bounds: &[Bounds],
    cancel: &CancelToken,
) -> (Vec<f64>, f64) {
    let n = from.len();
    let mut x = from.to_vec();
    clamp(&mut x, bounds);
    let mut value = f(&x);
    let mut inverse = DMatrix::<f64>::identity(n, n) * FIRST_INVERSE;
    let mut gradient = slope(&f, &x, value);
    for _ in 0..MAX_STEPS {
        if cancel.is_cancelled() {
            break;
        }
        let direction = descent(&mut inverse, &gradient);
        let Some((next, next_value)) = line_search(&f, &x, value, &direction, bounds) else {
            break;
        };
        let next_gradient = slope(&f, &next, next_value);
        let moved = DVector::from_iterator(n, next.iter().zip(&x).map(|(a, b)| a - b));
        update(&mut inverse, &moved, &(&next_gradient - &gradient));
        let gain = value - next_value;
        (x, value, gradient) = (next, next_value, next_gradient);
        if gain < MIN_GAIN {
            break;
        }
    }
    (x, value)
}

fn clamp(x: &mut [f64], bounds: &[Bounds]) {
    for (x, bounds) in x.iter_mut().zip(bounds) {
        *x = bounds.clamp(*x);
    }
}

/// The quasi-Newton direction, along which no number changes by more than a factor of e; `inverse`
/// begins anew where it leads up.
fn descent(inverse: &mut DMatrix<f64>, gradient: &DVector<f64>) -> DVector<f64> {
    let mut direction = -(&*inverse * gradient);
    if direction.dot(gradient) >= 0.0 {
        *inverse = DMatrix::identity(gradient.len(), gradient.len()) * FIRST_INVERSE;
        direction = -(&*inverse * gradient);
    }
    let longest = direction.amax();
    if longest > 1.0 {
        direction /= longest;
    }
    direction
}

/// The first place along `direction` that is lower.
fn line_search(
    f: &impl Fn(&[f64]) -> f64,
    x: &[f64],
    value: f64,
    direction: &DVector<f64>,
    bounds: &[Bounds],
) -> Option<(Vec<f64>, f64)> {
    let mut share = 1.0;
    for _ in 0..TRIES {
        let mut next = x.to_vec();
        for (x, d) in next.iter_mut().zip(direction.iter()) {
            *x += share * d;
        }
        clamp(&mut next, bounds);
        let next_value = f(&next);
        if next_value < value {
            return Some((next, next_value));
        }
        share *= SHORTER;
    }
    None
}

/// The inverse of the curvature after a step `moved` that changed the gradient by `turned`.
fn update(inverse: &mut DMatrix<f64>, moved: &DVector<f64>, turned: &DVector<f64>) {
    let product = moved.dot(turned);
    if product <= 1e-12 {
        return;
    }
    let identity = DMatrix::<f64>::identity(moved.len(), moved.len());
    let a = identity - moved * turned.transpose() / product;
    *inverse = &a * &*inverse * a.transpose() + moved * moved.transpose() / product;
}

fn slope(f: &impl Fn(&[f64]) -> f64, x: &[f64], value: f64) -> DVector<f64> {
    let mut out = DVector::zeros(x.len());
    for i in 0..x.len() {
        let mut there = x.to_vec();
        there[i] += DIFFERENCE;
        let v = f(&there);
        if v.is_finite() {
            out[i] = (v - value) / DIFFERENCE;
        }
    }
    out
}

/// Sum of the values to either side of `x` along the numbers `i` and `k`, which may be one.
fn sides(f: &impl Fn(&[f64]) -> f64, x: &[f64], i: usize, k: usize) -> f64 {
    let mut sum = 0.0;
    for by in [SECOND_DIFFERENCE, -SECOND_DIFFERENCE] {
        let mut there = x.to_vec();
        there[i] += by;
        if k != i {
            there[k] += by;
        }
        sum += f(&there);
    }
    sum
}

/// Second derivatives of `f` at `x`.
pub fn curvature(f: impl Fn(&[f64]) -> f64, x: &[f64]) -> DMatrix<f64> {
    let n = x.len();
    let here = f(x);
    let own: Vec<f64> = (0..n).map(|i| sides(&f, x, i, i)).collect();
    let square = SECOND_DIFFERENCE * SECOND_DIFFERENCE;
    let mut h = DMatrix::zeros(n, n);
    for i in 0..n {
        h[(i, i)] = (own[i] - 2.0 * here) / square;
        for k in 0..i {
            let second = sides(&f, x, i, k) - own[i] - own[k] + 2.0 * here;
            h[(i, k)] = second / (2.0 * square);
            h[(k, i)] = h[(i, k)];
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent_valley(x: &[f64]) -> f64 {
        30.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2)
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_lowest_place() {
        let cancel = CancelToken::new();
        let (x, value) = minimum(
            bent_valley,
            &[-1.0, 1.0],
            &[Bounds::new(-3.0, 3.0); 2],
            &cancel,
        );
        assert!(value < 1e-2 && (x[0] - 1.0).abs() < 0.1, "{x:?}: {value}");
        let h = curvature(bent_valley, &[1.0, 1.0]);
        assert!(
            (h[(0, 0)] - 242.0).abs() < 1.0 && (h[(1, 1)] - 60.0).abs() < 0.1,
            "{h}"
        );
    }

    #[test]
    fn what_is_not_wanted_any_more_takes_no_step() {
        let cancel = CancelToken::new();
        cancel.cancel();
        let (x, value) = minimum(
            bent_valley,
            &[-1.0, 1.0],
            &[Bounds::new(-3.0, 3.0); 2],
            &cancel,
        );
        assert_eq!((x, value), (vec![-1.0, 1.0], 4.0));
    }
}
