//! Running figures: rates, percentiles, short histories. All of bounded memory.

use std::collections::VecDeque;

/// Values with their times over the last so many seconds.
pub struct Recent {
    window_s: f64,
    values: VecDeque<(f64, f64)>,
}

impl Recent {
    pub fn new(window_s: f64) -> Self {
        Self {
            window_s,
            values: VecDeque::new(),
        }
    }

    pub fn push(&mut self, time_s: f64, value: f64) {
        self.values.push_back((time_s, value));
        while self
            .values
            .front()
            .is_some_and(|(t, _)| *t < time_s - self.window_s)
        {
            self.values.pop_front();
        }
    }

    /// Entries a second.
    pub fn rate_hz(&self) -> f64 {
        match (self.values.front(), self.values.back()) {
            (Some((a, _)), Some((b, _))) if b > a => (self.values.len() - 1) as f64 / (b - a),
            _ => 0.0,
        }
    }

    /// Sum of the values a second.
    pub fn sum_per_s(&self) -> f64 {
        match (self.values.front(), self.values.back()) {
            (Some((a, _)), Some((b, _))) if b > a => {
                self.values.iter().map(|v| v.1).sum::<f64>() / (b - a)
            }
            _ => 0.0,
        }
    }

    /// The value below which `share` of the values lie; 0 if there are none.
    pub fn percentile(&self, share: f64) -> f64 {
        let mut sorted: Vec<f64> = self.values.iter().map(|v| v.1).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = (share * (sorted.len().saturating_sub(1)) as f64).round() as usize;
        sorted.get(at).copied().unwrap_or(0.0)
    }
}

/// Width of a bin of a [`Histogram`], px, and number of bins; larger values count into the last.
const BIN_PX: f64 = 0.005;
const BINS: usize = 4000;

/// Distances counted in bins, for a median over a capture of any length.
#[derive(Clone, Debug, Default)]
pub struct Histogram {
    bins: Vec<u64>,
    count: u64,
}

impl Histogram {
    pub fn add(&mut self, px: f64) {
        self.bins.resize(BINS, 0);
        self.bins[((px / BIN_PX) as usize).min(BINS - 1)] += 1;
        self.count += 1;
    }

    /// Middle of the bin that holds the median, px; `None` if nothing was counted.
    pub fn median(&self) -> Option<f64> {
        let mut below = 0;
        let holds = |n: &u64| {
            below += n;
            2 * below >= self.count
        };
        let bin = self.bins.iter().position(holds)?;
        (self.count > 0).then_some((bin as f64 + 0.5) * BIN_PX)
    }
}
