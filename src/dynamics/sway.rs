//! Frequency and damping of every branch of a film.

use super::film::Film;
use super::free::{self, Demands};
use super::members::members;
use super::release::{Onset, onset};
use super::wind;
use crate::config::{Dynamics, Excited};
use crate::model::{Excitation, Skeleton, Swaying, Unidentified};

/// Fewer frames than this say nothing.
const LEAST_FRAMES: usize = 32;
/// Share of half the rate of the frames up to which frequencies are looked for.
const BELOW_NYQUIST: f64 = 0.9;
/// Periods that a film must have of the lowest frequency that is looked for in it.
pub const LEAST_PERIODS: f64 = 1.5;

/// What a film says of the sway of its tree.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// By measured node; copies sway as their originals.
    pub sway: Vec<Swaying>,
    /// What made the tree sway; `None` where there is too little film to tell.
    pub onset: Option<Onset>,
}

/// The sway of every measured node of `skeleton` (its foot among them, which has none) in `film`.
///
/// Never fails: what the film does not carry is [`Unidentified`].
pub fn analyse(skeleton: &Skeleton, film: &Film, config: &Dynamics) -> Analysis {
    analyse_with(skeleton, film, config, &|| true)
}

/// The same; `go_on` is asked before every branch, as many of them take a while: those that are left when it says no are
/// [`Unidentified::NotInTime`].
pub fn analyse_with(skeleton: &Skeleton, film: &Film, config: &Dynamics, go_on: &dyn Fn() -> bool) -> Analysis {
    let members = members(skeleton, film);
    let nothing = |why| {
        let of = |m: &Vec<usize>| Err(if m.is_empty() { Unidentified::NotMeasured } else { why });
        let mut sway: Vec<Swaying> = members.iter().map(of).collect();
        sway.iter_mut().take(1).for_each(|foot| *foot = Err(Unidentified::NotMeasured));
        Analysis { sway, onset: None }
    };
    if film.times_s.len() < LEAST_FRAMES || film.span_s() <= 0.0 {
        return nothing(Unidentified::TooShort);
    }
    let highest_hz = (BELOW_NYQUIST * 0.5 / film.step_s()).min(config.highest_hz);
    let frequencies_hz = [LEAST_PERIODS / film.span_s(), highest_hz];
    if frequencies_hz[0] >= frequencies_hz[1] {
        return nothing(Unidentified::TooShort);
    }
    let demands = Demands { frequencies_hz, highest_hz: config.highest_hz, widest: config.widest };
    let given = match config.excitation {
        Excited::Auto => None,
        Excited::Release => Some(Excitation::Release),
        Excited::Wind => Some(Excitation::Wind),
    };
    let onset = onset(film, members.get(1).map_or(&[], Vec::as_slice), given, frequencies_hz);
    let film = &film.until(onset.to);
    if film.times_s.len() - onset.from < LEAST_FRAMES {
        return nothing(Unidentified::TooShort);
    }
    let sway = match onset.excitation {
        Excitation::Release => free::sways(skeleton, film, &members, &onset, &demands, go_on),
        Excitation::Wind => wind::sways(skeleton, film, &members, &demands, go_on),
    };
    Analysis { sway, onset: Some(onset) }
}
