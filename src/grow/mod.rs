//! New trees that look and move like an example without being copies of it (Li 2011 sect. 5, Zeng
//! 2015 sect. 5.4.2), and trees of which a part is seen (Tan et al. 2008 sect. 3).
//!
//! Li's way: the example is read as a flat tree of straight branches between its forks
//! ([`fork_tree`]). The shape of its forks ([`bifurcations`]) is learned as two Dirichlet
//! distributions ([`ForkStatistics`]), and a new flat tree is grown of forks that are drawn from
//! them ([`grow_flat`]). Zeng's way: the angles between the example's branches are learned as von
//! Mises distributions ([`SideAngles`]) and drawn anew ([`resample`]).
//!
//! Tan's way (2008 sect. 3) begins with the branches that a picture shows: subtrees of a [`Library`]
//! grow on them ([`grow_subtrees`]), drawn by attractors in the picture and in space.
//!
//! How the branches sway is learned from their spectra ([`MotionStatistics`]). Where the trees of a
//! forest stand is drawn by [`Planting`].

mod attractors;
mod dirichlet;
mod engine;
mod features;
mod flat_tree;
mod forest;
mod fork_statistics;
mod fork_tree;
mod library;
mod motion;
mod poisson_disc;
mod resample;
mod space;
mod von_mises;

pub use dirichlet::{Basis, Dirichlet, DirichletFit, FEWEST_SAMPLES, fit};
pub use engine::{Growth, GrowthRegion, ROUNDS, grow_subtrees};
pub use features::{Bifurcation, bifurcations};
pub use flat_tree::{GrowError, grow_flat};
pub use forest::{Planting, PlantingError};
pub use fork_statistics::ForkStatistics;
pub use fork_tree::fork_tree;
pub use library::{Library, Subtree, SubtreeBranch, SubtreeKind};
pub use motion::{LOOP_S, MotionStatistics, sample_sway};
pub use resample::{Resampling, SideAngles, resample};
pub use von_mises::{NothingSoDense, VonMises};
