//! The principal motions of all points of a tree from a release on, as signals that damped cosines
//! with common frequencies and damping ratios are fitted to.

use super::decay::Start;
use super::film::Film;
use super::gap_free::frames_with;
use super::members::Points;
use super::motions::Motions;
use super::release::ReleaseTime;
use super::signals::Signals;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;

/// Points that are used at most.
const MOST_POINTS: usize = 120;
/// More modes than motions that are fitted at most.
const MODES_BEYOND_MOTIONS: usize = 2;
/// Noise is at most this share of a motion.
pub(super) const MAX_NOISE_SHARE: f64 = 0.5;
/// Frames that are needed.
const MIN_FRAMES: usize = 32;

/// The motions, and the points that they are of.
pub(super) struct DecayingMotions {
    pub points: Points,
    pub motions: Motions,
}

impl DecayingMotions {
    /// Of `tracks` in a film from its release on; `None` where there are too few frames.
    pub fn of(film: &Film, tracks: &[usize]) -> Option<Self> {
        let points = Points::up_to(MOST_POINTS, film, tracks);
        let frames = frames_with(film, &[&points], MIN_FRAMES)?;
        if points.tracks.is_empty() {
            return None;
        }
        Some(Self {
            motions: Motions::of(film, &points, &frames),
            points,
        })
    }

    /// The largest motions, of like size, as decays.
    pub fn signals(&self, start: Start, release: &ReleaseTime, frequencies_hz: Bounds) -> Signals {
        let times_s = self.motions.times_s.iter();
        Signals::new(
            times_s.map(|t| t - release.at_s).collect(),
            &self.motions.of_like_size(),
            start,
            release.sd_s,
            frequencies_hz,
        )
    }

    /// Share of the largest motions, of like size and without noise, that so many free decays leave at
    /// most; `None` where there is no motion, or `cancel` ends the search before. Fewer are fitted to
    /// few motions: six decays describe ten seconds of any single one.
    pub fn share_left(
        &self,
        most_modes: usize,
        release: &ReleaseTime,
        frequencies_hz: Bounds,
        cancel: &CancelToken,
    ) -> Option<f64> {
        let signals = self.signals(Start::Moving, release, frequencies_hz);
        let modes = most_modes.min(MODES_BEYOND_MOTIONS + self.motions.above_noise());
        let left = signals.fit_modes(modes, cancel)?.rss;
        let all = signals.squares();
        let noise = self.motions.noise_of_like_size().min(MAX_NOISE_SHARE * all);
        (all > 0.0).then(|| ((left - noise) / (all - noise)).max(0.0))
    }
}
