//! Tracks to poses: the one way from a model and a log to where the tree was.

use crate::config::Config;
use crate::model::{NodeId, NodeName, Pose, TrackId, TrackSet};
use crate::motion::{self, Binding, PoseEstimator};
use crate::solve::Model;
use nalgebra::Point2;
use std::sync::Arc;

/// Where the tracks put each measured node, px; `None` for a node none of whose tracks was seen.
pub type Targets = Vec<Option<Point2<f64>>>;

/// Follows the pose of a model from frame to frame, from its rest pose on.
pub struct PoseTracker {
    model: Arc<Model>,
    binding: Binding,
    estimator: PoseEstimator,
}

impl PoseTracker {
    pub fn new(model: Arc<Model>, config: &Config) -> Self {
        Self {
            binding: model.binding(),
            estimator: PoseEstimator::new(model.skeleton.clone(), &config.motion),
            model,
        }
    }

    /// The pose in the next frame, and where its tracks put the measured nodes.
    pub fn step(&mut self, tracks: &TrackSet) -> (Pose, Targets) {
        let targets_px = self.binding.targets_px(tracks);
        let depths = self.binding.target_depths(tracks);
        let pose = self
            .estimator
            .step_in_space(tracks.frame, tracks.time_s, &targets_px, &depths);
        (pose, targets_px)
    }

    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The first frame that is shown by this model.
    pub(super) fn set_shown_from(&mut self, frame: u64) {
        Arc::make_mut(&mut self.model).shown_from = frame;
    }

    /// Which track moves which node; tracks that were found since the build included.
    pub fn binding(&self) -> &Binding {
        &self.binding
    }
}

/// Frames over which the pose is blended. The picture allows a branch two depths, and the two ways
/// of following may have come to different ones.
const BLEND_FRAMES: u64 = 30;

/// Poses of all frames of a film, as they were or would have been live: from the frame in which the
/// model was first shown, followed from the first one that was remembered when it was built; before
/// that, followed from the film's first.
pub struct PoseReplay {
    before: PoseTracker,
    after: PoseTracker,
}

impl PoseReplay {
    pub fn new(model: &Arc<Model>, config: &Config) -> Self {
        Self {
            before: PoseTracker::new(model.clone(), config),
            after: PoseTracker::new(model.clone(), config),
        }
    }

    pub fn model(&self) -> &Arc<Model> {
        &self.after.model
    }

    /// The pose in the next frame, and where its tracks put the measured nodes (px); frames must
    /// come in their order.
    pub fn step(&mut self, tracks: &TrackSet) -> (Pose, Targets) {
        let model = self.after.model.clone();
        let frame = tracks.frame;
        if frame < model.followed_from {
            return self.before.step(tracks);
        }
        let (after, targets_px) = self.after.step(tracks);
        if frame >= model.shown_from {
            return (after, targets_px);
        }
        // Where it is first followed, at rest, it would jump in depth in the middle of the film; by
        // the frame in which it was shown it has settled.
        let (before, targets_px) = self.before.step(tracks);
        let left = model.shown_from - frame;
        if left >= BLEND_FRAMES || model.followed_from == 0 {
            return (before, targets_px);
        }
        let share = 1.0 - left as f64 / BLEND_FRAMES as f64;
        let blended = motion::between(&model.skeleton, &before, &after, share);
        (blended, targets_px)
    }

    /// The deepest node that a track belongs to, as known after the last step.
    pub fn node_of(&self, track: TrackId) -> Option<NodeId> {
        let bindings = [&self.after.binding, &self.before.binding];
        bindings.iter().find_map(|b| b.node_of(track))
    }

    /// Its name.
    pub fn node_name_of(&self, track: TrackId) -> Option<NodeName> {
        self.model().skeleton.name_of(self.node_of(track)?)
    }
}
