//! When a tree that was pulled is let go, and when it is at rest again: seen in what its points do
//! together.

use super::columns::{Qr, dot};
use super::film::Film;
use super::members::Points;
use nalgebra::{DMatrix, SymmetricEigen};

/// Motions that all points share, which are looked at: noise is spread over many more.
const SHARED: usize = 3;
/// Time over which speeds are taken, s.
const OVER_S: f64 = 0.12;
/// Speed, as a share of its peak, below which the tree is still at rest.
const AT_REST: f64 = 0.15;
/// A rest must have lasted so long to be believed, s.
const RESTED_S: f64 = 0.12;
/// The first moments of the motion, s, and the steps a frame in which its begin is looked for
/// there.
const FIRST_S: f64 = 0.3;
const STEPS: i32 = 10;
/// Time over which the energy is smoothed, s, and the share of its peak below which the tree is at
/// rest again.
const SMOOTH_S: f64 = 2.0;
const OVER: f64 = 0.004;
/// Least time of a decay that is looked at, s.
const LEAST_S: f64 = 6.0;

/// Begin and end of the greatest motion in a film.
#[derive(Clone, Copy, Debug)]
pub(super) struct Begin {
    /// Whether it is seen at rest before.
    pub rested: bool,
    /// When the motion begins, s.
    pub at_s: f64,
    /// First frame of the motion, and the one after its last.
    pub from: usize,
    pub to: usize,
}

/// Looks for the greatest motion of the points in a film.
pub(super) fn begin(film: &Film, points: &Points) -> Begin {
    let times = &film.times_s;
    let first_s = times.first().copied().unwrap_or(0.0);
    let nothing = Begin {
        rested: false,
        at_s: first_s,
        from: 0,
        to: times.len(),
    };
    let together = together(&points.signals, times.len());
    let over = ((OVER_S / film.step_s()).round() as usize).max(1);
    let energy: Vec<f64> = (0..times.len().saturating_sub(over))
        .map(|k| {
            let dt = times[k + over] - times[k];
            together
                .iter()
                .map(|s| ((s[k + over] - s[k]) / dt).powi(2))
                .sum()
        })
        .collect();
    let Some(top) = energy
        .iter()
        .copied()
        .max_by(f64::total_cmp)
        .filter(|t| *t > 0.0)
    else {
        return nothing;
    };
    let to = end(times, &energy, film.step_s());
    // The first great swing, and back to where it began.
    let Some(swing) = energy.iter().position(|e| *e >= 0.36 * top) else {
        return nothing;
    };
    let Some(still) = energy[..swing]
        .iter()
        .rposition(|e| *e < AT_REST * AT_REST * top)
    else {
        return Begin { to, ..nothing };
    };
    // Let go with the first frame, perhaps: the fit will tell.
    let at_once = still == 0;
    let rested = at_once
        || times[still] - first_s >= RESTED_S && {
            let before = times[..still]
                .iter()
                .rposition(|t| times[still] - t >= RESTED_S)
                .unwrap_or(0);
            energy[before..still]
                .iter()
                .all(|e| *e < AT_REST * AT_REST * top)
        };
    let near = if at_once {
        0
    } else {
        (still + over / 2).min(times.len() - 1)
    };
    let at_s = let_go(film, &together, near);
    let from = times.iter().position(|t| *t >= at_s).unwrap_or(near);
    Begin {
        rested,
        at_s,
        from,
        to: to.max(from),
    }
}

/// The moment at which the tree was let go, s: `near` is a frame near it. A body that is let go
/// from rest moves with the square of the time at first; the moment is the one from which square
/// and cube fit best.
fn let_go(film: &Film, together: &[Vec<f64>], near: usize) -> f64 {
    let times = &film.times_s;
    let step_s = film.step_s();
    let reach_s = FIRST_S.max(5.0 * step_s);
    let rows: Vec<usize> = (0..times.len())
        .filter(|&k| (times[k] - times[near]).abs() <= reach_s)
        .collect();
    let left = |at_s: f64| -> f64 {
        let power = |p: i32| {
            rows.iter()
                .map(|&k| (times[k] - at_s).max(0.0).powi(p))
                .collect()
        };
        let qr = Qr::new(vec![vec![1.0; rows.len()], power(2), power(3)]);
        let rest = |s: &Vec<f64>| {
            qr.solve(&rows.iter().map(|&k| s[k]).collect::<Vec<f64>>())
                .0
        };
        together.iter().map(rest).map(|r| dot(&r, &r)).sum()
    };
    let at = |k: i32| times[near] + f64::from(k) / f64::from(STEPS) * step_s;
    let tried = (-3 * STEPS..=3 * STEPS).map(|k| (left(at(k)), at(k)));
    tried
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(times[near], |(_, at_s)| at_s)
}

/// The frame after the last in which the smoothed energy is more than a small share of its peak.
fn end(times_s: &[f64], energy: &[f64], step_s: f64) -> usize {
    let half = (0.5 * SMOOTH_S / step_s).round() as usize;
    let smooth: Vec<f64> = (0..energy.len())
        .map(|k| {
            let near = &energy[k.saturating_sub(half)..(k + half + 1).min(energy.len())];
            near.iter().sum::<f64>() / near.len() as f64
        })
        .collect();
    let mut sorted = smooth.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    // What noise does is always there.
    let floor = sorted[sorted.len() / 20];
    let (peak, top) = smooth
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(b.1))
        .map_or((0, 0.0), |(k, e)| (k, *e));
    let last = smooth
        .iter()
        .rposition(|e| e - floor > OVER * (top - floor))
        .unwrap_or(0);
    let least = times_s
        .iter()
        .position(|t| *t > times_s[peak] + LEAST_S)
        .unwrap_or(times_s.len());
    (last + half).max(least).min(times_s.len())
}

/// What the signals do together: the leading principal components of those that were always seen,
/// or of all.
fn together(signals: &[Vec<f64>], frames: usize) -> Vec<Vec<f64>> {
    let whole: Vec<&Vec<f64>> = signals
        .iter()
        .filter(|s| s.iter().all(|x| x.is_finite()))
        .collect();
    let used: Vec<&Vec<f64>> = if whole.len() >= 8 {
        whole
    } else {
        signals.iter().collect()
    };
    let at = |s: &Vec<f64>, k: usize| if s[k].is_finite() { s[k] } else { 0.0 };
    let n = used.len();
    let product = |i: usize, j: usize| {
        (0..frames)
            .map(|k| at(used[i], k) * at(used[j], k))
            .sum::<f64>()
    };
    let eigen = SymmetricEigen::new(DMatrix::from_fn(n, n, product));
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let component = |c: &usize| {
        let weights = eigen.eigenvectors.column(*c);
        (0..frames)
            .map(|k| weights.iter().zip(&used).map(|(w, s)| w * at(s, k)).sum())
            .collect()
    };
    order.iter().take(SHARED).map(component).collect()
}
