//! What the motion says of the tree: angles between branches, and how each branch sways.

mod angle;
mod begin;
mod columns;
mod common;
mod decay;
mod film;
mod filter;
mod fit;
mod free;
mod gusts;
mod members;
mod minimum;
mod modal;
mod normal;
mod periodogram;
mod process;
mod pulls;
mod release;
mod signals;
mod spectrum;
mod spread;
mod sway;
mod swing;
mod wind;

pub use angle::{AngleToParent, angle_in_space_deg, angle_to_parent_deg};
pub use decay::{Mode, Start};
pub use film::{Film, FilmLog, FilmTrack};
pub use modal::{Shoot, shoots};
pub use pulls::energy;
pub use release::Onset;
pub use spectrum::{Spectrum, spectrum};
pub use sway::{Analysis, LEAST_PERIODS, analyse, analyse_soon};
