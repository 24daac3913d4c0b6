//! Spectra of angles, and the half-power damping: the reference method, and what is drawn.

use crate::bounds::Bounds;
use crate::signal::interpolation::linear;
use realfft::RealFftPlanner;

/// Fewer samples than this carry no answer.
const MIN_SAMPLES: usize = 32;

/// Amplitude spectrum of a signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Width of a bin, Hz; bin k stands for k times that.
    pub bin_hz: f64,
    /// Amplitude of the sine wave that would make such a bin, in the signal's unit.
    pub amplitude: Vec<f64>,
}

/// Amplitude spectrum by FFT of `values` at `times_s`, its mean taken off, drawn with four times as
/// many points as the film's length allows to tell apart. Values that are no numbers are left out.
/// For the eye and as a reference: the FFT needs even times, so that what is missing is drawn
/// straight between its neighbours. `None` for less than 32 values.
pub fn spectrum(times_s: &[f64], values: &[f64]) -> Option<Spectrum> {
    let (mut times, mut seen) = (Vec::new(), Vec::new());
    for (t, x) in times_s.iter().zip(values) {
        let is_later = times.last().is_none_or(|last| t > last);
        if t.is_finite() && x.is_finite() && is_later {
            times.push(*t);
            seen.push(*x);
        }
    }
    let n = times.len();
    if n < MIN_SAMPLES {
        return None;
    }
    let mut signal = even_grid(&times, &seen);
    let mean = signal.iter().sum::<f64>() / n as f64;
    signal
        .iter_mut()
        .for_each(|x| *x = 2.0 * (*x - mean) / n as f64);
    let padded = (4 * n).next_power_of_two();
    signal.resize(padded, 0.0);
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(padded);
    let mut out = fft.make_output_vec();
    fft.process(&mut signal, &mut out).ok()?;
    let bin_hz = (n - 1) as f64 / (times[n - 1] - times[0]) / padded as f64;
    Some(Spectrum {
        bin_hz,
        amplitude: out.iter().map(|c| c.norm()).collect(),
    })
}

/// What the largest peak of a spectrum says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfPower {
    pub peak_hz: f64,
    /// Width of the peak at 1/√2 of its amplitude over twice its frequency (Hu et al. eq. 6).
    pub damping_ratio: f64,
}

impl Spectrum {
    /// Of the largest peak within `frequencies_hz`. The width of a short film's bin comes on top of
    /// the tree's, so that it errs to the high side. `None` where there is no peak, or one that
    /// does not come down, or is so wide that nothing swings.
    pub fn half_power(&self, frequencies_hz: Bounds) -> Option<HalfPower> {
        let a = &self.amplitude;
        let last = ((frequencies_hz.hi / self.bin_hz) as usize).min(a.len().saturating_sub(2));
        let first = ((frequencies_hz.lo / self.bin_hz).ceil() as usize).max(1);
        let peak = (first..=last).max_by(|&i, &j| a[i].total_cmp(&a[j]))?;
        if a[peak] < a[peak - 1] || a[peak] < a[peak + 1] || a[peak] <= 0.0 {
            return None;
        }
        let level = a[peak] * std::f64::consts::FRAC_1_SQRT_2;
        let right = (peak + 1..a.len()).find(|&k| a[k] < level)?;
        let left = (0..peak).rev().find(|&k| a[k] < level)?;
        let right = (right - 1) as f64 + share_to(level, a[right - 1], a[right]);
        let left = (left + 1) as f64 - share_to(level, a[left + 1], a[left]);
        let damping_ratio = (right - left) / (2.0 * peak as f64);
        // A peak as wide as that is no oscillation's.
        (damping_ratio < 1.0).then_some(HalfPower {
            peak_hz: peak as f64 * self.bin_hz,
            damping_ratio,
        })
    }
}

/// How far `level` is on the way from one value to another.
fn share_to(level: f64, from: f64, to: f64) -> f64 {
    (from - level) / (from - to)
}

/// Linear interpolation at as many evenly spaced times.
fn even_grid(times_s: &[f64], values: &[f64]) -> Vec<f64> {
    let n = times_s.len();
    let step = (times_s[n - 1] - times_s[0]) / (n - 1) as f64;
    let even = (0..n).map(|k| times_s[0] + step * k as f64);
    even.map(|t| linear(times_s, values, t)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_power_tells_the_damping_of_a_long_decay() {
        for (hz, damping) in [(0.7, 0.05), (2.0, 0.03)] {
            let times: Vec<f64> = (0..1800).map(|k| f64::from(k) / 30.0).collect();
            let w = std::f64::consts::TAU * hz;
            let values: Vec<f64> = times
                .iter()
                .map(|t| 3.0 + (-damping * w * t).exp() * (w * t).cos())
                .collect();
            let found = spectrum(&times, &values)
                .unwrap()
                .half_power(Bounds::new(0.2, 5.0))
                .unwrap();
            assert!(
                (found.peak_hz / hz - 1.0).abs() < 0.01,
                "{found:?}, not {hz} Hz"
            );
            assert!(
                (found.damping_ratio / damping - 1.0).abs() < 0.15,
                "{found:?}, not {damping}"
            );
        }
        let flat = spectrum(&[0.0; 64], &[1.0; 64]);
        assert!(flat.is_none(), "times that stand still");
        let constant: Vec<f64> = (0..64).map(f64::from).collect();
        assert_eq!(
            spectrum(&constant, &[1.0; 64])
                .unwrap()
                .half_power(Bounds::new(0.05, 0.4)),
            None
        );
    }
}
