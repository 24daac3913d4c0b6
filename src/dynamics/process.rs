//! Likelihood of oscillators that are driven by chance, at any times.
//!
//! A damped oscillator driven by gusts is a Gaussian process whose covariance is a sum of exponentials of the time
//! between two values. The covariance matrix of such sums has a factor that is found in a time that grows with the number
//! of values only, whatever their times: Foreman-Mackey, Agol, Ambikasaran and Angus, "Fast and scalable Gaussian process
//! modeling with applications to astronomical time series" (2017), eqs. 9, 20, 33-43.

use super::columns::dot;
use super::decay::{each_step, powers};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// A part of what is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    /// A damped oscillator of this variance, driven by gusts that forget themselves at this rate, 1/s.
    Oscillator { variance: f64, frequency_hz: f64, damping: f64, gusts_per_s: f64 },
    /// What drifts: forgets itself at this rate, 1/s.
    Drift { variance: f64, rate_per_s: f64 },
}

impl Part {
    fn variance(&self) -> f64 {
        match self {
            Self::Oscillator { variance, .. } | Self::Drift { variance, .. } => *variance,
        }
    }
}

/// One term of the covariance: (a cos d t + b sin d t) exp(-c t).
#[derive(Clone, Copy)]
struct Term {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
}

/// A rank of the covariance in every frame: u v' faded from frame to frame. An oscillation has two, a fading one.
struct Wave {
    u: Vec<f64>,
    v: Vec<f64>,
    /// From the frame before.
    fade: Vec<f64>,
}

impl Term {
    fn waves(&self, times_s: &[f64]) -> Vec<Wave> {
        let mut fade = Vec::with_capacity(times_s.len());
        fade.extend(times_s.first().map(|_| 1.0));
        each_step(times_s, Complex::from(-self.c), |factor| fade.push(factor.re));
        if self.d == 0.0 {
            return vec![Wave { u: vec![self.a; times_s.len()], v: vec![1.0; times_s.len()], fade }];
        }
        let turn = powers(times_s, Complex::new(0.0, self.d));
        let of = |f: &dyn Fn(&Complex<f64>) -> f64| turn.iter().map(f).collect::<Vec<f64>>();
        let (cos, sin) = (of(&|t| t.re), of(&|t| t.im));
        vec![
            Wave { u: of(&|t| self.a * t.re + self.b * t.im), v: cos, fade: fade.clone() },
            Wave { u: of(&|t| self.a * t.im - self.b * t.re), v: sin, fade },
        ]
    }
}

impl Part {
    /// Its covariance. Of an oscillator it is what a driven one has: a sum over the poles p of H(s) = 1 / ((s² + 2 zeta w s +
    /// w²) (s + g)) of H's residue at p times H(-p), which is a pair for the oscillator and one for the gusts.
    fn terms(&self) -> Vec<Term> {
        match *self {
            Self::Oscillator { variance, frequency_hz, damping, gusts_per_s: g } => {
                let omega = TAU * frequency_hz;
                let p = Complex::new(-damping * omega, omega * (1.0 - damping * damping).sqrt());
                let of = |s: Complex<f64>| (s * s + s * (2.0 * damping * omega) + omega * omega) * (s + g);
                let pair = 2.0 / ((p - p.conj()) * (p + g) * of(-p));
                let gust = Complex::new(-g, 0.0);
                let single = 1.0 / ((gust * gust + gust * (2.0 * damping * omega) + omega * omega) * of(-gust));
                let unit = variance / (pair.re + single.re);
                vec![
                    Term { a: unit * pair.re, b: -unit * pair.im, c: -p.re, d: p.im },
                    Term { a: unit * single.re, b: 0.0, c: g, d: 0.0 },
                ]
            }
            Self::Drift { variance, rate_per_s } => vec![Term { a: variance, b: 0.0, c: rate_per_s, d: 0.0 }],
        }
    }
}

/// Terms that only fade, and alike, are one: all oscillators have the same gusts.
fn together(terms: impl Iterator<Item = Term>) -> Vec<Term> {
    let mut out: Vec<Term> = Vec::new();
    for term in terms {
        match out.iter_mut().find(|t| t.d == 0.0 && term.d == 0.0 && t.c == term.c) {
            Some(same) => same.a += term.a,
            None => out.push(term),
        }
    }
    out
}

/// Minus twice the logarithm of the likelihood of `values` at `times_s`, up to a constant, as a sum of `parts` and noise of
/// variance `noise` in every value, plus any multiples of `known` signals, whose best factors are taken.
/// Infinite where there is none.
pub(super) fn minus_2_log_likelihood(
    times_s: &[f64],
    values: &[f64],
    known: &[Vec<f64>],
    parts: &[Part],
    noise: f64,
) -> f64 {
    let terms = together(parts.iter().flat_map(Part::terms));
    let waves: Vec<Wave> = terms.iter().flat_map(|term| term.waves(times_s)).collect();
    let j = waves.len();
    let diagonal = noise + parts.iter().map(Part::variance).sum::<f64>();
    let signals = 1 + known.len();
    let (mut u, mut phi) = (vec![0.0; j], vec![0.0; j]);
    // S and W of the factor; f of the solution, a row for each signal.
    let (mut s, mut w, mut f) = (vec![0.0; j * j], vec![0.0; j], vec![0.0; j * signals]);
    let (mut z, mut d) = (vec![0.0; signals], 0.0);
    let (mut su, mut new) = (vec![0.0; j], vec![0.0; j]);
    let mut gram = vec![0.0; signals * signals];
    let mut log_determinant = 0.0;
    for n in 0..times_s.len() {
        for (k, wave) in waves.iter().enumerate() {
            (u[k], phi[k]) = (wave.u[n], wave.fade[n]);
            new[k] = d * w[k] * phi[k];
        }
        for (a, row) in s.chunks_exact_mut(j.max(1)).enumerate() {
            // S becomes phi phi' (S + d w w').
            let (old, added) = (phi[a], phi[a] * w[a]);
            for (x, (phi, new)) in row.iter_mut().zip(phi.iter().zip(&new)) {
                *x = old * phi * *x + added * new;
            }
            su[a] = dot(row, &u);
        }
        for (f, z) in f.chunks_exact_mut(j.max(1)).zip(&z) {
            for (f, (phi, w)) in f.iter_mut().zip(phi.iter().zip(&w)) {
                *f = phi * (*f + w * z);
            }
        }
        d = diagonal - dot(&u, &su);
        if d.is_nan() || d <= 0.0 {
            return f64::INFINITY;
        }
        for (k, wave) in waves.iter().enumerate() {
            w[k] = (wave.v[n] - su[k]) / d;
        }
        for (i, f) in f.chunks_exact(j.max(1)).enumerate() {
            let y = if i == 0 { values[n] } else { known[i - 1][n] };
            z[i] = y - dot(&u, f);
        }
        log_determinant += d.ln();
        for i in 0..signals {
            for k in 0..=i {
                gram[i * signals + k] += z[i] * z[k] / d;
            }
        }
    }
    log_determinant + squares_left(gram, signals)
}

/// What is left of the first signal's squares when the others have been fitted to it: `gram` holds the products below its
/// diagonal. Cholesky with the first signal last.
fn squares_left(gram: Vec<f64>, n: usize) -> f64 {
    let product = |i: usize, k: usize| gram[i.max(k) * n + i.min(k)];
    let order: Vec<usize> = (1..n).chain([0]).collect();
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for k in 0..=i {
            let sum: f64 = product(order[i], order[k]) - (0..k).map(|m| l[i * n + m] * l[k * n + m]).sum::<f64>();
            l[i * n + k] = if i == n - 1 && k == i {
                return sum;
            } else if k == i {
                // A signal that is a multiple of others adds nothing.
                if sum > 1e-10 * product(order[i], order[i]) { sum.sqrt() } else { f64::INFINITY }
            } else {
                sum / l[k * n + k]
            };
        }
    }
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Against the definition, with a full matrix, at uneven times.
    #[test]
    fn likelihood_is_that_of_the_covariance() {
        let times: Vec<f64> =
            (0..40).map(|k| 0.1 * k as f64 + 0.03 * (k as f64 * 1.7).sin() + if k > 20 { 1.3 } else { 0.0 }).collect();
        let values: Vec<f64> = times.iter().map(|t| (3.0 * t).sin() + 0.2 * (17.0 * t).cos()).collect();
        let known = vec![vec![1.0; 40], times.iter().map(|t| t.cos()).collect::<Vec<f64>>()];
        let parts = [
            Part::Oscillator { variance: 0.7, frequency_hz: 0.5, damping: 0.06, gusts_per_s: 1e4 },
            Part::Drift { variance: 0.2, rate_per_s: 0.4 },
        ];
        let covariance = |t: f64| {
            let (w, z) = (TAU * 0.5, 0.06_f64);
            let wd = w * (1.0 - z * z).sqrt();
            0.7 * (-z * w * t).exp() * ((wd * t).cos() + z * w / wd * (wd * t).sin()) + 0.2 * (-0.4 * t).exp()
        };
        let k =
            DMatrix::from_fn(40, 40, |i, j| covariance((times[i] - times[j]).abs()) + if i == j { 0.01 } else { 0.0 });
        let x = DMatrix::from_fn(40, 2, |i, j| known[j][i]);
        let y = DVector::from_vec(values.clone());
        let inverse = k.clone().try_inverse().unwrap();
        let factors = (x.transpose() * &inverse * &x).try_inverse().unwrap() * x.transpose() * &inverse * &y;
        let rest = &y - &x * factors;
        let wanted = (rest.transpose() * inverse * rest)[(0, 0)] + k.determinant().ln();
        let found = minus_2_log_likelihood(&times, &values, &known, &parts, 0.01);
        assert!((found - wanted).abs() < 1e-6 * wanted.abs(), "{found}, not {wanted}");
    }
}
