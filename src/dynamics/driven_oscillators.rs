//! The oscillators in one or two motions in wind, from their spectra.
//!
//! Gusts drive the oscillators; besides, the branch gives way to gusts as a whole, and what is left
//! is white. Any multiple of motions that are known, as those of a carrier, may be in each. The
//! likelihood of the Fourier coefficients is Whittle's (1951); Schwarz's criterion (1978) says how
//! many oscillators there are.

use super::branches::LnDeviations;
use super::decay::{LN_DAMPING_WEIGHT, Mode, USUAL_DAMPING, damping_penalty};
use super::driven_modes::{GUST_EXPONENT, Known, Spectrum};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::bfgs::{Cost, Stopping, curvature_of_slopes, minimum};
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::PI;

/// Damping ratios that are looked for.
pub(super) const DAMPING: Bounds = Bounds::new(0.003, 0.4);
/// Frequencies that a spectrum must have.
const MIN_FREQUENCIES: usize = 8;
/// Places with more power than is expected, from which one more oscillator is looked for.
const MOST_PEAKS: usize = 4;
/// Half the width of the bands whose power is compared, as a share of their frequency: that of usual
/// sways.
const HALF_BAND: f64 = 0.04;
/// Oscillators of a trunk's turn are looked for between these shares of the frequency at which most
/// moves.
const BAND: Bounds = Bounds::new(0.3, 2.0);
/// Power of the gusts is given as a share of that at this frequency, Hz, and falls with some exponent:
/// that of turbulence, with this standard deviation. One that is taken for known moves the frequency
/// of an oscillator whose gusts have another by a percent.
const GUST_HZ: f64 = 0.5;
const GUST_EXPONENT_SD: f64 = 1.0;
const GUST_EXPONENTS: Bounds = Bounds::new(-6.0, 2.0);
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

/// An oscillator that gusts drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Oscillator {
    pub mode: Mode,
    /// By the curvature of the likelihood; infinite where that has none.
    pub ln_sd: LnDeviations,
    /// Of all motions together, in the square of their unit.
    pub variance: f64,
    /// Whether it stands where the search ends.
    pub at_limit: bool,
}

/// What oscillators are looked for in.
pub(super) struct Driven {
    frequencies_hz: Vec<f64>,
    /// Motions that are not correlated, and share the frequency and damping of every oscillator.
    motions: Vec<Motion>,
    /// Coefficients of motions of which any multiple may be in each, by motion and frequency.
    known: Vec<Vec<Complex<f64>>>,
    /// Oscillators whose frequency and damping ratio are known, but not their size.
    ancestors: Vec<Mode>,
    within_hz: Bounds,
}

/// Fourier coefficients of a motion, of which what is no multiple of the known ones has a mean power
/// of 1.
struct Motion {
    coefficients: Vec<Complex<f64>>,
    /// What they were divided by, in squares: px²/Hz or rad²/Hz.
    mean: f64,
}

/// Some oscillators beyond the ancestors', and how likely they are.
pub(super) struct Fit<'a> {
    likelihood: Likelihood<'a>,
    x: Vec<f64>,
    criterion: f64,
}

/// The frequencies about that at which most of a motion is, by equal shares of frequency: gusts,
/// which grow the slower they are, do not hide an oscillator there.
pub(super) fn about_highest_hz(motion: &[f64], times_s: &[f64], within_hz: Bounds) -> Bounds {
    let spectrum = Spectrum::of(&[motion.to_vec()], times_s, within_hz);
    let powers: Vec<f64> = (spectrum.coefficients.iter().map(|c| c[0].norm_sqr())).collect();
    let mut highest = (0.0, 0.0);
    for (k, frequency_hz) in spectrum.frequencies_hz.iter().enumerate() {
        // Single coefficients are chance.
        let near = &powers[k.saturating_sub(1)..(k + 2).min(powers.len())];
        let mean = (near.iter().sum::<f64>() + powers[k]) / (near.len() + 1) as f64;
        if frequency_hz * mean > highest.1 {
            highest = (*frequency_hz, frequency_hz * mean);
        }
    }
    Bounds::new(
        (BAND.lo * highest.0).max(within_hz.lo),
        (BAND.hi * highest.0).min(within_hz.hi),
    )
}

impl Driven {
    /// Of `motions` at `times_s`, of which any multiple of the `known` ones may be a part. `None`
    /// where there are too few frequencies, or one of the motions is none.
    pub fn new(
        motions: &[Vec<f64>],
        known: &[Vec<f64>],
        times_s: &[f64],
        ancestors: Vec<Mode>,
        within_hz: Bounds,
    ) -> Option<Self> {
        let all = [motions, known].concat();
        let spectrum = Spectrum::of(&all, times_s, within_hz);
        let count = spectrum.frequencies_hz.len();
        if count < MIN_FREQUENCIES {
            return None;
        }
        let mut coefficients = Vec::with_capacity(all.len());
        for m in 0..all.len() {
            let of_motion: Vec<Complex<f64>> = spectrum.coefficients.iter().map(|c| c[m]).collect();
            coefficients.push(of_motion);
        }
        let known = coefficients.split_off(motions.len());
        let mut normed = Vec::with_capacity(motions.len());
        for mut coefficients in coefficients {
            let left = left_by(&known, &coefficients, &vec![1.0; count]);
            let mean = left.iter().sum::<f64>() / count as f64;
            if mean <= 0.0 || !mean.is_finite() {
                return None;
            }
            coefficients.iter_mut().for_each(|c| *c /= mean.sqrt());
            normed.push(Motion { coefficients, mean });
        }
        Some(Self {
            frequencies_hz: spectrum.frequencies_hz,
            motions: normed,
            known,
            ancestors,
            within_hz,
        })
    }

    /// The power of a motion, by frequency, without the likeliest multiples of the known ones.
    fn left(&self, expected: &[f64], motion: usize) -> Vec<f64> {
        left_by(&self.known, &self.motions[motion].coefficients, expected)
    }

    /// The likeliest fit of up to `most` oscillators; `None` where `cancel` ends the work before.
    pub fn likeliest(&self, most: usize, cancel: &CancelToken) -> Option<Fit<'_>> {
        let mut best = self.fit(&[], cancel);
        for _ in 0..most {
            let mut next: Option<Fit> = None;
            for frequency_hz in best.excess_hz() {
                if cancel.is_cancelled() {
                    return None;
                }
                let mut start = best.modes();
                start.push(Mode {
                    frequency_hz,
                    damping: USUAL_DAMPING,
                });
                let fit = self.fit(&start, cancel);
                if next.as_ref().is_none_or(|n| fit.criterion < n.criterion) {
                    next = Some(fit);
                }
            }
            match next {
                Some(next) if next.criterion < best.criterion => best = next,
                _ => break,
            }
        }
        (!cancel.is_cancelled()).then_some(best)
    }

    /// The likeliest fit of as many oscillators as there are modes to begin with.
    fn fit(&self, start: &[Mode], cancel: &CancelToken) -> Fit<'_> {
        let likelihood = Likelihood {
            driven: self,
            oscillators: start.len(),
        };
        let (x, bounds) = likelihood.start(start);
        let (x, cost) = minimum(&likelihood, &x, &bounds, &STOPPING, cancel);
        let frequencies = self.frequencies_hz.len() as f64;
        Fit {
            criterion: 2.0 * cost + x.len() as f64 * frequencies.ln(),
            likelihood,
            x,
        }
    }
}

impl Fit<'_> {
    /// Those that were found; one for whose frequency the likelihood has no top is at the limit.
    pub fn oscillators(&self) -> Vec<Oscillator> {
        let Some(known) = Known::of(curvature_of_slopes(&self.likelihood, &self.x)) else {
            return Vec::new();
        };
        let count = self.likelihood.oscillators;
        let ln_frequencies = self.likelihood.driven.within_hz.map(f64::ln);
        let ln_dampings = DAMPING.map(f64::ln);
        let mut out = Vec::with_capacity(count);
        for (k, mode) in self.modes().into_iter().enumerate() {
            let deviation = known.deviation(k);
            let is_inside =
                ln_frequencies.is_between(self.x[k]) && ln_dampings.is_between(self.x[count + k]);
            out.push(Oscillator {
                mode,
                ln_sd: LnDeviations {
                    frequency: deviation.unwrap_or(f64::INFINITY),
                    damping: known.deviation(count + k).unwrap_or(f64::INFINITY),
                },
                variance: self.variance(k),
                at_limit: deviation.is_none() || !is_inside,
            });
        }
        out
    }

    /// Share that an oscillator has of the power of the first motion, by frequency (Wiener's filter).
    /// Gusts are white here: the slow motion that red ones make is not the oscillator's alone.
    /// Noise has at least the power `noise`, px²/Hz.
    pub fn shares(&self, oscillator: usize, noise: f64) -> Vec<f64> {
        let likelihood = &self.likelihood;
        let driven = likelihood.driven;
        let exponent = self.gust_exponent();
        let rest = likelihood.rest();
        let of_noise = self.x[rest.noise].exp().max(noise / driven.motions[0].mean);
        let mut modes = self.modes();
        modes.extend(&driven.ancestors);
        let mut peaks = Vec::with_capacity(modes.len());
        for (k, mode) in modes.iter().enumerate() {
            let peak = self.x[likelihood.peak(k, 0)].exp();
            peaks.push(peak * gust(mode.frequency_hz, exponent));
        }
        let mut out = Vec::with_capacity(driven.frequencies_hz.len());
        for frequency_hz in &driven.frequencies_hz {
            let mut all = of_noise + self.x[rest.drift].exp() * gust(*frequency_hz, exponent);
            let mut own = 0.0;
            for (k, mode) in modes.iter().enumerate() {
                let power = Part::of(mode, peaks[k], *frequency_hz).power;
                all += power;
                if k == oscillator {
                    own = power;
                }
            }
            out.push(own / all);
        }
        out
    }

    fn modes(&self) -> Vec<Mode> {
        modes(&self.x, self.likelihood.oscillators)
    }

    fn gust_exponent(&self) -> f64 {
        self.x[self.x.len() - 1]
    }

    /// Of all motions: the power at the peak, over the width of the peak.
    fn variance(&self, k: usize) -> f64 {
        let mode = self.modes()[k];
        let gust = gust(mode.frequency_hz, self.gust_exponent());
        let mut peaks = 0.0;
        for (m, motion) in self.likelihood.driven.motions.iter().enumerate() {
            peaks += self.x[self.likelihood.peak(k, m)].exp() * motion.mean;
        }
        peaks * gust * PI * mode.frequency_hz * mode.damping
    }

    /// Where motions have more power than is expected of them, Hz, the most surprising first. By
    /// Whittle's likelihood, with each band's power as it is rather than as is expected.
    fn excess_hz(&self) -> Vec<f64> {
        let frequencies_hz = &self.likelihood.driven.frequencies_hz;
        let mut gains = vec![0.0; frequencies_hz.len()];
        for m in 0..self.likelihood.driven.motions.len() {
            let expected = self.likelihood.expected(&self.x, m);
            let left = self.likelihood.driven.left(&expected.powers, m);
            let ratios: Vec<f64> = left
                .iter()
                .zip(&expected.powers)
                .map(|(l, e)| l / e)
                .collect();
            for (k, gain) in gains.iter_mut().enumerate() {
                *gain += gain_of_band(&ratios, k, frequencies_hz);
            }
        }
        let mut peaks: Vec<usize> = (0..gains.len()).filter(|k| is_peak(&gains, *k)).collect();
        peaks.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]));
        peaks.truncate(MOST_PEAKS);
        peaks.iter().map(|k| frequencies_hz[*k]).collect()
    }
}

/// The power by frequency of what has some coefficients, without the multiples of `known` ones that
/// are likeliest where the `expected` power is left.
fn left_by(
    known: &[Vec<Complex<f64>>],
    coefficients: &[Complex<f64>],
    expected: &[f64],
) -> Vec<f64> {
    let count = known.len();
    let mut normal = DMatrix::<f64>::zeros(count, count);
    let mut right = DVector::<f64>::zeros(count);
    for (a, of_a) in known.iter().enumerate() {
        for (k, expected) in expected.iter().enumerate() {
            let weighted = of_a[k].conj() / *expected;
            right[a] += (weighted * coefficients[k]).re;
            for (b, of_b) in known.iter().enumerate().take(a + 1) {
                normal[(a, b)] += (weighted * of_b[k]).re;
            }
        }
    }
    normal.fill_upper_triangle_with_lower_triangle();
    let multiples = normal.cholesky().map(|c| c.solve(&right));
    let multiples = multiples.unwrap_or_else(|| DVector::zeros(count));
    let mut out = Vec::with_capacity(expected.len());
    for (k, coefficient) in coefficients.iter().enumerate() {
        let mut left = *coefficient;
        for (of_known, multiple) in known.iter().zip(&multiples) {
            left -= of_known[k] * *multiple;
        }
        out.push(left.norm_sqr());
    }
    out
}

fn is_peak(gains: &[f64], k: usize) -> bool {
    let near = &gains[k.saturating_sub(1)..(k + 2).min(gains.len())];
    gains[k] > 0.0 && near.iter().all(|gain| *gain <= gains[k])
}

/// Gain of likelihood by the mean of a band about `k` as it is.
fn gain_of_band(ratios: &[f64], k: usize, frequencies_hz: &[f64]) -> f64 {
    let step_hz = frequencies_hz[1] - frequencies_hz[0];
    let half = (HALF_BAND * frequencies_hz[k] / step_hz).round().max(1.0) as usize;
    let band = &ratios[k.saturating_sub(half)..(k + half + 1).min(ratios.len())];
    let mean = band.iter().sum::<f64>() / band.len() as f64;
    if mean > 1.0 {
        band.len() as f64 * (mean - 1.0 - mean.ln())
    } else {
        0.0
    }
}

/// Power of gusts.
fn gust(frequency_hz: f64, exponent: f64) -> f64 {
    (frequency_hz / GUST_HZ).powf(exponent)
}

fn modes(x: &[f64], count: usize) -> Vec<Mode> {
    let mut out = Vec::with_capacity(count);
    for k in 0..count {
        out.push(Mode {
            frequency_hz: x[k].exp(),
            damping: x[count + k].exp(),
        });
    }
    out
}

/// Minus the logarithm of the likelihood of some oscillators, with the priors on the damping and on
/// the gusts. The parameters are the logarithms of all frequencies, of all damping ratios, of the
/// powers at the peak, where gusts have a power of 1, of all oscillators and ancestors by motion, then
/// of the powers of drift there and of noise by motion; the last is the exponent of the gusts.
struct Likelihood<'a> {
    driven: &'a Driven,
    oscillators: usize,
}

/// Places of the first motion's drift and noise among the parameters.
struct Rest {
    drift: usize,
    noise: usize,
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

/// What is expected of one motion.
struct Expected {
    /// By frequency.
    powers: Vec<f64>,
    gusts: Vec<f64>,
    /// By frequency, each oscillator's and ancestor's.
    parts: Vec<Part>,
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
    /// Oscillators and ancestors.
    fn parts(&self) -> usize {
        self.oscillators + self.driven.ancestors.len()
    }

    /// Place of the power of a part in a motion among the parameters.
    fn peak(&self, part: usize, motion: usize) -> usize {
        2 * self.oscillators + part * self.driven.motions.len() + motion
    }

    fn rest(&self) -> Rest {
        let drift = self.peak(self.parts(), 0);
        Rest {
            drift,
            noise: drift + self.driven.motions.len(),
        }
    }

    /// Where the search begins, and the bounds within which it stays.
    fn start(&self, modes: &[Mode]) -> (Vec<f64>, Vec<Bounds>) {
        let motions = self.driven.motions.len();
        let mut x: Vec<f64> = modes.iter().map(|m| m.frequency_hz.ln()).collect();
        x.extend(modes.iter().map(|m| m.damping.ln()));
        x.extend(vec![FIRST_PEAK.ln(); self.parts() * motions]);
        x.extend(vec![FIRST_DRIFT.ln(); motions]);
        x.extend(vec![FIRST_NOISE.ln(); motions]);
        x.push(GUST_EXPONENT);
        let mut bounds = vec![LN_POWERS; x.len()];
        let count = self.oscillators;
        bounds[..count].fill(self.driven.within_hz.map(f64::ln));
        bounds[count..2 * count].fill(DAMPING.map(f64::ln));
        bounds[x.len() - 1] = GUST_EXPONENTS;
        (x, bounds)
    }

    fn expected(&self, x: &[f64], motion: usize) -> Expected {
        let rest = self.rest();
        let drift = x[rest.drift + motion].exp();
        let noise = x[rest.noise + motion].exp();
        let exponent = x[x.len() - 1];
        let mut modes = modes(x, self.oscillators);
        modes.extend(&self.driven.ancestors);
        let peaks: Vec<f64> = (0..modes.len())
            .map(|k| x[self.peak(k, motion)].exp())
            .collect();
        let frequencies_hz = &self.driven.frequencies_hz;
        let mut out = Expected {
            powers: Vec::with_capacity(frequencies_hz.len()),
            gusts: Vec::with_capacity(frequencies_hz.len()),
            parts: Vec::with_capacity(frequencies_hz.len() * modes.len()),
        };
        for frequency_hz in frequencies_hz {
            let gust = gust(*frequency_hz, exponent);
            let mut power = noise + drift * gust;
            for (mode, peak) in modes.iter().zip(&peaks) {
                let part = Part::of(mode, peak * gust, *frequency_hz);
                power += part.power;
                out.parts.push(part);
            }
            out.powers.push(power);
            out.gusts.push(gust);
        }
        out
    }

    /// The value, and its first derivatives; those by the multiples of known motions are zero at
    /// their best.
    fn value_and_slopes(&self, x: &[f64]) -> (f64, DVector<f64>) {
        let count = self.oscillators;
        let mut slopes = DVector::zeros(x.len());
        let of_exponent = x.len() - 1;
        let off = (x[of_exponent] - GUST_EXPONENT) / GUST_EXPONENT_SD;
        let mut cost = 0.5 * off * off;
        slopes[of_exponent] = off / GUST_EXPONENT_SD;
        for k in count..2 * count {
            cost += 0.5 * damping_penalty(x[k]);
            slopes[k] += LN_DAMPING_WEIGHT * (x[k] - USUAL_DAMPING.ln());
        }
        for motion in 0..self.driven.motions.len() {
            cost += self.add_slopes_of(motion, x, &mut slopes);
        }
        (cost, slopes)
    }

    /// The value of one motion, whose derivatives are added to the `slopes`.
    fn add_slopes_of(&self, motion: usize, x: &[f64], slopes: &mut DVector<f64>) -> f64 {
        let (count, parts) = (self.oscillators, self.parts());
        let rest = self.rest();
        let drift = x[rest.drift + motion].exp();
        let noise = x[rest.noise + motion].exp();
        let expected = self.expected(x, motion);
        let left = self.driven.left(&expected.powers, motion);
        let mut cost = 0.0;
        for (k, frequency_hz) in self.driven.frequencies_hz.iter().enumerate() {
            let (power, gust) = (expected.powers[k], expected.gusts[k]);
            cost += power.ln() + left[k] / power;
            let by_power = (1.0 - left[k] / power) / power;
            for (p, part) in expected.parts[k * parts..][..parts].iter().enumerate() {
                let by_part = by_power * part.power;
                if p < count {
                    slopes[p] += by_part * part.by_ln_frequency;
                    slopes[count + p] += by_part * part.by_ln_damping;
                }
                slopes[self.peak(p, motion)] += by_part;
            }
            slopes[rest.drift + motion] += by_power * drift * gust;
            slopes[rest.noise + motion] += by_power * noise;
            slopes[x.len() - 1] += by_power * (power - noise) * (frequency_hz / GUST_HZ).ln();
        }
        cost
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
        let driven = Driven::new(&[angles.to_vec()], &[], times_s, Vec::new(), WITHIN_HZ)?;
        let all = driven.likeliest(2, cancel)?.oscillators().into_iter();
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

    /// The large sway of the carrier, which its points show, does not hide the small one of the branch.
    #[test]
    fn a_small_sway_beside_a_large_one_that_is_known_is_found() {
        let (carried, times_s) = driven(&[0.5], 1200, 1);
        let (own, _) = driven(&[0.9], 1200, 2);
        let mut random = generator(3, 0);
        let mut all = Vec::new();
        for (carried, own) in carried.iter().zip(&own) {
            all.push(10.0 * carried + own + 1e-3 * random.random_range(-1.0..1.0));
        }
        for (known, wanted_hz) in [(Vec::new(), 0.5), (vec![carried], 0.9)] {
            let motion = std::slice::from_ref(&all);
            let driven = Driven::new(motion, &known, &times_s, Vec::new(), WITHIN_HZ);
            let driven = driven.expect("a spectrum");
            let fit = driven.likeliest(1, &CancelToken::new()).expect("a fit");
            let found_hz = fit.oscillators()[0].mode.frequency_hz;
            let off = (found_hz / wanted_hz).ln();
            assert!(off.abs() < 0.05, "{found_hz}, not {wanted_hz}");
            // What the filter lets through is about that frequency.
            let shares = fit.shares(0, 0.0);
            let peak = (0..shares.len()).max_by(|a, b| shares[*a].total_cmp(&shares[*b]));
            let peak_hz = driven.frequencies_hz[peak.expect("a share")];
            assert!((peak_hz / wanted_hz).ln().abs() < 0.1, "{peak_hz}");
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
        let (other, _) = driven(&[0.9], 600, 2);
        let (known, _) = driven(&[0.7], 600, 3);
        let ancestor = Mode {
            frequency_hz: 0.7,
            damping: 0.04,
        };
        let driven = Driven::new(
            &[angles, other],
            &[known],
            &times_s,
            vec![ancestor],
            WITHIN_HZ,
        )
        .expect("a spectrum");
        let likelihood = Likelihood {
            driven: &driven,
            oscillators: 2,
        };
        let x = [
            -0.6, 0.2, -3.2, -2.8, 1.5, 0.5, -1.0, -2.0, 0.3, 0.6, -1.0, -2.0, -1.2, 0.4, -1.6,
        ];
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
