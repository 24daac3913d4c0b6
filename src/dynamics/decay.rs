//! Free decay: the modes of a tree and how they look in time.

use std::f64::consts::TAU;

/// One mode: undamped frequency in Hz and damping ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    pub frequency_hz: f64,
    pub damping: f64,
}

/// How the decay begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Let go from rest at time 0: the phase of every mode is known, which tells modes apart that are close together.
    Rest,
    /// In the middle of the motion: any phase.
    Moving,
}

impl Mode {
    /// The mode's columns at `times_s`: one if it starts from rest, cosine and sine otherwise.
    pub(super) fn columns(&self, times_s: &[f64], start: Start) -> Vec<Vec<f64>> {
        let (omega, zeta) = (TAU * self.frequency_hz, self.damping);
        let root = (1.0 - zeta * zeta).sqrt();
        let at = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            times_s.iter().map(|t| (-zeta * omega * t).exp() * f(omega * root * t)).collect()
        };
        match start {
            Start::Rest => vec![at(&|p| p.cos() + zeta / root * p.sin())],
            Start::Moving => vec![at(&f64::cos), at(&f64::sin)],
        }
    }

    pub(super) fn parameters(&self) -> [f64; 2] {
        [self.frequency_hz.ln(), self.damping.ln()]
    }

    pub(super) fn of_parameters(x: &[f64]) -> Self {
        Self { frequency_hz: x[0].exp(), damping: x[1].exp() }
    }
}
