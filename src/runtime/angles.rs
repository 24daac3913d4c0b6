//! The angles of all branches over the last seconds of film, frame by frame.

use crate::dynamics::AngleToParent;
use crate::model::{Angles, NodeId, NodeName, Pose, Skeleton};
use std::collections::VecDeque;
use std::sync::Arc;

/// A window that slides along. A row is shared by all that look at it: a copy of the whole window costs one count a frame.
pub struct AngleWindow {
    window_s: f64,
    nodes: Arc<[NodeName]>,
    followers: Vec<AngleToParent>,
    rows: VecDeque<(f64, Arc<[f32]>)>,
}

impl AngleWindow {
    /// Keeps `window_s` seconds.
    pub fn new(window_s: f64) -> Self {
        Self { window_s, nodes: Arc::default(), followers: Vec::new(), rows: VecDeque::new() }
    }

    /// Begins anew with the measured branches of `skeleton`.
    pub fn begin(&mut self, skeleton: &Skeleton) {
        let measured = &skeleton.nodes[..skeleton.measured()];
        self.nodes = measured.iter().skip(1).map(|n| n.name).collect();
        self.followers = (1..measured.len()).map(|i| AngleToParent::new(skeleton, NodeId(i as u32))).collect();
        self.rows.clear();
    }

    /// Takes the next pose.
    pub fn push(&mut self, pose: &Pose) {
        let row = self.followers.iter_mut().map(|f| f.step(pose) as f32).collect();
        self.rows.push_back((pose.time_s, row));
        while self.rows.front().is_some_and(|(t, _)| pose.time_s - t > self.window_s) {
            self.rows.pop_front();
        }
    }

    /// The last `span_s` seconds.
    pub fn last(&self, span_s: f64) -> Angles {
        let from_s = self.rows.back().map_or(0.0, |(t, _)| t - span_s);
        let from = self.rows.partition_point(|(t, _)| *t < from_s);
        Angles { nodes: self.nodes.clone(), rows: self.rows.range(from..).cloned().collect() }
    }
}
