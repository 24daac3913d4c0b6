//! The principal motions of all points of a tree from a release on, as signals that damped cosines
//! with common frequencies and damping ratios are fitted to.

use super::decay::Start;
use super::film::Film;
use super::gap_free::enough_seen;
use super::members::Points;
use super::motions::Motions;
use super::release::RELEASE_SD_FRAMES;
use super::signals::Signals;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;

/// Points that are used at most.
const MOST_POINTS: usize = 120;
/// Neighbouring frames are taken together to so many a second, and frequencies are looked for up to
/// this share of them.
const FRAMES_PER_S: f64 = 15.0;
const MAX_FREQ_OF_RATE: f64 = 0.3;
/// More modes than motions that are fitted at most.
const MODES_BEYOND_MOTIONS: usize = 2;
/// Noise is at most this share of a motion.
pub(super) const MAX_NOISE_SHARE: f64 = 0.5;
/// Frames that are needed, taken together.
const MIN_FRAMES: usize = 32;

/// The motions, and the points that they are of.
pub(super) struct DecayingMotions {
    pub points: Points,
    pub motions: Motions,
    /// Standard deviation of the moment of a release, s.
    release_sd_s: f64,
}

impl DecayingMotions {
    /// Of `tracks` in `film` from its frame `from` on; `None` where there are too few frames.
    pub fn since(from: usize, film: &Film, tracks: &[usize]) -> Option<Self> {
        let points = Points::up_to(MOST_POINTS, film, tracks, 0);
        let every = (film.frames_per_period(FRAMES_PER_S) + 0.01).max(1.0);
        let mut frames = film.neighbours(from..film.times_s.len(), every as usize);
        frames.retain(|of| enough_seen(&points, of));
        if points.tracks.is_empty() || frames.len() < MIN_FRAMES {
            return None;
        }
        Some(Self {
            motions: Motions::of(film, &points, &frames),
            points,
            release_sd_s: RELEASE_SD_FRAMES * film.step_s(),
        })
    }

    /// The largest motions, of like size, as decays that begin at `at_s`.
    pub fn signals(&self, at_s: f64, start: Start, frequencies_hz: Bounds) -> Signals {
        let highest_hz = MAX_FREQ_OF_RATE / self.motions.step_s();
        let times_s = self.motions.times_s.iter();
        Signals::new(
            times_s.map(|t| t - at_s).collect(),
            &self.motions.of_like_size(),
            start,
            self.release_sd_s,
            Bounds::new(frequencies_hz.lo, frequencies_hz.hi.min(highest_hz)),
        )
    }

    /// Share of the largest motions, of like size and without noise, that so many free decays leave at
    /// most; `None` where there is no motion, or `cancel` ends the search before. Fewer are fitted to
    /// few motions: six decays describe ten seconds of any single one.
    pub fn share_left(
        &self,
        most_modes: usize,
        at_s: f64,
        frequencies_hz: Bounds,
        cancel: &CancelToken,
    ) -> Option<f64> {
        let signals = self.signals(at_s, Start::Moving, frequencies_hz);
        let modes = most_modes.min(MODES_BEYOND_MOTIONS + self.motions.above_noise());
        let left = signals.fit_modes(modes, cancel)?.rss;
        let all = signals.squares();
        let noise = self.motions.noise_of_like_size().min(MAX_NOISE_SHARE * all);
        (all > 0.0).then(|| ((left - noise) / (all - noise)).max(0.0))
    }
}
