//! From the motion hierarchy to a flat skeleton in the picture (Li 2011 app. A).

use crate::config;
use crate::model::{ClusterId, MotionHierarchy};
use nalgebra::Point2;

/// Node of the skeleton in the picture; the branch runs from the parent to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Node2d {
    /// Index of the parent, smaller than the node's own; `None` for the foot.
    pub parent: Option<usize>,
    /// 0 the trunk's foot, 1 its top, one more with every cut.
    pub level: u8,
    /// The cluster that moves the node; `None` for the foot, which stands still.
    pub cluster: Option<ClusterId>,
    pub position_px: Point2<f64>,
    /// As [`Cluster::certainty`](crate::model::Cluster::certainty).
    pub certainty: f32,
}

/// The 2D skeleton T' of Li 2011. Node 0 is the foot, at `foot_px`, node k + 1 belongs to cluster
/// k.
///
/// A node is where its cluster's branch ends; where that is not known, at the centroid, folded as
/// in the paper.
pub fn build(
    hierarchy: &MotionHierarchy,
    foot_px: Point2<f64>,
    settings: &config::Skeleton,
) -> Vec<Node2d> {
    let foot = Node2d {
        parent: None,
        level: 0,
        cluster: None,
        position_px: foot_px,
        certainty: 0.0,
    };
    let mut nodes = vec![foot];
    for (k, c) in hierarchy.clusters.iter().enumerate() {
        nodes.push(Node2d {
            parent: Some(c.parent.map_or(0, |p| p.0 as usize + 1)),
            level: c.level + 1,
            cluster: Some(ClusterId(k as u32)),
            position_px: c.end_px.unwrap_or(c.centroid_px),
            certainty: c.certainty,
        });
    }
    let mut has_children = vec![false; nodes.len()];
    for parent in nodes.iter().filter_map(|n| n.parent) {
        has_children[parent] = true;
    }
    // x' <- x' + alpha (parent - x'), root to tip, with the parent already folded; tips stay, lest
    // the tree shrinks.
    for i in 1..nodes.len() {
        let at_centroid = hierarchy.clusters[i - 1].end_px.is_none();
        if let Some(parent) = nodes[i].parent.filter(|_| has_children[i] && at_centroid) {
            let towards = nodes[parent].position_px;
            let p = &mut nodes[i].position_px;
            *p += settings.fold * (towards - *p);
        }
    }
    nodes
}
