//! Damped cosines fitted to many signals at once, at the times at which they were really taken.
//!
//! All signals share the frequencies and dampings and each has factors of its own, which come from a linear fit inside
//! the nonlinear one: variable projection (Golub and Pereyra 1973) with Kaufman's Jacobian (1975). Nothing is resampled,
//! so that gaps and uneven times cost only the frames that they lack. After a release the moment of it, which all modes
//! share, is fitted too.

use super::columns::{Qr, dot, take_off_once};
use super::decay::{Mode, Start};
use nalgebra::{DMatrix, DVector};

/// Iterations of the fit at most, and the relative change of the sum of squares at which it ends.
const MAX_STEPS: usize = 30;
const DONE: f64 = 1e-4;
/// Damping ratios that are tried.
const DAMPING: [f64; 2] = [0.002, 0.45];
/// Frequencies that a search tries per factor of e, and dampings.
const PER_E: f64 = 24.0;
const TRIED: [f64; 3] = [0.02, 0.05, 0.1];
/// A column of which less is left than this, when the others are taken off, adds nothing that could be told from them.
const ALIKE: f64 = 0.02;

/// What is known of a mode beforehand, with the standard deviations of the logarithms of its frequency and damping.
pub(super) type Prior = Option<(Mode, [f64; 2])>;

/// Signals that were seen in the same frames.
pub(super) struct Group {
    /// Of the frames.
    rows: Vec<usize>,
    /// Of the signals, as they were given.
    ids: Vec<usize>,
    values: Vec<Vec<f64>>,
}

/// Signals to be fitted together.
pub(super) struct Signals {
    pub times_s: Vec<f64>,
    pub start: Start,
    /// Standard deviation of the moment of a release that times are counted from, s.
    pub moment_sd_s: f64,
    pub groups: Vec<Group>,
    /// Number of values in all signals.
    pub values: usize,
    frequencies_hz: [f64; 2],
}

/// A fit of modes to signals.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit {
    pub modes: Vec<Mode>,
    /// How much later than time 0 the tree was let go, s.
    pub moment_s: f64,
    /// Sum of the squares that are left.
    pub rss: f64,
}

/// A mode's factors in one signal.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Factor {
    /// Of cosine and sine.
    pub cosine: f64,
    pub sine: f64,
    /// Square of the factors over their variance, by the noise that is left in this signal.
    pub significance: f64,
}

impl Factor {
    pub fn size(&self) -> f64 {
        self.cosine.hypot(self.sine)
    }
}

impl Signals {
    /// `signals` hold no number where they were not seen; frequencies are looked for within `frequencies_hz`.
    pub fn new(
        times_s: Vec<f64>,
        signals: &[Vec<f64>],
        start: Start,
        moment_sd_s: f64,
        frequencies_hz: [f64; 2],
    ) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        for (id, signal) in signals.iter().enumerate() {
            let rows: Vec<usize> = (0..times_s.len()).filter(|&k| signal[k].is_finite()).collect();
            let values: Vec<f64> = rows.iter().map(|&k| signal[k]).collect();
            match groups.iter_mut().find(|g| g.rows == rows) {
                Some(group) => {
                    group.ids.push(id);
                    group.values.push(values);
                }
                None => groups.push(Group { rows, ids: vec![id], values: vec![values] }),
            }
        }
        let values = groups.iter().map(|g| g.rows.len() * g.ids.len()).sum();
        Self { times_s, start, moment_sd_s, groups, values, frequencies_hz }
    }

    /// Columns per mode.
    pub fn per_mode(&self) -> usize {
        match self.start {
            Start::Rest => 1,
            Start::Moving => 2,
        }
    }

    fn columns(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let times: Vec<f64> = self.times_s.iter().map(|t| t - fit.moment_s).collect();
        let ones = std::iter::once(vec![1.0; times.len()]);
        ones.chain(fit.modes.iter().flat_map(|m| m.columns(&times, self.start))).collect()
    }

    fn fit_of(&self, x: &[f64]) -> Fit {
        let modes = x.chunks_exact(2).map(Mode::of_parameters).collect();
        Fit { modes, moment_s: if x.len() % 2 == 1 { x[x.len() - 1] } else { 0.0 }, rss: f64::NAN }
    }

    pub fn parameters(&self, fit: &Fit) -> Vec<f64> {
        let moment = (self.start == Start::Rest).then_some(fit.moment_s);
        fit.modes.iter().flat_map(Mode::parameters).chain(moment).collect()
    }

    /// Sum of the squares that `modes` leave.
    pub fn rss(&self, fit: &Fit) -> f64 {
        let columns = self.columns(fit);
        let of = |g: &Group| -> f64 {
            let qr = Qr::new(g.pick(&columns));
            g.values.iter().map(|y| qr.solve(y).0).map(|r| dot(&r, &r)).sum()
        };
        self.groups.iter().map(of).sum()
    }

    /// The mode that takes off most of what a fit leaves, by trying.
    pub fn search(&self, fit: &Fit) -> Option<Mode> {
        // The frames that a signal lacks are 0 here: good enough for a first guess, and one set of columns serves all.
        let columns = self.columns(fit);
        let qr = Qr::new(columns.clone());
        let left = self.groups.iter().flat_map(|g| {
            let own = Qr::new(g.pick(&columns));
            let spread = |rest: Vec<f64>| {
                let mut all = vec![0.0; self.times_s.len()];
                g.rows.iter().zip(&rest).for_each(|(k, r)| all[*k] = *r);
                all
            };
            g.values.iter().map(|y| spread(own.solve(y).0)).collect::<Vec<_>>()
        });
        let left: Vec<Vec<f64>> = left.collect();
        let [lo, hi] = self.frequencies_hz;
        let n = (PER_E * (hi / lo).ln()).ceil().max(1.0) as usize;
        let tried = (0..=n).flat_map(|k| {
            let frequency_hz = lo * (hi / lo).powf(k as f64 / n as f64);
            TRIED.map(|damping| Mode { frequency_hz, damping })
        });
        let times: Vec<f64> = self.times_s.iter().map(|t| t - fit.moment_s).collect();
        let gain = |mode: &Mode| -> f64 {
            let mut added: Vec<Vec<f64>> = Vec::new();
            for mut column in mode.columns(&times, self.start) {
                let before = dot(&column, &column);
                take_off_once(&mut column, &qr.q);
                take_off_once(&mut column, &added);
                let after = dot(&column, &column);
                if after > ALIKE * ALIKE * before {
                    column.iter_mut().for_each(|x| *x /= after.sqrt());
                    added.push(column);
                }
            }
            left.iter().map(|r| added.iter().map(|q| dot(r, q).powi(2)).sum::<f64>()).sum()
        };
        let gains = tried.map(|m| (gain(&m), m));
        gains.filter(|(g, _)| g.is_finite() && *g > 0.0).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, m)| m)
    }

    /// Fits all of `modes`; those that have a prior are held near it by its standard deviations (of the logarithms of
    /// frequency and damping).
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
                let Some(step) = h.lu().solve(&now.gradient) else { break };
                let mut next: Vec<f64> = x.iter().zip(step.iter()).map(|(x, d)| x + d.clamp(-0.3, 0.3)).collect();
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
        Fit { rss: self.rss(&fit), ..fit }
    }

    /// The squares that are left with what the priors add: a prior weighs as much as the noise of one value allows.
    fn cost(&self, x: &[f64], rss: f64, priors: &[Prior]) -> f64 {
        let off = |(m, prior): (usize, &Prior)| {
            let Some((mode, sd)) = prior else { return 0.0 };
            let at = mode.parameters();
            (0..2).map(|i| (at[i] - x[2 * m + i]).powi(2) / (sd[i] * sd[i]).max(1e-12)).sum::<f64>()
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
        let fit = self.fit_of(x);
        let p = x.len();
        let mut out = Linear { hessian: DMatrix::zeros(p, p), gradient: DVector::zeros(p), rss: 0.0 };
        let (columns, slopes) = (self.columns(&fit), self.slopes(x));
        for g in &self.groups {
            g.parts(&columns, &slopes).add(&mut out);
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

    /// Derivatives of the columns by each parameter, with the columns that they belong to.
    fn slopes(&self, x: &[f64]) -> Vec<Vec<(usize, Vec<f64>)>> {
        const STEP: f64 = 1e-5;
        let fit = self.fit_of(x);
        let slope = |(up, down): (Vec<f64>, Vec<f64>)| -> Vec<f64> {
            up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * STEP)).collect()
        };
        let times = |later: f64| self.times_s.iter().map(|t| t - fit.moment_s - later).collect::<Vec<f64>>();
        let now = times(0.0);
        let of_mode = |k: usize| {
            let moved = |by: f64| {
                let mut own = fit.modes[k / 2].parameters();
                own[k % 2] += by;
                Mode::of_parameters(&own).columns(&now, self.start)
            };
            self.columns_of(k / 2).zip(moved(STEP).into_iter().zip(moved(-STEP)).map(slope)).collect()
        };
        let of_moment = |_| {
            let (late, early) = (times(STEP), times(-STEP));
            let of = |m: &Mode| {
                let pairs = m.columns(&late, self.start).into_iter().zip(m.columns(&early, self.start));
                pairs.map(slope).collect::<Vec<_>>()
            };
            fit.modes.iter().flat_map(of).enumerate().map(|(c, s)| (c + 1, s)).collect()
        };
        let modes = 2 * fit.modes.len();
        (0..modes).map(of_mode).chain((modes..x.len()).map(of_moment)).collect()
    }

    fn columns_of(&self, mode: usize) -> std::ops::Range<usize> {
        1 + self.per_mode() * mode..1 + self.per_mode() * (mode + 1)
    }

    /// For every signal: its values' frames, and what each value adds to the gradient, `[parameter][value]`.
    pub fn scores(&self, fit: &Fit) -> Vec<(&[usize], Vec<Vec<f64>>)> {
        let (columns, slopes) = (self.columns(fit), self.slopes(&self.parameters(fit)));
        let of = |g: &'_ Group| {
            let parts = g.parts(&columns, &slopes);
            let signal = |(rest, factors): (&Vec<f64>, &Vec<f64>)| {
                let by = |of: &Vec<(usize, Vec<f64>)>| {
                    let at = |i: usize| rest[i] * of.iter().map(|(c, s)| factors[*c] * s[i]).sum::<f64>();
                    (0..rest.len()).map(at).collect::<Vec<f64>>()
                };
                parts.slopes.iter().map(by).collect::<Vec<_>>()
            };
            parts.rests.iter().zip(&parts.factors).map(signal).collect::<Vec<_>>()
        };
        self.groups.iter().flat_map(|g| of(g).into_iter().map(|s| (g.rows.as_slice(), s))).collect()
    }

    /// The factors of every mode in every signal, `[signal][mode]`, with their significance; `signals` is how many were
    /// given. Noise that is alike from frame to frame counts for less.
    pub fn factors(&self, fit: &Fit, signals: usize) -> Vec<Vec<Factor>> {
        let columns = self.columns(fit);
        let mut out = vec![vec![Factor::default(); fit.modes.len()]; signals];
        for g in &self.groups {
            let qr = Qr::new(g.pick(&columns));
            let variances = qr.variances();
            for (id, y) in g.ids.iter().zip(&g.values) {
                let (rest, factors) = qr.solve(y);
                let noise = dot(&rest, &rest) / (rest.len().saturating_sub(factors.len()) as f64).max(1.0);
                let inflation = inflation(&rest);
                for (m, factor) in out[*id].iter_mut().enumerate() {
                    let own = self.columns_of(m);
                    let f = &factors[own.clone()];
                    factor.cosine = f[0];
                    factor.sine = f.get(1).copied().unwrap_or(0.0);
                    let over =
                        |(f, v): (&f64, &f64)| if *v > 0.0 { f * f / (v * noise * inflation).max(1e-30) } else { 0.0 };
                    factor.significance = f.iter().zip(&variances[own]).map(over).sum();
                }
            }
        }
        out
    }
}

pub(super) struct Linear {
    pub hessian: DMatrix<f64>,
    pub gradient: DVector<f64>,
    pub rss: f64,
}

/// A group's share in a step.
struct Parts {
    rests: Vec<Vec<f64>>,
    factors: Vec<Vec<f64>>,
    /// By parameter: columns, and their derivatives without what the columns themselves span.
    slopes: Vec<Vec<(usize, Vec<f64>)>>,
}

impl Group {
    fn pick(&self, columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
        columns.iter().map(|c| self.thin(c)).collect()
    }

    fn thin(&self, column: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|&k| column[k]).collect()
    }

    fn parts(&self, columns: &[Vec<f64>], slopes: &[Vec<(usize, Vec<f64>)>]) -> Parts {
        let qr = Qr::new(self.pick(columns));
        let (rests, factors) = self.values.iter().map(|y| qr.solve(y)).unzip();
        let off = |(c, slope): &(usize, Vec<f64>)| {
            let mut slope = self.thin(slope);
            take_off_once(&mut slope, &qr.q);
            (*c, slope)
        };
        Parts { rests, factors, slopes: slopes.iter().map(|s| s.iter().map(off).collect()).collect() }
    }
}

impl Parts {
    /// Kaufman's Jacobian is slopes times factors, so that the normal equations need products of columns and of factors
    /// only, never the Jacobian itself.
    fn add(&self, to: &mut Linear) {
        let alike = |a: usize, b: usize| -> f64 { self.factors.iter().map(|f| f[a] * f[b]).sum() };
        for (k, of_k) in self.slopes.iter().enumerate() {
            for (l, of_l) in self.slopes.iter().enumerate().skip(k) {
                let pairs = of_k.iter().flat_map(|a| of_l.iter().map(move |b| (a, b)));
                let sum: f64 = pairs.map(|((c, s), (d, t))| dot(s, t) * alike(*c, *d)).sum();
                to.hessian[(k, l)] += sum;
                if l > k {
                    to.hessian[(l, k)] += sum;
                }
            }
            for (rest, factors) in self.rests.iter().zip(&self.factors) {
                to.gradient[k] += of_k.iter().map(|(c, s)| factors[*c] * dot(s, rest)).sum::<f64>();
            }
        }
        to.rss += self.rests.iter().map(|r| dot(r, r)).sum::<f64>();
    }
}

/// How much less values count that are alike from frame to frame: (1 + r) / (1 - r) by their correlation r.
fn inflation(rest: &[f64]) -> f64 {
    let squares = dot(rest, rest);
    let pairs: f64 = rest.windows(2).map(|w| w[0] * w[1]).sum();
    let r = if squares > 0.0 { (pairs / squares).clamp(0.0, 0.97) } else { 0.0 };
    (1.0 + r) / (1.0 - r)
}
