//! Frequency and damping of every branch of a film.

use super::film::Film;
use super::free::{self, Demands};
use super::members::members;
use super::modal;
use super::release::{Onset, onset};
use super::wind;
use crate::cancel::CancelToken;
use crate::config::{Dynamics, Excited};
use crate::model::{Excitation, Skeleton, Swaying, Unidentified};
use std::borrow::Cow;

/// Fewer frames than this say nothing.
const LEAST_FRAMES: usize = 32;
/// Share of half the rate of the frames up to which frequencies are looked for.
pub(super) const BELOW_NYQUIST: f64 = 0.9;
/// Periods that a film must have of the lowest frequency that is looked for in it.
pub const LEAST_PERIODS: f64 = 1.5;

/// What a film says of the sway of its tree.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// By measured node; copies sway as their originals.
    pub sway: Vec<Swaying>,
    /// What made the tree sway; `None` where there is too little film to tell.
    pub onset: Option<Onset>,
    /// When it was let go, s, where that was more than once: the answers are of one of them, the
    /// onset's.
    pub releases_s: Vec<f64>,
}

/// The sway of every measured node of `skeleton` (its foot among them, which has none) in `film`.
///
/// Never fails: what the film does not carry is [`Unidentified`].
/// `cancel` is looked at before every branch, as many of them take a while: those that are left by
/// then are [`Unidentified::NotInTime`].
pub fn analyse(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Analysis {
    looked_at(skeleton, film, config, true, cancel)
}

/// The same in a time that a screen can wait for: one branch after the other, and not all of them
/// at once besides, which takes several times as long and answers for a few more.
pub fn analyse_soon(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Analysis {
    looked_at(skeleton, film, config, false, cancel)
}

fn looked_at(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    at_once: bool,
    cancel: &CancelToken,
) -> Analysis {
    let Some(Begun {
        members,
        onset,
        releases_s,
        demands,
        film,
    }) = begun(skeleton, film, config)
    else {
        let of = |m: &Vec<usize>| {
            Err(if m.is_empty() {
                Unidentified::NotMeasured
            } else {
                Unidentified::TooShort
            })
        };
        let mut sway: Vec<Swaying> = members(skeleton, film).iter().map(of).collect();
        sway.iter_mut()
            .take(1)
            .for_each(|foot| *foot = Err(Unidentified::NotMeasured));
        return Analysis {
            sway,
            onset: None,
            releases_s: Vec::new(),
        };
    };
    let sway = match onset.excitation {
        Excitation::Release => {
            let mut sways = free::sways(skeleton, &film, &members, &onset, &demands, cancel);
            if at_once {
                modal::answer(skeleton, &film, &onset, &demands, &mut sways, cancel);
            }
            sways
        }
        Excitation::Wind => wind::sways(skeleton, &film, &members, &demands, cancel),
    };
    Analysis {
        sway,
        onset: Some(onset),
        releases_s,
    }
}

/// A film that is long enough to be looked at, and what made its tree sway.
pub(super) struct Begun<'a> {
    /// Points of every measured node and of all above it.
    pub members: Vec<Vec<usize>>,
    pub onset: Onset,
    pub releases_s: Vec<f64>,
    pub demands: Demands,
    /// As far as it is used.
    pub film: Cow<'a, Film>,
}

/// `None` where there is too little film.
pub(super) fn begun<'a>(
    skeleton: &Skeleton,
    film: &'a Film,
    config: &Dynamics,
) -> Option<Begun<'a>> {
    if film.times_s.len() < LEAST_FRAMES || film.span_s() <= 0.0 {
        return None;
    }
    let highest_hz = (BELOW_NYQUIST * 0.5 / film.step_s()).min(config.highest_hz);
    let frequencies_hz = [LEAST_PERIODS / film.span_s(), highest_hz];
    if frequencies_hz[0] >= frequencies_hz[1] {
        return None;
    }
    let demands = Demands {
        frequencies_hz,
        highest_hz: config.highest_hz,
        widest: config.widest,
    };
    let given = match config.excitation {
        Excited::Auto => None,
        Excited::Release => Some(Excitation::Release),
        Excited::Wind => Some(Excitation::Wind),
    };
    let members = members(skeleton, film);
    let (onset, releases_s) = onset(
        film,
        members.get(1).map_or(&[], Vec::as_slice),
        given,
        frequencies_hz,
    );
    let film = film.until(onset.to);
    if film.times_s.len() - onset.from < LEAST_FRAMES {
        return None;
    }
    Some(Begun {
        members,
        onset,
        releases_s,
        demands,
        film,
    })
}
