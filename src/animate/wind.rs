//! The air about a tree: a mean wind, gusts that travel across the crown, and eddies.

use super::noise::Noise;
use super::sound::Loudness;
use crate::config;
use crate::model::Skeleton;
use crate::random::seed_of_part;
use nalgebra::{Point3, Vector3};

/// Speed in steady wind of force 6, m/s: pressure is a multiple of what it is there.
const REFERENCE_M_S: f64 = 12.287;
/// From about this speed on a crown bends out of the wind and its drag grows less than with the
/// square of speed, m/s; far beyond with the power 2 - 1/2; Vogel found -0.4 to -0.9 for leaves and
/// branches of broad-leaved trees.
const STREAMLINED_M_S: f64 = 10.0;
/// Standard deviations of the speed across the wind and upwards, and of eddies, as shares of that
/// along the wind.
const ACROSS: f64 = 0.7;
const RISE: f64 = 0.4;
const EDDY: f64 = 0.6;
/// Eddies as small as a branch are shorter than this, s.
const EDDY_S: f64 = 1.0;
/// Gusts do not travel slower than this: in still air they would stand, m/s.
const SLOWEST_M_S: f64 = 1.0;
/// Time in which the wind follows a change of what is wished, s.
const CHANGE_S: f64 = 1.0;

/// Mean speed of a force on the Beaufort scale, m/s: 0.836 B^(3/2).
pub fn speed_m_s(force: f64) -> f64 {
    0.836 * force.max(0.0).powf(1.5)
}

/// Metres of a pixel for the wind about a tree: `given`, or where that is 0 as many as a tree of
/// the height in the settings has.
pub fn wind_scale(skeleton: &Skeleton, given: f64, settings: &config::Wind) -> f64 {
    if given > 0.0 {
        return given;
    }
    let heights_px = skeleton.nodes.iter().map(|n| n.position.y);
    settings.tree_height_m / heights_px.fold(1.0, f64::max)
}

/// What drives the gusts.
#[derive(Clone, Debug)]
enum Gusts {
    Noise(Noise),
    Sound(Loudness),
}

/// Wind about a tree.
#[derive(Clone, Debug)]
pub struct Wind {
    gusts: Gusts,
    across: Noise,
    rise: Noise,
    eddies: Noise,
    /// Standard deviation as a share of the mean.
    strength: f64,
    period_s: f64,
    metres_per_px: f64,
    wanted_m_s: Vector3<f64>,
    mean_m_s: Vector3<f64>,
}

/// The wind at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Air {
    time_s: f64,
    speed_m_s: f64,
    along: Vector3<f64>,
    across: Vector3<f64>,
    /// By so much later a gust comes to what lies a pixel farther along, s.
    delay_s_per_px: f64,
}

impl Wind {
    /// Wind that repeats itself after `period_s`, about a tree with a pixel of so many metres.
    pub fn new(settings: &config::Wind, period_s: f64, metres_per_px: f64) -> Self {
        let seed = u64::from(settings.seed);
        let [beta, gust_s] = [settings.beta, settings.gust_s];
        let mean_m_s = velocity(settings.force, settings.direction_deg);
        Self {
            gusts: Gusts::Noise(noise(period_s, beta, gust_s, seed_of_part(seed, 1))),
            across: noise(period_s, beta, gust_s, seed_of_part(seed, 2)),
            rise: noise(period_s, beta, gust_s, seed_of_part(seed, 3)),
            eddies: noise(period_s, beta, EDDY_S.min(gust_s), seed_of_part(seed, 4)),
            strength: settings.gusts,
            period_s,
            metres_per_px,
            wanted_m_s: mean_m_s,
            mean_m_s,
        }
    }

    /// The same with a sound's loudness instead of gusts: the wind blows as loud as it is.
    pub fn driven_by(mut self, sound: Loudness) -> Self {
        self.gusts = Gusts::Sound(sound);
        self
    }

    /// Asks for another wind; it comes within a second or two.
    pub fn turn_to(&mut self, force: f64, direction_deg: f64) {
        self.wanted_m_s = velocity(force, direction_deg);
    }

    /// Lets `step_s` pass for what was asked for.
    pub fn follow(&mut self, step_s: f64) {
        if self.mean_m_s != self.wanted_m_s {
            let left = self.wanted_m_s - self.mean_m_s;
            let near = left.norm() < 1e-3;
            self.mean_m_s += if near {
                left
            } else {
                left * (1.0 - (-step_s / CHANGE_S).exp())
            };
        }
    }

    /// The wind at a time; `None` where the air is still.
    pub fn at(&self, time_s: f64) -> Option<Air> {
        let speed_m_s = self.mean_m_s.norm();
        let along = self.mean_m_s.try_normalize(1e-6)?;
        let delay_s_per_px = self.metres_per_px / speed_m_s.max(SLOWEST_M_S);
        Some(Air {
            time_s,
            speed_m_s,
            along,
            across: Vector3::y().cross(&along),
            delay_s_per_px,
        })
    }

    /// How the air presses at a place (model axes, px), as a multiple of steady wind of force 6.
    /// `own_s` tells the eddies of one branch from those of another.
    pub fn pressure(&self, air: &Air, place: &Point3<f64>, own_s: f64) -> Vector3<f64> {
        let here_s = air.time_s - place.coords.dot(&air.along) * air.delay_s_per_px;
        let (mean, vary) = match &self.gusts {
            Gusts::Noise(noise) => (1.0 + self.strength * noise.at(here_s), 1.0),
            Gusts::Sound(sound) => {
                let loud = sound.at(here_s);
                (loud, loud)
            }
        };
        let vary = vary * self.strength;
        let eddies_s = air.time_s + own_s;
        let (ahead, aside, up) = (
            mean + vary * self.eddy(eddies_s, 0.0),
            vary * (ACROSS * self.across.at(here_s) + self.eddy(eddies_s, 1.0)),
            vary * (RISE * self.rise.at(here_s) + self.eddy(eddies_s, 2.0)),
        );
        let share = air.along * ahead + air.across * aside + Vector3::new(0.0, up, 0.0);
        drag(share * air.speed_m_s)
    }

    /// Eddies along (0), across (1) and up (2): one noise, read a third of its period apart.
    fn eddy(&self, time_s: f64, part: f64) -> f64 {
        EDDY * self.eddies.at(time_s + part * self.period_s / 3.0)
    }
}

/// Noise that is flat below the rate of its slowest changes.
fn noise(period_s: f64, beta: f64, slowest_s: f64, seed: u64) -> Noise {
    Noise::new(period_s, beta, 1.0 / slowest_s.max(1e-3), seed)
}

/// Of the mean wind, m/s in model axes.
fn velocity(force: f64, direction_deg: f64) -> Vector3<f64> {
    let (sin, cos) = direction_deg.to_radians().sin_cos();
    Vector3::new(cos, 0.0, -sin) * speed_m_s(force)
}

/// Pressure of air of this velocity, 1 at the reference.
fn drag(velocity_m_s: Vector3<f64>) -> Vector3<f64> {
    let speed = velocity_m_s.norm();
    let streamlined = (1.0 + REFERENCE_M_S / STREAMLINED_M_S) / (1.0 + speed / STREAMLINED_M_S);
    velocity_m_s * (speed / (REFERENCE_M_S * REFERENCE_M_S) * streamlined.sqrt())
}
