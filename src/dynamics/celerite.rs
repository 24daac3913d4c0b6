//! Likelihood of oscillators that are driven by chance, at any times: celerite.
//!
//! A damped oscillator driven by gusts is a Gaussian process whose covariance is a sum of
//! exponentials of the time between two values. The covariance matrix of such sums has a factor
//! that is found in a time that grows with the number of values only, whatever their times:
//! Foreman-Mackey, Agol, Ambikasaran and Angus, "Fast and scalable Gaussian process modeling with
//! applications to astronomical time series" (2017), eqs. 9, 20, 33-43.

use super::decay::{each_step, powers};
use crate::signal::gram::GramCholesky;
use crate::signal::ln_product::LnProduct;
use crate::signal::principal::symmetric;
use nalgebra::Complex;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::rc::Rc;

/// A part of what is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    /// A damped oscillator of this variance, driven by gusts that forget themselves at this rate,
    /// 1/s.
    Oscillator {
        variance: f64,
        frequency_hz: f64,
        damping: f64,
        gusts_per_s: f64,
    },
    /// What drifts: forgets itself at this rate, 1/s.
    Drift { variance: f64, rate_per_s: f64 },
}

impl Part {
    pub fn variance(&self) -> f64 {
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

/// Waves of the covariance in every frame, and how they fade from frame to frame; what depends on a
/// pole alone.
pub(super) struct Waves {
    pub cos: Vec<f64>,
    pub sin: Vec<f64>,
    pub fade: Vec<f64>,
}

impl Waves {
    fn new(times_s: &[f64], term: &Term) -> Self {
        let mut fade = Vec::with_capacity(times_s.len());
        fade.extend(times_s.first().map(|_| 1.0));
        each_step(times_s, Complex::from(-term.c), |factor| {
            fade.push(factor.re)
        });
        let turn = powers(times_s, Complex::new(0.0, term.d));
        Self {
            cos: turn.iter().map(|t| t.re).collect(),
            sin: turn.iter().map(|t| t.im).collect(),
            fade,
        }
    }
}

/// Times at which values are seen. The waves that were asked for last are kept: from one likelihood
/// to the next few poles change.
pub(super) struct Times {
    pub s: Vec<f64>,
    kept: RefCell<VecDeque<([u64; 2], Rc<Waves>)>>,
}

/// Ranks u v' of a covariance, which fade from frame to frame: an oscillation has two, a fading
/// one.
pub(super) struct Ranks(Vec<(Term, Rc<Waves>)>);

impl Times {
    pub fn new(s: Vec<f64>) -> Self {
        Self {
            s,
            kept: RefCell::default(),
        }
    }

    fn waves(&self, term: &Term) -> Rc<Waves> {
        const KEPT: usize = 24;
        let key = [term.c.to_bits(), term.d.to_bits()];
        let mut kept = self.kept.borrow_mut();
        if let Some((_, waves)) = kept.iter().rev().find(|(k, _)| *k == key) {
            return waves.clone();
        }
        let waves = Rc::new(Waves::new(&self.s, term));
        if kept.len() == KEPT {
            kept.pop_front();
        }
        kept.push_back((key, waves.clone()));
        waves
    }

    /// Of the covariance of a sum of `parts`.
    pub fn ranks(&self, parts: &[Part]) -> Ranks {
        let terms = together(parts.iter().flat_map(Part::terms));
        Ranks(
            terms
                .into_iter()
                .map(|term| (term, self.waves(&term)))
                .collect(),
        )
    }
}

impl Ranks {
    pub fn len(&self) -> usize {
        self.0.iter().map(|(term, _)| term.ranks()).sum()
    }

    /// u, v and the fading of every rank in frame `k`.
    pub fn at(&self, k: usize, u: &mut [f64], v: &mut [f64], fade: &mut [f64]) {
        let mut i = 0;
        for (term, waves) in &self.0 {
            let (cos, sin, faded) = (waves.cos[k], waves.sin[k], waves.fade[k]);
            (u[i], v[i], fade[i]) = (term.a * cos + term.b * sin, cos, faded);
            if term.ranks() == 2 {
                (u[i + 1], v[i + 1], fade[i + 1]) = (term.a * sin - term.b * cos, sin, faded);
            }
            i += term.ranks();
        }
    }
}

impl Part {
    /// Its power at `hz`, the transform of its covariance, per Hz on both sides.
    pub fn power(&self, hz: f64) -> f64 {
        let omega = TAU * hz;
        let mut power = 0.0;
        for term in self.terms() {
            power += term.power(term.d + omega) + term.power(term.d - omega);
        }
        power
    }
}

impl Term {
    fn ranks(&self) -> usize {
        if self.d == 0.0 { 1 } else { 2 }
    }

    /// Half of its transform, `by` from its frequency, 1/s.
    fn power(&self, by: f64) -> f64 {
        (self.a * self.c + self.b * by) / (self.c * self.c + by * by)
    }
}

impl Part {
    /// Its covariance. Of an oscillator it is what a driven one has: a sum over the poles p of H(s)
    /// = 1 / ((s² + 2 zeta w s + w²) (s + g)) of H's residue at p times H(-p), which is a pair for
    /// the oscillator and one for the gusts.
    fn terms(&self) -> Vec<Term> {
        match *self {
            Self::Oscillator {
                variance,
                frequency_hz,
                damping,
                gusts_per_s: g,
            } => {
                let omega = TAU * frequency_hz;
                let p = Complex::new(-damping * omega, omega * (1.0 - damping * damping).sqrt());
                let gust = Complex::new(-g, 0.0);
                let [at_p, at_gust, at_minus_gust] =
                    [-p, gust, -gust].map(|s| s * s + s * (2.0 * damping * omega) + omega * omega);
                let pair = 2.0 / ((p - p.conj()) * (p + g) * (at_p * (g - p)));
                let single = 1.0 / (at_gust * (at_minus_gust * (g - gust)));
                let unit = variance / (pair.re + single.re);
                vec![
                    Term {
                        a: unit * pair.re,
                        b: -unit * pair.im,
                        c: -p.re,
                        d: p.im,
                    },
                    Term {
                        a: unit * single.re,
                        b: 0.0,
                        c: g,
                        d: 0.0,
                    },
                ]
            }
            Self::Drift {
                variance,
                rate_per_s,
            } => vec![Term {
                a: variance,
                b: 0.0,
                c: rate_per_s,
                d: 0.0,
            }],
        }
    }
}

/// Terms that only fade, and alike, are one: all oscillators have the same gusts.
fn together(terms: impl Iterator<Item = Term>) -> Vec<Term> {
    let mut out: Vec<Term> = Vec::new();
    for term in terms {
        match out
            .iter_mut()
            .find(|t| t.d == 0.0 && term.d == 0.0 && t.c == term.c)
        {
            Some(same) => same.a += term.a,
            None => out.push(term),
        }
    }
    out
}

/// Minus twice the logarithm of the likelihood of the first of `signals` at `times`, up to a
/// constant, as a sum of `parts` and noise of variance `noise` in every value, plus any multiples
/// of the other signals, whose best factors are taken. Infinite where there is none.
pub(super) fn minus_2_log_likelihood(
    times: &Times,
    signals: &[&[f64]],
    parts: &[Part],
    noise: f64,
) -> f64 {
    let ranks = times.ranks(parts);
    let diagonal = noise + parts.iter().map(Part::variance).sum::<f64>();
    // The number of ranks is known to the compiler, or this takes three times as long.
    match ranks.len() {
        0..=2 => likelihood::<2>(times.s.len(), signals, &ranks, diagonal),
        3..=4 => likelihood::<4>(times.s.len(), signals, &ranks, diagonal),
        5..=6 => likelihood::<6>(times.s.len(), signals, &ranks, diagonal),
        7..=8 => likelihood::<8>(times.s.len(), signals, &ranks, diagonal),
        9..=10 => likelihood::<10>(times.s.len(), signals, &ranks, diagonal),
        11..=12 => likelihood::<12>(times.s.len(), signals, &ranks, diagonal),
        _ => f64::INFINITY,
    }
}

fn likelihood<const J: usize>(
    frames: usize,
    signals: &[&[f64]],
    ranks: &Ranks,
    diagonal: f64,
) -> f64 {
    let (mut u, mut v, mut phi) = ([0.0; J], [0.0; J], [0.0; J]);
    // S and W of the factor; f of the solution, a row for each signal.
    let (mut s, mut w, mut f) = ([[0.0; J]; J], [0.0; J], vec![[0.0; J]; signals.len()]);
    let (mut z, mut d) = (vec![0.0; signals.len()], 0.0);
    let n = signals.len();
    let mut gram = vec![0.0; n * n];
    let mut determinant = LnProduct::one();
    for k in 0..frames {
        ranks.at(k, &mut u, &mut v, &mut phi);
        let mut su = [0.0; J];
        for a in 0..J {
            // S becomes phi phi' (S + d w w'), which is symmetric.
            let added = d * w[a];
            for b in 0..J {
                s[a][b] = phi[a] * phi[b] * (s[a][b] + added * w[b]);
                su[b] += s[a][b] * u[a];
            }
        }
        for (f, z) in f.iter_mut().zip(&z) {
            for a in 0..J {
                f[a] = phi[a] * (f[a] + w[a] * z);
            }
        }
        d = diagonal - (0..J).map(|a| u[a] * su[a]).sum::<f64>();
        if d.is_nan() || d <= 0.0 {
            return f64::INFINITY;
        }
        for a in 0..J {
            w[a] = (v[a] - su[a]) / d;
        }
        for ((z, f), signal) in z.iter_mut().zip(&f).zip(signals) {
            *z = signal[k] - (0..J).map(|a| u[a] * f[a]).sum::<f64>();
        }
        determinant.times(d);
        for i in 0..n {
            let share = z[i] / d;
            for (sum, other) in gram[i * n..].iter_mut().zip(&z[..=i]) {
                *sum += share * other;
            }
        }
    }
    determinant.ln() + squares_left(&gram, n)
}

/// What is left of the first signal's squares when the others have been fitted to it: `gram` holds
/// the products below its diagonal.
fn squares_left(gram: &[f64], n: usize) -> f64 {
    let others = symmetric(n - 1, |i, k| gram[(i + 1) * n + k + 1]);
    let products: Vec<f64> = (1..n).map(|i| gram[i * n]).collect();
    gram[0] - GramCholesky::new(&others, n - 1).explained(&products)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    fn covariance(t: f64) -> f64 {
        let (w, z) = (TAU * 0.5, 0.06_f64);
        let wd = w * (1.0 - z * z).sqrt();
        0.7 * (-z * w * t).exp() * ((wd * t).cos() + z * w / wd * (wd * t).sin())
            + 0.2 * (-0.4 * t).exp()
    }

    /// Against the definition, with a full matrix, at uneven times.
    #[test]
    fn likelihood_is_that_of_the_covariance() {
        let times: Vec<f64> = (0..40)
            .map(|k| {
                0.1 * k as f64 + 0.03 * (k as f64 * 1.7).sin() + if k > 20 { 1.3 } else { 0.0 }
            })
            .collect();
        let values: Vec<f64> = times
            .iter()
            .map(|t| (3.0 * t).sin() + 0.2 * (17.0 * t).cos())
            .collect();
        let known = [
            vec![1.0; 40],
            times.iter().map(|t| t.cos()).collect::<Vec<f64>>(),
        ];
        let parts = [
            Part::Oscillator {
                variance: 0.7,
                frequency_hz: 0.5,
                damping: 0.06,
                gusts_per_s: 1e4,
            },
            Part::Drift {
                variance: 0.2,
                rate_per_s: 0.4,
            },
        ];
        let k = DMatrix::from_fn(40, 40, |i, j| {
            covariance((times[i] - times[j]).abs()) + if i == j { 0.01 } else { 0.0 }
        });
        let x = DMatrix::from_fn(40, 2, |i, j| known[j][i]);
        let y = DVector::from_vec(values.clone());
        let inverse = k.clone().try_inverse().unwrap();
        let factors =
            (x.transpose() * &inverse * &x).try_inverse().unwrap() * x.transpose() * &inverse * &y;
        let rest = &y - &x * factors;
        let wanted = (rest.transpose() * inverse * rest)[(0, 0)] + k.determinant().ln();
        let found = minus_2_log_likelihood(
            &Times::new(times),
            &[&values, &known[0], &known[1]],
            &parts,
            0.01,
        );
        assert!(
            (found - wanted).abs() < 1e-6 * wanted.abs(),
            "{found}, not {wanted}"
        );
    }
}
