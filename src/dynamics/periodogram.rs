//! Power of a signal by frequency.

use super::decay::powers;
use crate::bounds::Bounds;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Power of a signal at frequencies that are one over the film's length apart.
pub(super) struct Periodogram {
    first: usize,
    power: Vec<f64>,
}

impl Periodogram {
    /// Of `signal` at growing `times_s`, in a part of a film whose first and last frames may be
    /// missing, within `frequencies_hz`.
    pub fn of(part_s: Bounds, times_s: &[f64], signal: &[f64], frequencies_hz: Bounds) -> Self {
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
        Self { first, power }
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
