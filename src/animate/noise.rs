//! 1/f^beta noise that comes round to its beginning.

use super::fraction;
use crate::random::generator;
use rand::RngExt;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;

/// Values a second at least; between them the noise goes straight.
const RATE_HZ: f64 = 64.0;
/// What changes faster than this a branch hardly feels, and the table could not hold.
const FASTEST_HZ: f64 = 12.0;

/// Noise of mean 0 and variance 1 whose power falls as `1 / (corner^2 + f^2)^(beta / 2)`: flat
/// below the corner, 1/f^beta above (Hu et al. sect. 7).
#[derive(Clone, Debug)]
pub struct Noise {
    /// Many trees have many tables, and each is read all over: half the size is half the misses.
    values: Vec<f32>,
    per_s: f64,
}

impl Noise {
    /// Noise that repeats itself after `period_s` (above 0) without a seam.
    pub fn new(period_s: f64, beta: f64, corner_hz: f64, seed: u64) -> Self {
        let n = ((period_s * RATE_HZ).ceil() as usize).max(8);
        let mut random = generator(seed, 0);
        let mut planner = RealFftPlanner::<f64>::new();
        let inverse = planner.plan_fft_inverse(n);
        let mut spectrum: Vec<Complex<f64>> = inverse.make_input_vec();
        let mut power = 0.0;
        // The last entry of an even number of values has no phase.
        let last = (n - 1) / 2;
        for (k, entry) in spectrum.iter_mut().enumerate().take(last + 1).skip(1) {
            let frequency_hz = k as f64 / period_s;
            let phase = TAU * random.random::<f64>();
            if frequency_hz > FASTEST_HZ && k > 1 {
                break;
            }
            let amplitude =
                (corner_hz * corner_hz + frequency_hz * frequency_hz).powf(-0.25 * beta);
            *entry = Complex::from_polar(amplitude, phase);
            // A cosine of amplitude 2 a.
            power += 2.0 * amplitude * amplitude;
        }
        let mut values = inverse.make_output_vec();
        // Fails for lengths only, which come from the plan itself; still air then.
        if inverse.process(&mut spectrum, &mut values).is_err() {
            values.fill(0.0);
        }
        let scale = 1.0 / power.max(1e-300).sqrt();
        let values = values.into_iter().map(|v| (v * scale) as f32).collect();
        Self {
            values,
            per_s: n as f64 / period_s,
        }
    }

    /// The noise at a time, s; any time has one.
    pub fn at(&self, time_s: f64) -> f64 {
        let n = self.values.len();
        let turns = time_s * self.per_s / n as f64;
        let place = fraction(turns) * n as f64;
        let k = place as usize;
        let share = place - k as f64;
        let (a, b) = if k + 1 < n { (k, k + 1) } else { (n - 1, 0) };
        let (a, b) = (f64::from(self.values[a]), f64::from(self.values[b]));
        a + (b - a) * share
    }
}
