//! From the motion hierarchy to a flat skeleton in the picture (Li et al. appendix A).

use crate::config;
use crate::model::{ClusterId, MotionHierarchy, Outline};

/// Node of the skeleton in the picture; the branch runs from the parent to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Node2d {
    /// Index of the parent, smaller than the node's own; `None` for the foot.
    pub parent: Option<usize>,
    /// 0 the trunk's foot, 1 its top, one more with every cut.
    pub level: u8,
    /// The cluster that moves the node; `None` for the foot, which stands still.
    pub cluster: Option<ClusterId>,
    pub position_px: [f64; 2],
}

/// The 2D skeleton T' of the paper: cluster centroids, folded. Node 0 is the foot, node k + 1 belongs to cluster k.
pub fn build(hierarchy: &MotionHierarchy, outline: &Outline, settings: &config::Skeleton) -> Vec<Node2d> {
    let foot = Node2d { parent: None, level: 0, cluster: None, position_px: foot_px(outline) };
    let mut nodes = vec![foot];
    for (k, c) in hierarchy.clusters.iter().enumerate() {
        nodes.push(Node2d {
            parent: Some(c.parent.map_or(0, |p| p.0 as usize + 1)),
            level: c.level + 1,
            cluster: Some(ClusterId(k as u32)),
            position_px: c.centroid_px,
        });
    }
    let mut has_children = vec![false; nodes.len()];
    for parent in nodes.iter().filter_map(|n| n.parent) {
        has_children[parent] = true;
    }
    // x' <- x' + alpha (parent - x'), root to tip, with the parent already folded; tips stay, lest the tree shrinks.
    for i in 1..nodes.len() {
        if let Some(parent) = nodes[i].parent.filter(|_| has_children[i]) {
            let towards = nodes[parent].position_px;
            let p = &mut nodes[i].position_px;
            *p = [p[0] + settings.fold * (towards[0] - p[0]), p[1] + settings.fold * (towards[1] - p[1])];
        }
    }
    nodes
}

/// Where the trunk leaves the ground: the middle of the outline's lowest rows, px.
pub fn foot_px(outline: &Outline) -> [f64; 2] {
    let Some([_, top, _, bottom]) = outline.bounds_px() else { return [0.0, 0.0] };
    let width = outline.size.width as usize;
    let from = bottom - (bottom - top) / 30;
    let rows = outline.mask.chunks_exact(width).enumerate().skip(from as usize);
    let inside = rows.flat_map(|(_, row)| row.iter().enumerate().filter(|(_, m)| **m != 0).map(|(u, _)| u as f64));
    let (sum, n) = inside.fold((0.0, 0.0), |(s, n), u| (s + u, n + 1.0));
    [sum / f64::max(n, 1.0), f64::from(bottom)]
}

/// Half the outline's width at the foot, px: an upper bound of the trunk's radius, as outlines are drawn wide.
pub fn foot_half_width_px(outline: &Outline) -> f64 {
    let Some([_, top, _, bottom]) = outline.bounds_px() else { return 1.0 };
    let width = outline.size.width as usize;
    let from = (bottom - (bottom - top) / 12) as usize;
    let rows = outline.mask.chunks_exact(width).take(bottom as usize + 1).skip(from);
    let narrowest = rows.map(|row| row.iter().filter(|m| **m != 0).count()).filter(|&n| n > 0).max();
    narrowest.unwrap_or(2) as f64 / 2.0
}
