//! Signals of points without gaps: what is lacking is filled in from the few motions that all
//! points have in common.
//!
//! In wind any other way would add a motion that the oscillators had to explain. Where a mode is
//! only told to be of one point or another (modal/points.rs), straight lines are enough.

use super::film::Film;
use super::members::Points;
use crate::signal::principal::{PrincipalComponents, symmetric};
use crate::signal::vectors::dot;
use nalgebra::{DMatrix, DVector};

/// Share of the signals that a frame must show.
const MIN_SEEN_SHARE: f64 = 0.5;
/// Motions that gaps are filled in from at most, and times that it is done: what is filled in
/// changes them a little.
const MAX_MOTIONS: usize = 4;
const ROUNDS: usize = 4;

/// Signals without gaps.
pub(super) struct GapFree {
    /// Two a point, px, from their means.
    pub signals: Vec<Vec<f64>>,
    /// Variance that noise has in every value, px².
    pub noise: f64,
}

/// What one frame does not show.
struct Gap {
    frame: usize,
    /// Signals that are lacking there, and the others.
    lacking: Vec<usize>,
    seen: Vec<usize>,
}

/// The frames of `film` that show enough of each of these; `None` where there are not so many.
pub(super) fn frames_with(film: &Film, points: &[&Points], least: usize) -> Option<Vec<usize>> {
    let mut frames: Vec<usize> = (0..film.times_s.len()).collect();
    frames.retain(|&k| points.iter().all(|points| enough_seen(points, k)));
    (frames.len() >= least).then_some(frames)
}

/// Whether enough of the points were seen in a frame.
fn enough_seen(points: &Points, frame: usize) -> bool {
    let seen = points.signals.iter().filter(|s| s[frame].is_finite());
    seen.count() as f64 >= MIN_SEEN_SHARE * points.signals.len() as f64
}

impl GapFree {
    /// Of `points` in some frames.
    pub fn of(points: &Points, frames: &[usize]) -> Self {
        let mut signals: Vec<Vec<f64>> = Vec::with_capacity(points.signals.len());
        for signal in &points.signals {
            signals.push(frames.iter().map(|&k| signal[k]).collect());
        }
        let values = points.seen_values().count() as f64;
        let noise = points.noise() / values.max(1.0);
        let mut out = Self { signals, noise };
        out.fill_gaps();
        out
    }

    fn fill_gaps(&mut self) {
        let gaps = self.gaps();
        if gaps.is_empty() {
            return;
        }
        let mut motions = self.motions_of_seen();
        for gap in &gaps {
            for &i in &gap.lacking {
                self.signals[i][gap.frame] = 0.0;
            }
        }
        for round in 0..ROUNDS {
            if round > 0 {
                motions = PrincipalComponents::of_signals(&self.signals);
            }
            let most = MAX_MOTIONS.min(self.signals.len() / 3);
            let largest = motions.variances.iter().take(most);
            let used = largest.filter(|v| **v > self.noise).count();
            for gap in &gaps {
                self.fill(gap, &motions, used);
            }
            for signal in &mut self.signals {
                let mean = signal.iter().sum::<f64>() / signal.len() as f64;
                signal.iter_mut().for_each(|x| *x -= mean);
            }
        }
    }

    fn gaps(&self) -> Vec<Gap> {
        let mut out = Vec::new();
        for frame in 0..self.signals.first().map_or(0, Vec::len) {
            let (seen, lacking): (Vec<usize>, Vec<usize>) =
                (0..self.signals.len()).partition(|&i| self.signals[i][frame].is_finite());
            if !lacking.is_empty() {
                out.push(Gap {
                    frame,
                    lacking,
                    seen,
                });
            }
        }
        out
    }

    /// Of each two signals by the frames that show both.
    fn motions_of_seen(&self) -> PrincipalComponents {
        let (mut values, mut seen) = (self.signals.clone(), self.signals.clone());
        for (values, seen) in values.iter_mut().flatten().zip(seen.iter_mut().flatten()) {
            *seen = f64::from(u8::from(values.is_finite()));
            *values = if values.is_finite() { *values } else { 0.0 };
        }
        PrincipalComponents::of_products(symmetric(values.len(), |a, b| {
            dot(&values[a], &values[b]) / dot(&seen[a], &seen[b]).max(1.0)
        }))
    }

    /// From the first `used` motions, whose sizes are those that the signals that were seen tell
    /// best.
    fn fill(&mut self, gap: &Gap, motions: &PrincipalComponents, used: usize) {
        let mut normal = DMatrix::zeros(used, used);
        let mut products = DVector::zeros(used);
        for a in 0..used {
            let own = &motions.directions[a];
            for b in 0..used {
                let other = &motions.directions[b];
                normal[(a, b)] = gap.seen.iter().map(|&i| own[i] * other[i]).sum::<f64>();
            }
            normal[(a, a)] += self.noise / motions.variances[a];
            for &i in &gap.seen {
                products[a] += own[i] * self.signals[i][gap.frame];
            }
        }
        let Some(cholesky) = normal.cholesky() else {
            return;
        };
        let sizes = cholesky.solve(&products);
        for &i in &gap.lacking {
            self.signals[i][gap.frame] =
                (0..used).map(|a| motions.directions[a][i] * sizes[a]).sum();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;
    use rand::RngExt;

    fn arm(i: usize) -> f64 {
        1.0 + i as f64
    }

    fn sway(k: usize) -> f64 {
        (0.21 * k as f64).sin()
    }

    /// A point that is lost for a while moves there as its neighbours say, and not as if it stood
    /// still.
    #[test]
    fn a_gap_is_filled_by_what_the_others_do() {
        let mut random = generator(1, 0);
        let mut signals = vec![vec![0.0; 300]; 8];
        for (i, signal) in signals.iter_mut().enumerate() {
            for (k, value) in signal.iter_mut().enumerate() {
                *value = arm(i) * sway(k) + random.random_range(-0.06..0.06);
            }
        }
        (100..160).for_each(|k| (6..8).for_each(|i| signals[i][k] = f64::NAN));
        let points = Points {
            tracks: (0..4).collect(),
            signals,
        };
        let frames: Vec<usize> = (0..300).collect();
        assert!(enough_seen(&points, 120));
        let filled = GapFree::of(&points, &frames).signals;
        for (i, filled) in filled.iter().enumerate().skip(6) {
            let off = (100..160)
                .map(|k| (filled[k] - arm(i) * sway(k)).powi(2))
                .sum::<f64>()
                / 60.0;
            assert!(off.sqrt() < 0.5, "signal {i} is off by {}", off.sqrt());
        }
    }
}
