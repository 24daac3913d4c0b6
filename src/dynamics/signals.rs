//! Signals that share damped cosines, at the times at which they were really taken.
//!
//! All signals share the frequencies and dampings and each has factors of its own, which come from
//! a linear fit inside the nonlinear one (`fit.rs`). Nothing is resampled, so that gaps and uneven
//! times cost only the frames that they lack.

use super::decay::{Mode, Start};
use super::mode_search::mode_grid;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::extension::Candidates;
use crate::signal::gram::{GramCholesky, gram, gram_without};
use crate::signal::qr::Qr;
use crate::signal::variable_projection::{Explained, SignalBlock};
use crate::signal::vectors::{dot, slices, subtract_scaled};
use nalgebra::DMatrix;
use std::cell::OnceCell;

/// Frequencies that a search tries per factor of e.
const SEARCHED_PER_E: f64 = 24.0;
/// Correlation of neighbouring residuals that is believed at most.
const MAX_CORRELATION: f64 = 0.97;

/// Signals that were seen in the same frames.
pub(super) struct Group {
    /// Frames in which they were seen, and in which they were not.
    seen: Vec<usize>,
    lacking: Vec<usize>,
    /// Of the signals, as they were given.
    ids: Vec<usize>,
    pub signals: SignalBlock,
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
    pub frequencies_hz: Bounds,
    /// The columns of the modes that are tried, where they are the same for every fit.
    tried: OnceCell<Candidates>,
}

/// A fit of modes to signals.
#[derive(Clone, Debug, Default)]
pub(super) struct Fit {
    pub modes: Vec<Mode>,
    /// How much later than time 0 the tree was released, s.
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
    /// Of the columns of one mode (one, or cosine and sine), with the variances that they have for
    /// noise of variance 1.
    fn new(factors: &[f64], variances: &[f64], noise: f64) -> Self {
        let mut significance = 0.0;
        for (factor, variance) in factors.iter().zip(variances) {
            if *variance > 0.0 {
                significance += factor * factor / (variance * noise).max(1e-30);
            }
        }
        Self {
            significance,
            ..Self::of(factors)
        }
    }

    /// Of the columns of one mode, whatever the noise.
    pub fn of(factors: &[f64]) -> Self {
        Self {
            cosine: factors.first().copied().unwrap_or(0.0),
            sine: factors.get(1).copied().unwrap_or(0.0),
            significance: 0.0,
        }
    }

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
        frequencies_hz: Bounds,
    ) -> Self {
        let mut seen_alike: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for (id, signal) in signals.iter().enumerate() {
            let seen: Vec<usize> = (0..times_s.len())
                .filter(|&k| signal[k].is_finite())
                .collect();
            match seen_alike.iter_mut().find(|(frames, _)| *frames == seen) {
                Some((_, ids)) => ids.push(id),
                None => seen_alike.push((seen, vec![id])),
            }
        }
        let mut groups: Vec<Group> = Vec::with_capacity(seen_alike.len());
        for (seen, ids) in seen_alike {
            groups.push(Group::new(seen, ids, signals));
        }
        let values = groups.iter().map(|g| g.seen.len() * g.ids.len()).sum();
        Self {
            times_s,
            start,
            moment_sd_s,
            groups,
            values,
            frequencies_hz,
            tried: OnceCell::new(),
        }
    }

    /// From the first time to the last, s.
    pub fn span_s(&self) -> f64 {
        let ends = self.times_s.last().zip(self.times_s.first());
        ends.map_or(0.0, |(last, first)| last - first)
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
        let mut columns = vec![vec![1.0; times.len()]];
        for mode in &fit.modes {
            columns.extend(mode.columns(&times, self.start));
        }
        columns
    }

    /// Sum of the squares that `fit` leaves.
    pub fn rss(&self, fit: &Fit) -> f64 {
        let columns = self.columns(fit);
        let columns = slices(&columns);
        let all = gram(&columns);
        let mut rss = 0.0;
        for group in &self.groups {
            let factored = GramCholesky::new(&group.gram(&all, &columns), columns.len());
            let explained = Explained::new(&group.signals, &columns, &factored);
            rss += explained.left.iter().sum::<f64>();
        }
        rss
    }

    /// A fit of modes that are found one after the other, `most` or as many as there are; `None` where
    /// `cancel` ends the search before.
    pub fn fit_modes(&self, most: usize, cancel: &CancelToken) -> Option<Fit> {
        let mut fit = Fit {
            rss: self.squares(),
            ..Fit::default()
        };
        for _ in 0..most {
            if cancel.is_cancelled() {
                return None;
            }
            let Some(more) = self.with_one_more(&fit) else {
                break;
            };
            fit = more;
        }
        Some(fit)
    }

    /// A fit of one mode more; `None` where there is none.
    pub fn with_one_more(&self, fit: &Fit) -> Option<Fit> {
        let mut start = fit.clone();
        start.modes.push(self.search(fit)?);
        Some(self.fit(&start, &[]))
    }

    /// Sum of the squares of all values.
    pub fn squares(&self) -> f64 {
        let squares = self.groups.iter().flat_map(|g| &g.signals.squares);
        squares.sum()
    }

    /// The mode that takes off most of what a fit leaves, by trying.
    pub fn search(&self, fit: &Fit) -> Option<Mode> {
        let columns = self.columns(fit);
        let residuals = self.residuals(&columns);
        // The frames that a signal lacks are 0 here: good enough for a first guess, and one set of
        // columns serves all.
        let present = Qr::new(columns);
        let gains = match self.start {
            Start::Rest => self.tried(fit).explained(&present, &residuals),
            // The moment is not fitted.
            Start::Moving => {
                let tried = self.tried.get_or_init(|| self.tried(fit));
                tried.explained(&present, &residuals)
            }
        };
        let mut best: Option<(f64, Mode)> = None;
        for (mode, gains) in self.modes_tried().into_iter().zip(gains.row_iter()) {
            let gain = gains.sum();
            if gain.is_finite() && gain > best.map_or(0.0, |(gain, _)| gain) {
                best = Some((gain, mode));
            }
        }
        best.map(|(_, mode)| mode)
    }

    fn modes_tried(&self) -> Vec<Mode> {
        mode_grid(self.frequencies_hz, SEARCHED_PER_E)
    }

    /// The columns of the modes that are tried, from the moment of a fit on.
    fn tried(&self, fit: &Fit) -> Candidates {
        let times = self.times_of(fit);
        let modes = self.modes_tried().into_iter();
        Candidates::new(modes.map(|m| m.columns(&times, self.start)), times.len())
    }

    /// What columns leave of every signal, a column for each; 0 where it was not seen.
    fn residuals(&self, columns: &[Vec<f64>]) -> DMatrix<f64> {
        let columns = slices(columns);
        let all = gram(&columns);
        let mut out = Vec::new();
        let mut signals = 0;
        for group in &self.groups {
            let factored = GramCholesky::new(&group.gram(&all, &columns), columns.len());
            let explained = Explained::new(&group.signals, &columns, &factored);
            for (signal, factors) in group.signals.each().zip(explained.factors_of_each()) {
                out.extend(group.rest(signal, &columns, factors));
                signals += 1;
            }
        }
        DMatrix::from_vec(self.times_s.len(), signals, out)
    }

    /// The factors of every mode in every signal, `[signal][mode]`, with their significance;
    /// `signals` is how many were given. Noise that is alike from frame to frame counts for less.
    pub fn factors(&self, fit: &Fit, signals: usize) -> Vec<Vec<Factor>> {
        let columns = self.columns(fit);
        let columns = slices(&columns);
        let all = gram(&columns);
        let mut out = vec![vec![Factor::default(); fit.modes.len()]; signals];
        for group in &self.groups {
            let factored = GramCholesky::new(&group.gram(&all, &columns), columns.len());
            let variances = factored.variances();
            let explained = Explained::new(&group.signals, &columns, &factored);
            let signals = group.signals.each().zip(explained.factors_of_each());
            for (id, (signal, factors)) in group.ids.iter().zip(signals) {
                let rest = group.rest(signal, &columns, factors);
                let free = group.seen.len().saturating_sub(factors.len()).max(1) as f64;
                let noise = dot(&rest, &rest) / free * variance_inflation(&rest);
                for (m, factor) in out[*id].iter_mut().enumerate() {
                    let own = self.columns_of(m);
                    *factor = Factor::new(&factors[own.clone()], &variances[own], noise);
                }
            }
        }
        out
    }
}

impl Group {
    /// Of the signals `ids` of `signals`.
    fn new(seen: Vec<usize>, ids: Vec<usize>, signals: &[Vec<f64>]) -> Self {
        let frames = signals.first().map_or(0, Vec::len);
        let lacking: Vec<usize> = (0..frames)
            .filter(|k| seen.binary_search(k).is_err())
            .collect();
        let mut values: Vec<Vec<f64>> = Vec::with_capacity(ids.len());
        for &id in &ids {
            let mut signal = signals[id].clone();
            lacking.iter().for_each(|&k| signal[k] = 0.0);
            values.push(signal);
        }
        Self {
            seen,
            lacking,
            ids,
            signals: SignalBlock::new(&slices(&values)),
        }
    }

    /// Products of columns over the frames in which the signals were seen, from those over `all`
    /// frames.
    pub fn gram(&self, all: &DMatrix<f64>, columns: &[&[f64]]) -> DMatrix<f64> {
        gram_without(all, columns, &self.lacking)
    }

    /// What `factors` of the columns leave of `y`; 0 where that was not seen.
    pub fn rest(&self, y: &[f64], columns: &[&[f64]], factors: &[f64]) -> Vec<f64> {
        let mut rest = y.to_vec();
        for (column, factor) in columns.iter().zip(factors) {
            subtract_scaled(&mut rest, *factor, column);
        }
        self.lacking.iter().for_each(|&k| rest[k] = 0.0);
        rest
    }
}

/// Variance inflation of values that are alike from frame to frame, (1 + r) / (1 - r) by their
/// correlation r.
fn variance_inflation(rest: &[f64]) -> f64 {
    let squares = dot(rest, rest);
    if squares <= 0.0 {
        return 1.0;
    }
    let pairs: f64 = rest.windows(2).map(|w| w[0] * w[1]).sum();
    let r = (pairs / squares).clamp(0.0, MAX_CORRELATION);
    (1.0 + r) / (1.0 - r)
}
