//! The principal motions of some points, and their spectrum.

use super::driven_modes::Spectrum;
use super::film::Film;
use super::gap_free::GapFree;
use super::members::Points;
use crate::bounds::Bounds;
use crate::signal::principal::{PrincipalComponents, along};
use nalgebra::{DVector, Vector2};

/// Motions that are kept at most, and those that a subspace is of.
const MOST: usize = 24;
pub(super) const OF_SUBSPACE: usize = 8;

/// The few motions that those of many points are made of.
pub(super) struct Motions {
    pub times_s: Vec<f64>,
    /// Of mean 0, px.
    along: Vec<Vec<f64>>,
    variances: Vec<f64>,
    /// Of length 1, in all signals at once: u and v of each point in turn.
    directions: Vec<Vec<f64>>,
    /// Variance that noise has in every value, px².
    noise: f64,
}

impl Motions {
    /// Of `points` in `frames` of `film`.
    pub fn of(film: &Film, points: &Points, frames: &[usize]) -> Self {
        let GapFree { signals, noise } = GapFree::of(points, frames);
        let mut principal = PrincipalComponents::of_signals(&signals);
        principal.directions.truncate(MOST);
        principal.variances.truncate(MOST);
        let mut motions = Vec::with_capacity(principal.directions.len());
        for direction in &principal.directions {
            let mut motion = along(&signals, direction);
            let mean = motion.iter().sum::<f64>() / motion.len().max(1) as f64;
            motion.iter_mut().for_each(|x| *x -= mean);
            motions.push(motion);
        }
        Self {
            times_s: film.times_of(frames),
            along: motions,
            variances: principal.variances,
            directions: principal.directions,
            noise,
        }
    }

    pub fn span_s(&self) -> f64 {
        let ends = self.times_s.first().zip(self.times_s.last());
        ends.map_or(0.0, |(first, last)| last - first)
    }

    /// Mean time from one value to the next, s.
    pub fn step_s(&self) -> f64 {
        self.span_s() / self.times_s.len().max(2).saturating_sub(1) as f64
    }

    /// The largest, each divided by the square root of its size: the small ones tell near modes
    /// apart, but are the noisier ones.
    pub fn of_like_size(&self) -> Vec<Vec<f64>> {
        let mut out = Vec::with_capacity(OF_SUBSPACE);
        for (motion, scale) in self.along.iter().zip(self.scales()).take(OF_SUBSPACE) {
            out.push(motion.iter().map(|x| x / scale).collect());
        }
        out
    }

    /// How many of them are larger than any that noise has: the variances of the principal
    /// components of white noise end at an edge that follows from the numbers of signals and of
    /// times (Marchenko and Pastur 1967).
    pub fn above_noise(&self) -> usize {
        let signals = self.directions.first().map_or(0, Vec::len) as f64;
        let edge = 1.0 + (signals / self.times_s.len().max(1) as f64).sqrt();
        let least = edge * edge * self.noise;
        self.variances.iter().filter(|v| **v > least).count()
    }

    /// Squares that noise makes in all of [`of_like_size`](Self::of_like_size).
    pub fn noise_of_like_size(&self) -> f64 {
        let scales = self.scales().take(OF_SUBSPACE);
        let per_time: f64 = scales.map(|scale| self.noise / (scale * scale)).sum();
        per_time * self.times_s.len() as f64
    }

    /// What [`of_like_size`](Self::of_like_size) divides each motion by, px.
    pub fn scales(&self) -> impl Iterator<Item = f64> {
        let variances = self.variances.iter();
        variances.map(|v| v.powf(0.25).max(f64::MIN_POSITIVE))
    }

    /// Fourier coefficients at whole numbers of periods.
    pub fn spectrum(&self, within_hz: Bounds) -> Spectrum {
        Spectrum::of(&self.along, &self.times_s, within_hz)
    }

    /// What sizes of the motions are in the points.
    pub fn in_points(&self, sizes: &DVector<f64>) -> Vec<Vector2<f64>> {
        let signals = self.directions.first().map_or(0, Vec::len);
        let mut out = vec![Vector2::zeros(); signals / 2];
        for (direction, size) in self.directions.iter().zip(sizes.iter()) {
            for (sum, at) in out.iter_mut().zip(direction.chunks_exact(2)) {
                *sum += *size * Vector2::new(at[0], at[1]);
            }
        }
        out
    }

    /// What of displacements of the points is in the motions.
    pub fn sizes_of(&self, moved: &[Vector2<f64>]) -> DVector<f64> {
        let mut out = DVector::zeros(self.directions.len());
        for (size, direction) in out.iter_mut().zip(&self.directions) {
            for (at, moved) in direction.chunks_exact(2).zip(moved) {
                *size += at[0] * moved.x + at[1] * moved.y;
            }
        }
        out
    }
}
