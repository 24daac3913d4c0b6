//! The minimum of a smooth function of a few numbers, and how sharp it is.

use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use nalgebra::{DMatrix, DVector};

/// Ever shorter steps in one direction that are tried, each this share of the one before.
const TRIES: usize = 12;
const SHORTER: f64 = 0.4;
/// Inverse of the curvature that is assumed at first.
const FIRST_INVERSE: f64 = 0.1;
/// Step of the differences: the functions are logarithms of likelihoods, which are known to some
/// 1e-9.
const DIFFERENCE: f64 = 1e-4;
/// Step of the second differences.
const SECOND_DIFFERENCE: f64 = 1e-2;

/// What is to be as small as possible.
pub trait Cost {
    fn value(&self, x: &[f64]) -> f64;

    /// The first derivatives.
    fn slopes(&self, x: &[f64]) -> DVector<f64>;
}

/// A function whose derivatives are not known: they are found by differences.
pub struct ByDifferences<F>(pub F);

impl<F: Fn(&[f64]) -> f64> Cost for ByDifferences<F> {
    fn value(&self, x: &[f64]) -> f64 {
        self.0(x)
    }

    fn slopes(&self, x: &[f64]) -> DVector<f64> {
        slopes_by_differences(&self.0, x)
    }
}

/// When a search is done.
#[derive(Clone, Copy, Debug)]
pub struct Stopping {
    pub max_steps: usize,
    /// Steps that gain less than [`min_gain`](Self::min_gain), one after the other.
    pub small_steps: usize,
    pub min_gain: f64,
}

/// Minimum of `cost` near `from` within `bounds`, by BFGS (Broyden, Fletcher, Goldfarb and Shanno
/// 1970): the place and the value, or how far it has come when `cancel` ends it.
pub fn minimum(
    cost: &impl Cost,
    from: &[f64],
    bounds: &[Bounds],
    stopping: &Stopping,
    cancel: &CancelToken,
) -> (Vec<f64>, f64) {
    let n = from.len();
    let mut x = from.to_vec();
    clamp(&mut x, bounds);
    let (mut value, mut slopes) = (cost.value(&x), cost.slopes(&x));
    let mut inverse = DMatrix::<f64>::identity(n, n) * FIRST_INVERSE;
    let mut small_steps = 0;
    for _ in 0..stopping.max_steps {
        if cancel.is_cancelled() {
            break;
        }
        let direction = descent(&mut inverse, &slopes);
        let Some((next, next_value)) = line_search(cost, &x, value, &direction, bounds) else {
            break;
        };
        let next_slopes = cost.slopes(&next);
        let moved = DVector::from_iterator(n, next.iter().zip(&x).map(|(a, b)| a - b));
        update(&mut inverse, &moved, &(&next_slopes - &slopes));
        let gain = value - next_value;
        (x, value, slopes) = (next, next_value, next_slopes);
        small_steps = if gain < stopping.min_gain {
            small_steps + 1
        } else {
            0
        };
        if small_steps >= stopping.small_steps {
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

/// The first place along `direction` that is lower, and the value there.
fn line_search(
    cost: &impl Cost,
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
        let there = cost.value(&next);
        if there < value {
            return Some((next, there));
        }
        share *= SHORTER;
    }
    None
}

/// The inverse of the curvature after a step `moved` that changed the gradient by `turned` (Nocedal
/// and Wright 2006, eq. 6.17, multiplied out).
fn update(inverse: &mut DMatrix<f64>, moved: &DVector<f64>, turned: &DVector<f64>) {
    let product = moved.dot(turned);
    if product <= 1e-12 {
        return;
    }
    let expected = &*inverse * turned;
    let longer = (1.0 + turned.dot(&expected) / product) / product;
    inverse.ger(longer, moved, moved, 1.0);
    inverse.ger(-1.0 / product, &expected, moved, 1.0);
    inverse.ger(-1.0 / product, moved, &expected, 1.0);
}

fn slopes_by_differences(f: &impl Fn(&[f64]) -> f64, x: &[f64]) -> DVector<f64> {
    let value = f(x);
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

/// Second derivatives at `x` of a function whose first ones are known.
pub fn curvature_of_slopes(cost: &impl Cost, x: &[f64]) -> DMatrix<f64> {
    let n = x.len();
    let mut h = DMatrix::zeros(n, n);
    for i in 0..n {
        let sides = [DIFFERENCE, -DIFFERENCE].map(|by| {
            let mut there = x.to_vec();
            there[i] += by;
            cost.slopes(&there)
        });
        let second = (&sides[0] - &sides[1]) / (2.0 * DIFFERENCE);
        h.set_column(i, &second);
    }
    (&h + h.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    const STOPPING: Stopping = Stopping {
        max_steps: 60,
        small_steps: 1,
        min_gain: 1e-2,
    };

    fn bent_valley(x: &[f64]) -> f64 {
        30.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2)
    }

    #[test]
    fn a_bent_valley_is_followed_to_its_lowest_place() {
        let cancel = CancelToken::new();
        let (x, value) = minimum(
            &ByDifferences(bent_valley),
            &[-1.0, 1.0],
            &[Bounds::new(-3.0, 3.0); 2],
            &STOPPING,
            &cancel,
        );
        assert!(value < 1e-2 && (x[0] - 1.0).abs() < 0.1, "{x:?}: {value}");
        let h = curvature(bent_valley, &[1.0, 1.0]);
        assert!(
            (h[(0, 0)] - 242.0).abs() < 1.0 && (h[(1, 1)] - 60.0).abs() < 0.1,
            "{h}"
        );
        let by_slopes = curvature_of_slopes(&ByDifferences(bent_valley), &[1.0, 1.0]);
        assert!((by_slopes - &h).amax() < 1.0, "{h}");
    }

    #[test]
    fn what_is_not_wanted_any_more_takes_no_step() {
        let cancel = CancelToken::new();
        cancel.cancel();
        let (x, value) = minimum(
            &ByDifferences(bent_valley),
            &[-1.0, 1.0],
            &[Bounds::new(-3.0, 3.0); 2],
            &STOPPING,
            &cancel,
        );
        assert_eq!((x, value), (vec![-1.0, 1.0], 4.0));
    }
}
