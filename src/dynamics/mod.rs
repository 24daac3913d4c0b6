//! What the motion says of the tree: angles between branches, and how each branch sways.

mod ambient;
mod angle;
mod branch_tree;
mod branches;
mod celerite;
mod decay;
mod driven_oscillators;
mod film;
mod filter;
mod fit;
mod free_decay;
mod gap_free;
mod members;
mod modal;
mod mode_search;
mod periodogram;
mod release;
mod sandwich;
mod shake;
mod signals;
mod spectrum;
mod subspace;
mod sway;
mod swing;
mod wind;

pub use angle::{AngleToParent, angle_in_space_deg, angle_to_parent_deg};
pub use decay::{Mode, Start};
pub use film::{Film, FilmTrack, NOT_SEEN};
pub use modal::{Shoot, shoots};
pub use release::{Onset, fades_as_a_free_decay};
pub use shake::shake;
pub use spectrum::{HalfPower, Spectrum, spectrum};
pub use sway::{Analysis, Depth, LEAST_PERIODS, analyse};
