//! Where a signal has more power than is expected of it.

use super::decay::powers;
use super::process::Part;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Half the width of the bands that are compared, as a share of their frequency: that of usual
/// sways.
const BAND: f64 = 0.04;

/// Power of a signal at frequencies that are one over the film's length apart.
pub(super) struct Periodogram {
    step_hz: f64,
    first: usize,
    power: Vec<f64>,
    /// Power per Hz of noise of variance 1 in every value.
    of_noise: f64,
}

impl Periodogram {
    /// Of `signal` at growing `times_s` within `frequencies_hz`.
    pub fn new(times_s: &[f64], signal: &[f64], [lowest_hz, highest_hz]: [f64; 2]) -> Self {
        let first_s = times_s.first().copied().unwrap_or(0.0);
        let span_s = times_s.last().map_or(1.0, |t| t - first_s).max(1e-9);
        // Hann's window, or strong sways leak into others' bands.
        let window: Vec<f64> = times_s
            .iter()
            .map(|t| (PI * (t - first_s) / span_s).sin().powi(2))
            .collect();
        let squares = window.iter().map(|w| w * w).sum::<f64>().max(1e-9);
        let of_noise = span_s / times_s.len().max(1) as f64;
        let step_hz = 1.0 / span_s;
        let (first, last) = (
            (lowest_hz / step_hz).ceil() as usize,
            (highest_hz / step_hz).floor() as usize,
        );
        let power = |k: usize| {
            let waves = powers(times_s, Complex::new(0.0, TAU * step_hz * k as f64));
            let sum: Complex<f64> = waves
                .iter()
                .zip(signal.iter().zip(&window))
                .map(|(z, (x, w))| z * (x * w))
                .sum();
            sum.norm_sqr() / squares * of_noise
        };
        Self {
            step_hz,
            first,
            power: (first..=last.max(first)).map(power).collect(),
            of_noise,
        }
    }
}

/// The frequency about which signals most likely have more power than a sum of parts and noise of
/// some variance, which are given with each; `None` if there is none. By Whittle's likelihood, with
/// each band's power as it is rather than as is expected.
pub(super) fn excess_hz(signals: &[(Periodogram, Vec<Part>, f64)]) -> Option<f64> {
    let (first, _, _) = signals.first()?;
    let ratios: Vec<Vec<f64>> = signals
        .iter()
        .map(|(p, parts, noise)| {
            let expected =
                |hz: f64| noise * p.of_noise + parts.iter().map(|part| part.power(hz)).sum::<f64>();
            let of =
                |(k, x): (usize, &f64)| x / expected((p.first + k) as f64 * p.step_hz).max(1e-300);
            p.power.iter().enumerate().map(of).collect()
        })
        .collect();
    let gain = |k: usize| -> f64 {
        let half = ((BAND * (first.first + k) as f64).round() as usize).max(1);
        let of = |r: &Vec<f64>| {
            let band = &r[k.saturating_sub(half)..(k + half + 1).min(r.len())];
            let mean = band.iter().sum::<f64>() / band.len() as f64;
            if mean > 1.0 {
                band.len() as f64 * (mean - 1.0 - mean.ln())
            } else {
                0.0
            }
        };
        ratios.iter().map(of).sum()
    };
    let gains = (0..first.power.len()).map(|k| (k, gain(k)));
    let (k, _) = gains
        .filter(|(_, g)| g.is_finite() && *g > 0.0)
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((first.first + k) as f64 * first.step_hz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    /// The large sway of the carrier, which is expected, does not hide the small one of the branch.
    #[test]
    fn a_small_sway_beside_a_large_one_that_is_known_is_found() {
        let times: Vec<f64> = (0..900)
            .map(|k| 0.066 * f64::from(k) + 0.01 * (f64::from(k) * 1.7).sin())
            .collect();
        let mut random = crate::random::generator(7, 0);
        let wave = |hz: f64, t: f64| (TAU * hz * t).sin();
        let signal: Vec<f64> = times
            .iter()
            .map(|t| 10.0 * wave(0.5, *t) + wave(0.9, *t) + random.random_range(-0.5..0.5))
            .collect();
        let known = Part::Oscillator {
            variance: 50.0,
            frequency_hz: 0.5,
            damping: 0.03,
            gusts_per_s: 10.0,
        };
        let found = |parts: Vec<Part>| {
            let power = Periodogram::new(&times, &signal, [0.05, 3.0]);
            excess_hz(&[(power, parts, 1.0 / 12.0)]).unwrap()
        };
        assert!((found(Vec::new()) - 0.5).abs() < 0.03);
        assert!(
            (found(vec![known]) - 0.9).abs() < 0.05,
            "{}",
            found(vec![known])
        );
    }
}
