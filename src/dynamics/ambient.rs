//! The fundamental of a tree in wind, from all its points at once.
//!
//! The points' motions are compressed to their principal components. Subspace identification says
//! near which frequencies modes are (`subspace.rs`); their number, frequencies, damping ratios,
//! shapes and how sure these are then follow from the likelihood of the Fourier coefficients about
//! the lowest one (Bayesian operational modal analysis: Au 2011, 2012; Whittle 1951). Modes as near
//! to each other as a trunk's and a limb's differ in their shapes.

use super::branches::LnDeviations;
use super::decay::USUAL_DAMPING;
use super::driven_modes::{
    Coefficient, Known, Likelihood, MOTIONS, Observed, Parameters, Spectrum, integral_of_response,
};
use super::driven_oscillators::{DAMPING, Oscillator};
use super::film::Film;
use super::members::Points;
use super::motions::{Motions, OF_SUBSPACE};
use super::subspace::{LAGS_S, stable_poles};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::signal::bfgs::{ByDifferences, Cost, Stopping, curvature, minimum};

/// Points that are used at most.
pub(super) const MOST_POINTS: usize = 120;
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

/// The lowest mode of `points` in `frames` of `film`, looked for `within_hz`. `None` where none is
/// found, and where `cancel` ends the work before.
pub(super) fn fundamental(
    film: &Film,
    points: &Points,
    frames: &[usize],
    within_hz: Bounds,
    cancel: &CancelToken,
) -> Option<Oscillator> {
    if 2 * points.tracks.len() < OF_SUBSPACE {
        return None;
    }
    let motions = Motions::of(film, points, frames);
    let of_like_size = motions.of_like_size();
    let poles = stable_poles(&of_like_size, motions.step_s(), within_hz, &LAGS_S);
    let modes_hz: Vec<f64> = poles.iter().map(|p| p.frequency_hz).collect();
    let lowest_hz = modes_hz.first()?;
    let band_hz = Bounds::new(
        (BAND.lo * lowest_hz).max(LEAST_PERIODS / motions.span_s()),
        BAND.hi * lowest_hz,
    );
    let band = Band::of(&of_like_size[..MOTIONS], &motions.times_s, band_hz);
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
    band.lowest(&best?, &motions)
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

/// The motions about the fundamental.
struct Band {
    observed: Observed,
    /// What the coefficients were divided by.
    scale: f64,
}

/// A fit of some modes.
struct Fit {
    modes: usize,
    x: Vec<f64>,
    /// Of Bayes and Schwarz.
    criterion: f64,
}

impl Band {
    /// White forces drive the modes.
    fn of(motions: &[Vec<f64>], times_s: &[f64], band_hz: Bounds) -> Self {
        let spectrum = Spectrum::of(motions, times_s, band_hz);
        let coefficients = spectrum.coefficients.iter();
        let mut observed = Observed {
            gusts: vec![1.0; spectrum.frequencies_hz.len()],
            coefficients: coefficients
                .map(|c| Coefficient::from_column_slice(c.as_slice()))
                .collect(),
            frequencies_hz: spectrum.frequencies_hz,
        };
        let scale = observed.scale_to_one();
        Self { observed, scale }
    }

    fn likelihood(&self, modes: usize) -> Likelihood<'_> {
        Likelihood {
            observed: &self.observed,
            modes,
        }
    }

    fn fit(&self, start_hz: &[f64], band_hz: Bounds, cancel: &CancelToken) -> Fit {
        let modes = start_hz.len();
        let (mut x, mut forces) = (Vec::new(), vec![0.0; modes * modes]);
        x.extend(start_hz.iter().map(|f| f.ln()));
        x.extend(vec![USUAL_DAMPING.ln(); modes]);
        for (mode, f) in start_hz.iter().enumerate() {
            x.extend(self.observed.shape_near(*f).iter());
            let nearest = self.observed.nearest_to(*f).first().copied();
            let size = nearest.map_or(0.0, |k| self.observed.coefficients[k].norm());
            forces[mode] = size * 2.0 * USUAL_DAMPING;
        }
        x.extend(forces);
        x.push(0.01_f64.ln());
        let any = Bounds::new(-1e3, 1e3);
        let mut bounds = vec![any; x.len()];
        bounds[..modes].fill(band_hz.map(f64::ln));
        bounds[modes..2 * modes].fill(DAMPING.map(f64::ln));
        let likelihood = self.likelihood(modes);
        let mut cost = f64::INFINITY;
        for _ in 0..SEARCHES {
            let (next, value) = minimum(
                &ByDifferences(|x: &[f64]| likelihood.value(x)),
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
        let values = self.observed.values();
        Fit {
            modes,
            x,
            criterion: 2.0 * cost + parameters * values.ln(),
        }
    }

    /// The mode of lowest frequency of a fit; `None` where the likelihood has no top there.
    fn lowest(&self, fit: &Fit, motions: &Motions) -> Option<Oscillator> {
        let parameters = Parameters::of(fit.modes, &fit.x);
        let ln_f = parameters.ln_frequencies;
        let lowest = (0..fit.modes).min_by(|a, b| ln_f[*a].total_cmp(&ln_f[*b]))?;
        let likelihood = self.likelihood(fit.modes);
        let known = Known::of(curvature(|x| likelihood.value(x), &fit.x))?;
        let mode = parameters.mode(lowest);
        let response = integral_of_response(&mode);
        let power = parameters.power(lowest);
        let mut variance = 0.0;
        for (shape, scale) in parameters.shape(lowest).iter().zip(motions.scales()) {
            variance += (shape * scale * self.scale).powi(2) * power * response;
        }
        let ln_damping = parameters.ln_dampings[lowest];
        let ln_dampings = DAMPING.map(f64::ln);
        Some(Oscillator {
            mode,
            ln_sd: LnDeviations {
                frequency: known.deviation(lowest)?,
                damping: known.deviation(fit.modes + lowest)?,
            },
            variance,
            at_limit: ln_dampings.lo >= ln_damping || ln_dampings.hi <= ln_damping,
        })
    }
}
