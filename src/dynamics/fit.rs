//! The nonlinear fit of damped cosines to many signals at once: variable projection by
//! Levenberg-Marquardt. After a release the moment of it, which all modes share, is fitted too.

use super::branches::BranchMode;
use super::decay::{Mode, Slopes, Start};
use super::signals::{Fit, Signals};
use crate::bounds::Bounds;
use crate::signal::gram::{GramCholesky, gram};
use crate::signal::least_squares::{
    LeastSquares, NormalEquations, ParameterLimits, Stopping, levenberg_marquardt,
};
use crate::signal::variable_projection::{Basis, Explained, Slope};

/// When a fit is done.
const STOPPING: Stopping = Stopping {
    max_steps: 30,
    min_gain: 0.0,
    min_relative_gain: 1e-4,
};
/// Change of a logarithm in one step, and of the moment of a release, s.
const MAX_STEP: f64 = 0.3;
/// Damping ratios that are tried.
const DAMPING: Bounds = Bounds::new(0.002, 0.45);
/// Variances below this are none.
const MIN_VARIANCE: f64 = 1e-12;

/// What is known of a mode beforehand.
pub(super) type Prior = Option<BranchMode>;

/// A fit of signals with what is known of its modes.
struct DecayFit<'a> {
    signals: &'a Signals,
    priors: &'a [Prior],
}

impl LeastSquares for DecayFit<'_> {
    /// The squares that are left with what the priors add: a prior weighs as much as the noise of
    /// one value allows.
    fn cost(&self, x: &[f64]) -> f64 {
        let mut of_priors = 0.0;
        for (m, prior) in self.priors.iter().enumerate() {
            let Some(BranchMode { mode, ln_sd }) = prior else {
                continue;
            };
            let parameters = mode.parameters().into_iter().zip(ln_sd.parameters());
            for (i, (at, sd)) in parameters.enumerate() {
                of_priors += (at - x[2 * m + i]).powi(2) / sd.powi(2).max(MIN_VARIANCE);
            }
        }
        if self.signals.start == Start::Rest {
            of_priors += x[x.len() - 1].powi(2) / self.signals.moment_variance();
        }
        let rss = self.signals.rss(&self.signals.fit_of(x));
        rss * (1.0 + of_priors / (self.signals.values as f64).max(1.0))
    }

    fn normal_equations(&self, x: &[f64]) -> NormalEquations {
        self.signals.linearized(x, self.priors).normal
    }
}

/// A fit near its minimum.
pub(super) struct Linearized {
    pub normal: NormalEquations,
    pub rss: f64,
}

impl Signals {
    fn fit_of(&self, x: &[f64]) -> Fit {
        let moment_s = match self.start {
            Start::Rest => x[x.len() - 1],
            Start::Moving => 0.0,
        };
        Fit {
            modes: x.chunks_exact(2).map(Mode::of_parameters).collect(),
            moment_s,
            rss: f64::NAN,
        }
    }

    /// Logarithms of frequency and damping of each mode; after a release from rest its moment, s.
    pub fn parameters(&self, fit: &Fit) -> Vec<f64> {
        let mut x: Vec<f64> = fit.modes.iter().flat_map(Mode::parameters).collect();
        if self.start == Start::Rest {
            x.push(fit.moment_s);
        }
        x
    }

    fn parameter_limits(&self, modes: usize) -> Vec<ParameterLimits> {
        let mut out = Vec::with_capacity(2 * modes + 1);
        for _ in 0..modes {
            for bounds in [self.frequencies_hz, DAMPING] {
                out.push(ParameterLimits {
                    bounds: bounds.map(f64::ln),
                    max_step: MAX_STEP,
                });
            }
        }
        if self.start == Start::Rest {
            out.push(ParameterLimits {
                bounds: Bounds::new(f64::NEG_INFINITY, f64::INFINITY),
                max_step: MAX_STEP,
            });
        }
        out
    }

    /// Variance of the moment of the release, s².
    pub fn moment_variance(&self) -> f64 {
        self.moment_sd_s.powi(2).max(MIN_VARIANCE)
    }

    /// Fits all of `modes`; those that have a prior are held near it by its standard deviations (of
    /// the logarithms of frequency and damping).
    pub fn fit(&self, from: &Fit, priors: &[Prior]) -> Fit {
        let problem = DecayFit {
            signals: self,
            priors,
        };
        let limits = self.parameter_limits(from.modes.len());
        let x = levenberg_marquardt(&problem, self.parameters(from), &limits, &STOPPING);
        let fit = self.fit_of(&x);
        Fit {
            rss: self.rss(&fit),
            ..fit
        }
    }

    /// Whether a mode stands where the search ends: what it describes lies beyond.
    pub fn at_limit(&self, mode: &Mode) -> bool {
        is_at(mode.frequency_hz, self.frequencies_hz) || is_at(mode.damping, DAMPING)
    }

    /// The normal equations at `x`.
    pub fn linearized(&self, x: &[f64], priors: &[Prior]) -> Linearized {
        let mut normal = NormalEquations::zeros(x.len());
        let mut rss = 0.0;
        let basis = self.basis(&self.fit_of(x));
        let all = basis.columns_and_slopes();
        let of_all = gram(&all);
        for group in &self.groups {
            let weights = vec![1.0; group.signals.count()];
            let products = group.gram(&of_all, &all);
            rss += normal.add_signals(&basis, &products, &group.signals, &weights);
        }
        let noise = rss / (self.values as f64).max(1.0);
        for (m, prior) in priors.iter().enumerate() {
            let Some(BranchMode { mode, ln_sd }) = prior else {
                continue;
            };
            let parameters = mode.parameters().into_iter().zip(ln_sd.parameters());
            for (i, (at, sd)) in parameters.enumerate() {
                let k = 2 * m + i;
                normal.add_prior(k, at - x[k], noise / sd.powi(2).max(MIN_VARIANCE));
            }
        }
        if self.start == Start::Rest {
            let last = x.len() - 1;
            normal.add_prior(last, -x[last], noise / self.moment_variance());
        }
        Linearized { normal, rss }
    }

    fn basis(&self, fit: &Fit) -> Basis {
        let times = self.times_of(fit);
        let mut basis = Basis {
            columns: vec![vec![1.0; times.len()]],
            slopes: Vec::new(),
        };
        for (m, mode) in fit.modes.iter().enumerate() {
            for (values, slopes) in mode.columns_and_slopes(&times, self.start) {
                let column = basis.columns.len();
                basis.columns.push(values);
                let Slopes { by_mode, by_moment } = slopes;
                for (i, values) in by_mode.into_iter().enumerate() {
                    basis.slopes.push(Slope {
                        parameter: 2 * m + i,
                        column,
                        values,
                    });
                }
                if self.start == Start::Rest {
                    basis.slopes.push(Slope {
                        parameter: 2 * fit.modes.len(),
                        column,
                        values: by_moment,
                    });
                }
            }
        }
        basis
    }

    /// For every signal what each of its values adds to the gradient, `[parameter][frame]`: 0 in
    /// frames that it lacks.
    pub fn scores(&self, fit: &Fit) -> Vec<Vec<Vec<f64>>> {
        let basis = self.basis(fit);
        let all = basis.columns_and_slopes();
        let of_all = gram(&all);
        let parameters = self.parameters(fit).len();
        let n = basis.columns.len();
        let mut out = Vec::new();
        for group in &self.groups {
            let products = group.gram(&of_all, &all);
            let factored = GramCholesky::new(&products, n);
            // What the columns do not span of their slopes.
            let mut unspanned: Vec<Vec<f64>> = Vec::with_capacity(basis.slopes.len());
            for (s, slope) in basis.slopes.iter().enumerate() {
                let on_columns: Vec<f64> = (0..n).map(|c| products[(c, n + s)]).collect();
                let spanned = factored.solve(&on_columns);
                unspanned.push(group.rest(&slope.values, &all[..n], &spanned));
            }
            let explained = Explained::new(&group.signals, &all[..n], &factored);
            for (signal, factors) in group.signals.each().zip(explained.factors_of_each()) {
                let rest = group.rest(signal, &all[..n], factors);
                let mut scores = vec![vec![0.0; rest.len()]; parameters];
                for (slope, values) in basis.slopes.iter().zip(&unspanned) {
                    let factor = factors[slope.column];
                    let scores = scores[slope.parameter].iter_mut();
                    for (score, (r, s)) in scores.zip(rest.iter().zip(values)) {
                        *score += r * factor * s;
                    }
                }
                out.push(scores);
            }
        }
        out
    }
}

/// Whether `x` is one of the ends of `limits`.
fn is_at(x: f64, limits: Bounds) -> bool {
    [limits.lo, limits.hi]
        .iter()
        .any(|l| (x / l).ln().abs() < 1e-6)
}
