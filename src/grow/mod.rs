//! New trees that look and move like an example without being copies of it (Li 2011 sect. 5, Zeng
//! 2015 sect. 5.4.2).
//!
//! Li's way: the example is read as a flat tree of straight branches between its forks
//! ([`fork_tree`]). The shape of its forks ([`bifurcations`]) is learned as two Dirichlet
//! distributions ([`ForkStatistics`]), and a new flat tree is grown of forks that are drawn from
//! them ([`grow_flat`]). Zeng's way: the angles between the example's branches are learned as von
//! Mises distributions ([`SideAngles`]) and drawn anew ([`resample`]).
//!
//! How the branches sway is learned from their spectra ([`MotionStatistics`]). Where the trees of a
//! forest stand is drawn by [`Planting`].

mod dirichlet;
mod features;
mod flat_tree;
mod forest;
mod fork_tree;
mod motion;
mod poisson_disc;
mod resample;
mod space;
mod von_mises;

pub use dirichlet::{Basis, Dirichlet, DirichletFit, FEWEST_SAMPLES, fit};
pub use features::{Bifurcation, bifurcations};
pub use flat_tree::{FEWEST_FORKS, ForkStatistics, GrowError, grow_flat};
pub use forest::{Planting, PlantingError};
pub use fork_tree::fork_tree;
pub use motion::{LOOP_S, MotionStatistics, sample_sway};
pub use resample::{Resampling, SideAngles, resample};
pub use von_mises::{NothingSoDense, VonMises};
