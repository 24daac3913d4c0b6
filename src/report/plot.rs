//! Plots as SVG text. Colours and widths are those of the page's style sheet, by class, so that a
//! plot is light where the page is.

mod across;
mod angle;
mod axes;
mod curves;
mod labels;
mod map;
mod svg;
mod way;

pub use across::{Mark, Slot, across};
pub use angle::angle;
pub use curves::{Answer, Curve, spectra};
pub use map::{Map, map};
pub use svg::escaped;
pub use way::way;

/// Width and height of most plots, in units that are about a pixel on a phone.
const WIDTH: f64 = 360.0;
const HEIGHT: f64 = 210.0;
