//! When a tree was let go, and whether it was: the signal tells release from wind.

use super::begin::{Begin, begin};
use super::decay::Start;
use super::film::Film;
use super::members::Points;
use super::pulls::{REST_S, parts};
use super::signals::{Fit, Signals};
use crate::model::Excitation;

/// Points that are looked at.
const POINTS: usize = 24;
/// Modes by which a decay of the whole tree is described here.
const MODES: usize = 3;
/// Share of the motion that free decay must account for: of one that is not seen from rest on, and
/// of one that is.
const EXPLAINED: [f64; 2] = [0.85, 0.75];
/// Energy of the last third against that of the first, at most, after a release: of one that is not
/// seen from rest on, and of one that is. Wind that happens to fade is not rare in a short film.
const DIED_DOWN: [f64; 2] = [0.35, 0.5];
/// Rest is believed as the start if its fit leaves at most so many times the squares that a free
/// one does.
const REST_FITS: f64 = 1.3;
/// Standard deviation of the moment of a release, in frames, before all modes have their say in it.
pub(super) const MOMENT_SD: f64 = 0.7;
/// A film's last part tells whether it is a decay or wind if it is so long, s: before, a slow tree
/// has hardly died down.
const TELLS_S: f64 = 10.0;
/// Frames that a decay must have.
const LEAST_FRAMES: usize = 32;

/// What made a film's tree sway.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Onset {
    pub excitation: Excitation,
    /// Whether a release is seen from rest on.
    pub start: Start,
    /// Time of the release, or of the first frame, s.
    pub at_s: f64,
    /// First frame of the film that is used, and the one after the last.
    pub from: usize,
    pub to: usize,
}

/// Looks at the points of the whole tree; `given` is what the user says. Frequencies of the tree
/// lie within
/// `frequencies_hz`. Where the tree was let go several times, each from rest, it is the time with
/// the greatest motion, until the next pull; and when each was, s.
pub(super) fn onset(
    film: &Film,
    tracks: &[usize],
    given: Option<Excitation>,
    frequencies_hz: [f64; 2],
) -> (Onset, Vec<f64>) {
    let of_several = || of_parts(film, tracks, given, frequencies_hz);
    let found = if given == Some(Excitation::Wind) {
        None
    } else {
        of_several()
    };
    found.unwrap_or_else(|| (of_one(film, tracks, given, frequencies_hz), Vec::new()))
}

/// The same of the parts that hold a release each; `None` where there are none, or one of them is
/// wind.
fn of_parts(
    film: &Film,
    tracks: &[usize],
    given: Option<Excitation>,
    frequencies_hz: [f64; 2],
) -> Option<(Onset, Vec<f64>)> {
    let mut releases: Vec<(f64, Onset)> = Vec::new();
    let mut times_s = Vec::new();
    for frames in parts(film) {
        let part = film.part(frames.clone());
        // As with the whole film, less than a wave shows no frequency.
        let lowest_hz = frequencies_hz[0] * film.span_s() / part.span_s();
        let onset = of_one(
            &part,
            tracks,
            None,
            [lowest_hz.min(frequencies_hz[1]), frequencies_hz[1]],
        );
        match onset.excitation {
            Excitation::Release => {
                let motion = squares(&thinned(&part.until(onset.to), tracks, onset.from));
                let [from, to] = [onset.from, onset.to].map(|k| frames.start + k);
                releases.push((motion, Onset { from, to, ..onset }));
                times_s.push(onset.at_s);
            }
            // Wind, too, may rest and come again. Where the film ends soon after, it does not tell.
            Excitation::Wind
                if given.is_none()
                    && (frames.end < film.times_s.len() || part.span_s() >= TELLS_S) =>
            {
                return None;
            }
            Excitation::Wind => times_s.push(part.times_s[0] + REST_S),
        }
    }
    let (_, greatest) = releases.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((
        greatest,
        if times_s.len() > 1 {
            times_s
        } else {
            Vec::new()
        },
    ))
}

/// Of a film with one release at most.
fn of_one(
    film: &Film,
    tracks: &[usize],
    given: Option<Excitation>,
    frequencies_hz: [f64; 2],
) -> Onset {
    let first_s = film.times_s.first().copied().unwrap_or(0.0);
    let to = film.times_s.len();
    let wind = Onset {
        excitation: Excitation::Wind,
        start: Start::Moving,
        at_s: first_s,
        from: 0,
        to,
    };
    let whole = thinned(film, tracks, 0);
    if given == Some(Excitation::Wind) || whole.tracks.is_empty() {
        return wind;
    }
    let Begin {
        rested,
        at_s,
        from,
        to,
    } = begin(film, &whole);
    // What comes after it has died down must not come back either.
    let later: Vec<f64> = film.times_s[from..].iter().map(|t| t - at_s).collect();
    let left_over = left_over(&thinned(film, tracks, from), &later);
    let film = &film.until(to);
    let points = thinned(film, tracks, from);
    let times: Vec<f64> = film.times_s[from..].iter().map(|t| t - at_s).collect();
    if times.len() < LEAST_FRAMES || points.tracks.is_empty() {
        return wind;
    }
    let signals = |start| {
        Signals::new(
            times.clone(),
            &points.signals,
            start,
            MOMENT_SD * film.step_s(),
            frequencies_hz,
        )
    };
    let Some(free) = described(&signals(Start::Moving), MODES) else {
        return wind;
    };
    let all = squares(&points);
    let noise = points.noise().min(0.5 * all);
    if given.is_none()
        && !(left_over < DIED_DOWN[usize::from(rested)]
            && free - noise < (1.0 - EXPLAINED[usize::from(rested)]) * (all - noise))
    {
        return wind;
    }
    let moving = Onset {
        excitation: Excitation::Release,
        start: Start::Moving,
        at_s,
        from,
        to,
    };
    // As many columns as the free fit has.
    let fits = |rest: f64| rest - noise < REST_FITS * (free - noise).max(0.1 * noise);
    let rest = rested && described(&signals(Start::Rest), 2 * MODES).is_some_and(fits);
    Onset {
        start: if rest { Start::Rest } else { Start::Moving },
        ..moving
    }
}

/// What `n` modes that describe most of the motion leave of it.
fn described(signals: &Signals, n: usize) -> Option<f64> {
    let mut fit = Fit::default();
    for _ in 0..n {
        let new = signals.search(&fit)?;
        fit.modes.push(new);
        fit = signals.fit(&fit, &[]);
    }
    Some(fit.rss)
}

/// Of all displacements, px².
fn squares(points: &Points) -> f64 {
    points
        .signals
        .iter()
        .flatten()
        .filter(|x| x.is_finite())
        .map(|x| x * x)
        .sum()
}

fn thinned(film: &Film, tracks: &[usize], from: usize) -> Points {
    let n = tracks.len().min(POINTS);
    let some: Vec<usize> = (0..n).map(|i| tracks[i * tracks.len() / n]).collect();
    Points::of(film, &some, from)
}

/// Energy of the last third of some signals against that of the first.
fn left_over(points: &Points, times_s: &[f64]) -> f64 {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else {
        return 1.0;
    };
    let energy = |from: f64, to: f64| -> f64 {
        let within =
            |t: &f64| (t - first) >= from * (last - first) && (t - first) <= to * (last - first);
        let rows: Vec<usize> = (0..times_s.len())
            .filter(|&k| within(&times_s[k]))
            .collect();
        points
            .signals
            .iter()
            .map(|s| {
                let seen: Vec<f64> = rows
                    .iter()
                    .map(|&k| s[k])
                    .filter(|x| x.is_finite())
                    .collect();
                let n = (seen.len() as f64).max(1.0);
                let mean = seen.iter().sum::<f64>() / n;
                seen.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n
            })
            .sum()
    };
    energy(2.0 / 3.0, 1.0) / energy(0.0, 1.0 / 3.0)
}
