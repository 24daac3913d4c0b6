//! The spectrum of an angle that wind drives: a mean over pieces.
//!
//! Wind is chance: the spectrum of a long film in one piece is as ragged as noise, however long it
//! is, and the peaks in it are one bin wide (P. Welch 1967). The mean over pieces is smooth, and as
//! fine as a piece is long.

use crate::bounds::Bounds;
use crate::dynamics::{Spectrum, spectrum};

/// Length of a piece, s; each begins in the middle of the one before.
pub const PIECE_S: f64 = 20.0;

/// Length of what [`averaged`] looks at in one piece, s, of a film of `span_s`: no period that is
/// much longer shows.
pub fn looked_at_s(span_s: f64) -> f64 {
    if span_s < 1.5 * PIECE_S {
        span_s
    } else {
        PIECE_S
    }
}

/// The pieces of a film, of one length, s: the film itself where it is shorter than a piece and a
/// half.
pub fn pieces(film_s: Bounds) -> Vec<Bounds> {
    if looked_at_s(film_s.length()) >= film_s.length() {
        return vec![film_s];
    }
    let count = ((film_s.length() - PIECE_S) / (0.5 * PIECE_S)).floor() as usize + 1;
    let mut out = Vec::with_capacity(count);
    for k in 0..count {
        let from_s = film_s.lo + 0.5 * PIECE_S * k as f64;
        out.push(Bounds::new(from_s, from_s + PIECE_S));
    }
    out
}

/// The root of the mean square of the pieces' spectra; the film's own where it is shorter than a
/// piece and a half.
pub fn averaged(times_s: &[f64], values: &[f64]) -> Option<Spectrum> {
    let (first, last) = (*times_s.first()?, *times_s.last()?);
    let pieces = pieces(Bounds::new(first, last));
    if pieces.len() == 1 {
        return spectrum(times_s, values);
    }
    let mut pieces = pieces.iter().filter_map(|p| piece(times_s, values, *p));
    let Spectrum { bin_hz, amplitude } = pieces.next()?;
    let (mut squares, mut n): (Vec<f64>, f64) = (amplitude.iter().map(|a| a * a).collect(), 1.0);
    for other in pieces {
        // Gaps make pieces of fewer frames, with bins of another width.
        for (k, square) in squares.iter_mut().enumerate() {
            *square += amplitude_at(&other, k as f64 * bin_hz).powi(2);
        }
        n += 1.0;
    }
    Some(Spectrum {
        bin_hz,
        amplitude: squares.into_iter().map(|s| (s / n).sqrt()).collect(),
    })
}

/// The spectrum of a piece, without the moment at which it ends.
fn piece(times_s: &[f64], values: &[f64], piece_s: Bounds) -> Option<Spectrum> {
    let (mut piece_times_s, mut piece_values) = (Vec::new(), Vec::new());
    for (time_s, value) in times_s.iter().zip(values) {
        if piece_s.contains(*time_s) && *time_s < piece_s.hi {
            piece_times_s.push(*time_s);
            piece_values.push(*value);
        }
    }
    spectrum(&piece_times_s, &piece_values)
}

/// The amplitude at a frequency, straight between bins.
fn amplitude_at(spectrum: &Spectrum, hz: f64) -> f64 {
    let k = hz / spectrum.bin_hz;
    let (low, share) = (k.floor() as usize, k.fract());
    let [below, above] = [low, low + 1].map(|k| spectrum.amplitude.get(k).copied().unwrap_or(0.0));
    below + share * (above - below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Bounds;
    use rand::RngExt;

    /// An oscillator that chance drives for long: one spectrum of it all would give a damping of
    /// about nothing.
    #[test]
    fn the_half_power_damping_of_a_driven_oscillator_is_of_its_size() {
        let (hz, damping, step) = (0.8, 0.06, 1.0 / 30.0);
        let omega = std::f64::consts::TAU * hz;
        let (mut x, mut v) = (0.0_f64, 0.0_f64);
        let mut random = crate::random::generator(1, 0);
        let (mut times, mut values) = (Vec::new(), Vec::new());
        for k in 0..18_000 {
            let push = random.random_range(-0.5..0.5);
            v += step * (push * 100.0 - 2.0 * damping * omega * v - omega * omega * x);
            x += step * v;
            times.push(f64::from(k) * step);
            values.push(x);
        }
        let found = averaged(&times, &values)
            .unwrap()
            .half_power(Bounds::new(0.2, 5.0))
            .unwrap();
        assert!(
            (found.peak_hz / hz - 1.0).abs() < 0.05
                && (0.5..2.0).contains(&(found.damping_ratio / damping)),
            "{found:?}"
        );
        let whole = spectrum(&times, &values)
            .unwrap()
            .half_power(Bounds::new(0.2, 5.0))
            .unwrap();
        assert!(whole.damping_ratio < 0.2 * damping, "{whole:?}");
    }
}
