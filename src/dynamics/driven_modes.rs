//! Modes that wind drives, from the Fourier coefficients of a few motions in one band.
//!
//! Bayesian operational modal analysis (Au 2011, 2012): a mode is an oscillator with a real shape;
//! gusts drive the modes, in part the same ones; what is left is white. The likelihood of the
//! coefficients is Whittle's (1951). It tells how many modes there are, their frequencies, damping
//! ratios and shapes, and by its curvature how sure these are.

use super::branches::LnDeviations;
use super::decay::{LN_DAMPING_WEIGHT, Mode, USUAL_DAMPING, damping_penalty};
use super::driven_likelihood::Spanned;
use super::driven_oscillators::DAMPING;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::bfgs::{Cost, Stopping, curvature_of_slopes, minimum};
use nalgebra::{Complex, DMatrix, DVector, SMatrix, SVector, SymmetricEigen};
use std::f64::consts::{PI, TAU};

/// Motions that the likelihood is of.
pub(super) const MOTIONS: usize = 6;
/// Power of gusts falls with frequency by this exponent (Kolmogorov 1941).
pub(super) const GUST_EXPONENT: f64 = -5.0 / 3.0;
/// Of Schwarz's penalty this share is asked of a mode: modes near each other would be one by all of
/// it. Found on made films (docs/design/sway.md).
const PENALTY_SHARE: f64 = 0.5;
/// Power of the noise that the search begins with, as a share of the mean of the motions.
const FIRST_NOISE: f64 = 0.01;
/// When the search is done.
const STOPPING: Stopping = Stopping {
    max_steps: 300,
    small_steps: 3,
    min_gain: 1e-4,
};
/// The likelihood is flat in a direction with less curvature than this. Of a parameter that is known
/// no more than such a share of its square lies in flat directions.
const FLAT: f64 = 1e-3;
const MOST_FLAT: f64 = 0.01;

pub(super) type Coefficient = SVector<Complex<f64>, MOTIONS>;
/// What a mode does to each motion of a band, of length 1.
pub(super) type Shape = SVector<f64, MOTIONS>;

/// Fourier coefficients of many motions.
pub(super) struct Spectrum {
    pub frequencies_hz: Vec<f64>,
    /// By frequency; the square of each is the power density, px²/Hz.
    pub coefficients: Vec<DVector<Complex<f64>>>,
}

impl Spectrum {
    /// Of motions at `times_s`, at whole numbers of periods.
    pub fn of(motions: &[Vec<f64>], times_s: &[f64], within_hz: Bounds) -> Self {
        let ends = times_s.first().zip(times_s.last());
        let span_s = ends.map_or(0.0, |(first, last)| last - first);
        let density = (2.0 * span_s).sqrt() / times_s.len().max(1) as f64;
        let first = (within_hz.lo * span_s).ceil() as usize;
        let end = (within_hz.hi * span_s).floor() as usize + 1;
        // What every frame counts at every frequency.
        let frequencies = end.saturating_sub(first);
        let mut real = DMatrix::zeros(frequencies, times_s.len());
        let mut imaginary = real.clone();
        for (frame, time_s) in times_s.iter().enumerate() {
            let step = -TAU * time_s / span_s;
            let mut wave = Complex::from_polar(density, step * first as f64);
            let step = Complex::from_polar(1.0, step);
            for k in 0..frequencies {
                (real[(k, frame)], imaginary[(k, frame)]) = (wave.re, wave.im);
                wave *= step;
            }
        }
        let motions = DMatrix::from_fn(times_s.len(), motions.len(), |k, m| motions[m][k]);
        let (real, imaginary) = (real * &motions, imaginary * motions);
        let coefficients = real.zip_map(&imaginary, Complex::new);
        Self {
            frequencies_hz: (first..end).map(|k| k as f64 / span_s).collect(),
            coefficients: coefficients.row_iter().map(|row| row.transpose()).collect(),
        }
    }
}

/// What a likelihood is of: coefficients of [`MOTIONS`] motions, and the gusts that drive them.
pub(super) struct Observed {
    pub frequencies_hz: Vec<f64>,
    pub coefficients: Vec<Coefficient>,
    /// Square root of the power of the gusts at every frequency.
    pub gusts: Vec<f64>,
}

/// The [`MOTIONS`] largest motions of a spectrum in a band.
pub(super) struct Band {
    /// The gusts are a share of those in the middle.
    observed: Observed,
    /// Each motion of the spectrum by those of the band, px.
    by_motion: DMatrix<f64>,
    /// Directions of the band's motions among the spectrum's, divided by their scales.
    onto: DMatrix<f64>,
    within_hz: Bounds,
}

/// Where the search for a mode begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub frequency_hz: f64,
    pub shape: Shape,
}

/// What is known of one mode.
#[derive(Clone, Debug)]
pub(super) struct DrivenMode {
    pub mode: Mode,
    /// By the curvature of the likelihood.
    pub ln_sd: LnDeviations,
    /// Whether it stands where the search ends.
    pub at_limit: bool,
    /// What it does to every motion of the spectrum: root of the mean square, with a sign, px.
    pub motions_px: DVector<f64>,
}

/// A fit of some modes.
#[derive(Clone)]
pub(super) struct Fit {
    modes: usize,
    x: Vec<f64>,
    cost: f64,
}

/// The parameters of a fit.
pub(super) struct Parameters<'a> {
    pub ln_frequencies: &'a [f64],
    pub ln_dampings: &'a [f64],
    /// By mode, of any length.
    shapes: &'a [f64],
    /// What drives the modes: the lower triangle of a factor of its spectral matrix, the diagonal
    /// first, then by row, real and imaginary parts.
    forces: &'a [f64],
    pub noise: f64,
}

impl<'a> Parameters<'a> {
    pub fn of(modes: usize, x: &'a [f64]) -> Self {
        let (ln_frequencies, rest) = x.split_at(modes);
        let (ln_dampings, rest) = rest.split_at(modes);
        let (shapes, rest) = rest.split_at(modes * MOTIONS);
        let (forces, noise) = rest.split_at(modes * modes);
        Self {
            ln_frequencies,
            ln_dampings,
            shapes,
            forces,
            noise: noise[0].exp(),
        }
    }

    pub fn shape(&self, mode: usize) -> Shape {
        self.shape_of_any_length(mode) / self.length(mode)
    }

    pub fn length(&self, mode: usize) -> f64 {
        let length = self.shape_of_any_length(mode).norm();
        length.max(f64::MIN_POSITIVE)
    }

    fn shape_of_any_length(&self, mode: usize) -> Shape {
        Shape::from_column_slice(&self.shapes[mode * MOTIONS..(mode + 1) * MOTIONS])
    }

    /// Power of the force that drives a mode, where the gusts are 1.
    pub fn power(&self, mode: usize) -> f64 {
        let mut power = 0.0;
        for column in 0..=mode {
            power += self.force(mode, column).norm_sqr();
        }
        power
    }

    /// Row `row` and column `column` of the factor.
    pub fn force(&self, row: usize, column: usize) -> Complex<f64> {
        if row == column {
            return Complex::new(self.forces[row], 0.0);
        }
        let at = force_at(self.ln_frequencies.len(), row, column);
        Complex::new(self.forces[at], self.forces[at + 1])
    }

    pub fn mode(&self, mode: usize) -> Mode {
        Mode {
            frequency_hz: self.ln_frequencies[mode].exp(),
            damping: self.ln_dampings[mode].exp(),
        }
    }
}

/// Place of a factor beside the diagonal among the forces.
pub(super) fn force_at(modes: usize, row: usize, column: usize) -> usize {
    modes + row * (row - 1) + 2 * column
}

/// The integral over all frequencies of the square of a mode's response to a force.
pub(super) fn integral_of_response(mode: &Mode) -> f64 {
    PI * mode.frequency_hz / (4.0 * mode.damping)
}

impl Observed {
    /// Divides the coefficients so that all together have a mean square of 1, and gives by what.
    pub fn scale_to_one(&mut self) -> f64 {
        let squares: f64 = self.coefficients.iter().map(|c| c.norm_squared()).sum();
        let scale = (squares / self.values()).sqrt().max(f64::MIN_POSITIVE);
        for coefficient in &mut self.coefficients {
            *coefficient /= Complex::from(scale);
        }
        scale
    }

    /// Number of the values that they are.
    pub fn values(&self) -> f64 {
        (self.coefficients.len() * MOTIONS).max(1) as f64
    }

    /// The places of all frequencies, those nearest to one first.
    pub fn nearest_to(&self, frequency_hz: f64) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.coefficients.len()).collect();
        let distance = |k: &usize| (self.frequencies_hz[*k] - frequency_hz).abs();
        order.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        order
    }

    /// The shape in which most moves near a frequency.
    pub fn shape_near(&self, frequency_hz: f64) -> Shape {
        let mut products = SMatrix::<f64, MOTIONS, MOTIONS>::zeros();
        for k in self.nearest_to(frequency_hz).iter().take(4) {
            let coefficient = &self.coefficients[*k];
            products += (coefficient * coefficient.adjoint()).map(|c| c.re);
        }
        let eigen = SymmetricEigen::new(products);
        let largest = eigen.eigenvalues.imax();
        eigen.eigenvectors.column(largest).into_owned()
    }
}

impl Band {
    /// `None` where the band has too few frequencies for one mode.
    pub fn of(spectrum: &Spectrum, within_hz: Bounds) -> Option<Self> {
        let frequencies = spectrum.frequencies_hz.iter().enumerate();
        let inside: Vec<usize> = frequencies
            .filter(|(_, f)| within_hz.contains(**f))
            .map(|(k, _)| k)
            .collect();
        let motions = spectrum.coefficients.first()?.len();
        if inside.len() < MOTIONS || motions < MOTIONS {
            return None;
        }
        let mut products = DMatrix::<f64>::zeros(motions, motions);
        for &k in &inside {
            let coefficient = &spectrum.coefficients[k];
            for part in [coefficient.map(|c| c.re), coefficient.map(|c| c.im)] {
                products.ger(1.0, &part, &part, 1.0);
            }
        }
        let eigen = SymmetricEigen::new(products);
        let mut order: Vec<usize> = (0..motions).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let mut by_motion = DMatrix::zeros(motions, MOTIONS);
        let mut onto = DMatrix::zeros(MOTIONS, motions);
        for (i, &k) in order.iter().take(MOTIONS).enumerate() {
            // Each by the square root of its size: the small ones tell near modes apart, but are
            // the noisier ones.
            let scale = eigen.eigenvalues[k].max(0.0).powf(0.25);
            let scale = scale.max(f64::MIN_POSITIVE);
            let direction = eigen.eigenvectors.column(k);
            by_motion.set_column(i, &(direction * scale));
            onto.set_row(i, &(direction.transpose() / scale));
        }
        let complex_onto = onto.map(Complex::from);
        let mut observed = Observed {
            frequencies_hz: Vec::with_capacity(inside.len()),
            coefficients: Vec::with_capacity(inside.len()),
            gusts: Vec::with_capacity(inside.len()),
        };
        for k in inside {
            let frequency_hz = spectrum.frequencies_hz[k];
            let coefficient = &complex_onto * &spectrum.coefficients[k];
            observed.frequencies_hz.push(frequency_hz);
            observed.gusts.push(gust(frequency_hz, within_hz));
            let coefficient = Coefficient::from_column_slice(coefficient.as_slice());
            observed.coefficients.push(coefficient);
        }
        let scale = observed.scale_to_one();
        Some(Self {
            observed,
            by_motion: by_motion * scale,
            onto: onto / scale,
            within_hz,
        })
    }

    /// A shape of the spectrum's motions in those of the band; `None` for one that is not in them.
    pub fn shape_of(&self, motions: &DVector<f64>) -> Option<Shape> {
        let shape = &self.onto * motions;
        let shape = Shape::from_column_slice(shape.as_slice());
        shape.try_normalize(f64::MIN_POSITIVE)
    }

    /// The shape in which most moves near a frequency.
    pub fn shape_near(&self, frequency_hz: f64) -> Shape {
        self.observed.shape_near(frequency_hz)
    }

    /// Where along a shape, and across those of `others`, most moves, Hz.
    pub fn peak_hz(&self, shape: &Shape, others: &[Shape]) -> f64 {
        let mut along = *shape;
        let mut basis: Vec<Shape> = Vec::new();
        for other in others {
            let mut rest = *other;
            for b in &basis {
                rest -= b * b.dot(other);
            }
            basis.extend(rest.try_normalize(1e-6));
        }
        for b in &basis {
            along -= b * b.dot(shape);
        }
        let along = along.map(Complex::from);
        let observed = self.observed.coefficients.iter();
        let powers = observed
            .zip(&self.observed.gusts)
            .map(|(c, g)| along.dot(c).norm_sqr() / (g * g));
        let powers: Vec<f64> = powers.collect();
        // Of three neighbours together: single coefficients are chance.
        let mut best = (0, f64::NEG_INFINITY);
        for k in 0..powers.len() {
            let near = &powers[k.saturating_sub(1)..(k + 2).min(powers.len())];
            let mean = near.iter().sum::<f64>() / near.len() as f64;
            if mean > best.1 {
                best = (k, mean);
            }
        }
        self.observed.frequencies_hz[best.0]
    }

    /// The likeliest modes, from these starts on; modes that gain too little are left out.
    pub fn fit(&self, starts: &[Start], cancel: &CancelToken) -> Fit {
        let mut fit = self.search(self.first(starts), starts.len(), cancel);
        while fit.modes > 1 && !cancel.is_cancelled() {
            let fewer = (0..fit.modes).map(|m| {
                let without = self.without(&fit, m);
                self.search(without, fit.modes - 1, cancel)
            });
            let Some(best) = fewer.min_by(|a, b| a.cost.total_cmp(&b.cost)) else {
                break;
            };
            if self.criterion(&best) >= self.criterion(&fit) {
                break;
            }
            fit = best;
        }
        fit
    }

    /// Of Schwarz (1978), with a share of the penalty.
    fn criterion(&self, fit: &Fit) -> f64 {
        // A shape's length says nothing.
        let parameters = (fit.x.len() - fit.modes) as f64;
        2.0 * fit.cost + PENALTY_SHARE * parameters * self.observed.values().ln()
    }

    fn first(&self, starts: &[Start]) -> Vec<f64> {
        let modes = starts.len();
        let mut x: Vec<f64> = starts.iter().map(|s| s.frequency_hz.ln()).collect();
        x.extend(vec![USUAL_DAMPING.ln(); modes]);
        let mut forces = vec![0.0; modes * modes];
        for (start, force) in starts.iter().zip(&mut forces) {
            x.extend(start.shape.iter());
            let Observed {
                frequencies_hz,
                coefficients,
                ..
            } = &self.observed;
            let next = frequencies_hz.partition_point(|f| *f < start.frequency_hz);
            let next = next.min(coefficients.len() - 1);
            let along = coefficients[next].norm().max(0.1);
            *force = along * 2.0 * USUAL_DAMPING;
        }
        x.extend(forces);
        x.push(FIRST_NOISE.ln());
        x
    }

    /// The parameters without mode `out`: the forces on the others stay what they are.
    fn without(&self, fit: &Fit, out: usize) -> Vec<f64> {
        let parameters = Parameters::of(fit.modes, &fit.x);
        let kept: Vec<usize> = (0..fit.modes).filter(|m| *m != out).collect();
        let mut factor = DMatrix::<Complex<f64>>::zeros(kept.len(), fit.modes);
        for (row, &m) in kept.iter().enumerate() {
            for column in 0..=m {
                factor[(row, column)] = parameters.force(m, column);
            }
        }
        let product = &factor * factor.adjoint();
        let mut forces = vec![0.0; kept.len() * kept.len()];
        for (i, force) in forces.iter_mut().take(kept.len()).enumerate() {
            *force = product[(i, i)].re.sqrt();
        }
        if let Some(cholesky) = product.cholesky() {
            let l = cholesky.l();
            for row in 0..kept.len() {
                forces[row] = l[(row, row)].re;
                for column in 0..row {
                    let at = force_at(kept.len(), row, column);
                    forces[at] = l[(row, column)].re;
                    forces[at + 1] = l[(row, column)].im;
                }
            }
        }
        let mut x: Vec<f64> = kept.iter().map(|m| parameters.ln_frequencies[*m]).collect();
        x.extend(kept.iter().map(|m| parameters.ln_dampings[*m]));
        for &m in &kept {
            x.extend(parameters.shape(m).iter());
        }
        x.extend(forces);
        x.push(parameters.noise.ln());
        x
    }

    fn search(&self, from: Vec<f64>, modes: usize, cancel: &CancelToken) -> Fit {
        let any = Bounds::new(-1e3, 1e3);
        let mut bounds = vec![any; from.len()];
        bounds[..modes].fill(self.within_hz.map(f64::ln));
        bounds[modes..2 * modes].fill(DAMPING.map(f64::ln));
        let cost = Likelihood {
            observed: &self.observed,
            modes,
        };
        let (x, cost) = minimum(&cost, &from, &bounds, &STOPPING, cancel);
        Fit { modes, x, cost }
    }

    /// What is known of the modes of a fit; those that the likelihood has no top for are left out.
    pub fn modes(&self, fit: &Fit) -> Vec<DrivenMode> {
        let parameters = Parameters::of(fit.modes, &fit.x);
        let cost = Likelihood {
            observed: &self.observed,
            modes: fit.modes,
        };
        let sharpness = curvature_of_slopes(&cost, &fit.x);
        let Some(known) = Known::of(sharpness) else {
            return Vec::new();
        };
        let mut out = Vec::with_capacity(fit.modes);
        for m in 0..fit.modes {
            let deviations = (known.deviation(m), known.deviation(fit.modes + m));
            let (Some(frequency), Some(damping)) = deviations else {
                continue;
            };
            let mode = parameters.mode(m);
            let gust = gust(mode.frequency_hz, self.within_hz);
            let response = integral_of_response(&mode);
            let rms = (parameters.power(m) * gust * gust * response).sqrt();
            let shape = DVector::from_column_slice(parameters.shape(m).as_slice());
            let limits = DAMPING.map(f64::ln);
            let ln_damping = parameters.ln_dampings[m];
            let within = self.within_hz.map(f64::ln);
            let ln_frequency = parameters.ln_frequencies[m];
            out.push(DrivenMode {
                mode,
                ln_sd: LnDeviations { frequency, damping },
                at_limit: !limits.is_between(ln_damping) || !within.is_between(ln_frequency),
                motions_px: &self.by_motion * shape * rms,
            });
        }
        out
    }
}

/// Square root of the power of gusts at a frequency, as a share of that in the middle of a band.
fn gust(frequency_hz: f64, within_hz: Bounds) -> f64 {
    let middle_hz = (within_hz.lo * within_hz.hi).sqrt();
    (frequency_hz / middle_hz).powf(0.5 * GUST_EXPONENT)
}

/// Minus the logarithm of the likelihood of some modes, with the prior on the damping.
pub(super) struct Likelihood<'a> {
    pub observed: &'a Observed,
    /// 1 to 4.
    pub modes: usize,
}

impl Likelihood<'_> {
    fn prior(parameters: &Parameters) -> f64 {
        let dampings = parameters.ln_dampings.iter();
        dampings.map(|d| 0.5 * damping_penalty(*d)).sum()
    }

    fn value_of<const M: usize>(&self, parameters: &Parameters) -> f64 {
        Spanned::<M>::of(self.observed, parameters).value()
    }

    fn add_slopes<const M: usize>(&self, parameters: &Parameters, slopes: &mut DVector<f64>) {
        Spanned::<M>::of(self.observed, parameters).add_slopes(slopes);
    }
}

// The number of modes is known to the compiler, or this takes longer.
impl Cost for Likelihood<'_> {
    fn value(&self, x: &[f64]) -> f64 {
        let parameters = Parameters::of(self.modes, x);
        let cost = match self.modes {
            1 => self.value_of::<1>(&parameters),
            2 => self.value_of::<2>(&parameters),
            3 => self.value_of::<3>(&parameters),
            4 => self.value_of::<4>(&parameters),
            _ => f64::INFINITY,
        };
        Self::prior(&parameters) + cost
    }

    fn slopes(&self, x: &[f64]) -> DVector<f64> {
        let parameters = Parameters::of(self.modes, x);
        let mut slopes = DVector::zeros(x.len());
        match self.modes {
            1 => self.add_slopes::<1>(&parameters, &mut slopes),
            2 => self.add_slopes::<2>(&parameters, &mut slopes),
            3 => self.add_slopes::<3>(&parameters, &mut slopes),
            4 => self.add_slopes::<4>(&parameters, &mut slopes),
            _ => {}
        }
        for (m, ln_damping) in parameters.ln_dampings.iter().enumerate() {
            slopes[self.modes + m] += LN_DAMPING_WEIGHT * (ln_damping - USUAL_DAMPING.ln());
        }
        slopes
    }
}

/// How sure parameters are by the curvature of minus the logarithm of a likelihood in all of them.
/// Directions in which it is flat, as the length of a shape is, or in which the search has not
/// reached the top, are left as they are.
pub(super) struct Known(SymmetricEigen<f64, nalgebra::Dyn>);

impl Known {
    pub fn of(sharpness: DMatrix<f64>) -> Option<Self> {
        // The likelihood may end beside the place that was found.
        let is_finite = sharpness.iter().all(|x| x.is_finite());
        is_finite.then(|| Self(SymmetricEigen::new(sharpness)))
    }

    /// Standard deviation; `None` where the likelihood is flat.
    pub fn deviation(&self, parameter: usize) -> Option<f64> {
        let (mut variance, mut flat) = (0.0, 0.0);
        let directions = self.0.eigenvectors.column_iter();
        for (value, direction) in self.0.eigenvalues.iter().zip(directions) {
            let share = direction[parameter].powi(2);
            if *value > FLAT {
                variance += share / value;
            } else {
                flat += share;
            }
        }
        (flat < MOST_FLAT).then(|| variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;
    use rand::RngExt;

    /// A minute of a spectrum of chance.
    fn band() -> Band {
        let mut random = generator(7, 0);
        let mut spectrum = Spectrum {
            frequencies_hz: Vec::new(),
            coefficients: Vec::new(),
        };
        for k in 20..80 {
            spectrum.frequencies_hz.push(f64::from(k) / 60.0);
            let mut values = Vec::new();
            for motion in 0..8 {
                let size = 1.0 / (1.0 + motion as f64);
                let mut part = || size * random.random_range(-1.0..1.0);
                values.push(Complex::new(part(), part()));
            }
            spectrum.coefficients.push(DVector::from_vec(values));
        }
        Band::of(&spectrum, Bounds::new(0.4, 1.2)).expect("a band")
    }

    /// Starts of a search at some frequencies, a little off.
    fn near(band: &Band, frequencies_hz: &[f64]) -> Vec<f64> {
        let mut starts = Vec::new();
        for &frequency_hz in frequencies_hz {
            starts.push(Start {
                frequency_hz,
                shape: band.shape_near(frequency_hz),
            });
        }
        let mut x = band.first(&starts);
        for (i, x) in x.iter_mut().enumerate() {
            *x += 0.1 * (i as f64 * 1.7).sin();
        }
        x
    }

    /// By the whole spectral matrix of the motions.
    fn cost_by_definition(band: &Band, modes: usize, x: &[f64]) -> f64 {
        let parameters = Parameters::of(modes, x);
        let mut cost = Likelihood::prior(&parameters);
        for (k, coefficient) in band.observed.coefficients.iter().enumerate() {
            let noise = Complex::from(parameters.noise);
            let mut matrix = SMatrix::<_, MOTIONS, MOTIONS>::from_diagonal_element(noise);
            for part in 0..modes {
                let mut moved = Coefficient::zeros();
                for m in part..modes {
                    let Mode {
                        frequency_hz,
                        damping,
                    } = parameters.mode(m);
                    let ratio = band.observed.frequencies_hz[k] / frequency_hz;
                    let stiff = Complex::new(1.0 - ratio * ratio, 2.0 * damping * ratio);
                    let by = parameters.force(m, part) * band.observed.gusts[k] / stiff;
                    moved += parameters.shape(m).map(|s| by * s);
                }
                matrix += moved * moved.adjoint();
            }
            let inverse = matrix.try_inverse().expect("noise in all directions");
            cost += matrix.determinant().re.ln() + coefficient.dotc(&(inverse * coefficient)).re;
        }
        cost
    }

    #[test]
    fn the_cost_is_that_of_the_whole_spectral_matrix() {
        let band = band();
        for frequencies_hz in [&[0.6][..], &[0.6, 0.95], &[0.6, 0.7, 0.9, 1.1]] {
            let modes = frequencies_hz.len();
            let mut x = near(&band, frequencies_hz);
            let cost = Likelihood {
                observed: &band.observed,
                modes,
            };
            let wanted = cost_by_definition(&band, modes, &x);
            let found = cost.value(&x);
            assert!(
                (found - wanted).abs() < 1e-9 * wanted.abs(),
                "{modes} modes: {found}, not {wanted}"
            );
            // Modes of one shape span a direction less.
            let (first, last) = (2 * modes, 2 * modes + (modes - 1) * MOTIONS);
            x.copy_within(first..first + MOTIONS, last);
            let wanted = cost_by_definition(&band, modes, &x);
            let found = cost.value(&x);
            assert!(
                (found - wanted).abs() < 1e-9 * wanted.abs(),
                "{modes} modes, two of one shape: {found}, not {wanted}"
            );
        }
    }

    #[test]
    fn slopes_are_those_of_the_cost() {
        let band = band();
        for frequencies_hz in [&[0.6][..], &[0.6, 0.95], &[0.6, 0.7, 0.95]] {
            let x = near(&band, frequencies_hz);
            let cost = Likelihood {
                observed: &band.observed,
                modes: frequencies_hz.len(),
            };
            let slopes = cost.slopes(&x);
            for i in 0..x.len() {
                let sides = [1e-5, -1e-5].map(|by| {
                    let mut there = x.clone();
                    there[i] += by;
                    cost.value(&there)
                });
                let difference = (sides[0] - sides[1]) / 2e-5;
                let off = (difference - slopes[i]).abs();
                assert!(
                    off < 1e-4 * (1.0 + difference.abs()),
                    "{i}: {difference}, not {}",
                    slopes[i]
                );
            }
        }
    }

    /// Against the definition, at uneven times.
    #[test]
    fn a_spectrum_is_the_sum_over_all_frames() {
        let times_s: Vec<f64> = (0..90)
            .map(|k| 3.0 + 0.1 * f64::from(k) + 0.02 * f64::from(k * k % 7))
            .collect();
        let motion: Vec<f64> = times_s.iter().map(|t| (3.1 * t).sin() + 0.2 * t).collect();
        let span_s = times_s[89] - times_s[0];
        let within_hz = Bounds::new(0.3, 2.0);
        let found = Spectrum::of(std::slice::from_ref(&motion), &times_s, within_hz);
        assert_eq!(found.frequencies_hz.len(), found.coefficients.len());
        let ends = (
            found.frequencies_hz[0],
            found.frequencies_hz.last().copied(),
        );
        assert_eq!(ends, (3.0 / span_s, Some((2.0 * span_s).floor() / span_s)));
        for (frequency_hz, coefficient) in found.frequencies_hz.iter().zip(&found.coefficients) {
            let mut wanted = Complex::from(0.0);
            for (time_s, at) in times_s.iter().zip(&motion) {
                wanted += Complex::from_polar(*at, -TAU * frequency_hz * time_s);
            }
            wanted *= (2.0 * span_s).sqrt() / 90.0;
            assert!(
                (coefficient[0] - wanted).norm() < 1e-10 * (1.0 + wanted.norm()),
                "{frequency_hz} Hz: {}, not {wanted}",
                coefficient[0]
            );
        }
    }
}
