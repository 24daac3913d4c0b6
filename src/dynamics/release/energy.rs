//! The energy of a tree's motion over time: squares of speeds.

use super::super::film::Film;
use super::super::members::count_seen;
use crate::signal::median;
use crate::signal::statistics::nth_smallest;
use nalgebra::Point2;

/// A point counts if it is seen in so much of the film.
const MIN_SEEN_SHARE: f64 = 0.9;
/// Fewer speeds say nothing.
const MIN_FRAMES: usize = 32;
/// One of so many values is no more than what noise makes.
const NOISE_ONE_OF: usize = 20;

/// Energy at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Energy {
    pub time_s: f64,
    /// px²/s².
    pub square: f64,
}

/// Square of the speed of the middle one of the points over `over_s` seconds; `None` where too
/// little was seen.
pub(super) fn energy(film: &Film, over_s: f64) -> Option<Vec<Energy>> {
    let times = &film.times_s;
    let over = frames_of(film, over_s);
    let least = MIN_SEEN_SHARE * times.len() as f64;
    let mut tracks: Vec<&[Point2<f64>]> = Vec::new();
    for track in &film.tracks {
        if count_seen(&track.at_px) as f64 >= least {
            tracks.push(&track.at_px);
        }
    }
    if tracks.is_empty() || times.len() < MIN_FRAMES + over {
        return None;
    }
    let longest_s = (over as f64 + 0.5) * film.step_s();
    let mut out = Vec::with_capacity(times.len());
    for k in 0..times.len() - over {
        let dt = times[k + over] - times[k];
        // Over a gap every speed is small.
        if dt > longest_s {
            continue;
        }
        let moved = tracks.iter().filter_map(|at_px| square(at_px, k, k + over));
        if let Some(middle) = median(moved.collect(), f64::total_cmp) {
            out.push(Energy {
                time_s: 0.5 * (times[k] + times[k + over]),
                square: middle / (dt * dt),
            });
        }
    }
    Some(out)
}

/// Square of the way between two frames, px².
fn square(at_px: &[Point2<f64>], from: usize, to: usize) -> Option<f64> {
    let (a, b) = (at_px.get(from)?, at_px.get(to)?);
    let square = (b - a).norm_squared();
    square.is_finite().then_some(square)
}

/// Number of frames in so many seconds, one at least.
pub(super) fn frames_of(film: &Film, seconds: f64) -> usize {
    ((seconds / film.step_s()).round() as usize).max(1)
}

/// What some energies have by noise, and what the largest has beyond it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub floor: f64,
    pub top: f64,
}

impl Level {
    pub fn of(squares: &[f64]) -> Self {
        let floor = nth_smallest(squares.to_vec(), squares.len() / NOISE_ONE_OF).unwrap_or(0.0);
        let largest = squares.iter().copied().max_by(f64::total_cmp);
        Self {
            floor,
            top: largest.map_or(0.0, |largest| largest - floor),
        }
    }
}
