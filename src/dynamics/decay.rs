//! Free decay: the modes of a tree and how they look in time.

use nalgebra::Complex;
use std::f64::consts::TAU;

/// Damping ratio that is usual of branches, and the standard deviation of its logarithm: some
/// hundredths of the critical damping. A weak prior where the film is too short to tell.
pub(super) const USUAL_DAMPING: f64 = 0.05;
const LN_DAMPING_SD: f64 = 0.7;
/// What a step between two frames may be off the one before, times the rate of a mode, for a short
/// series to tell it.
const MAX_SERIES_ARGUMENT: f64 = 0.05;
/// Chains of products that a processor works on at once.
const CHAINS: usize = 4;

/// One mode: undamped frequency in Hz and damping ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    pub frequency_hz: f64,
    pub damping: f64,
}

/// How the decay begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Released from rest at time 0: the phase of every mode is known, which tells modes apart that
    /// are close together.
    Rest,
    /// In the middle of the motion: any phase.
    Moving,
}

/// How one column of a mode changes with its parameters.
pub(super) struct Slopes {
    /// With the logarithms of frequency and damping.
    pub by_mode: [Vec<f64>; 2],
    /// With the moment at which times begin, s.
    pub by_moment: Vec<f64>,
}

impl Mode {
    /// λ of exp(λ t).
    fn pole(&self) -> Complex<f64> {
        let (omega, zeta) = (TAU * self.frequency_hz, self.damping);
        Complex::new(-zeta * omega, omega * (1.0 - zeta * zeta).sqrt())
    }

    /// Complex factors of exp(λ t) whose real parts are the columns: of one from rest, or of cosine
    /// and sine; each with its derivative by the logarithm of the damping.
    fn weights(&self, start: Start) -> Vec<[Complex<f64>; 2]> {
        let root = (1.0 - self.damping * self.damping).sqrt();
        let i = Complex::i();
        match start {
            Start::Rest => vec![[
                1.0 - i * (self.damping / root),
                -i * (self.damping / root.powi(3)),
            ]],
            Start::Moving => vec![
                [Complex::from(1.0), Complex::from(0.0)],
                [-i, Complex::from(0.0)],
            ],
        }
    }

    /// The mode's columns at `times_s`: one if it starts from rest, cosine and sine otherwise.
    pub(super) fn columns(&self, times_s: &[f64], start: Start) -> Vec<Vec<f64>> {
        let waves = powers(times_s, self.pole());
        self.weights(start)
            .iter()
            .map(|[a, _]| waves.iter().map(|z| (a * z).re).collect())
            .collect()
    }

    /// The columns, and how each changes with the parameters.
    pub(super) fn columns_and_slopes(
        &self,
        times_s: &[f64],
        start: Start,
    ) -> Vec<(Vec<f64>, Slopes)> {
        let pole = self.pole();
        let waves = powers(times_s, pole);
        let root = (1.0 - self.damping * self.damping).sqrt();
        let omega = TAU * self.frequency_hz;
        let by_damping = -self.damping * omega * Complex::new(1.0, self.damping / root);
        let mut out = Vec::new();
        for [weight, slope] in self.weights(start) {
            let (faster, damped, later) = (weight * pole, weight * by_damping, -weight * pole);
            let n = times_s.len();
            let mut column = Vec::with_capacity(n);
            let mut slopes = Slopes {
                by_mode: [Vec::with_capacity(n), Vec::with_capacity(n)],
                by_moment: Vec::with_capacity(n),
            };
            for (t, z) in times_s.iter().zip(&waves) {
                column.push((weight * z).re);
                slopes.by_mode[0].push((faster * z * t).re);
                slopes.by_mode[1].push(((slope + damped * t) * z).re);
                slopes.by_moment.push((later * z).re);
            }
            out.push((column, slopes));
        }
        out
    }

    /// Whether the frequencies of two modes are no farther apart than this share.
    pub(super) fn has_frequency_of(&self, other: &Mode, tolerance: f64) -> bool {
        self.ln_frequency_ratio(other).abs() < tolerance
    }

    /// Logarithm of this frequency over another one's.
    pub(super) fn ln_frequency_ratio(&self, other: &Mode) -> f64 {
        (self.frequency_hz / other.frequency_hz).ln()
    }

    pub(super) fn parameters(&self) -> [f64; 2] {
        [self.frequency_hz.ln(), self.damping.ln()]
    }

    pub(super) fn of_parameters(x: &[f64]) -> Self {
        Self {
            frequency_hz: x[0].exp(),
            damping: x[1].exp(),
        }
    }
}

/// What the prior on the damping adds to minus twice a logarithm of likelihood.
pub(super) fn damping_penalty(ln_damping: f64) -> f64 {
    ((ln_damping - USUAL_DAMPING.ln()) / LN_DAMPING_SD).powi(2)
}

/// Weight of that prior in normal equations: one over the variance.
pub(super) const LN_DAMPING_WEIGHT: f64 = 1.0 / (LN_DAMPING_SD * LN_DAMPING_SD);

/// exp(λ t) at growing times: each value is the one before times a factor, in chains that do not wait
/// for each other, as the factors are most of the work of a fit.
pub(super) fn powers(times_s: &[f64], pole: Complex<f64>) -> Vec<Complex<f64>> {
    let mut out = Vec::with_capacity(times_s.len());
    out.push(Complex::from(1.0));
    each_step(times_s, pole, |factor| out.push(factor));
    out.truncate(times_s.len());
    let of_chain = times_s.len().div_ceil(CHAINS).max(1);
    for first in (0..out.len()).step_by(of_chain) {
        out[first] = (pole * times_s[first]).exp();
    }
    for after in 1..of_chain {
        for k in (after..out.len()).step_by(of_chain) {
            let before = out[k - 1];
            out[k] *= before;
        }
    }
    out
}

/// exp(λ dt) for the time from each frame to the next. The frames of a camera are nearly evenly
/// apart, so that a factor serves for many, with a short series for the little that a step is off.
pub(super) fn each_step(times_s: &[f64], pole: Complex<f64>, mut take: impl FnMut(Complex<f64>)) {
    let (mut step_s, mut factor) = (0.0, Complex::from(1.0));
    for pair in times_s.windows(2) {
        let dt = pair[1] - pair[0];
        let off = pole * (dt - step_s);
        if off.norm_sqr() <= MAX_SERIES_ARGUMENT * MAX_SERIES_ARGUMENT {
            take(factor * short_exp(off));
        } else {
            (step_s, factor) = (dt, (pole * dt).exp());
            take(factor);
        }
    }
}

/// exp of a small number, to 1e-12.
fn short_exp(x: Complex<f64>) -> Complex<f64> {
    let square = x * x;
    let start = square * 0.5 + x + 1.0;
    // The clock of a camera is off by microseconds as a rule.
    if x.norm_sqr() < 1e-8 {
        return start;
    }
    start
        + square
            * x
            * (square * (1.0 / 120.0) + x * (1.0 / 24.0) + 1.0 / 6.0 + square * x * (1.0 / 720.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera's uneven times, with a gap.
    fn times() -> Vec<f64> {
        (0..300)
            .map(|k| {
                k as f64 / 30.0 - 0.01
                    + 0.003 * (k as f64 * 1.7).sin()
                    + if k > 200 { 0.4 } else { 0.0 }
            })
            .collect()
    }

    #[test]
    fn columns_are_those_of_the_definition() {
        for (frequency_hz, damping) in [(0.5, 0.02), (4.7, 0.3)] {
            let mode = Mode {
                frequency_hz,
                damping,
            };
            let (omega, root) = (TAU * frequency_hz, (1.0 - damping * damping).sqrt());
            let rest = mode.columns(&times(), Start::Rest);
            let moving = mode.columns(&times(), Start::Moving);
            for (k, t) in times().into_iter().enumerate() {
                let fade = (-damping * omega * t).exp();
                let (sin, cos) = (omega * root * t).sin_cos();
                for (found, wanted) in [
                    (moving[0][k], cos),
                    (moving[1][k], sin),
                    (rest[0][k], cos + damping / root * sin),
                ] {
                    assert!(
                        (found - fade * wanted).abs() < 1e-10,
                        "{found}, not {}",
                        fade * wanted
                    );
                }
            }
        }
    }

    /// With other logarithms of frequency and damping.
    fn moved(mode: &Mode, by_ln_frequency: f64, by_ln_damping: f64) -> Mode {
        let x = mode.parameters();
        Mode::of_parameters(&[x[0] + by_ln_frequency, x[1] + by_ln_damping])
    }

    fn earlier(by_s: f64) -> Vec<f64> {
        times().iter().map(|t| t - by_s).collect()
    }

    #[test]
    fn slopes_are_those_of_the_columns() {
        let mode = Mode {
            frequency_hz: 0.8,
            damping: 0.06,
        };
        let step = 1e-5;
        for start in [Start::Rest, Start::Moving] {
            for (c, (column, slopes)) in mode
                .columns_and_slopes(&times(), start)
                .into_iter()
                .enumerate()
            {
                assert_eq!(column, mode.columns(&times(), start)[c]);
                let pairs = [
                    (
                        &slopes.by_mode[0],
                        moved(&mode, step, 0.0).columns(&times(), start),
                        moved(&mode, -step, 0.0).columns(&times(), start),
                    ),
                    (
                        &slopes.by_mode[1],
                        moved(&mode, 0.0, step).columns(&times(), start),
                        moved(&mode, 0.0, -step).columns(&times(), start),
                    ),
                    (
                        &slopes.by_moment,
                        mode.columns(&earlier(step), start),
                        mode.columns(&earlier(-step), start),
                    ),
                ];
                for (slope, up, down) in pairs {
                    for (k, s) in slope.iter().enumerate() {
                        let wanted = (up[c][k] - down[c][k]) / (2.0 * step);
                        assert!(
                            (s - wanted).abs() < 1e-5 * (1.0 + wanted.abs()),
                            "{s}, not {wanted}"
                        );
                    }
                }
            }
        }
    }
}
