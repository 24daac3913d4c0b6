//! The oscillators in the turn of one branch in wind, from its spectrum.
//!
//! Gusts drive the oscillators; besides, the branch gives way to gusts as a whole, and what is left
//! is white. The likelihood of the Fourier coefficients is Whittle's (1951); Schwarz's criterion
//! (1978) says how many oscillators there are.

use super::branches::LnDeviations;
use super::decay::{LN_DAMPING_WEIGHT, Mode, USUAL_DAMPING, damping_penalty};
use super::driven_modes::{GUST_EXPONENT, Known, Spectrum};
use super::driven_oscillators::{DAMPING, Oscillator};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::bfgs::{Cost, Stopping, curvature_of_slopes, minimum};
use nalgebra::DVector;
use std::f64::consts::PI;

/// Frequencies that a spectrum must have.
const MIN_FREQUENCIES: usize = 8;
/// Oscillators at most, and the highest peaks of the spectrum, from which they are looked for.
const MOST_OSCILLATORS: usize = 2;
const MOST_PEAKS: usize = 4;
/// Oscillators are looked for between these shares of the frequency at which most moves.
const BAND: Bounds = Bounds::new(0.3, 2.0);
/// Power of the gusts is given as a share of that at this frequency, Hz, and falls with some exponent:
/// that of turbulence, with this standard deviation. One that is taken for known moves the frequency
/// of an oscillator whose gusts have another by a percent.
const GUST_HZ: f64 = 0.5;
const GUST_EXPONENT_SD: f64 = 1.0;
const GUST_EXPONENTS: Bounds = Bounds::new(-6.0, 2.0);
/// Parameters of an oscillator: the logarithms of frequency, damping ratio and power at its peak; and
/// of all else: the logarithms of the powers of what gives way to gusts and of noise, and the exponent
/// of the gusts.
const OF_OSCILLATOR: usize = 3;
const OF_REST: usize = 3;
/// Powers that the search begins with, and those between which it goes on, as shares of the mean.
const FIRST_PEAK: f64 = 3.0;
const FIRST_DRIFT: f64 = 0.1;
const FIRST_NOISE: f64 = 0.05;
const LN_POWERS: Bounds = Bounds::new(-14.0, 10.0);
/// When the search is done.
const STOPPING: Stopping = Stopping {
    max_steps: 200,
    small_steps: 2,
    min_gain: 1e-3,
};

/// The oscillators in `angles` at `times_s`, rad and s, about the largest one that is `within_hz`, by
/// the likeliest fit; their variances in rad². None where there are too few frequencies or nothing
/// moves, where chance explains the motion as well, and where `cancel` ends the work before.
pub(super) fn oscillators(
    angles: &[f64],
    times_s: &[f64],
    within_hz: Bounds,
    cancel: &CancelToken,
) -> Vec<Oscillator> {
    let all = Powers::of(angles, times_s, within_hz);
    let about_highest = all.and_then(|all| Powers::of(angles, times_s, all.about_highest_hz()));
    let Some(powers) = about_highest else {
        return Vec::new();
    };
    let likeliest = powers.likeliest(cancel);
    likeliest.map_or(Vec::new(), |fit| powers.oscillators(&fit))
}

/// All ways to choose `count` of some numbers, in their order.
fn choices(all: &[f64], count: usize) -> Vec<Vec<f64>> {
    if count == 0 {
        return vec![Vec::new()];
    }
    let mut out = Vec::new();
    for (i, first) in all.iter().enumerate() {
        for mut rest in choices(&all[i + 1..], count - 1) {
            rest.insert(0, *first);
            out.push(rest);
        }
    }
    out
}

/// The powers of a turn, as shares of their mean.
struct Powers {
    frequencies_hz: Vec<f64>,
    powers: Vec<f64>,
    /// Their mean, rad²/Hz.
    mean: f64,
    within_hz: Bounds,
}

struct Fit {
    oscillators: usize,
    x: Vec<f64>,
    criterion: f64,
}

impl Fit {
    fn mode(&self, k: usize) -> Mode {
        Mode {
            frequency_hz: self.x[k].exp(),
            damping: self.x[self.oscillators + k].exp(),
        }
    }

    fn gust_exponent(&self) -> f64 {
        self.x[OF_OSCILLATOR * self.oscillators + 2]
    }

    /// As a share of the mean power: the power at the peak, over the width of the peak.
    fn variance(&self, k: usize) -> f64 {
        let mode = self.mode(k);
        let peak =
            self.x[2 * self.oscillators + k].exp() * gust(mode.frequency_hz, self.gust_exponent());
        peak * PI * mode.frequency_hz * mode.damping
    }
}

impl Powers {
    fn of(angles: &[f64], times_s: &[f64], within_hz: Bounds) -> Option<Self> {
        let spectrum = Spectrum::of(&[angles.to_vec()], times_s, within_hz);
        let coefficients = spectrum.coefficients.iter();
        let mut powers: Vec<f64> = coefficients.map(|c| c[0].norm_sqr()).collect();
        let mean = powers.iter().sum::<f64>() / powers.len().max(1) as f64;
        if powers.len() < MIN_FREQUENCIES || mean <= 0.0 || !mean.is_finite() {
            return None;
        }
        powers.iter_mut().for_each(|power| *power /= mean);
        Some(Self {
            frequencies_hz: spectrum.frequencies_hz,
            powers,
            mean,
            within_hz,
        })
    }

    /// Means of neighbours: single coefficients are chance.
    fn smooth(&self) -> Vec<f64> {
        let n = self.powers.len();
        let mut out = Vec::with_capacity(n);
        for k in 0..n {
            let near = &self.powers[k.saturating_sub(1)..(k + 2).min(n)];
            let sum = near.iter().sum::<f64>() + self.powers[k];
            out.push(sum / (near.len() + 1) as f64);
        }
        out
    }

    /// The frequencies about that at which most moves, by equal shares of frequency: gusts, which
    /// grow the slower they are, do not hide an oscillator there.
    fn about_highest_hz(&self) -> Bounds {
        let powers = self.frequencies_hz.iter().zip(self.smooth());
        let highest = powers.max_by(|(f, a), (g, b)| (*f * a).total_cmp(&(*g * b)));
        let highest_hz = highest.map_or(0.0, |(f, _)| *f);
        Bounds::new(
            (BAND.lo * highest_hz).max(self.within_hz.lo),
            (BAND.hi * highest_hz).min(self.within_hz.hi),
        )
    }

    /// Where most moves, Hz, the highest peak first.
    fn peaks_hz(&self) -> Vec<f64> {
        let (n, smooth) = (self.powers.len(), self.smooth());
        let is_peak = |k: &usize| {
            let near = &smooth[k.saturating_sub(1)..(k + 2).min(n)];
            near.iter().all(|power| *power <= smooth[*k])
        };
        let mut peaks: Vec<usize> = (0..n).filter(is_peak).collect();
        peaks.sort_by(|a, b| smooth[*b].total_cmp(&smooth[*a]));
        peaks.truncate(MOST_PEAKS);
        peaks.iter().map(|k| self.frequencies_hz[*k]).collect()
    }

    fn fit(&self, start_hz: &[f64], cancel: &CancelToken) -> Fit {
        let count = start_hz.len();
        let mut x: Vec<f64> = start_hz.iter().map(|f| f.ln()).collect();
        x.extend(vec![USUAL_DAMPING.ln(); count]);
        x.extend(vec![FIRST_PEAK.ln(); count]);
        x.extend([FIRST_DRIFT.ln(), FIRST_NOISE.ln(), GUST_EXPONENT]);
        let mut bounds = vec![LN_POWERS; x.len()];
        bounds[..count].fill(self.within_hz.map(f64::ln));
        bounds[count..2 * count].fill(DAMPING.map(f64::ln));
        bounds[OF_OSCILLATOR * count + 2] = GUST_EXPONENTS;
        let likelihood = Likelihood {
            powers: self,
            oscillators: count,
        };
        let (x, cost) = minimum(&likelihood, &x, &bounds, &STOPPING, cancel);
        let parameters = (OF_OSCILLATOR * count + OF_REST) as f64;
        Fit {
            oscillators: count,
            x,
            criterion: 2.0 * cost + parameters * (self.powers.len() as f64).ln(),
        }
    }

    /// The likeliest fit of any number of oscillators; `None` where `cancel` ends the work before.
    fn likeliest(&self, cancel: &CancelToken) -> Option<Fit> {
        let peaks_hz = self.peaks_hz();
        let mut fits = Vec::new();
        for count in 0..=MOST_OSCILLATORS {
            for start_hz in choices(&peaks_hz, count) {
                if cancel.is_cancelled() {
                    return None;
                }
                fits.push(self.fit(&start_hz, cancel));
            }
        }
        let fits = fits.into_iter();
        fits.min_by(|a, b| a.criterion.total_cmp(&b.criterion))
    }

    /// Those of a fit; one for whose frequency the likelihood has no top is at the limit.
    fn oscillators(&self, fit: &Fit) -> Vec<Oscillator> {
        let count = fit.oscillators;
        let likelihood = Likelihood {
            powers: self,
            oscillators: count,
        };
        let Some(known) = Known::of(curvature_of_slopes(&likelihood, &fit.x)) else {
            return Vec::new();
        };
        let ln_frequencies = self.within_hz.map(f64::ln);
        let ln_dampings = DAMPING.map(f64::ln);
        let mut out = Vec::with_capacity(count);
        for k in 0..count {
            let deviation = known.deviation(k);
            let is_inside =
                ln_frequencies.is_between(fit.x[k]) && ln_dampings.is_between(fit.x[count + k]);
            out.push(Oscillator {
                mode: fit.mode(k),
                ln_sd: LnDeviations {
                    frequency: deviation.unwrap_or(f64::INFINITY),
                    damping: known.deviation(count + k).unwrap_or(f64::INFINITY),
                },
                variance: fit.variance(k) * self.mean,
                at_limit: deviation.is_none() || !is_inside,
            });
        }
        out
    }
}

/// Power of gusts.
fn gust(frequency_hz: f64, exponent: f64) -> f64 {
    (frequency_hz / GUST_HZ).powf(exponent)
}

/// Minus the logarithm of the likelihood of some oscillators, with the priors on the damping and on
/// the gusts. The parameters are the logarithms of all frequencies, all damping ratios, all powers at
/// the peak where gusts have a power of 1, then of the powers of drift there and of noise, and the
/// exponent of the gusts.
struct Likelihood<'a> {
    powers: &'a Powers,
    oscillators: usize,
}

/// The power of an oscillator at one frequency, and the derivatives of its logarithm by those of
/// frequency and damping ratio.
#[derive(Clone, Copy, Default)]
struct Part {
    power: f64,
    by_ln_frequency: f64,
    by_ln_damping: f64,
}

impl Part {
    fn of(mode: &Mode, peak: f64, frequency_hz: f64) -> Self {
        let ratio = (frequency_hz / mode.frequency_hz).powi(2);
        let width = (2.0 * mode.damping).powi(2);
        let response = width / ((1.0 - ratio).powi(2) + width * ratio);
        Self {
            power: peak * response,
            by_ln_frequency: (2.0 * width * ratio - 4.0 * ratio * (1.0 - ratio)) * response / width,
            by_ln_damping: 2.0 - 2.0 * ratio * response,
        }
    }
}

impl Cost for Likelihood<'_> {
    fn value(&self, x: &[f64]) -> f64 {
        self.value_and_slopes(x).0
    }

    fn slopes(&self, x: &[f64]) -> DVector<f64> {
        self.value_and_slopes(x).1
    }
}

impl Likelihood<'_> {
    /// The value, and its first derivatives.
    fn value_and_slopes(&self, x: &[f64]) -> (f64, DVector<f64>) {
        let count = self.oscillators;
        let rest = OF_OSCILLATOR * count;
        let (drift, noise, exponent) = (x[rest].exp(), x[rest + 1].exp(), x[rest + 2]);
        let mut slopes = DVector::zeros(x.len());
        let off = (exponent - GUST_EXPONENT) / GUST_EXPONENT_SD;
        let mut cost = 0.5 * off * off;
        slopes[rest + 2] = off / GUST_EXPONENT_SD;
        let mut modes = Vec::with_capacity(count);
        for k in 0..count {
            let ln_damping = x[count + k];
            cost += 0.5 * damping_penalty(ln_damping);
            slopes[count + k] += LN_DAMPING_WEIGHT * (ln_damping - USUAL_DAMPING.ln());
            modes.push(Mode {
                frequency_hz: x[k].exp(),
                damping: ln_damping.exp(),
            });
        }
        let spectrum = &self.powers.frequencies_hz;
        for (frequency_hz, power) in spectrum.iter().zip(&self.powers.powers) {
            let gust = gust(*frequency_hz, exponent);
            let mut parts = [Part::default(); MOST_OSCILLATORS];
            let mut expected = noise + drift * gust;
            for (k, mode) in modes.iter().enumerate() {
                parts[k] = Part::of(mode, x[2 * count + k].exp() * gust, *frequency_hz);
                expected += parts[k].power;
            }
            cost += expected.ln() + power / expected;
            let by_expected = (1.0 - power / expected) / expected;
            for (k, part) in parts.iter().take(count).enumerate() {
                let by_part = by_expected * part.power;
                slopes[k] += by_part * part.by_ln_frequency;
                slopes[count + k] += by_part * part.by_ln_damping;
                slopes[2 * count + k] += by_part;
            }
            slopes[rest] += by_expected * drift * gust;
            slopes[rest + 1] += by_expected * noise;
            let of_gusts = expected - noise;
            slopes[rest + 2] += by_expected * of_gusts * (frequency_hz / GUST_HZ).ln();
        }
        (cost, slopes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;
    use rand::RngExt;
    use std::f64::consts::TAU;

    const STEP_S: f64 = 1.0 / 15.0;
    const WITHIN_HZ: Bounds = Bounds::new(0.2, 2.0);

    /// Oscillators that white noise drives, and times, s.
    fn driven(frequencies_hz: &[f64], frames: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut random = generator(seed, 0);
        let mut states = vec![(0.0, 0.0); frequencies_hz.len()];
        let (mut angles, mut times_s) = (Vec::new(), Vec::new());
        let step_s = STEP_S / 20.0;
        for frame in 0..frames {
            for _ in 0..20 {
                for ((at, speed), f) in states.iter_mut().zip(frequencies_hz) {
                    let omega = TAU * f;
                    let force: f64 = random.random_range(-1.0..1.0);
                    *speed += step_s * (force - 0.06 * omega * *speed - omega * omega * *at);
                    *at += step_s * *speed;
                }
            }
            angles.push(states.iter().map(|(at, _)| at).sum());
            times_s.push(frame as f64 * STEP_S);
        }
        (angles, times_s)
    }

    fn found(frequencies_hz: &[f64], frames: usize, seed: u64) -> Option<Oscillator> {
        let (angles, times_s) = driven(frequencies_hz, frames, seed);
        slowest(&angles, &times_s, &CancelToken::new())
    }

    fn slowest(angles: &[f64], times_s: &[f64], cancel: &CancelToken) -> Option<Oscillator> {
        let all = oscillators(angles, times_s, WITHIN_HZ, cancel).into_iter();
        all.min_by(|a, b| a.mode.frequency_hz.total_cmp(&b.mode.frequency_hz))
    }

    #[test]
    fn the_slowest_is_found_within_what_is_said_of_it() {
        for frequencies_hz in [&[0.5][..], &[0.5, 0.8]] {
            let mut hold = 0;
            for seed in 0..20 {
                let found = found(frequencies_hz, 1800, seed).expect("an oscillator");
                let off = (found.mode.frequency_hz / 0.5).ln();
                let sd = found.ln_sd.frequency;
                assert!(
                    !found.at_limit && sd < 0.02 && off.abs() < 0.05,
                    "{seed}: {off} {sd}"
                );
                hold += u32::from(off.abs() < 2.0 * sd);
            }
            assert!(hold >= 17, "{hold} of 20 intervals hold");
        }
    }

    #[test]
    fn what_says_nothing_has_none() {
        assert!(found(&[0.5], 20, 1).is_none(), "too short");
        let times_s: Vec<f64> = (0..900).map(|k| f64::from(k) * STEP_S).collect();
        let mut random = generator(9, 0);
        let noise: Vec<f64> = (0..900).map(|_| random.random_range(-1.0..1.0)).collect();
        for angles in [vec![0.0; 900], vec![f64::NAN; 900], noise] {
            let found = slowest(&angles, &times_s, &CancelToken::new());
            assert!(found.is_none());
        }
        let cancel = CancelToken::new();
        cancel.cancel();
        let (angles, times_s) = driven(&[0.5], 900, 1);
        assert!(slowest(&angles, &times_s, &cancel).is_none());
    }

    #[test]
    fn slopes_are_those_of_the_cost() {
        let (angles, times_s) = driven(&[0.5, 1.1], 600, 1);
        let powers = Powers::of(&angles, &times_s, WITHIN_HZ).expect("a spectrum");
        let likelihood = Likelihood {
            powers: &powers,
            oscillators: 2,
        };
        let x = [-0.6, 0.2, -3.2, -2.8, 1.5, 0.5, -1.0, -2.0, -1.2];
        let slopes = likelihood.value_and_slopes(&x).1;
        for i in 0..x.len() {
            let [above, below] = [1e-6, -1e-6].map(|by| {
                let mut there = x;
                there[i] += by;
                likelihood.value(&there)
            });
            let difference = (above - below) / 2e-6;
            let off = (difference - slopes[i]).abs();
            assert!(
                off < 1e-4 * (1.0 + difference.abs()),
                "{i}: {difference}, {}",
                slopes[i]
            );
        }
    }
}
