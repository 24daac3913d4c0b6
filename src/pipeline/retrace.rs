//! Poses once more, for the capture: every frame gets one, also those from before the tree was
//! built.

use super::{Poser, Targets, Tree};
use crate::config::Config;
use crate::model::{NodeName, Pose, TrackId, TrackSet};
use crate::motion;
use std::sync::Arc;

/// Frames over which the pose is led over. The picture allows a branch two depths, and the two ways
/// of following may have come to different ones.
const LED_OVER: u64 = 30;

/// Poses of frames that are over, as they were or would have been live: from the frame in which the
/// tree was first shown, followed from the first one that was remembered when it was built; before
/// that, followed from the capture's first.
pub struct Retrace {
    tree: Arc<Tree>,
    before: Poser,
    after: Poser,
}

impl Retrace {
    pub fn new(tree: &Arc<Tree>, config: &Config) -> Self {
        Self {
            tree: tree.clone(),
            before: tree.poser(config),
            after: tree.poser(config),
        }
    }

    /// The pose in the next frame, and where its tracks put the measured nodes (px); frames must
    /// come in their order.
    pub fn step(&mut self, tracks: &TrackSet) -> (Pose, Targets) {
        let (frame, shown_from) = (tracks.frame, self.tree.shown_from);
        let after = (frame >= self.tree.followed_from).then(|| self.after.step(tracks));
        // Where it is first followed, at rest, it would jump in depth in the middle of the film; by
        // here it has settled.
        match after {
            Some(after) if frame >= shown_from => after,
            Some((after, _)) if frame + LED_OVER > shown_from && self.tree.followed_from > 0 => {
                let (before, targets) = self.before.step(tracks);
                let share = 1.0 - (shown_from - frame) as f64 / LED_OVER as f64;
                (
                    motion::between(&self.tree.skeleton, &before, &after, share),
                    targets,
                )
            }
            _ => self.before.step(tracks),
        }
    }

    /// The name of the deepest node that a track belongs to, as known after the last step.
    pub fn node_of(&self, track: TrackId) -> Option<NodeName> {
        let node = self
            .after
            .binding
            .node_of(track)
            .or_else(|| self.before.binding.node_of(track))?;
        self.tree.skeleton.name_of(node)
    }
}
