//! How often a tree was pulled and released in a film, and what of the film each time takes.

use super::super::film::{Film, FilmTrack};
use super::super::members::is_seen;
use super::energy::{Energy, Level, energy};
use crate::signal::median;
use nalgebra::{Point2, Vector2};
use std::ops::Range;

/// Time over which speeds are taken, s: the longer, the less noise is in them.
const OVER_S: f64 = 0.2;
/// Before a release the tree is at rest for so long, s, with at most this share of the energy that
/// it has at its peak so long after it, s; and that is at least this share of the film's largest.
pub(super) const REST_S: f64 = 0.6;
const MAX_ENERGY_AT_REST: f64 = 0.02;
const RISE_S: f64 = 1.0;
const MIN_PEAK: f64 = 0.2;
/// Of the rest so much must be seen, s.
const MIN_SEEN_REST_S: f64 = 0.3;
/// A sway that begins with its release is largest at once, and one that wind stirs grows: of the
/// energy that it has at its peak so long after the rest, s, the first peak has this share.
const GROWN_S: f64 = 6.0;
const MIN_FIRST_PEAK: f64 = 0.33;
/// What is shorter from its rest on is no decay, but the pull itself, s.
const MIN_DECAY_S: f64 = 3.0;
/// A hand brings the tree from where it rests to where it holds it: it has come so far along when
/// it is surely under way, and when it is all but there.
const UNDER_WAY: f64 = 0.3;
const ALL_BUT_THERE: f64 = 0.9;

/// Energy beyond what noise makes at its peak within some time from the first value on.
fn peak_within(energy: &[Energy], within_s: f64, floor: f64) -> f64 {
    let mut peak = 0.0_f64;
    for e in energy {
        if e.time_s - energy[0].time_s > within_s {
            break;
        }
        peak = peak.max(e.square - floor);
    }
    peak
}

/// Whether the tree is at rest until value `k`, and comes out of it as it does when it is released.
fn is_last_rest(energy: &[Energy], k: usize, level: Level, step_s: f64) -> bool {
    let (mut sum, mut seen) = (0.0, 0.0);
    for e in energy[..=k].iter().rev() {
        if energy[k].time_s - e.time_s > REST_S {
            break;
        }
        sum += e.square - level.floor;
        seen += 1.0;
    }
    let later = &energy[k..];
    let first_peak = peak_within(later, RISE_S, level.floor);
    // What was hardly seen was not seen at rest.
    seen * step_s >= MIN_SEEN_REST_S
        && sum < MAX_ENERGY_AT_REST * first_peak * seen
        && first_peak >= MIN_PEAK * level.top
        && first_peak >= MIN_FIRST_PEAK * peak_within(later, GROWN_S, level.floor)
}

/// When the tree was released from rest, or pulled from there with a jerk, s; `step_s` lie between
/// two frames.
fn comes_out_of_rest_s(energy: &[Energy], level: Level, step_s: f64) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::new();
    let mut at_rest: Option<f64> = None;
    for (k, now) in energy.iter().enumerate() {
        // Of all moments at which the motion is about to come, the last at rest.
        if is_last_rest(energy, k, level, step_s) {
            at_rest = Some(now.time_s);
        } else {
            out.extend(at_rest.take());
        }
    }
    out
}

/// The first frame that is not before `time_s`.
fn frame_at(film: &Film, time_s: f64) -> usize {
    film.times_s.partition_point(|t| *t < time_s)
}

/// The parts of a film that hold a release each, in order: from the rest before it until a hand
/// pulls again. None where the tree came out of rest once at most.
pub(super) fn parts(film: &Film) -> Vec<Range<usize>> {
    let Some(energy) = energy(film, OVER_S) else {
        return Vec::new();
    };
    let squares: Vec<f64> = energy.iter().map(|e| e.square).collect();
    let level = Level::of(&squares);
    let releases_s = comes_out_of_rest_s(&energy, level, film.step_s());
    if releases_s.len() < 2 {
        return Vec::new();
    }
    let swings = energy
        .iter()
        .filter(|e| e.square - level.floor > MAX_ENERGY_AT_REST * level.top);
    let swinging: Vec<usize> = swings.map(|e| frame_at(film, e.time_s)).collect();
    let mut out = Vec::new();
    for (k, release_s) in releases_s.iter().enumerate() {
        let from = frame_at(film, release_s - REST_S);
        let to = match releases_s.get(k + 1) {
            Some(next_s) => frame_at(film, pulled_again_s(film, &swinging, *release_s, *next_s)),
            None => film.times_s.len(),
        };
        if from < to && film.times_s[to - 1] - film.times_s[from] >= MIN_DECAY_S {
            out.push(from..to);
        }
    }
    out
}

/// The way that a hand pulls one point.
struct Pull {
    track: usize,
    /// The place about which the point swings, px.
    rest_px: Point2<f64>,
    /// From there to where it is held.
    way_px: Vector2<f64>,
}

/// The middle of the places at which a point was seen in some frames, px.
fn middle_px(at_px: &[Point2<f64>], frames: &[usize]) -> Option<Point2<f64>> {
    let seen = frames.iter().map(|&k| at_px[k]).filter(is_seen);
    let (u, v): (Vec<f64>, Vec<f64>) = seen.map(|p| (p.x, p.y)).unzip();
    Some(Point2::new(
        median(u, f64::total_cmp)?,
        median(v, f64::total_cmp)?,
    ))
}

/// How every point is pulled that is seen both `swinging` and held in the frames `holding`.
fn pulls(film: &Film, swinging: &[usize], holding: &[usize]) -> Vec<Pull> {
    let mut out = Vec::new();
    for (track, FilmTrack { at_px, .. }) in film.tracks.iter().enumerate() {
        let (rest, held) = (middle_px(at_px, swinging), middle_px(at_px, holding));
        if let (Some(rest_px), Some(held)) = (rest, held) {
            out.push(Pull {
                track,
                rest_px,
                way_px: held - rest_px,
            });
        }
    }
    out
}

/// How far along the points are in a frame: 0 where they rest, 1 where they are held.
fn share_of_way(film: &Film, pulls: &[Pull], frame: usize) -> f64 {
    let (mut along, mut all) = (0.0, 0.0);
    for pull in pulls {
        let at = film.tracks[pull.track].at_px[frame];
        if is_seen(&at) {
            along += (at - pull.rest_px).dot(&pull.way_px);
            all += pull.way_px.norm_squared();
        }
    }
    along / all
}

/// When a hand came back after a release before the next one, s. In the frames `swinging` the tree
/// is not held.
fn pulled_again_s(film: &Film, swinging: &[usize], release_s: f64, next_s: f64) -> f64 {
    let [first, held, next] = [release_s, next_s - REST_S, next_s].map(|t| frame_at(film, t));
    let pulls = pulls(film, swinging, &(held..next).collect::<Vec<_>>());
    let under_way = (first..held)
        .rev()
        .find(|&k| share_of_way(film, &pulls, k) < UNDER_WAY)
        .unwrap_or(first);
    let there = (under_way..next)
        .find(|&k| share_of_way(film, &pulls, k) > ALL_BUT_THERE)
        .unwrap_or(held);
    let took_s = film.times_s[there] - film.times_s[under_way];
    // It began as slowly as it went on, or more slowly.
    (film.times_s[under_way] - took_s).max(release_s)
}

#[cfg(test)]
mod tests {
    use super::super::super::film::NOT_SEEN;
    use super::*;
    use crate::bounds::Bounds;
    use crate::model::NodeId;
    use std::f64::consts::TAU;

    /// Nine points that move as `sway` says, px, each by another factor, with a little noise;
    /// frames at `rate_hz` but for a `gap`, s.
    fn film(seconds: f64, rate_hz: f64, gap: Range<f64>, sway: impl Fn(f64) -> f64) -> Film {
        let all = (0..(rate_hz * seconds) as u32).map(|k| f64::from(k) / rate_hz);
        let times: Vec<f64> = all.filter(|t| !gap.contains(t)).collect();
        let mut tracks = Vec::new();
        for i in 0..9 {
            let factor = 0.5 + 0.1 * f64::from(i);
            let at = times.iter().map(|&t| {
                let [u, v] = [t, t + 0.7].map(|t| noise(t, i));
                Point2::new(9.0 + factor * sway(t) + u, v)
            });
            tracks.push(FilmTrack {
                node: NodeId(1),
                at_px: at.collect(),
            });
        }
        Film::new(&times, tracks)
    }

    fn noise(t: f64, point: u32) -> f64 {
        0.2 * (1234.5 * t * f64::from(point + 1)).sin()
    }

    /// Pulled aside by `px`, and released at a time.
    struct Release {
        at_s: f64,
        px: f64,
    }

    impl Release {
        const fn new(at_s: f64, px: f64) -> Self {
            Self { at_s, px }
        }

        fn decay(&self, t: f64) -> f64 {
            self.px
                * (-0.04 * TAU * 0.6 * (t - self.at_s)).exp()
                * (TAU * 0.6 * (t - self.at_s)).cos()
        }
    }

    /// Pulled within a second, held for `holds_s`, and released, each time in turn.
    fn pulled(releases: &[Release], holds_s: f64, t: f64) -> f64 {
        let now = releases.iter().rposition(|r| r.at_s <= t);
        let free = now.map_or(0.0, |k| releases[k].decay(t));
        match releases.get(now.map_or(0, |k| k + 1)) {
            Some(next) if t > next.at_s - holds_s => next.px,
            Some(next) if t > next.at_s - holds_s - 1.0 => {
                let share = t - (next.at_s - holds_s - 1.0);
                free * (1.0 - share) + next.px * share
            }
            _ => free,
        }
    }

    /// Of the decay rather too little than any of the pull.
    fn is_near(is: &Bounds, wanted: &Bounds) -> bool {
        (is.lo - wanted.lo).abs() < 0.3 && (-0.8..0.1).contains(&(is.hi - wanted.hi))
    }

    #[track_caller]
    fn holds(film: &Film, wanted_s: &[Bounds]) {
        let parts: Vec<Bounds> = parts(film)
            .iter()
            .map(|p| Bounds::new(film.times_s[p.start], film.times_s[p.end - 1]))
            .collect();
        assert!(
            parts.len() == wanted_s.len()
                && parts
                    .iter()
                    .zip(wanted_s)
                    .all(|(is, wanted)| is_near(is, wanted)),
            "{parts:?}, not {wanted_s:?}"
        );
    }

    /// With the second pull in it, a decay is none.
    #[test]
    fn a_part_begins_with_the_rest_before_a_release_and_ends_with_the_next_pull() {
        let three = [
            Release::new(1.0, 9.0),
            Release::new(21.0, 8.0),
            Release::new(41.0, 12.0),
        ];
        for rate_hz in [30.0, 12.0] {
            holds(
                &film(60.0, rate_hz, 0.0..0.0, |t| pulled(&three, 1.0, t)),
                &[
                    Bounds::new(0.4, 19.0),
                    Bounds::new(20.4, 39.0),
                    Bounds::new(40.4, 60.0),
                ],
            );
        }
        // Held for longer than it swings.
        let two = [Release::new(1.0, 9.0), Release::new(31.0, 9.0)];
        holds(
            &film(40.0, 30.0, 0.0..0.0, |t| pulled(&two, 18.0, t)),
            &[Bounds::new(0.4, 12.0), Bounds::new(30.4, 40.0)],
        );
    }

    #[test]
    fn a_film_with_one_release_has_no_parts_nor_one_with_none() {
        let one = [Release::new(1.0, 9.0)];
        holds(&film(20.0, 30.0, 0.0..0.0, |t| pulled(&one, 1.0, t)), &[]);
        holds(&film(20.0, 30.0, 0.0..0.0, |_| 0.0), &[]);
        holds(&film(1.0, 30.0, 0.0..0.0, |t| pulled(&one, 1.0, t)), &[]);
        holds(&Film::default(), &[]);
        let mut unseen = film(20.0, 30.0, 0.0..0.0, |t| pulled(&one, 1.0, t));
        unseen
            .tracks
            .iter_mut()
            .for_each(|t| t.at_px.fill(NOT_SEEN));
        holds(&unseen, &[]);
    }

    /// A gap shows no rest.
    #[test]
    fn a_gap_in_a_decay_is_no_rest() {
        let one = [Release::new(1.0, 9.0)];
        for tenths in 5..40 {
            let gap_s = f64::from(tenths) / 10.0;
            holds(
                &film(20.0, 30.0, 4.0..4.0 + gap_s, |t| pulled(&one, 1.0, t)),
                &[],
            );
        }
    }
}
