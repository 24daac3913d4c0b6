//! Poses once more, for the capture: every frame gets one, also those from before the tree was built.

use super::{Poser, Targets, Tree};
use crate::config::Config;
use crate::model::{NodeName, Pose, TrackId, TrackSet};
use std::sync::Arc;

/// Poses of frames that are over, as they were or would have been live: from the frame in which the tree was first shown,
/// followed from the first one that was remembered when it was built; before that, followed from the capture's first.
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
        let after = (tracks.frame >= self.tree.followed_from).then(|| self.after.step(tracks));
        // Where it is first followed, at rest, it would jump in depth in the middle of the film; by here it has settled.
        after.filter(|_| tracks.frame >= self.tree.shown_from).unwrap_or_else(|| self.before.step(tracks))
    }

    /// The name of the deepest node that a track belongs to, as known after the last step.
    pub fn node_of(&self, track: TrackId) -> Option<NodeName> {
        let node = self.after.binding.node_of(track).or_else(|| self.before.binding.node_of(track))?;
        self.tree.skeleton.name_of(node)
    }
}
