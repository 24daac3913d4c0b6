//! Oscillators in wind: how many a branch's motion carries, at what frequency and damping, and how
//! sure that is.

use super::branches::LnDeviations;
use super::celerite::{Part, Times, minus_2_log_likelihood};
use super::decay::{Mode, USUAL_DAMPING, damping_penalty};
use super::filter::Filter;
use super::periodogram::{Observed, Periodogram, excess_hz};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::bfgs::{ByDifferences, Stopping, curvature, minimum};
use crate::signal::vectors::dot;
use nalgebra::DMatrix;
use std::cell::RefCell;
use std::collections::VecDeque;

/// Oscillators that are looked for beyond the ancestors'.
const MAX_NEW: usize = 3;
/// How often the gusts of a wind forget themselves, 1/s, at the least and at the most, which is
/// white noise to a tree.
const GUSTS_PER_S: Bounds = Bounds::new(0.1, 60.0);
pub(super) const DAMPING: Bounds = Bounds::new(0.003, 0.4);
/// When the search for the likeliest is done.
const STOPPING: Stopping = Stopping {
    max_steps: 60,
    small_steps: 1,
    min_gain: 1e-2,
};
/// Likelihoods that are kept: a step in a number that only one motion has leaves the other's as it
/// was.
const MAX_KEPT: usize = 64;

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
    /// By the curvature of the likelihood; infinite where that has none.
    pub ln_sd: LnDeviations,
    /// Of all motions together, px².
    pub variance: f64,
    /// Whether it stands where the search ends.
    pub at_limit: bool,
}

/// A fit.
pub(super) struct Fitted<'a> {
    problem: &'a Problem,
    x: Vec<f64>,
    bounds: Vec<Bounds>,
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
        let mut prior = 0.0;
        for oscillator in x[self.first_new()..].chunks(self.per_new()) {
            prior += damping_penalty(oscillator[1]);
        }
        let motions = 0..self.motions.len();
        prior + motions.map(|m| self.cost_of(m, x)).sum::<f64>()
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
        if had.len() == MAX_KEPT {
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
        let gusts_per_s = x[2].exp();
        let mut out = vec![Part::Drift {
            variance: x[1].exp(),
            rate_per_s: self.drift_per_s,
        }];
        for (mode, ln_variance) in self.ancestors.iter().zip(of_ancestors) {
            out.push(Part::Oscillator {
                variance: ln_variance.exp(),
                frequency_hz: mode.frequency_hz,
                damping: mode.damping,
                gusts_per_s,
            });
        }
        for p in of_new.chunks(3) {
            out.push(Part::Oscillator {
                variance: p[0].exp(),
                frequency_hz: p[1].exp(),
                damping: p[2].exp(),
                gusts_per_s,
            });
        }
        out
    }

    /// With as many new oscillators as the data carry (Schwarz 1978), within `frequencies_hz`.
    /// `left` are the motions without what is known of them; noise has about the variance `noise`
    /// in them. Nothing is to be made of it where `cancel` has ended it.
    pub fn fit(
        &self,
        left: &[Vec<f64>],
        noise: f64,
        frequencies_hz: Bounds,
        cancel: &CancelToken,
    ) -> Fitted<'_> {
        let scale = Scale::of(left);
        let start = self.start(&scale, noise);
        let mut bounds = self.bounds(&scale);
        let (x, mut value) = minimum(
            &ByDifferences(|x: &[f64]| self.cost(x)),
            &start,
            &bounds,
            &STOPPING,
            cancel,
        );
        let mut found = Fitted {
            problem: self,
            x,
            bounds: bounds.clone(),
        };
        let penalty = (self.times.s.len() as f64).ln() * self.per_new() as f64;
        let mut observed: Vec<Observed> = Vec::with_capacity(left.len());
        for signal in left {
            observed.push(Observed {
                power: Periodogram::new(&self.times.s, signal, frequencies_hz),
                expected: Vec::new(),
                noise: 0.0,
            });
        }
        for _ in 0..MAX_NEW {
            if cancel.is_cancelled() {
                break;
            }
            for (m, observed) in observed.iter_mut().enumerate() {
                let own = self.of_motion(m, &found.x);
                observed.expected = self.parts(&own);
                observed.noise = own[0].exp();
            }
            let Some(hz) = excess_hz(&observed) else {
                break;
            };
            // What was there may have taken the new one's place: only the oscillators stay where
            // they were.
            let mut x = start.clone();
            x.extend(&found.x[self.first_new()..]);
            x.extend([hz.ln(), USUAL_DAMPING.ln()]);
            x.extend(scale.ln_variances.iter().map(|v| v - 1.0));
            bounds.extend([frequencies_hz.map(f64::ln), DAMPING.map(f64::ln)]);
            bounds.extend(scale.ln_variances.iter().map(|_| scale.bounds()));
            let (x, there) = minimum(
                &ByDifferences(|x: &[f64]| self.cost(x)),
                &x,
                &bounds,
                &STOPPING,
                cancel,
            );
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

    /// Where a fit without new oscillators begins.
    fn start(&self, scale: &Scale, noise: f64) -> Vec<f64> {
        let mut start = vec![noise.max(1e-12).ln(), scale.level() - 4.0, 0.0];
        for v in &scale.ln_variances {
            start.extend(self.ancestors.iter().map(|_| v - 2.0));
        }
        start
    }

    /// And within which bounds it stays.
    fn bounds(&self, scale: &Scale) -> Vec<Bounds> {
        let level = scale.level();
        let of_noise = Bounds::new(level - 16.0, level + 1.0);
        let mut bounds = vec![of_noise, scale.bounds(), GUSTS_PER_S.map(f64::ln)];
        let of_ancestors = self.ancestors.len() * scale.ln_variances.len();
        bounds.extend((0..of_ancestors).map(|_| scale.bounds()));
        bounds
    }
}

/// How large the motions are.
struct Scale {
    /// Logarithms of their variances.
    ln_variances: Vec<f64>,
}

impl Scale {
    fn of(motions: &[Vec<f64>]) -> Self {
        let mut ln_variances = Vec::with_capacity(motions.len());
        for s in motions {
            ln_variances.push((dot(s, s) / s.len() as f64).ln());
        }
        Self { ln_variances }
    }

    /// Of the first.
    fn level(&self) -> f64 {
        self.ln_variances[0]
    }

    /// Of the logarithm of the variance of any part of them.
    fn bounds(&self) -> Bounds {
        Bounds::new(self.level() - 16.0, self.level() + 4.0)
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
        let mut out = Vec::new();
        for i in (first..self.x.len()).step_by(per) {
            out.push(Oscillator {
                mode: Mode::of_parameters(&self.x[i..]),
                ln_sd: LnDeviations {
                    frequency: deviation(covariance.as_ref(), i),
                    damping: deviation(covariance.as_ref(), i + 1),
                },
                variance: self.x[i + 2..i + per].iter().map(|v| v.exp()).sum(),
                at_limit: self.is_at_limit(i) || self.is_at_limit(i + 1),
            });
        }
        out
    }

    fn is_at_limit(&self, i: usize) -> bool {
        let Bounds { lo, hi } = self.bounds[i];
        [lo, hi].iter().any(|b| (self.x[i] - b).abs() < 1e-6)
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

/// Infinite where there is no covariance.
fn deviation(covariance: Option<&DMatrix<f64>>, i: usize) -> f64 {
    covariance
        .map_or(f64::INFINITY, |c| c[(i, i)])
        .max(0.0)
        .sqrt()
}
