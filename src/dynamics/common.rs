//! What points have in common: the few motions that their signals are made of, and what gaps lack
//! filled in from them.

use super::columns::dot;
use super::members::Points;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Share of the signals that a frame must show.
const SEEN: f64 = 0.5;
/// Motions that gaps are filled in from at most, and times that it is done: what is filled in
/// changes them a little.
const MOST: usize = 4;
const ROUNDS: usize = 4;

/// Signals without gaps.
pub(super) struct Common {
    /// Two a point, px, from their means.
    pub signals: Vec<Vec<f64>>,
    /// Variance that noise has in every value, px².
    pub noise: f64,
}

/// Directions of motion in all signals at once, of length 1, and the variance along each, the
/// largest first.
pub(super) struct Principal {
    pub variances: Vec<f64>,
    pub ways: Vec<Vec<f64>>,
}

/// Whether enough of the points were seen in one of `frames`, which are neighbours.
pub(super) fn enough(points: &Points, frames: &[usize]) -> bool {
    let seen = points
        .signals
        .iter()
        .filter(|s| frames.iter().any(|&k| s[k].is_finite()))
        .count();
    seen as f64 >= SEEN * points.signals.len() as f64
}

impl Common {
    /// Of `points` in `frames`, each some neighbours taken together as their mean.
    pub fn of(points: &Points, frames: &[Vec<usize>]) -> Self {
        let mean = |s: &Vec<f64>, of: &Vec<usize>| {
            let seen = || of.iter().map(|&k| s[k]).filter(|x| x.is_finite());
            seen().sum::<f64>() / seen().count() as f64
        };
        let mut signals: Vec<Vec<f64>> = points
            .signals
            .iter()
            .map(|s| frames.iter().map(|of| mean(s, of)).collect())
            .collect();
        let values = points
            .signals
            .iter()
            .flatten()
            .filter(|x| x.is_finite())
            .count() as f64;
        let together =
            frames.iter().map(Vec::len).sum::<usize>() as f64 / frames.len().max(1) as f64;
        let noise = points.noise() / values.max(1.0) / together.max(1.0);
        let seen: Vec<Vec<f64>> = signals
            .iter()
            .map(|s| {
                s.iter()
                    .map(|x| f64::from(u8::from(x.is_finite())))
                    .collect()
            })
            .collect();
        let mut gaps: Vec<(usize, Vec<usize>)> = Vec::new();
        for k in 0..frames.len() {
            let lacking: Vec<usize> = (0..signals.len())
                .filter(|&i| !signals[i][k].is_finite())
                .collect();
            lacking.iter().for_each(|&i| signals[i][k] = 0.0);
            if !lacking.is_empty() {
                gaps.push((k, lacking));
            }
        }
        let most = MOST.min(signals.len() / 3);
        for round in 0..if gaps.is_empty() { 0 } else { ROUNDS } {
            let p = if round == 0 {
                principal_of_seen(&signals, &seen)
            } else {
                principal(&signals)
            };
            let used = p
                .variances
                .iter()
                .take(most)
                .filter(|v| **v > noise)
                .count();
            for (k, lacking) in &gaps {
                fill(&mut signals, *k, lacking, &p, used, noise);
            }
            for s in &mut signals {
                let mean = s.iter().sum::<f64>() / s.len() as f64;
                s.iter_mut().for_each(|x| *x -= mean);
            }
        }
        Self { signals, noise }
    }
}

/// The motion along a direction in all signals.
pub(super) fn along(signals: &[Vec<f64>], way: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; signals.first().map_or(0, Vec::len)];
    for (s, w) in signals.iter().zip(way) {
        out.iter_mut().zip(s).for_each(|(o, x)| *o += w * x);
    }
    out
}

/// In frame `k` from the first `used` motions, whose sizes there are those that the signals that
/// were seen tell best.
fn fill(
    signals: &mut [Vec<f64>],
    k: usize,
    lacking: &[usize],
    p: &Principal,
    used: usize,
    noise: f64,
) {
    let seen: Vec<usize> = (0..signals.len())
        .filter(|i| !lacking.contains(i))
        .collect();
    let product = |a: usize, b: usize| {
        seen.iter()
            .map(|&i| p.ways[a][i] * p.ways[b][i])
            .sum::<f64>()
    };
    let own = |a: usize| noise / p.variances[a];
    let normal = DMatrix::from_fn(used, used, |a, b| {
        product(a, b) + if a == b { own(a) } else { 0.0 }
    });
    let by = DVector::from_fn(used, |a, _| {
        seen.iter()
            .map(|&i| p.ways[a][i] * signals[i][k])
            .sum::<f64>()
    });
    let Some(sizes) = normal.cholesky().map(|c| c.solve(&by)) else {
        return;
    };
    for &i in lacking {
        signals[i][k] = (0..used).map(|a| p.ways[a][i] * sizes[a]).sum();
    }
}

/// Of `signals`; nothing of none.
pub(super) fn principal(signals: &[Vec<f64>]) -> Principal {
    let frames = signals.first().map_or(1, Vec::len).max(1) as f64;
    of_products(signals.len(), |a, b| dot(&signals[a], &signals[b]) / frames)
}

/// Of `signals` that are 0 where they were not `seen` (1 or 0): of each two by the frames that show
/// both.
fn principal_of_seen(signals: &[Vec<f64>], seen: &[Vec<f64>]) -> Principal {
    of_products(signals.len(), |a, b| {
        dot(&signals[a], &signals[b]) / dot(&seen[a], &seen[b]).max(1.0)
    })
}

fn of_products(n: usize, product: impl Fn(usize, usize) -> f64) -> Principal {
    if n == 0 {
        return Principal {
            variances: Vec::new(),
            ways: Vec::new(),
        };
    }
    let products = DMatrix::from_fn(n, n, |a, b| if a >= b { product(a, b) } else { 0.0 });
    let eigen = SymmetricEigen::new(DMatrix::from_fn(n, n, |a, b| {
        products[(a.max(b), a.min(b))]
    }));
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    Principal {
        variances: order
            .iter()
            .map(|&i| eigen.eigenvalues[i].max(0.0))
            .collect(),
        ways: order
            .iter()
            .map(|&i| eigen.eigenvectors.column(i).iter().copied().collect())
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point that is lost for a while moves there as its neighbours say, and not as if it stood
    /// still.
    #[test]
    fn a_gap_is_filled_by_what_the_others_do() {
        let sway = |k: usize| (0.21 * k as f64).sin();
        let noise = |k: usize, i: usize| 0.05 * ((k * 131 + i * 977) as f64).sin();
        let signal = |i: usize| {
            (0..300)
                .map(|k| (1.0 + i as f64) * sway(k) + noise(k, i))
                .collect::<Vec<f64>>()
        };
        let mut signals: Vec<Vec<f64>> = (0..8).map(signal).collect();
        (100..160).for_each(|k| (6..8).for_each(|i| signals[i][k] = f64::NAN));
        let points = Points {
            tracks: (0..4).collect(),
            signals,
        };
        let frames: Vec<Vec<usize>> = (0..300).map(|k| vec![k]).collect();
        assert!(enough(&points, &frames[120]));
        let filled = Common::of(&points, &frames).signals;
        for (i, filled) in filled.iter().enumerate().skip(6) {
            let off = (100..160)
                .map(|k| (filled[k] - (1.0 + i as f64) * sway(k)).powi(2))
                .sum::<f64>()
                / 60.0;
            assert!(off.sqrt() < 0.5, "signal {i} is off by {}", off.sqrt());
        }
    }
}
