//! Making a measured tree move: in a wind that nobody filmed, pulled and released, or as it was
//! filmed but more so.
//!
//! Every branch is the oscillator of Hu et al. eq. 7 with the frequency and the damping that were
//! measured on it ([`tune`]), solved exactly ([`Transition`]). What drives it is the moment that
//! bends it at its base: that of the wind ([`Wind`]) on all that it carries ([`loads`]), in its own
//! axes, in which it bends and neither stretches nor twists. A limb is a chain of such branches, so
//! it bends as a beam of segments does, each by its own bending moment.

mod animator;
mod known;
mod load;
mod magnify;
mod noise;
mod oscillator;
mod pull;
mod sound;
mod tune;
mod wind;

pub use animator::{Animator, Pull};
pub use known::Known;
pub use load::{Load, loads};
pub use magnify::{Magnify, MagnifyError, magnify};
pub use noise::Noise;
pub use oscillator::{Oscillation, Transition};
pub use pull::place_to_pull;
pub use sound::{Loudness, SoundError};
pub use tune::{Tuning, tune};
pub use wind::{Air, Wind, speed_m_s, wind_scale};

/// By how much an angle is to be multiplied so that it never exceeds `most` (same unit): not at all
/// up to `knee`, beyond it more and more.
fn soft(angle: f64, knee: f64, most: f64) -> f64 {
    let room = most - knee;
    if angle <= knee || angle <= 0.0 || room <= 0.0 {
        return if angle > most { most / angle } else { 1.0 };
    }
    (knee + room * ((angle - knee) / room).tanh()) / angle
}

/// What is left of a number of turns without the whole ones, 0 and above, below 1. `floor` would be
/// a call into a library.
fn fraction(turns: f64) -> f64 {
    let left = turns - (turns as i64) as f64;
    let above = if left < 0.0 { left + 1.0 } else { left };
    // So little below 0 that adding 1 rounds to it.
    if above < 1.0 { above } else { 0.0 }
}
