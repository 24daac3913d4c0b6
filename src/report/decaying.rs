//! The part of an angle that is a branch's own free decay: how far it sways, for the table and for
//! the eye. Frequency and damping come from the points, not from here.

use crate::bounds::Bounds;
use crate::model::Sway;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Oscillations that count as one in an angle: frequencies within this share of each other.
const SAME: f64 = 0.01;

/// A branch's own free decay in an angle.
pub struct Decaying {
    /// In every frame, degrees; no number outside of the time that is used.
    pub curve_deg: Vec<f64>,
    /// Its amplitude at the release, degrees.
    pub amplitude_deg: f64,
}

/// The damped cosine of `own` that fits `angle_deg` best within `used_s` (none elsewhere), beside
/// those of `others` and a constant. `None` without a damping, or where the angle has too few
/// values.
pub fn decaying(
    times_s: &[f64],
    angle_deg: &[f64],
    used_s: Bounds,
    released_s: f64,
    own: &Sway,
    others: &[Sway],
) -> Option<Decaying> {
    let own_mode = Mode::of(own)?;
    let mut modes: Vec<Mode> = own_mode.sound().into_iter().collect();
    for other in others {
        let apart = (other.frequency_hz.value / own_mode.frequency_hz)
            .ln()
            .abs()
            > SAME;
        modes.extend(Mode::of(other).filter(|_| apart).and_then(|m| m.sound()));
    }
    let rows: Vec<usize> = (0..times_s.len().min(angle_deg.len()))
        .filter(|&k| used_s.contains(times_s[k]) && angle_deg[k].is_finite())
        .collect();
    let columns = 1 + 2 * modes.len();
    if rows.len() < 2 * columns || columns < 3 {
        return None;
    }
    let mut squares = DMatrix::<f64>::zeros(columns, columns);
    let mut products = DVector::<f64>::zeros(columns);
    for &k in &rows {
        let mut row = vec![1.0];
        for mode in &modes {
            let wave = mode.wave(times_s[k] - released_s);
            row.extend([wave.cosine, wave.sine]);
        }
        let x = DVector::from_vec(row);
        squares += &x * x.transpose();
        products += x * angle_deg[k];
    }
    let factors = squares.cholesky()?.solve(&products);
    let (cosine, sine) = (factors[1], factors[2]);
    let mut curve_deg = vec![f64::NAN; times_s.len()];
    for (deg, t) in curve_deg.iter_mut().zip(times_s) {
        if used_s.contains(*t) {
            let wave = modes[0].wave(t - released_s);
            *deg = cosine * wave.cosine + sine * wave.sine;
        }
    }
    let amplitude_deg = cosine.hypot(sine);
    amplitude_deg.is_finite().then_some(Decaying {
        curve_deg,
        amplitude_deg,
    })
}

/// A damped oscillation.
#[derive(Clone, Copy)]
struct Mode {
    frequency_hz: f64,
    damping_ratio: f64,
}

/// A damped oscillation's cosine and sine at one time.
struct Wave {
    cosine: f64,
    sine: f64,
}

impl Mode {
    /// `None` without a damping.
    fn of(sway: &Sway) -> Option<Self> {
        Some(Self {
            frequency_hz: sway.frequency_hz.value,
            damping_ratio: sway.damping_ratio?.value,
        })
    }

    /// Itself, if it can oscillate.
    fn sound(self) -> Option<Self> {
        let sound = self.frequency_hz > 0.0 && (0.0..1.0).contains(&self.damping_ratio);
        sound.then_some(self)
    }

    /// At a time since the release, s.
    fn wave(&self, t: f64) -> Wave {
        let size = (-self.damping_ratio * TAU * self.frequency_hz * t).exp();
        let damped = (1.0 - self.damping_ratio * self.damping_ratio).sqrt();
        let phase = damped * TAU * self.frequency_hz * t;
        Wave {
            cosine: size * phase.cos(),
            sine: size * phase.sin(),
        }
    }
}
