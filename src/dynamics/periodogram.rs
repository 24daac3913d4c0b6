//! Where a signal has more power than is expected of it.

use super::celerite::Part;
use super::decay::powers;
use crate::bounds::Bounds;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Half the width of the bands that are compared, as a share of their frequency: that of usual
/// sways.
const HALF_BAND: f64 = 0.04;

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
    pub fn new(times_s: &[f64], signal: &[f64], frequencies_hz: Bounds) -> Self {
        let first_s = times_s.first().copied().unwrap_or(0.0);
        let last_s = times_s.last().copied().unwrap_or(1.0);
        Self::within(
            Bounds::new(first_s, last_s),
            times_s,
            signal,
            frequencies_hz,
        )
    }

    /// The same of a part of a film, whose first and last frames may be missing.
    pub fn within(part_s: Bounds, times_s: &[f64], signal: &[f64], frequencies_hz: Bounds) -> Self {
        let span_s = part_s.length().max(1e-9);
        // Hann's window, or strong sways leak into others' bands.
        let window: Vec<f64> = times_s
            .iter()
            .map(|t| (PI * (t - part_s.lo) / span_s).sin().powi(2))
            .collect();
        let squares = window.iter().map(|w| w * w).sum::<f64>().max(1e-9);
        let of_noise = span_s / times_s.len().max(1) as f64;
        let step_hz = 1.0 / span_s;
        let (first, last) = (
            (frequencies_hz.lo / step_hz).ceil() as usize,
            (frequencies_hz.hi / step_hz).floor() as usize,
        );
        let mut power = Vec::new();
        for k in first..=last.max(first) {
            let waves = powers(times_s, Complex::new(0.0, TAU * step_hz * k as f64));
            let mut sum = Complex::from(0.0);
            for ((z, x), w) in waves.iter().zip(signal).zip(&window) {
                sum += z * (x * w);
            }
            power.push(sum.norm_sqr() / squares * of_noise);
        }
        Self {
            step_hz,
            first,
            power,
            of_noise,
        }
    }

    /// The power at every frequency.
    pub fn power(&self) -> &[f64] {
        &self.power
    }

    /// Which multiple of one over the film's length the first of them is.
    pub fn first_multiple(&self) -> usize {
        self.first
    }
}

/// The power of a signal, and what is expected of it: a sum of parts, and noise of this variance in
/// every value.
pub(super) struct Observed {
    pub power: Periodogram,
    pub expected: Vec<Part>,
    pub noise: f64,
}

impl Observed {
    /// Power at every frequency over what is expected there.
    fn ratios(&self) -> Vec<f64> {
        let of = &self.power;
        let mut out = Vec::with_capacity(of.power.len());
        for (k, power) in of.power.iter().enumerate() {
            let hz = (of.first + k) as f64 * of.step_hz;
            let parts: f64 = self.expected.iter().map(|part| part.power(hz)).sum();
            out.push(power / (self.noise * of.of_noise + parts).max(1e-300));
        }
        out
    }
}

/// The frequency about which signals most likely have more power than is expected; `None` if there
/// is none. By Whittle's likelihood, with each band's power as it is rather than as is expected.
pub(super) fn excess_hz(signals: &[Observed]) -> Option<f64> {
    let power = &signals.first()?.power;
    let ratios: Vec<Vec<f64>> = signals.iter().map(Observed::ratios).collect();
    let mut best: Option<(f64, usize)> = None;
    for k in 0..power.power.len() {
        let half = ((HALF_BAND * (power.first + k) as f64).round() as usize).max(1);
        let gain: f64 = ratios.iter().map(|r| gain_of_band(r, k, half)).sum();
        if gain.is_finite() && gain > 0.0 && best.is_none_or(|(most, _)| gain >= most) {
            best = Some((gain, k));
        }
    }
    best.map(|(_, k)| (power.first + k) as f64 * power.step_hz)
}

/// Gain of likelihood by the mean of a band about `k` as it is.
fn gain_of_band(ratios: &[f64], k: usize, half: usize) -> f64 {
    let band = &ratios[k.saturating_sub(half)..(k + half + 1).min(ratios.len())];
    let mean = band.iter().sum::<f64>() / band.len() as f64;
    if mean > 1.0 {
        band.len() as f64 * (mean - 1.0 - mean.ln())
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    fn wave(hz: f64, t: f64) -> f64 {
        (TAU * hz * t).sin()
    }

    /// The large sway of the carrier, which is expected, does not hide the small one of the branch.
    #[test]
    fn a_small_sway_beside_a_large_one_that_is_known_is_found() {
        let times: Vec<f64> = (0..900)
            .map(|k| 0.066 * f64::from(k) + 0.01 * (f64::from(k) * 1.7).sin())
            .collect();
        let mut random = crate::random::generator(7, 0);
        let mut signal = Vec::with_capacity(times.len());
        for t in &times {
            signal.push(10.0 * wave(0.5, *t) + wave(0.9, *t) + random.random_range(-0.5..0.5));
        }
        let known = Part::Oscillator {
            variance: 50.0,
            frequency_hz: 0.5,
            damping: 0.03,
            gusts_per_s: 10.0,
        };
        for (expected, wanted_hz, tolerance) in [(Vec::new(), 0.5, 0.03), (vec![known], 0.9, 0.05)]
        {
            let observed = Observed {
                power: Periodogram::new(&times, &signal, Bounds::new(0.05, 3.0)),
                expected,
                noise: 1.0 / 12.0,
            };
            let found = excess_hz(&[observed]).unwrap();
            assert!(
                (found - wanted_hz).abs() < tolerance,
                "{found}, not {wanted_hz}"
            );
        }
    }
}
