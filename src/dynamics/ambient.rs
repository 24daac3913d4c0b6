//! The fundamental of a tree in wind, from all its points at once.
//!
//! The points' motions are compressed to their principal components. Subspace identification says
//! near which frequencies modes are (`subspace.rs`); their number, frequencies, damping ratios,
//! shapes and how sure these are then follow from the likelihood of the Fourier coefficients about
//! the lowest one (Bayesian operational modal analysis: Au 2011, 2012; Whittle 1951). Modes as near
//! to each other as a trunk's and a limb's differ in their shapes.

use super::branches::LnDeviations;
use super::decay::{Mode, USUAL_DAMPING, damping_penalty};
use super::driven_oscillators::{DAMPING, Oscillator};
use super::film::Film;
use super::gap_free::GapFree;
use super::members::Points;
use super::subspace::{LAGS_S, stable_poles};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::bfgs::{ByDifferences, Stopping, curvature, minimum};
use crate::signal::principal::{PrincipalComponents, along};
use nalgebra::{Complex, DMatrix, SMatrix, SVector, SymmetricEigen};
use std::f64::consts::{PI, TAU};

/// Points that are used at most.
pub(super) const MOST_POINTS: usize = 120;
/// Principal motions that the likelihood is of, and that the subspace is of.
const MOTIONS: usize = 6;
const SUBSPACE_MOTIONS: usize = 8;
/// Modes about the fundamental at most.
const MOST_MODES: usize = 3;
/// The band about the fundamental, as shares of its frequency, and the lowest frequency in it, in
/// periods a film.
const BAND: Bounds = Bounds::new(0.6, 1.55);
const LEAST_PERIODS: f64 = 1.2;
/// Modes that nothing is known of stand by this factor above the one before.
const NEXT_MODE: f64 = 1.15;
/// The search for the best fit is begun anew from where it ended so often at most, and until it
/// gains less than this.
const SEARCHES: usize = 4;
const LEAST_GAIN: f64 = 0.1;
/// When one search is done.
const STOPPING: Stopping = Stopping {
    max_steps: 60,
    small_steps: 1,
    min_gain: 1e-2,
};
/// The likelihood is flat in a direction with less curvature than this. Of a parameter that is known
/// no more than such a share of its square lies in flat directions.
const FLAT: f64 = 1e-3;
const MOST_FLAT: f64 = 0.01;

type Coefficient = SVector<Complex<f64>, MOTIONS>;

/// The lowest mode of `points` in `frames` of `film`, each some neighbours taken together, looked
/// for `within_hz`. `None` where none is found, and where `cancel` ends the work before.
pub(super) fn fundamental(
    film: &Film,
    points: &Points,
    frames: &[Vec<usize>],
    within_hz: Bounds,
    cancel: &CancelToken,
) -> Option<Oscillator> {
    if 2 * points.tracks.len() < SUBSPACE_MOTIONS {
        return None;
    }
    let times_s: Vec<f64> = frames.iter().map(|of| film.mean_s(of)).collect();
    let motions = Motions::of(&GapFree::of(points, frames));
    let span_s = times_s.last()? - times_s.first()?;
    let step_s = span_s / times_s.len().max(2).saturating_sub(1) as f64;
    let poles = stable_poles(&motions.along, step_s, within_hz, &LAGS_S);
    let modes_hz: Vec<f64> = poles.iter().map(|p| p.frequency_hz).collect();
    let lowest_hz = modes_hz.first()?;
    let band_hz = Bounds::new(
        (BAND.lo * lowest_hz).max(LEAST_PERIODS / span_s),
        BAND.hi * lowest_hz,
    );
    let band = Band::of(&motions.along[..MOTIONS], &times_s, band_hz);
    let in_band: Vec<f64> = modes_hz.into_iter().filter(|f| *f < band_hz.hi).collect();
    let mut best: Option<Fit> = None;
    for count in 1..=MOST_MODES {
        for start in starts(&in_band, count) {
            if cancel.is_cancelled() {
                return None;
            }
            let fit = band.fit(&start, band_hz, cancel);
            if best.as_ref().is_none_or(|b| fit.criterion < b.criterion) {
                best = Some(fit);
            }
        }
    }
    band.lowest(&best?, &motions.scales)
}

/// Where the search for `count` modes begins, Hz.
fn starts(stable_hz: &[f64], count: usize) -> Vec<Vec<f64>> {
    let mut starts = Vec::new();
    for known in [count.min(stable_hz.len()), 1] {
        let mut start = stable_hz[..known].to_vec();
        while start.len() < count {
            start.push(NEXT_MODE * start[start.len() - 1]);
        }
        starts.push(start);
    }
    starts.dedup();
    starts
}

/// The principal motions of some points, each divided by the square root of its size: the small
/// ones tell the near modes apart, but are the noisier ones.
struct Motions {
    along: Vec<Vec<f64>>,
    /// What each was divided by, px.
    scales: Vec<f64>,
}

impl Motions {
    fn of(points: &GapFree) -> Self {
        let principal = PrincipalComponents::of_signals(&points.signals);
        let (mut motions, mut scales) = (Vec::new(), Vec::new());
        let all = principal.directions.iter().zip(&principal.variances);
        for (direction, variance) in all.take(SUBSPACE_MOTIONS) {
            let scale = variance.powf(0.25).max(f64::MIN_POSITIVE);
            let mut motion = along(&points.signals, direction);
            let mean = motion.iter().sum::<f64>() / motion.len().max(1) as f64;
            for x in &mut motion {
                *x = (*x - mean) / scale;
            }
            motions.push(motion);
            scales.push(scale);
        }
        Self {
            along: motions,
            scales,
        }
    }
}

/// Fourier coefficients of the motions in a band.
struct Band {
    frequencies_hz: Vec<f64>,
    /// Scaled so that the square of each is the power density, and all together have a mean
    /// square of 1.
    coefficients: Vec<Coefficient>,
    /// What they were divided by.
    scale: f64,
}

/// A fit of some modes.
struct Fit {
    modes: usize,
    x: Vec<f64>,
    /// Of Bayes and Schwarz.
    criterion: f64,
}

/// The parameters of a fit.
struct Parameters<'a> {
    ln_frequencies: &'a [f64],
    ln_dampings: &'a [f64],
    /// By mode.
    shapes: Vec<SVector<f64, MOTIONS>>,
    /// What drives the modes: the lower triangle of a factor of its spectral matrix, by row, real
    /// and imaginary parts.
    forces: &'a [f64],
    noise: f64,
}

impl<'a> Parameters<'a> {
    fn of(modes: usize, x: &'a [f64]) -> Self {
        let (ln_frequencies, rest) = x.split_at(modes);
        let (ln_dampings, rest) = rest.split_at(modes);
        let (shapes, rest) = rest.split_at(modes * MOTIONS);
        let (forces, noise) = rest.split_at(modes * modes);
        Self {
            ln_frequencies,
            ln_dampings,
            shapes: shapes.chunks_exact(MOTIONS).map(unit_shape).collect(),
            forces,
            noise: noise[0].exp(),
        }
    }

    /// Row `row` and column `column` of the factor: the diagonal first, which is real.
    fn force(&self, row: usize, column: usize) -> Complex<f64> {
        if row == column {
            return Complex::new(self.forces[row], 0.0);
        }
        let modes = self.ln_frequencies.len();
        let at = modes + row * (row - 1) + 2 * column;
        Complex::new(self.forces[at], self.forces[at + 1])
    }

    /// Response of a mode's displacement to a force, in that to a steady one.
    fn response(&self, mode: usize, frequency_hz: f64) -> Complex<f64> {
        let ratio = frequency_hz / self.ln_frequencies[mode].exp();
        let damping = self.ln_dampings[mode].exp();
        Complex::new(1.0 - ratio * ratio, 2.0 * damping * ratio).inv()
    }
}

/// A shape of length 1.
fn unit_shape(shape: &[f64]) -> SVector<f64, MOTIONS> {
    let shape = SVector::<f64, MOTIONS>::from_column_slice(shape);
    shape / shape.norm().max(f64::MIN_POSITIVE)
}

impl Band {
    fn of(motions: &[Vec<f64>], times_s: &[f64], band_hz: Bounds) -> Self {
        let span_s = times_s[times_s.len() - 1] - times_s[0];
        let first = (band_hz.lo * span_s).ceil() as usize;
        let last = (band_hz.hi * span_s).floor() as usize;
        let density = (2.0 * span_s).sqrt() / times_s.len() as f64;
        let (mut frequencies_hz, mut coefficients) = (Vec::new(), Vec::new());
        let mut squares = 0.0;
        for k in first..=last {
            let frequency_hz = k as f64 / span_s;
            let mut coefficient = Coefficient::zeros();
            for (frame, time_s) in times_s.iter().enumerate() {
                let turn = Complex::from_polar(density, -TAU * frequency_hz * time_s);
                for (sum, motion) in coefficient.iter_mut().zip(motions) {
                    *sum += turn * motion[frame];
                }
            }
            squares += coefficient.norm_squared();
            frequencies_hz.push(frequency_hz);
            coefficients.push(coefficient);
        }
        let values = (coefficients.len() * MOTIONS).max(1) as f64;
        let scale = (squares / values).sqrt().max(f64::MIN_POSITIVE);
        for coefficient in &mut coefficients {
            *coefficient /= Complex::new(scale, 0.0);
        }
        Self {
            frequencies_hz,
            coefficients,
            scale,
        }
    }

    /// Minus the logarithm of the likelihood, with the prior on the damping.
    fn cost(&self, modes: usize, x: &[f64]) -> f64 {
        let parameters = Parameters::of(modes, x);
        let mut cost = 0.0;
        for ln_damping in parameters.ln_dampings {
            cost += 0.5 * damping_penalty(*ln_damping);
        }
        for (frequency_hz, coefficient) in self.frequencies_hz.iter().zip(&self.coefficients) {
            let Some(factored) = self.spectrum(&parameters, *frequency_hz).cholesky() else {
                return f64::INFINITY;
            };
            let factor = factored.l_dirty();
            for k in 0..MOTIONS {
                cost += 2.0 * factor[(k, k)].re.ln();
            }
            let Some(white) = factor.solve_lower_triangular(coefficient) else {
                return f64::INFINITY;
            };
            cost += white.norm_squared();
        }
        cost
    }

    /// The spectral matrix that the motions should have.
    fn spectrum(
        &self,
        parameters: &Parameters,
        frequency_hz: f64,
    ) -> SMatrix<Complex<f64>, MOTIONS, MOTIONS> {
        let modes = parameters.shapes.len();
        let noise = Complex::new(parameters.noise, 0.0);
        let mut out = SMatrix::from_diagonal_element(noise);
        for column in 0..modes {
            let mut moved = Coefficient::zeros();
            for row in column..modes {
                let by = parameters.response(row, frequency_hz) * parameters.force(row, column);
                moved += parameters.shapes[row].map(|s| by * s);
            }
            out += moved * moved.adjoint();
        }
        out
    }

    fn fit(&self, start_hz: &[f64], band_hz: Bounds, cancel: &CancelToken) -> Fit {
        let modes = start_hz.len();
        let (mut x, mut forces) = (Vec::new(), vec![0.0; modes * modes]);
        x.extend(start_hz.iter().map(|f| f.ln()));
        x.extend(vec![USUAL_DAMPING.ln(); modes]);
        for (mode, f) in start_hz.iter().enumerate() {
            let (shape, size) = self.shape_near(*f);
            x.extend(shape.iter());
            forces[mode] = size * 2.0 * USUAL_DAMPING;
        }
        x.extend(forces);
        x.push(0.01_f64.ln());
        let any = Bounds::new(-1e3, 1e3);
        let mut bounds = vec![any; x.len()];
        bounds[..modes].fill(band_hz.map(f64::ln));
        bounds[modes..2 * modes].fill(DAMPING.map(f64::ln));
        let mut cost = f64::INFINITY;
        for _ in 0..SEARCHES {
            let (next, value) = minimum(
                &ByDifferences(|x: &[f64]| self.cost(modes, x)),
                &x,
                &bounds,
                &STOPPING,
                cancel,
            );
            let gain = cost - value;
            (x, cost) = (next, value);
            if gain < LEAST_GAIN {
                break;
            }
        }
        // A shape's length says nothing.
        let parameters = (x.len() - modes) as f64;
        let values = (self.coefficients.len() * MOTIONS).max(1) as f64;
        Fit {
            modes,
            x,
            criterion: 2.0 * cost + parameters * values.ln(),
        }
    }

    /// The shape in which most moves near a frequency, and the size of the coefficient there.
    fn shape_near(&self, frequency_hz: f64) -> (SVector<f64, MOTIONS>, f64) {
        let mut order: Vec<usize> = (0..self.coefficients.len()).collect();
        let distance = |k: &usize| (self.frequencies_hz[*k] - frequency_hz).abs();
        order.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut products = SMatrix::<f64, MOTIONS, MOTIONS>::zeros();
        for k in order.iter().take(4) {
            let coefficient = &self.coefficients[*k];
            products += (coefficient * coefficient.adjoint()).map(|c| c.re);
        }
        let eigen = SymmetricEigen::new(products);
        let largest = eigen.eigenvalues.imax();
        let size = order.first().map_or(0.0, |k| self.coefficients[*k].norm());
        (eigen.eigenvectors.column(largest).into_owned(), size)
    }

    /// The mode of lowest frequency of a fit; `None` where the likelihood has no top there.
    fn lowest(&self, fit: &Fit, scales: &[f64]) -> Option<Oscillator> {
        let parameters = Parameters::of(fit.modes, &fit.x);
        let ln_f = parameters.ln_frequencies;
        let mode = (0..fit.modes).min_by(|a, b| ln_f[*a].total_cmp(&ln_f[*b]))?;
        let ln_damping = parameters.ln_dampings[mode];
        let of_mode = [mode, fit.modes + mode];
        let sharpness = curvature(|x| self.cost(fit.modes, x), &fit.x);
        let [ln_frequency_sd, ln_damping_sd] = deviations(sharpness, of_mode)?;
        let (frequency_hz, damping) = (ln_f[mode].exp(), ln_damping.exp());
        // The integral of the squared response over all frequencies.
        let response = PI * frequency_hz / (4.0 * damping);
        let mut force = 0.0;
        for column in 0..=mode {
            force += parameters.force(mode, column).norm_sqr();
        }
        let mut variance = 0.0;
        for (shape, scale) in parameters.shapes[mode].iter().zip(scales) {
            variance += (shape * scale * self.scale).powi(2) * force * response;
        }
        let ln_dampings = DAMPING.map(f64::ln);
        Some(Oscillator {
            mode: Mode {
                frequency_hz,
                damping,
            },
            ln_sd: LnDeviations {
                frequency: ln_frequency_sd,
                damping: ln_damping_sd,
            },
            variance,
            at_limit: ln_dampings.lo >= ln_damping || ln_dampings.hi <= ln_damping,
        })
    }
}

/// Standard deviations of some parameters, from the curvature of minus the logarithm of a likelihood
/// in all of them. Directions in which it is flat, as the length of a shape is, or in which the
/// search has not reached the top, are left as they are; `None` where these parameters are among
/// them.
fn deviations(sharpness: DMatrix<f64>, of: [usize; 2]) -> Option<[f64; 2]> {
    // The likelihood may end beside the place that was found.
    if !sharpness.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(sharpness);
    let mut variances = [0.0; 2];
    let mut flat = [0.0; 2];
    for (value, direction) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        for (k, &parameter) in of.iter().enumerate() {
            let share = direction[parameter].powi(2);
            if *value > FLAT {
                variances[k] += share / value;
            } else {
                flat[k] += share;
            }
        }
    }
    let is_known = flat.iter().all(|share| *share < MOST_FLAT);
    is_known.then(|| variances.map(f64::sqrt))
}
