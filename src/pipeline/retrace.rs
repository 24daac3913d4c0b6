//! Poses once more, for the capture: every frame gets one, also those from before the tree was built.

use super::Tree;
use crate::config::Config;
use crate::model::{NodeId, Pose, TrackId, TrackSet};
use crate::motion::{Binding, PoseEstimator};
use std::sync::Arc;

/// Poses of frames that are over, as they were or would have been live: followed from the frame that was the first one
/// remembered when the tree was built, and, where there are earlier ones, apart from the capture's first.
pub struct Retrace {
    tree: Arc<Tree>,
    before: (Binding, PoseEstimator),
    after: (Binding, PoseEstimator),
}

impl Retrace {
    pub fn new(tree: &Arc<Tree>, config: &Config) -> Self {
        let fresh = || (tree.binding(), tree.estimator(config));
        Self { tree: tree.clone(), before: fresh(), after: fresh() }
    }

    /// The pose in the next frame, and where its tracks put the measured nodes (px); frames must come in their order.
    pub fn step(&mut self, tracks: &TrackSet) -> (Pose, Vec<Option<[f64; 2]>>) {
        let live = tracks.frame >= self.tree.followed_from;
        let (binding, estimator) = if live { &mut self.after } else { &mut self.before };
        let targets = binding.targets_px(tracks);
        let pose = estimator.step(tracks.frame, tracks.time_s, &targets);
        (pose, targets)
    }

    /// The deepest node that a track belongs to, as known after the last step.
    pub fn node_of(&self, track: TrackId) -> Option<NodeId> {
        self.after.0.node_of(track).or_else(|| self.before.0.node_of(track))
    }
}
