//! Which frames of a film in wind are taken together, and which frequencies they show.

use super::branches::SearchLimits;
use super::film::Film;
use super::gap_free::enough_seen;
use super::members::Points;
use crate::bounds::Bounds;
use crate::model::Unidentified;

/// Frames a period of the highest frequency beyond which neighbours are taken together as their
/// mean: they cost time and tell little.
const FRAMES_PER_PERIOD: f64 = 3.0;
/// Longer films, in frames that are left, are thinned to so many a second, if there are as many;
/// and frequencies are looked for up to this share of the rate. A mean over neighbours hides what
/// is faster, and does not show it as something slower.
const LONG_FILM_FRAMES: usize = 900;
const LONG_FILM_HZ: f64 = 7.5;
const MAX_FREQ_OF_RATE: f64 = 0.3;
const MIN_FRAMES: usize = 48;

/// A film in means of some neighbouring frames.
pub(super) struct Sampling<'a> {
    film: &'a Film,
    /// Neighbouring frames that are taken together.
    every: usize,
    /// Frequencies that are looked for in these means, Hz.
    pub frequencies_hz: Bounds,
}

impl<'a> Sampling<'a> {
    pub fn of(film: &'a Film, limits: &SearchLimits) -> Self {
        let every = frames_per_mean(film, limits.highest_hz);
        Self {
            film,
            every,
            frequencies_hz: frequencies_hz(film, limits.frequencies_hz, every),
        }
    }

    /// The frames that show all of these points well enough, by `every` neighbours.
    pub fn frames_with(&self, points: &[&Points]) -> Result<Vec<Vec<usize>>, Unidentified> {
        let mut frames = self.film.neighbours(0..self.film.times_s.len(), self.every);
        frames.retain(|of| points.iter().all(|points| enough_seen(points, of)));
        if frames.len() < MIN_FRAMES {
            return Err(Unidentified::TooShort);
        }
        Ok(frames)
    }
}

/// Neighbouring frames that are taken together.
fn frames_per_mean(film: &Film, highest_hz: f64) -> usize {
    let fine = nearest_to_rate(film, FRAMES_PER_PERIOD * highest_hz);
    if film.times_s.len() / fine > LONG_FILM_FRAMES {
        nearest_to_rate(film, LONG_FILM_HZ).max(fine)
    } else {
        fine
    }
}

/// Frames whose means come at about this rate.
fn nearest_to_rate(film: &Film, rate_hz: f64) -> usize {
    film.frames_per_period(rate_hz).round().max(1.0) as usize
}

/// Frequencies that are looked for in means of so many frames.
fn frequencies_hz(film: &Film, within_hz: Bounds, every: usize) -> Bounds {
    if every == 1 {
        return within_hz;
    }
    let of_rate = MAX_FREQ_OF_RATE / (every as f64 * film.step_s());
    Bounds::new(within_hz.lo, within_hz.hi.min(of_rate))
}
