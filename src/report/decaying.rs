//! The part of an angle that is a branch's own free decay: how far it sways, for the table and for
//! the eye. Frequency and damping come from the points, not from here.

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

/// The damped cosine of `own` that fits `angle_deg` best between the two times `used_s` (none
/// elsewhere), beside those of
/// `others` and a constant. `None` without a damping, or where the angle has too few values.
pub fn decaying(
    times_s: &[f64],
    angle_deg: &[f64],
    used_s: [f64; 2],
    released_s: f64,
    own: &Sway,
    others: &[Sway],
) -> Option<Decaying> {
    let own_hz = own.frequency_hz.value;
    let apart = |s: &&Sway| (s.frequency_hz.value / own_hz).ln().abs() > SAME;
    let modes: Vec<(f64, f64)> = std::iter::once(own)
        .chain(others.iter().filter(apart))
        .filter_map(|s| Some((s.frequency_hz.value, s.damping_ratio?.value)))
        .filter(|(hz, damping)| *hz > 0.0 && (0.0..1.0).contains(damping))
        .collect();
    own.damping_ratio?;
    let wave = |(hz, damping): (f64, f64), t: f64| {
        let (size, phase) = (
            (-damping * TAU * hz * t).exp(),
            (1.0 - damping * damping).sqrt() * TAU * hz * t,
        );
        [size * phase.cos(), size * phase.sin()]
    };
    let row = |t: f64| -> Vec<f64> {
        std::iter::once(1.0)
            .chain(modes.iter().flat_map(|&mode| wave(mode, t - released_s)))
            .collect()
    };
    let within = |t: f64| used_s[0] <= t && t <= used_s[1];
    let rows: Vec<usize> = (0..times_s.len().min(angle_deg.len()))
        .filter(|&k| within(times_s[k]) && angle_deg[k].is_finite())
        .collect();
    let columns = 1 + 2 * modes.len();
    if rows.len() < 2 * columns || columns < 3 {
        return None;
    }
    let mut squares = DMatrix::<f64>::zeros(columns, columns);
    let mut products = DVector::<f64>::zeros(columns);
    for &k in &rows {
        let x = DVector::from_vec(row(times_s[k]));
        squares += &x * x.transpose();
        products += x * angle_deg[k];
    }
    let factors = squares.cholesky()?.solve(&products);
    let [cosine, sine] = [factors[1], factors[2]];
    let own_part = |t: f64| {
        let [c, s] = wave(modes[0], t - released_s);
        cosine * c + sine * s
    };
    let at = |t: &f64| if within(*t) { own_part(*t) } else { f64::NAN };
    let amplitude_deg = cosine.hypot(sine);
    amplitude_deg.is_finite().then(|| Decaying {
        curve_deg: times_s.iter().map(at).collect(),
        amplitude_deg,
    })
}
