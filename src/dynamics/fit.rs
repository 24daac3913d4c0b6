//! The nonlinear fit of damped cosines to many signals at once.
//!
//! Factors come from a linear fit inside the nonlinear one: variable projection (Golub and Pereyra
//! 1973) with Kaufman's Jacobian (1975), all of it by normal equations, so that a step costs
//! products of columns with signals and little else. After a release the moment of it, which all
//! modes share, is fitted too.

use super::columns::dot;
use super::decay::{Mode, Slopes, Start};
use super::normal::{Factored, products};
use super::signals::{Explained, Fit, Group, Signals, slices};
use nalgebra::{DMatrix, DVector};

/// Iterations of the fit at most, and the relative change of the sum of squares at which it ends.
const MAX_STEPS: usize = 30;
const DONE: f64 = 1e-4;
/// Damping ratios that are tried.
const DAMPING: [f64; 2] = [0.002, 0.45];

/// What is known of a mode beforehand, with the standard deviations of the logarithms of its
/// frequency and damping.
pub(super) type Prior = Option<(Mode, [f64; 2])>;

/// Everything that a step needs.
pub(super) struct Linear {
    pub hessian: DMatrix<f64>,
    pub gradient: DVector<f64>,
    pub rss: f64,
}

/// Columns of a fit, and how they change with its parameters.
struct Basis {
    columns: Vec<Vec<f64>>,
    slopes: Vec<Slope>,
}

struct Slope {
    parameter: usize,
    column: usize,
    values: Vec<f64>,
}

impl Signals {
    fn fit_of(&self, x: &[f64]) -> Fit {
        let modes = x.chunks_exact(2).map(Mode::of_parameters).collect();
        Fit {
            modes,
            moment_s: if x.len() % 2 == 1 {
                x[x.len() - 1]
            } else {
                0.0
            },
            rss: f64::NAN,
        }
    }

    /// Logarithms of frequency and damping of each mode; after a release from rest its moment, s.
    pub fn parameters(&self, fit: &Fit) -> Vec<f64> {
        let moment = (self.start == Start::Rest).then_some(fit.moment_s);
        fit.modes
            .iter()
            .flat_map(Mode::parameters)
            .chain(moment)
            .collect()
    }

    /// Fits all of `modes`; those that have a prior are held near it by its standard deviations (of
    /// the logarithms of frequency and damping).
    pub fn fit(&self, from: &Fit, priors: &[Prior]) -> Fit {
        let mut x = self.parameters(from);
        let mut now = self.linearized(&x, priors);
        let mut cost = self.cost(&x, now.rss, priors);
        let mut lambda = 1e-3;
        for _ in 0..MAX_STEPS {
            let mut better = false;
            for _ in 0..6 {
                let mut h = now.hessian.clone();
                (0..h.nrows()).for_each(|i| h[(i, i)] *= 1.0 + lambda);
                let Some(step) = h.lu().solve(&now.gradient) else {
                    break;
                };
                let mut next: Vec<f64> = x
                    .iter()
                    .zip(step.iter())
                    .map(|(x, d)| x + d.clamp(-0.3, 0.3))
                    .collect();
                next.chunks_exact_mut(2).for_each(|p| {
                    p[0] = p[0].clamp(self.frequencies_hz[0].ln(), self.frequencies_hz[1].ln());
                    p[1] = p[1].clamp(DAMPING[0].ln(), DAMPING[1].ln());
                });
                let there = self.cost(&next, self.rss(&self.fit_of(&next)), priors);
                if there < cost {
                    better = cost - there > DONE * cost;
                    if better {
                        now = self.linearized(&next, priors);
                    }
                    (x, cost) = (next, there);
                    lambda *= 0.2;
                    break;
                }
                lambda = (lambda * 5.0).max(1e-6);
            }
            if !better {
                break;
            }
        }
        let fit = self.fit_of(&x);
        Fit {
            rss: self.rss(&fit),
            ..fit
        }
    }

    /// Whether a mode stands where the search ends: what it describes lies beyond.
    pub fn at_limit(&self, mode: &Mode) -> bool {
        let at = |x: f64, limits: [f64; 2]| limits.iter().any(|l| (x / l).ln().abs() < 1e-6);
        at(mode.frequency_hz, self.frequencies_hz) || at(mode.damping, DAMPING)
    }

    /// The squares that are left with what the priors add: a prior weighs as much as the noise of
    /// one value allows.
    fn cost(&self, x: &[f64], rss: f64, priors: &[Prior]) -> f64 {
        let off = |(m, prior): (usize, &Prior)| {
            let Some((mode, sd)) = prior else { return 0.0 };
            let at = mode.parameters();
            (0..2)
                .map(|i| (at[i] - x[2 * m + i]).powi(2) / (sd[i] * sd[i]).max(1e-12))
                .sum::<f64>()
        };
        let of_modes: f64 = priors.iter().enumerate().map(off).sum();
        let of_moment = match self.start {
            Start::Rest => x[x.len() - 1].powi(2) / self.moment_sd_s.powi(2).max(1e-12),
            Start::Moving => 0.0,
        };
        rss * (1.0 + (of_modes + of_moment) / (self.values as f64).max(1.0))
    }

    /// Everything that a step needs at `x`.
    pub fn linearized(&self, x: &[f64], priors: &[Prior]) -> Linear {
        let p = x.len();
        let mut out = Linear {
            hessian: DMatrix::zeros(p, p),
            gradient: DVector::zeros(p),
            rss: 0.0,
        };
        let basis = self.basis(&self.fit_of(x));
        let all = basis.all();
        let of_all = products(&all);
        for g in &self.groups {
            out.add(g, &g.products(&of_all, &all), &basis, &all);
        }
        let noise = out.rss / (self.values as f64).max(1.0);
        for (m, prior) in priors.iter().enumerate() {
            let Some((mode, sd)) = prior else { continue };
            for (i, at) in mode.parameters().into_iter().enumerate() {
                let k = 2 * m + i;
                let weight = noise / (sd[i] * sd[i]).max(1e-12);
                out.hessian[(k, k)] += weight;
                out.gradient[k] += weight * (at - x[k]);
            }
        }
        if self.start == Start::Rest {
            let weight = noise / self.moment_sd_s.powi(2).max(1e-12);
            out.hessian[(p - 1, p - 1)] += weight;
            out.gradient[p - 1] -= weight * x[p - 1];
        }
        out
    }

    fn basis(&self, fit: &Fit) -> Basis {
        let times = self.times_of(fit);
        let mut basis = Basis {
            columns: vec![vec![1.0; times.len()]],
            slopes: Vec::new(),
        };
        for (m, mode) in fit.modes.iter().enumerate() {
            for (values, Slopes { by_mode, by_moment }) in
                mode.columns_and_slopes(&times, self.start)
            {
                let column = basis.columns.len();
                basis.columns.push(values);
                let of_mode = by_mode
                    .into_iter()
                    .enumerate()
                    .map(|(i, values)| (2 * m + i, values));
                let of_moment =
                    (self.start == Start::Rest).then_some((2 * fit.modes.len(), by_moment));
                let slopes = of_mode.chain(of_moment);
                basis.slopes.extend(slopes.map(|(parameter, values)| Slope {
                    parameter,
                    column,
                    values,
                }));
            }
        }
        basis
    }

    /// For every signal what each of its values adds to the gradient, `[parameter][frame]`: 0 in
    /// frames that it lacks.
    pub fn scores(&self, fit: &Fit) -> Vec<Vec<Vec<f64>>> {
        let basis = self.basis(fit);
        let all = basis.all();
        let (of_all, n, p) = (
            products(&all),
            basis.columns.len(),
            self.parameters(fit).len(),
        );
        let of_group = |g: &Group| {
            let products = g.products(&of_all, &all);
            let factored = Factored::new(&products, n);
            // What the columns do not span of their slopes.
            let off = |(s, slope): (usize, &Slope)| {
                let by: Vec<f64> = (0..n).map(|c| products[(c, n + s)]).collect();
                g.rest(&slope.values, &all[..n], &factored.solve(&by))
            };
            let slopes: Vec<Vec<f64>> = basis.slopes.iter().enumerate().map(off).collect();
            let signal = |y: &Vec<f64>| {
                let factors = Explained::new(y, &all[..n], &factored).factors;
                let rest = g.rest(y, &all[..n], &factors);
                let mut scores = vec![vec![0.0; rest.len()]; p];
                for (slope, values) in basis.slopes.iter().zip(&slopes) {
                    let factor = factors[slope.column];
                    let of = scores[slope.parameter]
                        .iter_mut()
                        .zip(rest.iter().zip(values));
                    of.for_each(|(score, (r, s))| *score += r * factor * s);
                }
                scores
            };
            g.values.iter().map(signal).collect::<Vec<_>>()
        };
        self.groups.iter().flat_map(of_group).collect()
    }
}

impl Basis {
    /// The columns, then their slopes.
    fn all(&self) -> Vec<&[f64]> {
        let mut all = slices(&self.columns);
        all.extend(self.slopes.iter().map(|s| s.values.as_slice()));
        all
    }
}

impl Linear {
    /// Adds a group's share. Kaufman's Jacobian is slopes (without what the columns span of them)
    /// times factors, so that products of columns and of factors are enough, and the Jacobian
    /// itself is never made.
    fn add(&mut self, group: &Group, products: &DMatrix<f64>, basis: &Basis, all: &[&[f64]]) {
        let n = basis.columns.len();
        let factored = Factored::new(products, n);
        let explained: Vec<Explained> = group
            .values
            .iter()
            .map(|y| Explained::new(y, all, &factored))
            .collect();
        let alike = DMatrix::from_fn(n, n, |a, b| {
            explained
                .iter()
                .map(|e| e.factors[a] * e.factors[b])
                .sum::<f64>()
        });
        let on_columns = |s: usize| (0..n).map(|c| products[(c, n + s)]).collect::<Vec<f64>>();
        for (s, slope) in basis.slopes.iter().enumerate() {
            let by = on_columns(s);
            let spanned = factored.solve(&by);
            for (t, other) in basis.slopes.iter().enumerate() {
                let left = products[(n + s, n + t)]
                    - (0..n)
                        .map(|c| spanned[c] * products[(c, n + t)])
                        .sum::<f64>();
                self.hessian[(slope.parameter, other.parameter)] +=
                    left * alike[(slope.column, other.column)];
            }
            let of = |e: &Explained| e.factors[slope.column] * (e.by[n + s] - dot(&by, &e.factors));
            self.gradient[slope.parameter] += explained.iter().map(of).sum::<f64>();
        }
        self.rss += explained.iter().map(|e| e.left).sum::<f64>();
    }
}
