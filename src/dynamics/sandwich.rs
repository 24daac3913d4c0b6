//! How sure a fit of decays is: the sandwich covariance of its parameters.

use super::fit::Prior;
use super::signals::{Fit, Signals};
use crate::signal::vectors::add_scaled;
use nalgebra::{DMatrix, DVector};

/// Standard deviations of the parameters of a fit: logarithms of every mode's frequency and
/// damping, then the moment of the release (s), if that was fitted; `None` if the data leave some
/// of them open.
///
/// They take in that what is left is alike in neighbouring frames and in all signals at once: the
/// sandwich of White (1980), once with the frames in clusters and once with the signals, the larger
/// of the two.
pub(super) fn deviations(signals: &Signals, fit: &Fit, priors: &[Prior]) -> Option<Vec<f64>> {
    let x = signals.parameters(fit);
    let p = x.len();
    let linear = signals.linearized(&x, priors);
    let inverse = linear.normal.hessian.try_inverse()?;
    let scores = signals.scores(fit);
    let mut slowest_hz = f64::INFINITY;
    for mode in &fit.modes {
        slowest_hz = slowest_hz.min(mode.frequency_hz);
    }
    let by_frame = newey_west(
        &frame_scores(&scores, signals.times_s.len(), p),
        &signals.times_s,
        0.5 / slowest_hz,
    );
    let noise = linear.rss / (signals.values as f64 - p as f64).max(1.0);
    let prior = prior_scores(signals, fit, priors, noise, p);
    let frames = &inverse * (by_frame + &prior) * &inverse;
    let channels = &inverse * (signal_scores(&scores, p) + &prior) * &inverse;
    let mut out = Vec::with_capacity(p);
    for k in 0..p {
        let clustered = frames[(k, k)].max(channels[(k, k)]);
        let plain = noise * inverse[(k, k)];
        out.push(clustered.max(plain).max(0.0).sqrt());
    }
    Some(out)
}

/// Sum over the signals, `[frame][parameter]`.
fn frame_scores(scores: &[Vec<Vec<f64>>], frames: usize, p: usize) -> Vec<Vec<f64>> {
    let mut out = vec![vec![0.0; p]; frames];
    for of_signal in scores {
        for (k, of_parameter) in of_signal.iter().enumerate() {
            for (row, score) in out.iter_mut().zip(of_parameter) {
                row[k] += score;
            }
        }
    }
    out
}

/// Sum of the products of the signals' own sums.
fn signal_scores(scores: &[Vec<Vec<f64>>], p: usize) -> DMatrix<f64> {
    let mut out = DMatrix::<f64>::zeros(p, p);
    for of_signal in scores {
        let sum = DVector::from_iterator(p, of_signal.iter().map(|s| s.iter().sum::<f64>()));
        out += &sum * sum.transpose();
    }
    let count = scores.len() as f64;
    if count > 1.0 {
        out *= count / (count - 1.0);
    }
    out
}

/// What the priors add, as if each were a value of its own.
fn prior_scores(
    signals: &Signals,
    fit: &Fit,
    priors: &[Prior],
    noise: f64,
    p: usize,
) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(p, p);
    for (m, prior) in priors.iter().enumerate() {
        let Some(known) = prior else { continue };
        for (i, sd) in known.ln_sd.parameters().into_iter().enumerate() {
            let k = 2 * m + i;
            out[(k, k)] = noise * noise / sd.powi(2).max(1e-12);
        }
    }
    if p > 2 * fit.modes.len() {
        out[(p - 1, p - 1)] = noise * noise / signals.moment_variance();
    }
    out
}

/// Sum of the products of scores that are up to `reach_s` apart, weighed down with their distance
/// (Newey and West 1987).
fn newey_west(scores: &[Vec<f64>], times_s: &[f64], reach_s: f64) -> DMatrix<f64> {
    let p = scores.first().map_or(0, Vec::len);
    let mut out = DMatrix::zeros(p, p);
    for (i, own) in scores.iter().enumerate() {
        // Those that come later, summed first: each pair counts both ways round.
        let mut later: Vec<f64> = own.iter().map(|s| 0.5 * s).collect();
        for (score, time_s) in scores.iter().zip(times_s).skip(i + 1) {
            let weight = 1.0 - (time_s - times_s[i]) / reach_s;
            if weight <= 0.0 {
                break;
            }
            add_scaled(&mut later, weight, score);
        }
        for a in 0..p {
            for b in 0..p {
                out[(a, b)] += own[a] * later[b] + later[a] * own[b];
            }
        }
    }
    out
}
