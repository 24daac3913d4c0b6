//! The wood that pictures show.

use super::{BranchGraph, Rgb};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The wood of a tree, as the pictures of a film show it at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wood {
    pub branches: BranchGraph,
    /// The trunk's bark as a tile that repeats without a seam (sRGB): once round a limb, and as far
    /// along it as it is round. One texel where only its colour is seen, `None` where no trunk is.
    pub bark: Option<Arc<Rgb>>,
}

/// The wood that was found while a film went on, by the newest frame that was looked at.
pub type WoodSeen = BTreeMap<u64, Arc<Wood>>;
