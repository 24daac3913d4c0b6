//! How often a tree was pulled and let go in a film, and what of the film each time takes.

use super::film::Film;
use super::members::is_seen;
use crate::signal::median;
use std::ops::Range;

/// Time over which speeds are taken, s: the longer, the less noise is in them.
const OVER_S: f64 = 0.2;
/// A point counts if it is seen in so much of the film.
const SEEN: f64 = 0.9;
/// Before a release the tree is at rest for so long, s, with at most this share of the energy that
/// it has at its peak so long after it, s; and that is at least this share of the film's largest.
pub(super) const REST_S: f64 = 0.6;
const AT_REST: f64 = 0.02;
const RISE_S: f64 = 1.0;
/// Of the rest so much must be seen, s.
const LEAST_REST_S: f64 = 0.3;
const LARGE: f64 = 0.2;
/// A sway that begins with its release is largest at once, and one that wind stirs grows: of the
/// energy that it has at its peak so long after the rest, s, the first peak has this share.
const GROWN_S: f64 = 6.0;
const AT_ONCE: f64 = 0.33;
/// What is shorter from its rest on is no decay, but the pull itself, s.
const LEAST_S: f64 = 3.0;
/// Fewer speeds say nothing.
const LEAST_FRAMES: usize = 32;
/// A hand brings the tree from where it rests to where it holds it: it has come so far along when
/// it is surely under way, and when it is all but there.
const UNDER_WAY: f64 = 0.3;
const THERE: f64 = 0.9;

/// Time, s, and square of the speed of the middle one of the points over `over_s` seconds, px²/s²;
/// `None` where too little was seen.
pub fn energy(film: &Film, over_s: f64) -> Option<Vec<[f64; 2]>> {
    let times = &film.times_s;
    let step_s = film.step_s();
    let over = ((over_s / step_s).round() as usize).max(1);
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
        // Over a gap every speed is small.
        if dt > (over as f64 + 0.5) * step_s {
            return None;
        }
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

/// What is always there of some energies, by noise, and what the largest has beyond it.
fn floor_and_top(energy: &[[f64; 2]]) -> [f64; 2] {
    let mut sorted: Vec<f64> = energy.iter().map(|e| e[1]).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let floor = sorted.get(sorted.len() / 20).copied().unwrap_or(0.0);
    [floor, sorted.last().map_or(0.0, |top| top - floor)]
}

/// When the tree was let go from rest, or pulled from there with a jerk, s; `step_s` lie between
/// two frames.
fn comes_out_of_rest_s(energy: &[[f64; 2]], step_s: f64) -> Vec<f64> {
    let [floor, top] = floor_and_top(energy);
    let mut out: Vec<f64> = Vec::new();
    let mut at_rest: Option<f64> = None;
    for (k, &[now, _]) in energy.iter().enumerate() {
        let before = energy[..=k]
            .iter()
            .rev()
            .take_while(|e| now - e[0] <= REST_S);
        let (sum, n) = before.fold((0.0, 0.0), |(sum, n), e| (sum + e[1] - floor, n + 1.0));
        let peak = |within_s: f64| {
            energy[k..]
                .iter()
                .take_while(|e| e[0] - now <= within_s)
                .map(|e| e[1] - floor)
                .fold(0.0, f64::max)
        };
        let after = peak(RISE_S);
        // What was hardly seen was not seen at rest.
        let rested = n * step_s >= LEAST_REST_S && sum < AT_REST * after * n;
        // Of all moments at which the motion is about to come, the last at rest.
        if rested && after >= LARGE * top && after >= AT_ONCE * peak(GROWN_S) {
            at_rest = Some(now);
        } else {
            out.extend(at_rest.take());
        }
    }
    out
}

/// The parts of a film that hold a release each, in order: from the rest before it until a hand
/// pulls again. None where the tree came out of rest once at most.
pub(super) fn parts(film: &Film) -> Vec<Range<usize>> {
    let Some(energy) = energy(film, OVER_S) else {
        return Vec::new();
    };
    let out_of_rest_s = comes_out_of_rest_s(&energy, film.step_s());
    if out_of_rest_s.len() < 2 {
        return Vec::new();
    }
    let at = |t: f64| film.times_s.partition_point(|s| *s < t);
    let [floor, top] = floor_and_top(&energy);
    let swinging: Vec<usize> = energy
        .iter()
        .filter(|e| e[1] - floor > AT_REST * top)
        .map(|e| at(e[0]))
        .collect();
    let begins = out_of_rest_s.iter().map(|t| at(t - REST_S));
    let pulled = out_of_rest_s
        .windows(2)
        .map(|pair| at(pulled_again_s(film, &swinging, [pair[0], pair[1]])));
    let long = |&(from, to): &(usize, usize)| {
        from < to && film.times_s[to - 1] - film.times_s[from] >= LEAST_S
    };
    begins
        .zip(pulled.chain([film.times_s.len()]))
        .filter(long)
        .map(|(from, to)| from..to)
        .collect()
}

/// When a hand came back after the first of two releases, s. In the frames `swinging` the tree is
/// not held.
fn pulled_again_s(film: &Film, swinging: &[usize], releases_s: [f64; 2]) -> f64 {
    let at = |t: f64| film.times_s.partition_point(|s| *s < t);
    let [first, held, second] = [releases_s[0], releases_s[1] - REST_S, releases_s[1]].map(at);
    let holding: Vec<usize> = (held..second).collect();
    let middle = |at_px: &[[f64; 2]], frames: &[usize]| -> Option<[f64; 2]> {
        let seen: Vec<[f64; 2]> = frames.iter().map(|&k| at_px[k]).filter(is_seen).collect();
        let of = |c: usize| median(seen.iter().map(|p| p[c]).collect(), f64::total_cmp);
        Some([of(0)?, of(1)?])
    };
    // Of every point the place about which it swings, and which way and how far it is held from
    // there.
    let ways: Vec<(usize, [f64; 2], [f64; 2])> = (0..film.tracks.len())
        .filter_map(|k| {
            let at_px = &film.tracks[k].at_px;
            let (rest, there) = (middle(at_px, swinging)?, middle(at_px, &holding)?);
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
    let under_way = (first..held)
        .rev()
        .find(|&k| share(k) < UNDER_WAY)
        .unwrap_or(first);
    let there = (under_way..second)
        .find(|&k| share(k) > THERE)
        .unwrap_or(held);
    let took_s = film.times_s[there] - film.times_s[under_way];
    // It began as slowly as it went on, or more slowly.
    (film.times_s[under_way] - took_s).max(releases_s[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::FilmTrack;
    use crate::model::NodeId;
    use std::f64::consts::TAU;

    /// Nine points that move as `sway` says, px, each by another factor, with a little noise;
    /// frames at `rate_hz` but for a `gap`, s.
    fn film(seconds: f64, rate_hz: f64, gap: Range<f64>, sway: impl Fn(f64) -> f64) -> Film {
        let all = (0..(rate_hz * seconds) as u32).map(|k| f64::from(k) / rate_hz);
        let times: Vec<f64> = all.filter(|t| !gap.contains(t)).collect();
        let track = |i: u32| {
            let noise = |t: f64| 0.2 * (1234.5 * t * f64::from(i + 1)).sin();
            let at_px = times.iter().map(|&t| {
                [
                    9.0 + (0.5 + 0.1 * f64::from(i)) * sway(t) + noise(t),
                    noise(t + 0.7),
                ]
            });
            FilmTrack {
                node: NodeId(1),
                at_px: at_px.collect(),
            }
        };
        Film::new(&times, (0..9).map(track).collect())
    }

    /// Pulled within a second, held for `holds_s`, and let go at each of some times, s, by so many
    /// px.
    fn pulled(releases: &[[f64; 2]], holds_s: f64, t: f64) -> f64 {
        let after = |[at, px]: [f64; 2]| {
            px * (-0.04 * TAU * 0.6 * (t - at)).exp() * (TAU * 0.6 * (t - at)).cos()
        };
        let now = releases.iter().rposition(|r| r[0] <= t);
        let free = now.map_or(0.0, |k| after(releases[k]));
        match releases.get(now.map_or(0, |k| k + 1)) {
            Some([at, px]) if t > at - holds_s => *px,
            Some([at, px]) if t > at - holds_s - 1.0 => {
                let share = t - (at - holds_s - 1.0);
                free * (1.0 - share) + px * share
            }
            _ => free,
        }
    }

    #[track_caller]
    fn holds(film: &Film, wanted_s: &[[f64; 2]]) {
        let parts: Vec<[f64; 2]> = parts(film)
            .iter()
            .map(|p| [film.times_s[p.start], film.times_s[p.end - 1]])
            .collect();
        // Of the decay rather too little than any of the pull.
        let near = |(is, wanted): (&[f64; 2], &[f64; 2])| {
            (is[0] - wanted[0]).abs() < 0.3 && (-0.8..0.1).contains(&(is[1] - wanted[1]))
        };
        assert!(
            parts.len() == wanted_s.len() && parts.iter().zip(wanted_s).all(near),
            "{parts:?}, not {wanted_s:?}"
        );
    }

    /// With the second pull in it, a decay is none.
    #[test]
    fn a_part_begins_with_the_rest_before_a_release_and_ends_with_the_next_pull() {
        let three = [[1.0, 9.0], [21.0, 8.0], [41.0, 12.0]];
        for rate_hz in [30.0, 12.0] {
            holds(
                &film(60.0, rate_hz, 0.0..0.0, |t| pulled(&three, 1.0, t)),
                &[[0.4, 19.0], [20.4, 39.0], [40.4, 60.0]],
            );
        }
        // Held for longer than it swings.
        let two = [[1.0, 9.0], [31.0, 9.0]];
        holds(
            &film(40.0, 30.0, 0.0..0.0, |t| pulled(&two, 18.0, t)),
            &[[0.4, 12.0], [30.4, 40.0]],
        );
    }

    #[test]
    fn a_film_with_one_release_has_no_parts_nor_one_with_none() {
        let one = [[1.0, 9.0]];
        holds(&film(20.0, 30.0, 0.0..0.0, |t| pulled(&one, 1.0, t)), &[]);
        holds(&film(20.0, 30.0, 0.0..0.0, |_| 0.0), &[]);
        holds(&film(1.0, 30.0, 0.0..0.0, |t| pulled(&one, 1.0, t)), &[]);
        holds(&Film::default(), &[]);
        let mut unseen = film(20.0, 30.0, 0.0..0.0, |t| pulled(&one, 1.0, t));
        unseen
            .tracks
            .iter_mut()
            .for_each(|t| t.at_px.fill([f64::NAN; 2]));
        holds(&unseen, &[]);
    }

    /// A gap shows no rest.
    #[test]
    fn a_gap_in_a_decay_is_no_rest() {
        let one = [[1.0, 9.0]];
        for tenths in 5..40 {
            let gap_s = f64::from(tenths) / 10.0;
            holds(
                &film(20.0, 30.0, 4.0..4.0 + gap_s, |t| pulled(&one, 1.0, t)),
                &[],
            );
        }
    }
}
