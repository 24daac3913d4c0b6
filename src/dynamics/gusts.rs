//! Oscillators in wind: how many a branch's motion carries, at what frequency and damping, and how
//! sure that is.

use super::columns::dot;
use super::decay::Mode;
use super::filter::Filter;
use super::minimum::{curvature, minimum};
use super::periodogram::{Periodogram, excess_hz};
use super::process::{Part, Times, minus_2_log_likelihood};
use std::cell::RefCell;
use std::collections::VecDeque;

/// Oscillators that are looked for beyond the ancestors'.
const MOST_NEW: usize = 3;
/// How often the gusts of a wind forget themselves, 1/s, at the least and at the most, which is
/// white noise to a tree.
const GUSTS_PER_S: [f64; 2] = [0.1, 60.0];
const DAMPING: [f64; 2] = [0.003, 0.4];
/// Trees are damped by some hundredths of the critical: a weak prior for films that are too short
/// to tell, as the standard deviation of a logarithm.
const USUAL_DAMPING: f64 = 0.05;
const DAMPING_SD: f64 = 0.7;
/// Likelihoods that are kept: a step in a number that only one motion has leaves the other's as it
/// was.
const KEPT: usize = 64;

/// Motions, their parameters and likelihoods.
type Had = RefCell<VecDeque<(usize, Vec<f64>, f64)>>;

/// What is fitted for one branch.
pub(super) struct Problem {
    pub times: Times,
    /// Motions that are not correlated, and share the frequency and damping of every oscillator.
    pub motions: Vec<Vec<f64>>,
    /// Signals of which any multiple may be in each.
    pub known: Vec<Vec<f64>>,
    pub ancestors: Vec<Mode>,
    /// How often what drifts forgets itself, 1/s.
    pub drift_per_s: f64,
    pub had: Had,
}

/// An oscillator that is no ancestor's.
pub(super) struct Oscillator {
    pub mode: Mode,
    /// Of the logarithms of its frequency and damping, by the curvature of the likelihood; infinite
    /// where that has none.
    pub sd: [f64; 2],
    /// Of all motions together, px².
    pub variance: f64,
    /// Whether it stands where the search ends.
    pub at_limit: bool,
}

/// A fit.
pub(super) struct Fitted<'a> {
    problem: &'a Problem,
    x: Vec<f64>,
    bounds: Vec<[f64; 2]>,
}

impl Problem {
    fn first_new(&self) -> usize {
        3 + self.ancestors.len() * self.motions.len()
    }

    fn per_new(&self) -> usize {
        2 + self.motions.len()
    }

    /// Of logarithms: noise, the drift's variance, the rate of the gusts; the ancestors' variances
    /// in each motion; then frequency, damping and the variances of each new oscillator.
    fn cost(&self, x: &[f64]) -> f64 {
        let off = |p: &[f64]| (p[1] - USUAL_DAMPING.ln()) / DAMPING_SD;
        let prior: f64 = x[self.first_new()..]
            .chunks(self.per_new())
            .map(|p| off(p).powi(2))
            .sum();
        prior
            + (0..self.motions.len())
                .map(|m| self.cost_of(m, x))
                .sum::<f64>()
    }

    fn cost_of(&self, m: usize, x: &[f64]) -> f64 {
        let own = self.of_motion(m, x);
        let mut had = self.had.borrow_mut();
        if let Some((_, _, value)) = had
            .iter()
            .rev()
            .find(|(motion, x, _)| *motion == m && *x == own)
        {
            return *value;
        }
        let parts = self.parts(&own);
        let signals: Vec<&[f64]> = std::iter::once(&self.motions[m])
            .chain(&self.known)
            .map(Vec::as_slice)
            .collect();
        let value = minus_2_log_likelihood(&self.times, &signals, &parts, own[0].exp());
        if had.len() == KEPT {
            had.pop_front();
        }
        had.push_back((m, own, value));
        value
    }

    /// The parameters of one motion: the first three, the ancestors' variances, then variance,
    /// frequency and damping.
    fn of_motion(&self, m: usize, x: &[f64]) -> Vec<f64> {
        let n = self.ancestors.len();
        let new = x[self.first_new()..]
            .chunks(self.per_new())
            .flat_map(|p| [p[2 + m], p[0], p[1]]);
        x[..3]
            .iter()
            .chain(&x[3 + m * n..3 + (m + 1) * n])
            .copied()
            .chain(new)
            .collect()
    }

    fn parts(&self, x: &[f64]) -> Vec<Part> {
        let (of_ancestors, of_new) = x[3..].split_at(self.ancestors.len());
        let drift = Part::Drift {
            variance: x[1].exp(),
            rate_per_s: self.drift_per_s,
        };
        let oscillator = |variance: f64, frequency_hz: f64, damping: f64| Part::Oscillator {
            variance,
            frequency_hz,
            damping,
            gusts_per_s: x[2].exp(),
        };
        let old = self
            .ancestors
            .iter()
            .zip(of_ancestors)
            .map(|(m, v)| oscillator(v.exp(), m.frequency_hz, m.damping));
        let new = of_new
            .chunks(3)
            .map(|p| oscillator(p[0].exp(), p[1].exp(), p[2].exp()));
        std::iter::once(drift).chain(old).chain(new).collect()
    }

    /// With as many new oscillators as the data carry (Schwarz 1978), within `frequencies_hz`.
    /// `left` are the motions without what is known of them; noise has about the variance `noise`
    /// in them.
    pub fn fit(&self, left: &[Vec<f64>], noise: f64, frequencies_hz: [f64; 2]) -> Fitted<'_> {
        let variances: Vec<f64> = left.iter().map(|s| dot(s, s) / s.len() as f64).collect();
        let level = variances[0].ln();
        let of_variance = [level - 16.0, level + 4.0];
        let mut bounds = vec![
            [level - 16.0, level + 1.0],
            of_variance,
            GUSTS_PER_S.map(f64::ln),
        ];
        let mut start = vec![noise.max(1e-12).ln(), level - 4.0, 0.0];
        for v in &variances {
            bounds.extend(self.ancestors.iter().map(|_| of_variance));
            start.extend(self.ancestors.iter().map(|_| v.ln() - 2.0));
        }
        let cost = |x: &[f64]| self.cost(x);
        let (x, value) = minimum(cost, &start, &bounds);
        let mut found = Fitted {
            problem: self,
            x,
            bounds: bounds.clone(),
        };
        let mut value = value;
        let penalty = (self.times.s.len() as f64).ln() * self.per_new() as f64;
        let mut powers: Vec<(Periodogram, Vec<Part>, f64)> = left
            .iter()
            .map(|s| {
                (
                    Periodogram::new(&self.times.s, s, frequencies_hz),
                    Vec::new(),
                    0.0,
                )
            })
            .collect();
        for _ in 0..MOST_NEW {
            for (m, (_, parts, noise)) in powers.iter_mut().enumerate() {
                let own = self.of_motion(m, &found.x);
                (*parts, *noise) = (self.parts(&own), own[0].exp());
            }
            let Some(hz) = excess_hz(&powers) else { break };
            // What was there may have taken the new one's place: only the oscillators stay where
            // they were.
            let mut x = start.clone();
            x.extend(&found.x[self.first_new()..]);
            x.extend([hz.ln(), USUAL_DAMPING.ln()]);
            x.extend(variances.iter().map(|v| v.ln() - 1.0));
            bounds.extend([frequencies_hz.map(f64::ln), DAMPING.map(f64::ln)]);
            bounds.extend(variances.iter().map(|_| of_variance));
            let (x, there) = minimum(cost, &x, &bounds);
            if there + penalty >= value {
                break;
            }
            value = there;
            found = Fitted {
                problem: self,
                x,
                bounds: bounds.clone(),
            };
        }
        found
    }
}

impl Fitted<'_> {
    /// Those that were found.
    pub fn oscillators(&self) -> Vec<Oscillator> {
        let (first, per) = (self.problem.first_new(), self.problem.per_new());
        if self.x.len() == first {
            return Vec::new();
        }
        let covariance = (0.5 * curvature(|x| self.problem.cost(x), &self.x)).try_inverse();
        let sd = |i: usize| {
            covariance
                .as_ref()
                .map_or(f64::INFINITY, |c| c[(i, i)])
                .max(0.0)
                .sqrt()
        };
        let at_limit = |i: usize| self.bounds[i].iter().any(|b| (self.x[i] - b).abs() < 1e-6);
        let of = |i: usize| Oscillator {
            mode: Mode::of_parameters(&self.x[i..]),
            sd: [sd(i), sd(i + 1)],
            variance: self.x[i + 2..i + per].iter().map(|v| v.exp()).sum(),
            at_limit: at_limit(i) || at_limit(i + 1),
        };
        (first..self.x.len()).step_by(per).map(of).collect()
    }

    /// What lets through the oscillator of this number, in signals whose noise has at least the
    /// variance `noise`. Gusts are white here: the slow motion that red ones make is not the
    /// oscillator's alone.
    pub fn filter(&self, oscillator: usize, noise: f64) -> Option<Filter> {
        const WHITE_PER_S: f64 = 1e3;
        let mut x = self.problem.of_motion(0, &self.x);
        x[2] = WHITE_PER_S.ln();
        let of = 1 + self.problem.ancestors.len() + oscillator;
        Filter::new(
            &self.problem.times,
            &self.problem.parts(&x),
            x[0].exp().max(noise),
            of,
        )
    }
}
