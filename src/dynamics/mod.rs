//! What the motion says of the tree: angles between branches, and for now the dominant frequency of a
//! displacement, for the screen.

mod angle;
mod spectrum;

pub use angle::angle_to_parent_deg;
pub use spectrum::dominant_frequency_hz;
