//! Peaks of spectra that stand out of a smooth background, and those that several signals share.
//!
//! The background is a power law, a straight line through the logarithms of power and frequency. Of
//! noise with that spectrum the power over it is a chi-squared variable over its degrees of freedom,
//! two for each piece that the spectrum is a mean over; a peak that is too high for it is no chance
//! (S. Vaughan 2005, A&A 431, 391). The uncertainty of the line is not counted,
//! nor that a floor of white noise bends it: then noise has a peak in four to ten of a hundred
//! spectra, mostly near the highest frequencies.

use super::periodogram::Periodogram;
use crate::bounds::Bounds;
use crate::signal::statistics::nth_smallest;
use nalgebra::Vector2;

/// The chance that noise with a power law as its spectrum shows a peak at any of the frequencies.
pub const FALSE_ALARM: f64 = 0.01;
/// Fewer frequencies than this tell no background: the mean of ten logarithms of power is known
/// within a factor of 1.5.
const LEAST_FREQUENCIES: usize = 10;
/// Fewer values than this in a piece tell no spectrum.
const LEAST_VALUES: usize = 32;
/// Euler's constant.
const EULER: f64 = 0.577_215_664_901_532_9;

/// The power of a signal over its background.
#[derive(Clone, Debug, PartialEq)]
pub struct RelativeSpectrum {
    /// What can be told apart, one over the length of a piece, Hz. Frequencies are whole multiples
    /// of it, from `first` on.
    pub resolution_hz: f64,
    first: usize,
    /// Pieces that the power is a mean over.
    pieces: usize,
    over_background: Vec<f64>,
}

/// A peak that noise would not show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DominantPeak {
    /// By a parabola through the logarithms of three powers, Hz.
    pub frequency_hz: f64,
    /// Power over the background's; of several signals what at least half of them reach.
    pub over_background: f64,
}

impl RelativeSpectrum {
    /// Of `values` at growing `times_s`, as a mean over `pieces` of one length, s, of which each
    /// may begin in the middle of the one before: with Hann's window these count as independent to
    /// 5 % (P. Welch 1967). Times need not be even; values that are no numbers are left out.
    ///
    /// `None` where a piece has less than 32 values, where there are fewer than ten frequencies
    /// within `frequencies_hz`, and of a signal that does not move.
    pub fn of(
        times_s: &[f64],
        values: &[f64],
        pieces: &[Bounds],
        frequencies_hz: Bounds,
    ) -> Option<Self> {
        let resolution_hz = 1.0 / pieces.first()?.length();
        let mut sum: Vec<f64> = Vec::new();
        let mut first = 0;
        for piece in pieces {
            let of = of_piece(times_s, values, *piece, frequencies_hz)?;
            first = of.first_multiple();
            sum.resize(of.power().len(), 0.0);
            sum.iter_mut().zip(of.power()).for_each(|(s, p)| *s += p);
        }
        let mut hz = Vec::with_capacity(sum.len());
        for k in 0..sum.len() {
            hz.push((first + k) as f64 * resolution_hz);
        }
        let background = power_law(&hz, &sum, pieces.len())?;
        Some(Self {
            resolution_hz,
            first,
            pieces: pieces.len(),
            over_background: sum.iter().zip(background).map(|(s, b)| s / b).collect(),
        })
    }
}

/// The power of a signal within a piece of its time; `None` where that has too few values.
fn of_piece(
    times_s: &[f64],
    values: &[f64],
    piece: Bounds,
    frequencies_hz: Bounds,
) -> Option<Periodogram> {
    let (mut own_times_s, mut own) = (Vec::new(), Vec::new());
    for (time_s, value) in times_s.iter().zip(values) {
        if piece.contains(*time_s) && value.is_finite() {
            own_times_s.push(*time_s);
            own.push(*value);
        }
    }
    if own.len() < LEAST_VALUES {
        return None;
    }
    let mean = own.iter().sum::<f64>() / own.len() as f64;
    own.iter_mut().for_each(|x| *x -= mean);
    Some(Periodogram::of(piece, &own_times_s, &own, frequencies_hz))
}

/// The power law that fits best, by least squares of logarithms, at these frequencies; `None` where
/// there are too few, or where there is no power.
fn power_law(hz: &[f64], power: &[f64], pieces: usize) -> Option<Vec<f64>> {
    if hz.len() < LEAST_FREQUENCIES {
        return None;
    }
    // The mean of the logarithm of chi squared over its degrees of freedom, ψ(n) - ln n; of one
    // piece -0.577.
    let harmonic: f64 = (1..pieces).map(|k| 1.0 / k as f64).sum();
    let bias = harmonic - EULER - (pieces as f64).ln();
    let mut points = Vec::with_capacity(hz.len());
    for (hz, power) in hz.iter().zip(power) {
        points.push(Vector2::new(hz.ln(), power.ln() - bias));
    }
    let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let (mut squares, mut products) = (0.0, 0.0);
    for point in &points {
        let off = point - mean;
        squares += off.x * off.x;
        products += off.x * off.y;
    }
    let slope = products / squares;
    let line = hz.iter().map(|hz| mean.y + slope * (hz.ln() - mean.x));
    let background: Vec<f64> = line.map(f64::exp).collect();
    let is_positive = background.iter().all(|b| b.is_finite() && *b > 0.0);
    is_positive.then_some(background)
}

/// The peaks that at least half of the signals have, the highest over the background first. The
/// signals are those of one film: of the same pieces and frequencies. They need not be independent:
/// that fewer than half of them have a peak is refused where the partial conjunction of their tests
/// leaves less than [`FALSE_ALARM`] for it (Benjamini and Heller 2008, Biometrics 64, 1215), over
/// all frequencies together.
pub fn shared_peaks(signals: &[&RelativeSpectrum]) -> Vec<DominantPeak> {
    let Some(one) = signals.first() else {
        return Vec::new();
    };
    let half = signals.len().div_ceil(2);
    let frequencies = one.over_background.len();
    let mut reached = Vec::with_capacity(frequencies);
    for k in 0..frequencies {
        let all: Vec<f64> = signals
            .iter()
            .filter_map(|s| s.over_background.get(k).copied())
            .collect();
        let below = all.len().saturating_sub(half);
        reached.push(nth_smallest(all, below).unwrap_or(0.0));
    }
    // Of all frequencies, and of all choices of a half that the partial conjunction allows.
    let tests = (frequencies * (signals.len() - half + 1)) as f64;
    let mut peaks = Vec::new();
    for (k, three) in (1..).zip(reached.windows(3)) {
        let is_peak = three[0] <= three[1] && three[1] > three[2];
        if is_peak && tests * chance_of(three[1], one.pieces) <= FALSE_ALARM {
            let [below, at, above] = [three[0], three[1], three[2]].map(|x| x.max(1e-300).ln());
            let off = 0.5 * (below - above) / (below - 2.0 * at + above);
            peaks.push(DominantPeak {
                frequency_hz: ((one.first + k) as f64 + off) * one.resolution_hz,
                over_background: three[1],
            });
        }
    }
    peaks.sort_by(|a, b| b.over_background.total_cmp(&a.over_background));
    peaks
}

/// The chance that a mean over `pieces` is this many times its expectation or more: that of chi
/// squared with two degrees of freedom for each.
fn chance_of(over_background: f64, pieces: usize) -> f64 {
    let x = over_background * pieces as f64;
    // exp(-x) x^k / k!, by its logarithm, as x may be large.
    let (mut sum, mut log) = (0.0, -x);
    for k in 1..=pieces {
        sum += log.exp();
        log += (x / k as f64).ln();
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use std::f64::consts::TAU;

    const WITHIN_HZ: Bounds = Bounds::new(0.08, 5.0);

    /// Uneven times of 45 s, as a camera that drops frames has them.
    fn times(seed: u64) -> Vec<f64> {
        let mut random = crate::random::generator(seed, 1);
        let mut times = Vec::new();
        for k in 0..1350 {
            if random.random_range(0.0..1.0) > 0.1 {
                times.push(f64::from(k) / 30.0 + random.random_range(-0.005..0.005));
            }
        }
        times
    }

    fn pieces() -> Vec<Bounds> {
        [0.0, 10.0, 20.0]
            .map(|from| Bounds::new(from, from + 20.0))
            .to_vec()
    }

    /// Red noise: a random walk that is called back, with a corner at 0.2 Hz.
    fn red(times_s: &[f64], seed: u64) -> Vec<f64> {
        let mut random = crate::random::generator(seed, 2);
        let (mut x, mut last_s) = (0.0, 0.0);
        let mut out = Vec::with_capacity(times_s.len());
        for time_s in times_s {
            let dt = (time_s - last_s).max(0.0);
            x = x * (-dt * TAU * 0.05).exp() + dt.sqrt() * random.random_range(-1.0..1.0);
            last_s = *time_s;
            out.push(x);
        }
        out
    }

    fn with_wave(mut values: Vec<f64>, times_s: &[f64], hz: f64, amplitude: f64) -> Vec<f64> {
        for (x, t) in values.iter_mut().zip(times_s) {
            *x += amplitude * (TAU * hz * t).sin();
        }
        values
    }

    fn spectrum(times_s: &[f64], values: &[f64]) -> RelativeSpectrum {
        RelativeSpectrum::of(times_s, values, &pieces(), WITHIN_HZ).expect("a spectrum")
    }

    fn found(values: &[Vec<f64>], times_s: &[f64]) -> Vec<DominantPeak> {
        let all: Vec<RelativeSpectrum> = values.iter().map(|v| spectrum(times_s, v)).collect();
        shared_peaks(&all.iter().collect::<Vec<_>>())
    }

    #[test]
    fn a_wave_in_red_noise_is_a_peak_at_its_frequency_in_spite_of_missing_frames() {
        let times_s = times(1);
        for hz in [0.42, 0.77, 1.46, 3.1] {
            let values = with_wave(red(&times_s, 3), &times_s, hz, 0.5);
            let peaks = found(&[values], &times_s);
            assert_eq!(peaks.len(), 1, "{hz} Hz: {peaks:?}");
            assert!((peaks[0].frequency_hz - hz).abs() < 0.01, "{peaks:?}");
        }
    }

    /// One in a hundred has one by chance; more where missing frames bend the background.
    #[test]
    fn noise_has_hardly_a_peak() {
        let even: Vec<f64> = (0..1350).map(|k| f64::from(k) / 30.0).collect();
        let mut with_peaks = [0; 2];
        for seed in 0..200 {
            for (count, times_s) in with_peaks.iter_mut().zip([even.clone(), times(seed)]) {
                let peaks = found(&[red(&times_s, seed)], &times_s);
                *count += usize::from(!peaks.is_empty());
            }
        }
        assert!(with_peaks[0] <= 8, "{with_peaks:?} of 200");
        assert!(with_peaks[1] <= 30, "{with_peaks:?} of 200");
    }

    #[test]
    fn what_half_of_the_signals_have_is_shared() {
        let times_s = times(5);
        let noise = |seed| red(&times_s, seed);
        let wave = |seed| with_wave(noise(seed), &times_s, 0.9, 0.5);
        for (waves, shared) in [(1, false), (2, true), (3, true)] {
            let mut all = Vec::new();
            for seed in 0..4 {
                all.push(if seed < waves {
                    wave(seed)
                } else {
                    noise(seed)
                });
            }
            let peaks = found(&all, &times_s);
            assert_eq!(peaks.len() == 1, shared, "{waves} of 4: {peaks:?}");
        }
        assert!(shared_peaks(&[]).is_empty());
    }

    /// Means over more pieces scatter less: the tables of chi squared.
    #[test]
    fn the_chances_are_those_of_the_tables() {
        for (freedom, chi_squared, chance) in [
            (2.0, 9.210, 0.01),
            (6.0, 16.812, 0.01),
            (20.0, 31.410, 0.05),
        ] {
            let pieces = (freedom / 2.0) as usize;
            let found = chance_of(chi_squared / freedom, pieces);
            assert!((found / chance - 1.0).abs() < 0.01, "{freedom}: {found}");
        }
        assert_eq!(chance_of(1e9, 59), 0.0);
        assert_eq!(chance_of(0.0, 3), 1.0);
    }

    #[test]
    fn what_tells_no_spectrum_has_none() {
        let times_s = times(1);
        let of = |values: &[f64], pieces: &[Bounds], within_hz| {
            RelativeSpectrum::of(&times_s, values, pieces, within_hz)
        };
        let values = red(&times_s, 1);
        assert!(of(&values, &pieces(), WITHIN_HZ).is_some());
        assert_eq!(of(&vec![3.0; values.len()], &pieces(), WITHIN_HZ), None);
        assert_eq!(
            of(&vec![f64::NAN; values.len()], &pieces(), WITHIN_HZ),
            None
        );
        assert_eq!(of(&values, &pieces(), Bounds::new(0.1, 0.5)), None);
        assert_eq!(of(&values, &[], WITHIN_HZ), None);
        assert_eq!(of(&values, &[Bounds::new(0.0, 0.0)], WITHIN_HZ), None);
        let late = [Bounds::new(44.0, 64.0)];
        assert_eq!(of(&values, &late, WITHIN_HZ), None);
    }
}
