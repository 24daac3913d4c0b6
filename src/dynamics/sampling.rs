//! Which frames of a film are used, in means of neighbours: one set of signals for all estimators.

use super::film::Film;
use std::borrow::Cow;
use std::ops::Range;

/// Frames a period of the highest frequency beyond which neighbours are taken together as their
/// mean: they cost time and say little. A mean hides what is faster, and does not show it as
/// something slower.
const FRAMES_PER_PERIOD: f64 = 3.0;
/// Longer films of wind, in frames that are left, are thinned to so many a second, if there are as
/// many.
const LONG_FILM_FRAMES: usize = 900;
const LONG_FILM_HZ: f64 = 7.5;
/// Share of the rate of the frames up to which frequencies are looked for, and of the rate of means:
/// these weaken a motion that is nearly as fast as half their rate, and one that is faster shows as a
/// slower one.
const SHOWN_BY_FRAMES: f64 = 0.45;
const SHOWN_BY_MEANS: f64 = 0.3;

/// Some frames of a film after a release, in means of about as many a second as show frequencies up
/// to `highest_hz`.
pub(super) fn of_release(film: &Film, frames: Range<usize>, highest_hz: f64) -> Cow<'_, Film> {
    let every = nearest_to_rate(film, FRAMES_PER_PERIOD * highest_hz);
    Film::in_means_of(film.part(frames), every)
}

/// A film of wind in such means, or fewer where it is long.
pub(super) fn of_wind(film: &Film, highest_hz: f64) -> Cow<'_, Film> {
    let mut every = nearest_to_rate(film, FRAMES_PER_PERIOD * highest_hz);
    if film.times_s.len() / every > LONG_FILM_FRAMES {
        every = every.max(nearest_to_rate(film, LONG_FILM_HZ));
    }
    Film::in_means_of(Cow::Borrowed(film), every)
}

/// Highest frequency that is looked for in `film`, Hz: the frames of `filmed`, or means of them.
pub(super) fn highest_hz(filmed: &Film, film: &Film) -> f64 {
    let frames_per_mean = film.step_s() / filmed.step_s();
    let of_rate = if frames_per_mean < 1.5 {
        SHOWN_BY_FRAMES
    } else {
        SHOWN_BY_MEANS
    };
    of_rate / film.step_s()
}

/// Neighbouring frames whose means come at about this rate.
fn nearest_to_rate(film: &Film, rate_hz: f64) -> usize {
    let frames = 1.0 / (rate_hz * film.step_s());
    frames.round().max(1.0) as usize
}
