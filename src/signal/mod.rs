//! Mathematics that several stages need, one way of each: statistics, principal components, linear
//! and nonlinear least squares, minimisation. It imports nothing else of the crate.

pub mod bfgs;
pub mod extension;
pub mod gram;
mod hull;
pub mod interpolation;
pub mod least_squares;
mod line;
pub mod ln_product;
mod local_affine;
pub mod principal;
pub mod qr;
pub mod reflection;
mod segments;
mod similarity;
pub mod statistics;
pub mod variable_projection;
pub mod vectors;

pub use hull::convex_hull;
pub use line::corners;
pub use local_affine::{Fit, Witness, local_affine};
pub use principal::along_principal_direction;
pub use segments::{distance_to_segment, segments_cross};
pub use similarity::{CAUCHY, CommonMotion, Pair, sd_of_misses};
pub use statistics::median;
