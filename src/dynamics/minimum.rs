//! The minimum of a smooth function of a few numbers, and how sharp it is.

use nalgebra::{DMatrix, DVector};

const MOST_STEPS: usize = 60;
/// Step of the differences: the functions are logarithms of likelihoods, which are known to some
/// 1e-9.
const STEP: f64 = 1e-4;
/// Change of the function at which it is done.
const DONE: f64 = 1e-2;

/// Minimum near `from` within `bounds`, by BFGS with differences: the place and the value.
pub(super) fn minimum(
    f: impl Fn(&[f64]) -> f64,
    from: &[f64],
    bounds: &[[f64; 2]],
) -> (Vec<f64>, f64) {
    let within = |x: &mut [f64]| {
        x.iter_mut()
            .zip(bounds)
            .for_each(|(x, b)| *x = x.clamp(b[0], b[1]))
    };
    let n = from.len();
    let mut x = from.to_vec();
    within(&mut x);
    let mut value = f(&x);
    let mut inverse = DMatrix::<f64>::identity(n, n) * 0.1;
    let mut gradient = slope(&f, &x, value);
    for _ in 0..MOST_STEPS {
        let mut way = -(&inverse * &gradient);
        if way.dot(&gradient) >= 0.0 {
            inverse = DMatrix::identity(n, n) * 0.1;
            way = -(&inverse * &gradient);
        }
        // No number changes by more than a factor of e at once.
        let longest = way.amax();
        if longest > 1.0 {
            way /= longest;
        }
        let mut share = 1.0;
        let mut found = None;
        for _ in 0..12 {
            let mut there: Vec<f64> = x
                .iter()
                .zip(way.iter())
                .map(|(x, w)| x + share * w)
                .collect();
            within(&mut there);
            let v = f(&there);
            if v < value {
                found = Some((there, v));
                break;
            }
            share *= 0.4;
        }
        let Some((there, v)) = found else { break };
        let next = slope(&f, &there, v);
        let s = DVector::from_iterator(n, there.iter().zip(&x).map(|(a, b)| a - b));
        let y = &next - &gradient;
        let sy = s.dot(&y);
        if sy > 1e-12 {
            let i = DMatrix::<f64>::identity(n, n);
            let a = &i - &s * y.transpose() / sy;
            inverse = &a * inverse * a.transpose() + &s * s.transpose() / sy;
        }
        let gained = value - v;
        (x, value, gradient) = (there, v, next);
        if gained < DONE {
            break;
        }
    }
    (x, value)
}

fn slope(f: &impl Fn(&[f64]) -> f64, x: &[f64], value: f64) -> DVector<f64> {
    DVector::from_iterator(
        x.len(),
        (0..x.len()).map(|i| {
            let mut there = x.to_vec();
            there[i] += STEP;
            let v = f(&there);
            if v.is_finite() {
                (v - value) / STEP
            } else {
                0.0
            }
        }),
    )
}

/// Second derivatives at `x`.
pub(super) fn curvature(f: impl Fn(&[f64]) -> f64, x: &[f64]) -> DMatrix<f64> {
    const WIDE: f64 = 1e-2;
    let n = x.len();
    let at = |i: usize, k: usize, by: f64| {
        let mut there = x.to_vec();
        there[i] += by;
        if k != i {
            there[k] += by;
        }
        f(&there)
    };
    // To either side: of one number, and of two at once.
    let sides = |i: usize, k: usize| at(i, k, WIDE) + at(i, k, -WIDE);
    let (here, own) = (f(x), (0..n).map(|i| sides(i, i)).collect::<Vec<f64>>());
    let mut h = DMatrix::zeros(n, n);
    for i in 0..n {
        h[(i, i)] = (own[i] - 2.0 * here) / (WIDE * WIDE);
        for k in 0..i {
            let second = sides(i, k) - own[i] - own[k] + 2.0 * here;
            h[(i, k)] = second / (2.0 * WIDE * WIDE);
            h[(k, i)] = h[(i, k)];
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bent_valley_is_followed_to_its_lowest_place() {
        let f = |x: &[f64]| 30.0 * (x[1] - x[0] * x[0]).powi(2) + (1.0 - x[0]).powi(2);
        let (x, value) = minimum(f, &[-1.0, 1.0], &[[-3.0, 3.0]; 2]);
        assert!(value < 1e-2 && (x[0] - 1.0).abs() < 0.1, "{x:?}: {value}");
        let h = curvature(f, &[1.0, 1.0]);
        assert!(
            (h[(0, 0)] - 242.0).abs() < 1.0 && (h[(1, 1)] - 60.0).abs() < 0.1,
            "{h}"
        );
    }
}
