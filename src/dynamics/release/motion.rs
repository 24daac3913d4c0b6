//! The greatest motion in a film: when a tree that was pulled is released, and when it is at rest
//! again, seen in what its points do together.

use super::super::film::Film;
use super::super::members::Points;
use super::energy::{Level, frames_of};
use crate::signal::principal::{PrincipalComponents, along, symmetric};
use crate::signal::qr::Qr;
use crate::signal::vectors::dot;

/// Motions that all points share, which are looked at: noise is spread over many more.
const SHARED_MOTIONS: usize = 3;
/// So many points that were always seen are enough.
const ENOUGH_WHOLE_SIGNALS: usize = 8;
/// Time over which speeds are taken, s.
const OVER_S: f64 = 0.12;
/// Energy, as a share of its peak, from which the motion is surely under way.
const MIN_SWING: f64 = 0.36;
/// Speed, as a share of its peak, below which the tree is still at rest.
const MAX_SPEED_AT_REST: f64 = 0.15;
/// A rest must have lasted so long to be believed, s.
const MIN_REST_S: f64 = 0.12;
/// The first moments of the motion, s, in frames at least, the frames about its begin in which the
/// release is looked for, and the steps a frame.
const FIRST_S: f64 = 0.3;
const MIN_FIRST_FRAMES: f64 = 5.0;
const SEARCHED_FRAMES: i32 = 3;
const STEPS_PER_FRAME: i32 = 10;
/// Time over which the energy is smoothed, s, and the share of its peak below which the tree is at
/// rest again.
const SMOOTH_S: f64 = 2.0;
const MAX_ENERGY_AT_END: f64 = 0.004;
/// Least time of a decay that is looked at, s.
const MIN_DECAY_S: f64 = 6.0;

/// Begin and end of the greatest motion in a film.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Whether it is seen at rest before.
    pub rested: bool,
    /// When the motion begins, s.
    pub at_s: f64,
    /// First frame of the motion, and the one after its last.
    pub from: usize,
    pub to: usize,
}

/// Looks for the greatest motion of the points in a film.
pub(super) fn greatest_motion(film: &Film, points: &Points) -> Motion {
    let times = &film.times_s;
    let whole_film = Motion {
        rested: false,
        at_s: times.first().copied().unwrap_or(0.0),
        from: 0,
        to: times.len(),
    };
    let shared = shared_motions(&points.signals);
    let over = frames_of(film, OVER_S);
    let energy = energy_of(&shared, times, over);
    let top = energy.iter().copied().fold(0.0, f64::max);
    // The first great swing, and back to where it began.
    let Some(swing) = energy
        .iter()
        .position(|e| top > 0.0 && *e >= MIN_SWING * top)
    else {
        return whole_film;
    };
    let to = end(film, &energy);
    let at_rest = MAX_SPEED_AT_REST * MAX_SPEED_AT_REST * top;
    let Some(still) = energy[..swing].iter().rposition(|e| *e < at_rest) else {
        return Motion { to, ..whole_film };
    };
    // Released with the first frame, perhaps: the fit will tell.
    let (near, rested) = if still == 0 {
        (0, true)
    } else {
        let near = (still + over / 2).min(times.len() - 1);
        (near, rests_before(still, times, &energy, at_rest))
    };
    let at_s = release_time_s(film, &shared, near);
    let from = times.iter().position(|t| *t >= at_s).unwrap_or(near);
    Motion {
        rested,
        at_s,
        from,
        to: to.max(from),
    }
}

/// Squares of the speeds of some motions over so many frames.
fn energy_of(motions: &[Vec<f64>], times_s: &[f64], over: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(times_s.len());
    for k in 0..times_s.len().saturating_sub(over) {
        let dt = times_s[k + over] - times_s[k];
        let speeds = motions.iter().map(|s| (s[k + over] - s[k]) / dt);
        out.push(speeds.map(|v| v * v).sum());
    }
    out
}

/// Whether a rest that ends with frame `still` lasts long enough.
fn rests_before(still: usize, times_s: &[f64], energy: &[f64], at_rest: f64) -> bool {
    let mut earlier = times_s[..still].iter();
    let Some(begin) = earlier.rposition(|t| times_s[still] - t >= MIN_REST_S) else {
        return false;
    };
    energy[begin..still].iter().all(|e| *e < at_rest)
}

/// The moment at which the tree was released, s: `near` is a frame near it. A body that is released
/// from rest moves with the square of the time at first; the moment is the one from which square
/// and cube fit best.
fn release_time_s(film: &Film, motions: &[Vec<f64>], near: usize) -> f64 {
    let times = &film.times_s;
    let step_s = film.step_s();
    let reach_s = FIRST_S.max(MIN_FIRST_FRAMES * step_s);
    let first = times.partition_point(|t| times[near] - t > reach_s);
    let after = times.partition_point(|t| t - times[near] <= reach_s);
    let mut best = (f64::INFINITY, times[near]);
    let reach = SEARCHED_FRAMES * STEPS_PER_FRAME;
    for k in -reach..=reach {
        let at_s = times[near] + f64::from(k) / f64::from(STEPS_PER_FRAME) * step_s;
        let left = left_by_release_at(at_s, &times[first..after], motions, first);
        if left < best.0 {
            best = (left, at_s);
        }
    }
    best.1
}

/// Squares that a release from rest at this time leaves of motions at `times_s`, which begin with
/// frame `first`.
fn left_by_release_at(at_s: f64, times_s: &[f64], motions: &[Vec<f64>], first: usize) -> f64 {
    let mut columns = vec![vec![1.0; times_s.len()]];
    for power in [2, 3] {
        let since = times_s.iter().map(|t| (t - at_s).max(0.0));
        columns.push(since.map(|s| s.powi(power)).collect());
    }
    let qr = Qr::new(columns);
    let mut left = 0.0;
    for motion in motions {
        let (rest, _) = qr.solve(&motion[first..first + times_s.len()]);
        left += dot(&rest, &rest);
    }
    left
}

/// The frame after the last in which the smoothed energy is more than a small share of its peak.
fn end(film: &Film, energy: &[f64]) -> usize {
    let times_s = &film.times_s;
    let half = (0.5 * SMOOTH_S / film.step_s()).round() as usize;
    let mut smooth = Vec::with_capacity(energy.len());
    for k in 0..energy.len() {
        let near = &energy[k.saturating_sub(half)..(k + half + 1).min(energy.len())];
        smooth.push(near.iter().sum::<f64>() / near.len() as f64);
    }
    let level = Level::of(&smooth);
    let peak = (0..smooth.len())
        .max_by(|a, b| smooth[*a].total_cmp(&smooth[*b]))
        .unwrap_or(0);
    let last = smooth
        .iter()
        .rposition(|e| e - level.floor > MAX_ENERGY_AT_END * level.top)
        .unwrap_or(0);
    let least = times_s
        .iter()
        .position(|t| *t > times_s[peak] + MIN_DECAY_S)
        .unwrap_or(times_s.len());
    (last + half).max(least).min(times_s.len())
}

/// What the signals do together: the leading principal components of those that were always seen,
/// or of all.
fn shared_motions(signals: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let whole = signals.iter().filter(|s| s.iter().all(|x| x.is_finite()));
    let mut used: Vec<Vec<f64>> = whole.cloned().collect();
    if used.len() < ENOUGH_WHOLE_SIGNALS {
        used = signals.to_vec();
        for x in used.iter_mut().flatten().filter(|x| !x.is_finite()) {
            *x = 0.0;
        }
    }
    let products = symmetric(used.len(), |a, b| dot(&used[a], &used[b]));
    let components = PrincipalComponents::of_products(products).directions;
    let leading = components.iter().take(SHARED_MOTIONS);
    leading.map(|direction| along(&used, direction)).collect()
}
