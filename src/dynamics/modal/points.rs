//! The points of a film for the analysis of all branches at once, without gaps.

use super::super::film::Film;
use super::super::members::{count_seen, is_seen, mean_px};
use super::tree::Point;
use crate::signal::interpolation::linear;
use nalgebra::Point2;

/// What comes later after a release says little, s.
const ENOUGH_S: f64 = 20.0;
/// A point must have been seen in this share of the frames.
const MIN_SEEN_SHARE: f64 = 0.8;
const MIN_NOISE_PX: f64 = 0.03;

/// A film from its release on, with short gaps bridged by straight lines: to find whose a mode is.
pub(super) struct BridgedFilm {
    /// From the release on, s.
    pub times_s: Vec<f64>,
    /// Those that were seen nearly always.
    pub points: Vec<Point>,
    /// Which tracks of the film they are.
    pub tracks: Vec<usize>,
}

impl BridgedFilm {
    /// Of a film from its release at `at_s` on.
    pub fn of(film: &Film, at_s: f64) -> Self {
        let until = film.times_s.partition_point(|t| *t <= at_s + ENOUGH_S);
        let mut out = Self {
            times_s: film.times_s[..until].iter().map(|t| t - at_s).collect(),
            points: Vec::new(),
            tracks: Vec::new(),
        };
        for (k, track) in film.tracks.iter().enumerate() {
            let at_px = &track.at_px[..until];
            if let Some(values) = bridged(&out.times_s, at_px) {
                out.points
                    .push(Point::new(values, mean_px(at_px), MIN_NOISE_PX));
                out.tracks.push(k);
            }
        }
        out
    }

    pub fn span_s(&self) -> f64 {
        let ends = self.times_s.last().zip(self.times_s.first());
        ends.map_or(0.0, |(last, first)| last - first)
    }
}

/// Displacement from the mean, px; nothing for a point that was seen too little.
fn bridged(times_s: &[f64], at_px: &[Point2<f64>]) -> Option<[Vec<f64>; 2]> {
    let seen = count_seen(at_px);
    if seen == 0 || (seen as f64) < MIN_SEEN_SHARE * at_px.len() as f64 {
        return None;
    }
    let mean = mean_px(at_px);
    let mut seen_s = Vec::with_capacity(seen);
    let mut displacements = [Vec::with_capacity(seen), Vec::with_capacity(seen)];
    for (time_s, at) in times_s.iter().zip(at_px) {
        if is_seen(at) {
            seen_s.push(*time_s);
            displacements[0].push(at.x - mean.x);
            displacements[1].push(at.y - mean.y);
        }
    }
    Some(displacements.map(|values| {
        let times = times_s.iter();
        times.map(|t| linear(&seen_s, &values, *t)).collect()
    }))
}
