//! Free decay: the modes of a tree and how they look in time.

use nalgebra::Complex;
use std::f64::consts::TAU;

/// What a step between two frames may be off the one before, times the rate of a mode, for a short
/// series to tell it.
const ALIKE: f64 = 0.05;

/// One mode: undamped frequency in Hz and damping ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    pub frequency_hz: f64,
    pub damping: f64,
}

/// How the decay begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Let go from rest at time 0: the phase of every mode is known, which tells modes apart that
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
        let of = |f: &dyn Fn(f64, Complex<f64>) -> Complex<f64>| -> Vec<f64> {
            times_s
                .iter()
                .zip(&waves)
                .map(|(t, z)| f(*t, *z).re)
                .collect()
        };
        let column = |[a, slope]: &[Complex<f64>; 2]| {
            let (faster, damped, later) = (a * pole, a * by_damping, -a * pole);
            let by_mode = [
                of(&|t, z| faster * z * t),
                of(&|t, z| (slope + damped * t) * z),
            ];
            (
                of(&|_, z| a * z),
                Slopes {
                    by_mode,
                    by_moment: of(&|_, z| later * z),
                },
            )
        };
        self.weights(start).iter().map(column).collect()
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

/// exp(λ t) at growing times: each value is the one before times a factor, which is most of the
/// work of a fit.
pub(super) fn powers(times_s: &[f64], pole: Complex<f64>) -> Vec<Complex<f64>> {
    let Some(first) = times_s.first() else {
        return Vec::new();
    };
    let mut value = (pole * *first).exp();
    let mut out = vec![value];
    each_step(times_s, pole, |factor| {
        value *= factor;
        out.push(value);
    });
    out
}

/// exp(λ dt) for the time from each frame to the next. The frames of a camera are nearly evenly
/// apart, so that a factor serves for many, with a short series for the little that a step is off.
pub(super) fn each_step(times_s: &[f64], pole: Complex<f64>, mut take: impl FnMut(Complex<f64>)) {
    let (mut step_s, mut factor) = (0.0, Complex::from(1.0));
    for pair in times_s.windows(2) {
        let dt = pair[1] - pair[0];
        let off = pole * (dt - step_s);
        if off.norm_sqr() <= ALIKE * ALIKE {
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
                let moved = |by: [f64; 2]| {
                    let x = mode.parameters();
                    Mode::of_parameters(&[x[0] + by[0], x[1] + by[1]])
                        .columns(&times(), start)
                        .swap_remove(c)
                };
                let shifted = |by: f64| {
                    let later: Vec<f64> = times().iter().map(|t| t - by).collect();
                    mode.columns(&later, start).swap_remove(c)
                };
                let pairs = [
                    (&slopes.by_mode[0], moved([step, 0.0]), moved([-step, 0.0])),
                    (&slopes.by_mode[1], moved([0.0, step]), moved([0.0, -step])),
                    (&slopes.by_moment, shifted(step), shifted(-step)),
                ];
                for (slope, up, down) in pairs {
                    for (k, s) in slope.iter().enumerate() {
                        let wanted = (up[k] - down[k]) / (2.0 * step);
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
