//! The sway of one branch about one axis, solved exactly (Hu et al. eq. 7).

use nalgebra::Matrix2;

/// Where an oscillator is, in the unit of what drives it, and its speed per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Oscillation {
    pub x: f64,
    pub v: f64,
}

/// One step of `x'' + 4 pi xi f x' + 4 pi^2 f^2 x = F(t) / m` (Hu et al. eq. 7).
///
/// The force is given as the place `u = F / (4 pi^2 f^2 m)` at which it would hold the branch
/// still, and goes evenly from one value to the next. For such a force the step is the solution
/// itself, not an approximation as explicit Euler is: nothing is gained or lost however long the
/// step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    step_s: f64,
    /// `2 xi / omega`: by so much, times its slope, the branch lags behind an even force.
    lag_s: f64,
    /// The free motion over the step.
    free: Matrix2<f64>,
}

impl Transition {
    /// For a branch of undamped natural frequency f (Hz, above 0) and damping ratio xi (0 and
    /// above).
    pub fn new(frequency_hz: f64, damping_ratio: f64, step_s: f64) -> Self {
        let omega = std::f64::consts::TAU * frequency_hz;
        let (decay, rest) = (damping_ratio * omega, 1.0 - damping_ratio * damping_ratio);
        // Both times exp(-decay t): alone, cosh would overflow where the damping is strong.
        let (cos, sin_by_rate) = if rest > 1e-12 {
            let (rate, fade) = (omega * rest.sqrt(), (-decay * step_s).exp());
            (
                fade * (rate * step_s).cos(),
                fade * (rate * step_s).sin() / rate,
            )
        } else if rest < -1e-12 {
            let rate = omega * (-rest).sqrt();
            let (slow, fast) = (
                ((rate - decay) * step_s).exp(),
                ((-rate - decay) * step_s).exp(),
            );
            (0.5 * (slow + fast), 0.5 * (slow - fast) / rate)
        } else {
            let fade = (-decay * step_s).exp();
            (fade, fade * step_s)
        };
        let free = Matrix2::new(
            cos + decay * sin_by_rate,
            sin_by_rate,
            -omega * omega * sin_by_rate,
            cos - decay * sin_by_rate,
        );
        Self {
            step_s,
            lag_s: 2.0 * damping_ratio / omega,
            free,
        }
    }

    /// Length of the step, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Where it is a step later, while what drives it goes evenly from `u0` to `u1`.
    pub fn step(&self, now: Oscillation, u0: f64, u1: f64) -> Oscillation {
        let slope = if self.step_s > 0.0 {
            (u1 - u0) / self.step_s
        } else {
            0.0
        };
        let behind = self.lag_s * slope;
        // About the motion that the even force alone would keep up, it swings freely.
        let (x, v) = (now.x - u0 + behind, now.v - slope);
        let free = self.free;
        Oscillation {
            x: free.m11 * x + free.m12 * v + u1 - behind,
            v: free.m21 * x + free.m22 * v + slope,
        }
    }

    /// By how much a start must be moved so that it comes round to itself, if over a period of
    /// `steps` steps it has moved on by `by`: the solution z of `z - A^steps z = by`. The free
    /// motion must fade within the period.
    pub fn closing(&self, steps: u64, by: Oscillation) -> Oscillation {
        let free = power(self.free, steps);
        let (p, q, r, s) = (1.0 - free.m11, -free.m12, -free.m21, 1.0 - free.m22);
        let det = p * s - q * r;
        if det.abs() < 1e-12 {
            return Oscillation::default();
        }
        Oscillation {
            x: (s * by.x - q * by.v) / det,
            v: (p * by.v - r * by.x) / det,
        }
    }
}

/// Square and multiply.
fn power(mut base: Matrix2<f64>, mut exponent: u64) -> Matrix2<f64> {
    let mut out = Matrix2::identity();
    while exponent > 0 {
        if exponent & 1 == 1 {
            out *= base;
        }
        base *= base;
        exponent >>= 1;
    }
    out
}
