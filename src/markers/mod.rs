//! Coloured markers bound on branches, followed by their hue (Hu et al. sect. 5.1).
//!
//! Each marker has a histogram of hues, taken from its window in the first frame, and a window that
//! moves to the middle of what is likely in each next frame: mean shift of a window of fixed size, or
//! CamShift (Bradski 1998). A marker that is hidden is looked for in windows all over the places that it can
//! have reached (the paper enlarges its window to four sides), or set back by the user. No two markers share a
//! blob. Places are the weighted middles of the likely pixels, so that they are finer than a pixel.

mod area;
mod blobs;
mod claims;
mod error;
mod follow;
mod hue;
mod marker;
mod places;
mod search;
mod shift;
mod way;

pub use error::{MarkerError, MarkerEvent};
pub use follow::{MarkerPlace, MarkerTracker, NoScene, Scene};
pub use places::check_places;
