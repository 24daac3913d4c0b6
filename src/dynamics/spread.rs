//! How sure a fit of decays is.

use super::fit::Prior;
use super::signals::{Fit, Signals};
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
    let inverse = linear.hessian.try_inverse()?;
    let mut by_frame = vec![vec![0.0; p]; signals.times_s.len()];
    let (mut by_signal, mut count) = (DMatrix::<f64>::zeros(p, p), 0.0);
    for scores in signals.scores(fit) {
        let sum = DVector::from_iterator(p, scores.iter().map(|s| s.iter().sum::<f64>()));
        by_signal += &sum * sum.transpose();
        count += 1.0;
        for (k, of_parameter) in scores.iter().enumerate() {
            by_frame
                .iter_mut()
                .zip(of_parameter)
                .for_each(|(row, s)| row[k] += s);
        }
    }
    if count > 1.0 {
        by_signal *= count / (count - 1.0);
    }
    let slowest = fit
        .modes
        .iter()
        .map(|m| m.frequency_hz)
        .fold(f64::INFINITY, f64::min);
    let by_frame = newey_west(&by_frame, &signals.times_s, 0.5 / slowest);
    let noise = linear.rss / (signals.values as f64 - p as f64).max(1.0);
    let mut prior = DMatrix::zeros(p, p);
    for (m, at) in priors.iter().enumerate() {
        let Some((_, sd)) = at else { continue };
        (0..2).for_each(|i| {
            prior[(2 * m + i, 2 * m + i)] = noise * noise / (sd[i] * sd[i]).max(1e-12)
        });
    }
    if p > 2 * fit.modes.len() {
        prior[(p - 1, p - 1)] = noise * noise / signals.moment_sd_s.powi(2).max(1e-12);
    }
    let spread = |meat: DMatrix<f64>| &inverse * (meat + &prior) * &inverse;
    let (frames, channels) = (spread(by_frame), spread(by_signal));
    let sd = |k: usize| {
        frames[(k, k)]
            .max(channels[(k, k)])
            .max(noise * inverse[(k, k)])
            .max(0.0)
            .sqrt()
    };
    Some((0..p).map(sd).collect())
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
            later
                .iter_mut()
                .zip(score)
                .for_each(|(sum, s)| *sum += weight * s);
        }
        for a in 0..p {
            for b in 0..p {
                out[(a, b)] += own[a] * later[b] + later[a] * own[b];
            }
        }
    }
    out
}
