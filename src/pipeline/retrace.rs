//! Poses once more, for the capture: every frame gets one, also those from before the tree was built.

use super::{Poser, Targets, Tree};
use crate::config::Config;
use crate::model::{NodeName, Pose, TrackId, TrackSet};
use std::sync::Arc;

/// Poses of frames that are over, as they were or would have been live: followed from the frame that was the first one
/// remembered when the tree was built, and, where there are earlier ones, apart from the capture's first.
pub struct Retrace {
    tree: Arc<Tree>,
    before: Poser,
    after: Poser,
}

impl Retrace {
    pub fn new(tree: &Arc<Tree>, config: &Config) -> Self {
        Self { tree: tree.clone(), before: tree.poser(config), after: tree.poser(config) }
    }

    /// The pose in the next frame, and where its tracks put the measured nodes (px); frames must come in their order.
    pub fn step(&mut self, tracks: &TrackSet) -> (Pose, Targets) {
        let live = tracks.frame >= self.tree.followed_from;
        if live { self.after.step(tracks) } else { self.before.step(tracks) }
    }

    /// The name of the deepest node that a track belongs to, as known after the last step.
    pub fn node_of(&self, track: TrackId) -> Option<NodeName> {
        let node = self.after.binding.node_of(track).or_else(|| self.before.binding.node_of(track))?;
        self.tree.skeleton.name_of(node)
    }
}
