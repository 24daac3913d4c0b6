//! Was the tree released, when, and how often: the signal tells release from wind.
//!
//! Four questions are asked of a film, each in a file of its own. How often was the tree pulled and
//! released (`repeated.rs`)? Where does the greatest motion begin and end (`motion.rs`)? Is what is
//! between the sum of a few decays, and does it die down (here)? And, where the answer is wind, may
//! it be the later part of a decay all the same (`fading.rs`, a hint only)?

mod energy;
mod fading;
mod motion;
mod repeated;

use super::decay::Start;
use super::decaying_motions::{DecayingMotions, MAX_NOISE_SHARE};
use super::film::Film;
use super::members::{Points, evenly_chosen};
use super::sampling;
use super::signals::Signals;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::Excitation;
pub use fading::fades_as_a_free_decay;
use motion::greatest_motion;
use repeated::{REST_S, parts};
use std::borrow::Cow;

/// Points that are looked at.
const MAX_POINTS: usize = 24;
/// Modes by which a decay of some points is described, and that of all points' principal motions.
const MODES: usize = 3;
const MODES_OF_ALL: usize = 6;
/// What a motion must do to be a free decay, where it is not seen from rest on and where it is.
/// Wind that happens to fade is not rare in a short film.
const FROM_MOTION: DecayCriteria = DecayCriteria {
    max_left: 0.075,
    max_energy_ratio: 0.35,
};
const FROM_REST: DecayCriteria = DecayCriteria {
    max_left: 0.1,
    max_energy_ratio: 0.5,
};
/// Rest is believed as the start if its fit leaves at most so many times the squares that a free
/// one does.
const MAX_RSS_FROM_REST: f64 = 1.3;
/// At least this share of the noise counts as left by a free fit.
const MIN_LEFT_OF_NOISE: f64 = 0.1;
/// Standard deviation of the moment of a release, in frames, before all modes have their say in it.
const RELEASE_SD_FRAMES: f64 = 0.7;
/// A film's last part tells whether it is a decay or wind if it is so long, s: before, a slow tree
/// has hardly died down.
const TELLS_S: f64 = 10.0;
/// Frames that a decay must have.
const MIN_FRAMES: usize = 32;

/// What a free decay is known by.
struct DecayCriteria {
    /// Share of the principal motions of all points that [`MODES_OF_ALL`] modes leave at most.
    max_left: f64,
    /// Energy of the last third against that of the first, at most.
    max_energy_ratio: f64,
}

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

/// When the tree was released, s, and the standard deviation of that.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReleaseTime {
    pub at_s: f64,
    pub sd_s: f64,
}

/// What made a film's tree sway, and what was worked out on the way to that.
pub(super) struct FoundOnset<'a> {
    pub onset: Onset,
    pub release: ReleaseTime,
    /// The frames that are used, in means of neighbours.
    pub film: Cow<'a, Film>,
    /// Where there are several releases, when each was, s.
    pub releases_s: Vec<f64>,
    /// After a release the motions of all points; `None` where there are too few frames, and in wind.
    pub decaying: Option<DecayingMotions>,
}

impl ReleaseTime {
    fn of(at_s: f64, film: &Film) -> Self {
        Self {
            at_s,
            sd_s: RELEASE_SD_FRAMES * film.step_s(),
        }
    }
}

impl<'a> FoundOnset<'a> {
    fn wind(film: &'a Film, highest_hz: f64) -> Self {
        let onset = Onset {
            excitation: Excitation::Wind,
            start: Start::Moving,
            at_s: film.times_s.first().copied().unwrap_or(0.0),
            from: 0,
            to: film.times_s.len(),
        };
        Self {
            release: ReleaseTime::of(onset.at_s, film),
            onset,
            film: sampling::of_wind(film, highest_hz),
            releases_s: Vec::new(),
            decaying: None,
        }
    }
}

/// Looks at the points of the whole tree; `given` is what the user says. Frequencies of the tree
/// lie within `frequencies_hz`. Where the tree was released several times, each from rest, it is
/// the time with the greatest motion, until the next pull. Nothing is to be made of it where
/// `cancel` has ended it.
pub(super) fn onset<'a>(
    film: &'a Film,
    tracks: &[usize],
    given: Option<Excitation>,
    frequencies_hz: Bounds,
    cancel: &CancelToken,
) -> FoundOnset<'a> {
    if given != Some(Excitation::Wind)
        && let Some(found) = of_parts(film, tracks, given, frequencies_hz, cancel)
    {
        return found;
    }
    of_one(film, tracks, given, frequencies_hz, cancel)
}

/// The same of the parts that hold a release each; `None` where there are none, or one of them is
/// wind.
fn of_parts(
    film: &Film,
    tracks: &[usize],
    given: Option<Excitation>,
    frequencies_hz: Bounds,
    cancel: &CancelToken,
) -> Option<FoundOnset<'static>> {
    let mut greatest: Option<(f64, FoundOnset)> = None;
    let mut times_s = Vec::new();
    for frames in parts(film) {
        let part = film.part(frames.clone());
        // As with the whole film, less than a wave shows no frequency.
        let lowest_hz = frequencies_hz.lo * film.span_s() / part.span_s();
        let frequencies_hz = Bounds::new(lowest_hz.min(frequencies_hz.hi), frequencies_hz.hi);
        let found = of_one(&part, tracks, None, frequencies_hz, cancel);
        let onset = found.onset;
        if onset.excitation == Excitation::Wind {
            // Wind, too, may rest and come again. Where the film ends soon after, it does not tell.
            let tells = frames.end < film.times_s.len() || part.span_s() >= TELLS_S;
            if given.is_none() && tells {
                return None;
            }
            times_s.push(part.times_s[0] + REST_S);
            continue;
        }
        times_s.push(onset.at_s);
        let motion = of_some(&found.film, tracks).squares();
        if greatest.as_ref().is_none_or(|(most, _)| motion >= *most) {
            let [from, to] = [onset.from, onset.to].map(|k| frames.start + k);
            let found = FoundOnset {
                onset: Onset { from, to, ..onset },
                film: Cow::Owned(found.film.into_owned()),
                ..found
            };
            greatest = Some((motion, found));
        }
    }
    let (_, greatest) = greatest?;
    if times_s.len() < 2 {
        times_s.clear();
    }
    Some(FoundOnset {
        releases_s: times_s,
        ..greatest
    })
}

/// Of a film with one release at most.
fn of_one<'a>(
    film: &'a Film,
    tracks: &[usize],
    given: Option<Excitation>,
    frequencies_hz: Bounds,
    cancel: &CancelToken,
) -> FoundOnset<'a> {
    let whole = of_some(film, tracks);
    if given == Some(Excitation::Wind) || whole.tracks.is_empty() {
        return FoundOnset::wind(film, frequencies_hz.hi);
    }
    let motion = greatest_motion(film, &whole);
    // What comes after it has died down must not come back either.
    let later = film.part(motion.from..film.times_s.len());
    let energy_ratio = energy_ratio(&of_some(&later, tracks), &later.times_s);
    let used = sampling::of_release(film, motion.from..motion.to, frequencies_hz.hi);
    let release = ReleaseTime::of(motion.at_s, film);
    let decay = Decay {
        points: of_some(&used, tracks),
        times_s: used.times_s.iter().map(|t| t - release.at_s).collect(),
        release_sd_s: release.sd_s,
        frequencies_hz,
        cancel,
    };
    let criteria = if motion.rested {
        FROM_REST
    } else {
        FROM_MOTION
    };
    let dies_down = energy_ratio < criteria.max_energy_ratio;
    if motion.to - motion.from < MIN_FRAMES
        || decay.points.tracks.is_empty()
        || given.is_none() && !dies_down
    {
        return FoundOnset::wind(film, frequencies_hz.hi);
    }
    let decaying = DecayingMotions::of(&used, tracks);
    if given.is_none() {
        let left = decaying
            .as_ref()
            .and_then(|motions| motions.share_left(MODES_OF_ALL, &release, frequencies_hz, cancel));
        if left.is_none_or(|left| left > criteria.max_left) {
            return FoundOnset::wind(film, frequencies_hz.hi);
        }
    }
    FoundOnset {
        onset: Onset {
            excitation: Excitation::Release,
            start: if motion.rested && decay.fits_rest() {
                Start::Rest
            } else {
                Start::Moving
            },
            at_s: motion.at_s,
            from: motion.from,
            to: motion.to,
        },
        release,
        film: used,
        releases_s: Vec::new(),
        decaying,
    }
}

/// What may be a free decay.
struct Decay<'a> {
    points: Points,
    /// From its begin on.
    times_s: Vec<f64>,
    release_sd_s: f64,
    frequencies_hz: Bounds,
    cancel: &'a CancelToken,
}

impl Decay<'_> {
    /// What `n` modes that describe most of the motion of the points, or as many as there are, leave of
    /// it, px²; `None` where `cancel` ends the search before.
    fn left_by(&self, start: Start, n: usize) -> Option<f64> {
        let signals = Signals::new(
            self.times_s.clone(),
            &self.points.signals,
            start,
            self.release_sd_s,
            self.frequencies_hz,
        );
        signals.fit_modes(n, self.cancel).map(|fit| fit.rss)
    }

    /// Whether modes that all start from rest describe it as well as free ones.
    fn fits_rest(&self) -> bool {
        let free = self.left_by(Start::Moving, MODES);
        // As many columns as the free fit has.
        let from_rest = self.left_by(Start::Rest, 2 * MODES);
        let Some((free, from_rest)) = free.zip(from_rest) else {
            return false;
        };
        let noise = self
            .points
            .noise()
            .min(MAX_NOISE_SHARE * self.points.squares());
        let least = (free - noise).max(MIN_LEFT_OF_NOISE * noise);
        from_rest - noise < MAX_RSS_FROM_REST * least
    }
}

/// Some of the points.
fn of_some(film: &Film, tracks: &[usize]) -> Points {
    Points::of(film, &evenly_chosen(tracks, MAX_POINTS))
}

/// Energy of the last third of some signals against that of the first.
fn energy_ratio(points: &Points, times_s: &[f64]) -> f64 {
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else {
        return 1.0;
    };
    let third_s = (last - first) / 3.0;
    let end_of_first = times_s.partition_point(|t| *t <= first + third_s);
    let begin_of_last = times_s.partition_point(|t| *t < last - third_s);
    let [mut early, mut late] = [0.0; 2];
    for signal in &points.signals {
        early += variance_of_seen(&signal[..end_of_first]);
        late += variance_of_seen(&signal[begin_of_last..]);
    }
    late / early
}

fn variance_of_seen(values: &[f64]) -> f64 {
    let seen: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    let n = (seen.len() as f64).max(1.0);
    let mean = seen.iter().sum::<f64>() / n;
    seen.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n
}
