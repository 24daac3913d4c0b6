//! Running figures: rates, percentiles, short histories. All of bounded memory.

use std::collections::VecDeque;

/// Values with their times over the last so many seconds.
pub struct Recent {
    window_s: f64,
    values: VecDeque<(f64, f64)>,
}

impl Recent {
    pub fn new(window_s: f64) -> Self {
        Self { window_s, values: VecDeque::new() }
    }

    pub fn push(&mut self, time_s: f64, value: f64) {
        self.values.push_back((time_s, value));
        while self.values.front().is_some_and(|(t, _)| *t < time_s - self.window_s) {
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
            (Some((a, _)), Some((b, _))) if b > a => self.values.iter().map(|v| v.1).sum::<f64>() / (b - a),
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

    /// The values, oldest first.
    pub fn values(&self) -> Vec<f64> {
        self.values.iter().map(|v| v.1).collect()
    }
}
