//! How often a tree was pulled and let go in a film, and what of the film each time takes.

use super::film::Film;
use super::members::is_seen;
use crate::signal::median;
use std::ops::Range;

/// Time over which speeds are taken, s: the longer, the less noise is in them.
const OVER_S: f64 = 0.2;
/// A point counts if it is seen in so much of the film.
const SEEN: f64 = 0.9;
/// Before a release the tree is at rest for so long, s, with at most this share of the energy that it has at its peak so long
/// after it, s; and that is at least this share of the film's largest.
const REST_S: f64 = 0.6;
const AT_REST: f64 = 0.02;
const RISE_S: f64 = 1.0;
/// At the begin of the film less of the rest may be seen, s.
const LEAST_REST_S: f64 = 0.3;
const LARGE: f64 = 0.2;
/// What is shorter from its rest on is no decay, but the pull itself, s.
const LEAST_S: f64 = 3.0;
/// Fewer speeds say nothing.
const LEAST_FRAMES: usize = 32;
/// A hand brings the tree from where it rests to where it holds it: it has come so far along when it is surely under way, and
/// when it is all but there.
const UNDER_WAY: f64 = 0.3;
const THERE: f64 = 0.9;

/// Time, s, and square of the speed of the middle one of the points over `over_s` seconds, px²/s²; `None` where too little was
/// seen.
pub fn energy(film: &Film, over_s: f64) -> Option<Vec<[f64; 2]>> {
    let times = &film.times_s;
    let over = ((over_s / film.step_s()).round() as usize).max(1);
    let tracks: Vec<&Vec<[f64; 2]>> = film
        .tracks
        .iter()
        .map(|t| &t.at_px)
        .filter(|at| at.iter().filter(|p| is_seen(p)).count() as f64 >= SEEN * times.len() as f64)
        .collect();
    if tracks.is_empty() || times.len() < LEAST_FRAMES + over {
        return None;
    }
    let at = |k: usize| {
        let dt = times[k + over] - times[k];
        let speed = |at: &&Vec<[f64; 2]>| {
            let (a, b) = (at.get(k)?, at.get(k + over)?);
            let square = (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
            square.is_finite().then_some(square / (dt * dt))
        };
        let mut all: Vec<f64> = tracks.iter().filter_map(speed).collect();
        all.sort_unstable_by(f64::total_cmp);
        Some([0.5 * (times[k] + times[k + over]), *all.get(all.len() / 2)?])
    };
    Some((0..times.len() - over).filter_map(at).collect())
}

/// When the tree was let go from rest, or pulled from there with a jerk, s.
fn releases(energy: &[[f64; 2]]) -> Vec<f64> {
    let mut sorted: Vec<f64> = energy.iter().map(|e| e[1]).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    // What noise does is always there.
    let (Some(floor), Some(top)) = (sorted.get(sorted.len() / 20), sorted.last()) else { return Vec::new() };
    let top = top - floor;
    let first_s = energy[0][0];
    let mut out: Vec<f64> = Vec::new();
    let mut at_rest: Option<f64> = None;
    for (k, &[now, _]) in energy.iter().enumerate() {
        let before = energy[..=k].iter().rev().take_while(|e| now - e[0] <= REST_S);
        let (sum, n) = before.fold((0.0, 0.0), |(sum, n), e| (sum + e[1] - floor, n + 1.0));
        let after = energy[k..].iter().take_while(|e| e[0] - now <= RISE_S).map(|e| e[1] - floor).fold(0.0, f64::max);
        let about_to = now - first_s >= LEAST_REST_S && after >= LARGE * top && sum < AT_REST * after * n;
        // Of all moments at which the motion is about to come, the last at rest.
        if about_to {
            at_rest = Some(now);
        } else {
            out.extend(at_rest.take());
        }
    }
    out
}

/// The parts of a film that hold a release each, in order: from the rest before it until a hand pulls again. None where the tree
/// came out of rest once at most.
pub(super) fn parts(film: &Film) -> Vec<Range<usize>> {
    let releases = energy(film, OVER_S).map_or(Vec::new(), |energy| releases(&energy));
    if releases.len() < 2 {
        return Vec::new();
    }
    let at = |t: f64| film.times_s.partition_point(|s| *s < t);
    let begins = releases.iter().map(|t| at(t - REST_S));
    let ends = releases.windows(2).map(|pair| at(pulled_again_s(film, [pair[0], pair[1]]))).chain([film.times_s.len()]);
    let long = |&(from, to): &(usize, usize)| from < to && film.times_s[to - 1] - film.times_s[from] >= LEAST_S;
    begins.zip(ends).filter(long).map(|(from, to)| from..to).collect()
}

/// When a hand came back after the first of two releases, s.
fn pulled_again_s(film: &Film, releases_s: [f64; 2]) -> f64 {
    let at = |t: f64| film.times_s.partition_point(|s| *s < t);
    let [first, held, second] = [releases_s[0], releases_s[1] - REST_S, releases_s[1]].map(at);
    let middle = |at_px: &[[f64; 2]]| -> Option<[f64; 2]> {
        let seen = |c: usize| at_px.iter().filter(|p| is_seen(p)).map(|p| p[c]).collect::<Vec<f64>>();
        Some([median(seen(0), f64::total_cmp)?, median(seen(1), f64::total_cmp)?])
    };
    // Of every point where it rests, as it is there most of the time, and which way and how far it is held from there.
    let ways: Vec<(usize, [f64; 2], [f64; 2])> = (0..film.tracks.len())
        .filter_map(|k| {
            let at_px = &film.tracks[k].at_px;
            let (rest, there) = (middle(at_px)?, middle(&at_px[held..second])?);
            Some((k, rest, [there[0] - rest[0], there[1] - rest[1]]))
        })
        .collect();
    let share = |frame: usize| {
        let (mut along, mut all) = (0.0, 0.0);
        for (k, rest, way) in &ways {
            let at = film.tracks[*k].at_px[frame];
            if is_seen(&at) {
                along += (at[0] - rest[0]) * way[0] + (at[1] - rest[1]) * way[1];
                all += way[0] * way[0] + way[1] * way[1];
            }
        }
        along / all
    };
    let under_way = (first..held).rev().find(|&k| share(k) < UNDER_WAY).unwrap_or(first);
    let there = (under_way..second).find(|&k| share(k) > THERE).unwrap_or(held);
    let took_s = film.times_s[there] - film.times_s[under_way];
    // It began as slowly as it went on, or more slowly.
    (film.times_s[under_way] - took_s).max(releases_s[0])
}
