//! What the motion says of the tree: for now, the dominant frequency of a displacement, for the screen.

mod spectrum;

pub use spectrum::dominant_frequency_hz;
