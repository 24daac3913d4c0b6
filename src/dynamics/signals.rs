//! Signals that share damped cosines, at the times at which they were really taken.
//!
//! All signals share the frequencies and dampings and each has factors of its own, which come from
//! a linear fit inside the nonlinear one (`fit.rs`). Nothing is resampled, so that gaps and uneven
//! times cost only the frames that they lack.

use super::columns::{Qr, dot};
use super::decay::{Mode, Start};
use super::normal::{Factored, products, products_without};
use nalgebra::DMatrix;

/// Frequencies that a search tries per factor of e, and dampings.
const PER_E: f64 = 24.0;
const TRIED: [f64; 3] = [0.02, 0.05, 0.1];
/// A column of which less is left than this, when the others are taken off, adds nothing that could
/// be told from them.
const ALIKE: f64 = 0.02;

/// Signals that were seen in the same frames.
pub(super) struct Group {
    /// Frames in which they were seen, and in which they were not.
    seen: Vec<usize>,
    lacking: Vec<usize>,
    /// Of the signals, as they were given.
    ids: Vec<usize>,
    /// In all frames; 0 where they were not seen.
    pub values: Vec<Vec<f64>>,
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
    pub frequencies_hz: [f64; 2],
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
    /// `signals` hold no number where they were not seen; frequencies are looked for within
    /// `frequencies_hz`.
    pub fn new(
        times_s: Vec<f64>,
        signals: &[Vec<f64>],
        start: Start,
        moment_sd_s: f64,
        frequencies_hz: [f64; 2],
    ) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        for (id, signal) in signals.iter().enumerate() {
            let (seen, lacking): (Vec<usize>, Vec<usize>) =
                (0..times_s.len()).partition(|&k| signal[k].is_finite());
            let mut values = signal.clone();
            lacking.iter().for_each(|&k| values[k] = 0.0);
            match groups.iter_mut().find(|g| g.seen == seen) {
                Some(group) => {
                    group.ids.push(id);
                    group.values.push(values);
                }
                None => groups.push(Group {
                    seen,
                    lacking,
                    ids: vec![id],
                    values: vec![values],
                }),
            }
        }
        let values = groups.iter().map(|g| g.seen.len() * g.ids.len()).sum();
        Self {
            times_s,
            start,
            moment_sd_s,
            groups,
            values,
            frequencies_hz,
        }
    }

    /// Columns per mode.
    fn per_mode(&self) -> usize {
        match self.start {
            Start::Rest => 1,
            Start::Moving => 2,
        }
    }

    /// Factors that a mode has in all signals.
    pub fn factors_per_mode(&self) -> usize {
        self.per_mode() * self.groups.iter().map(|g| g.ids.len()).sum::<usize>()
    }

    /// Of a mode, beside the constant's.
    pub fn columns_of(&self, mode: usize) -> std::ops::Range<usize> {
        1 + self.per_mode() * mode..1 + self.per_mode() * (mode + 1)
    }

    pub fn times_of(&self, fit: &Fit) -> Vec<f64> {
        self.times_s.iter().map(|t| t - fit.moment_s).collect()
    }

    /// A constant, then the columns of each mode.
    pub fn columns(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let times = self.times_of(fit);
        let ones = std::iter::once(vec![1.0; times.len()]);
        ones.chain(fit.modes.iter().flat_map(|m| m.columns(&times, self.start)))
            .collect()
    }

    /// Sum of the squares that `fit` leaves.
    pub fn rss(&self, fit: &Fit) -> f64 {
        let columns = self.columns(fit);
        let columns = slices(&columns);
        let all = products(&columns);
        let of = |g: &Group| -> f64 {
            let factored = Factored::new(&g.products(&all, &columns), columns.len());
            g.values
                .iter()
                .map(|y| Explained::new(y, &columns, &factored).left)
                .sum()
        };
        self.groups.iter().map(of).sum()
    }

    /// The mode that takes off most of what a fit leaves, by trying.
    pub fn search(&self, fit: &Fit) -> Option<Mode> {
        let columns = self.columns(fit);
        let slices = slices(&columns);
        let all = products(&slices);
        // The frames that a signal lacks are 0 here: good enough for a first guess, and one set of
        // columns serves all.
        let qr = Qr::new(columns.clone());
        let of_group = |g: &Group| {
            let factored = Factored::new(&g.products(&all, &slices), slices.len());
            let left = |y: &Vec<f64>| {
                let rest = g.rest(y, &slices, &Explained::new(y, &slices, &factored).factors);
                let on_columns: Vec<f64> = qr.q.iter().map(|q| dot(q, &rest)).collect();
                (rest, on_columns)
            };
            g.values.iter().map(left).collect::<Vec<_>>()
        };
        let left: Vec<(Vec<f64>, Vec<f64>)> = self.groups.iter().flat_map(of_group).collect();
        let [lo, hi] = self.frequencies_hz;
        let n = (PER_E * (hi / lo).ln()).ceil().max(1.0) as usize;
        let frequencies_hz = (0..=n).map(|k| lo * (hi / lo).powf(k as f64 / n as f64));
        let tried = frequencies_hz.flat_map(|frequency_hz| {
            TRIED.map(|damping| Mode {
                frequency_hz,
                damping,
            })
        });
        let times = self.times_of(fit);
        let gain = |mode: &Mode| -> f64 {
            let new = mode.columns(&times, self.start);
            // What the new columns add to the fit's: their products, and those with what is left,
            // without the fit's.
            let on_columns: Vec<Vec<f64>> = new
                .iter()
                .map(|c| qr.q.iter().map(|q| dot(q, c)).collect())
                .collect();
            let k = new.len();
            let before = DMatrix::from_fn(k, k, |a, b| dot(&new[a], &new[b]));
            let mut own = DMatrix::from_fn(k, k, |a, b| {
                before[(a, b)] - dot(&on_columns[a], &on_columns[b])
            });
            for a in 0..k {
                if own[(a, a)] <= ALIKE * ALIKE * before[(a, a)] {
                    own.row_mut(a).fill(0.0);
                    own.column_mut(a).fill(0.0);
                }
            }
            let factored = Factored::new(&own, k);
            let taken = |(rest, of_rest): &(Vec<f64>, Vec<f64>)| {
                let by: Vec<f64> = (0..k)
                    .map(|a| dot(rest, &new[a]) - dot(of_rest, &on_columns[a]))
                    .collect();
                dot(&factored.solve(&by), &by)
            };
            left.iter().map(taken).sum()
        };
        let gains = tried.map(|m| (gain(&m), m));
        gains
            .filter(|(g, _)| g.is_finite() && *g > 0.0)
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, m)| m)
    }

    /// The factors of every mode in every signal, `[signal][mode]`, with their significance;
    /// `signals` is how many were given. Noise that is alike from frame to frame counts for less.
    pub fn factors(&self, fit: &Fit, signals: usize) -> Vec<Vec<Factor>> {
        let columns = self.columns(fit);
        let columns = slices(&columns);
        let all = products(&columns);
        let mut out = vec![vec![Factor::default(); fit.modes.len()]; signals];
        for g in &self.groups {
            let factored = Factored::new(&g.products(&all, &columns), columns.len());
            let variances = factored.variances();
            for (id, y) in g.ids.iter().zip(&g.values) {
                let factors = Explained::new(y, &columns, &factored).factors;
                let rest = g.rest(y, &columns, &factors);
                let noise = dot(&rest, &rest)
                    / (g.seen.len().saturating_sub(factors.len()) as f64).max(1.0);
                let inflation = inflation(&rest);
                for (m, factor) in out[*id].iter_mut().enumerate() {
                    let own = self.columns_of(m);
                    let f = &factors[own.clone()];
                    factor.cosine = f[0];
                    factor.sine = f.get(1).copied().unwrap_or(0.0);
                    let over = |(f, v): (&f64, &f64)| {
                        if *v > 0.0 {
                            f * f / (v * noise * inflation).max(1e-30)
                        } else {
                            0.0
                        }
                    };
                    factor.significance = f.iter().zip(&variances[own]).map(over).sum();
                }
            }
        }
        out
    }
}

pub(super) fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// What columns explain of one signal.
pub(super) struct Explained {
    /// Products of the columns with the signal.
    pub by: Vec<f64>,
    /// Of the columns that `Factored` holds.
    pub factors: Vec<f64>,
    /// Squares that are left.
    pub left: f64,
}

impl Explained {
    /// Of `y` by the first of `columns`, as many as `factored` holds; the products are had of all.
    pub fn new(y: &[f64], columns: &[&[f64]], factored: &Factored) -> Self {
        let by: Vec<f64> = columns.iter().map(|c| dot(c, y)).collect();
        let factors = factored.solve(&by);
        let left = (dot(y, y) - dot(&by[..factors.len()], &factors)).max(0.0);
        Self { by, factors, left }
    }
}

impl Group {
    /// Products of columns over the frames in which the signals were seen, from those over `all`
    /// frames.
    pub fn products(&self, all: &DMatrix<f64>, columns: &[&[f64]]) -> DMatrix<f64> {
        products_without(all, columns, &self.lacking)
    }

    /// What `factors` of the columns leave of `y`; 0 where that was not seen.
    pub fn rest(&self, y: &[f64], columns: &[&[f64]], factors: &[f64]) -> Vec<f64> {
        let mut rest = y.to_vec();
        for (column, factor) in columns.iter().zip(factors) {
            rest.iter_mut()
                .zip(*column)
                .for_each(|(r, c)| *r -= factor * c);
        }
        self.lacking.iter().for_each(|&k| rest[k] = 0.0);
        rest
    }
}

/// How much less values count that are alike from frame to frame: (1 + r) / (1 - r) by their
/// correlation r.
fn inflation(rest: &[f64]) -> f64 {
    let squares = dot(rest, rest);
    let pairs: f64 = rest.windows(2).map(|w| w[0] * w[1]).sum();
    let r = if squares > 0.0 {
        (pairs / squares).clamp(0.0, 0.97)
    } else {
        0.0
    };
    (1.0 + r) / (1.0 - r)
}
