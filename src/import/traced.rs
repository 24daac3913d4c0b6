//! The branches that a photograph shows, as a flat tree: each is a stroke from where it leaves
//! another one to its tip.

use super::error::ImportError;
use super::flat_tree::FlatTree;
use super::join::joined;
use super::sketch::{Sketch, Stroke};
use crate::model::{BranchGraph, RADIUS_SHARE, Size, Skeleton};
use nalgebra::Point2;

/// Up to this share of the tree's height the trunk is as thick as where it is thickest there.
const FOOT_SHARE: f64 = 0.2;
/// A tip is as thick as its branch is so far below it, px.
const TIP_PX: f64 = 8.0;

/// The flat tree of the branches that were traced in a picture of this `size`, with the radii that
/// are seen, and 0.75 of the parent's where none is. Its crown has these corners, px.
///
/// # Errors
/// There are no branches, or too many forks on one another.
pub fn traced(
    branches: &BranchGraph,
    size: Size,
    crown_px: &[Point2<f64>],
) -> Result<FlatTree, ImportError> {
    let sketch = Sketch {
        size,
        strokes: strokes(branches),
        crown_px: crown_px.to_vec(),
    };
    let mut flat = joined(&sketch)?;
    assign_radii(&mut flat, branches);
    flat.has_radii = true;
    Ok(flat)
}

/// Radii as they are seen, none larger than that of the parent. Where none is seen a branch begins
/// with 0.75 of its parent's and tapers to its tip.
fn assign_radii(flat: &mut FlatTree, branches: &BranchGraph) {
    let beyond_px = beyond_px(&flat.skeleton);
    let seen_px = seen_radii_px(flat, branches);
    let skeleton = &mut flat.skeleton;
    for i in 1..skeleton.nodes.len() {
        let Some(parent) = skeleton.nodes[i].parent.map(|p| p.index()) else {
            continue;
        };
        let seen_px = seen_px[i];
        let piece_px = (skeleton.nodes[i].position - skeleton.nodes[parent].position).norm();
        let goes_on = beyond_px[i] + piece_px >= beyond_px[parent];
        let below_px = match skeleton.nodes[parent].radius {
            0.0 => seen_px,
            radius_px => radius_px,
        };
        skeleton.nodes[i].radius = if seen_px > 0.0 {
            seen_px.min(below_px)
        } else if goes_on {
            let left = (beyond_px[i] + TIP_PX) / (beyond_px[parent] + TIP_PX);
            below_px * left.sqrt()
        } else {
            RADIUS_SHARE * below_px
        };
    }
    if let [foot, first, ..] = &mut skeleton.nodes[..] {
        foot.radius = first.radius;
    }
}

/// The radius that is seen of the branch that ends in each node, px; 0 where none is. In the lowest
/// part of the trunk it is the largest there: the foot may lie in grass or shade.
fn seen_radii_px(flat: &FlatTree, branches: &BranchGraph) -> Vec<f64> {
    let skeleton = &flat.skeleton;
    let mut seen_px = Vec::with_capacity(skeleton.nodes.len());
    let heights = skeleton.nodes.iter().map(|n| n.position.y);
    let low_px = FOOT_SHARE * heights.fold(0.0, f64::max);
    let mut most_px = 0.0_f64;
    let mut is_low = Vec::with_capacity(skeleton.nodes.len());
    for node in &skeleton.nodes {
        let at_px = skeleton.image_from_model(&node.position);
        let piece = branches.piece_at(at_px, skeleton.image_size);
        let own_px = piece.map_or(0.0, |piece| branches.nodes[piece].radius_px);
        is_low.push(flat.is_on_trunk(at_px) && node.position.y <= low_px);
        if is_low[is_low.len() - 1] {
            most_px = most_px.max(own_px);
        }
        seen_px.push(own_px);
    }
    for (seen_px, is_low) in seen_px.iter_mut().zip(is_low) {
        *seen_px = if is_low { most_px } else { *seen_px };
    }
    seen_px
}

/// How far the tree reaches beyond each node, px.
fn beyond_px(skeleton: &Skeleton) -> Vec<f64> {
    let nodes = &skeleton.nodes;
    let mut beyond_px = vec![0.0_f64; nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        if let Some(parent) = node.parent.map(|p| p.index()) {
            let piece_px = (node.position - nodes[parent].position).norm();
            beyond_px[parent] = beyond_px[parent].max(beyond_px[i] + piece_px);
        }
    }
    beyond_px
}

/// The branches as strokes, the trunk first. At a fork the branch goes on in what reaches farthest.
fn strokes(branches: &BranchGraph) -> Vec<Stroke> {
    let nodes = &branches.nodes;
    let goes_on = goes_on_in(branches);
    let mut strokes = Vec::new();
    for (first, node) in nodes.iter().enumerate().skip(1) {
        let Some(from) = node.parent else { continue };
        // All but the one in which a branch goes on begin a stroke.
        if from != 0 && goes_on[from] == Some(first) {
            continue;
        }
        let mut points_px = vec![nodes[from].position_px, node.position_px];
        let mut at = first;
        while let Some(next) = goes_on[at] {
            points_px.push(nodes[next].position_px);
            at = next;
        }
        points_px.dedup();
        if points_px.len() > 1 {
            strokes.push(Stroke {
                name: format!("branch {}", strokes.len() + 1),
                points_px,
                is_trunk: strokes.is_empty(),
                width_px: None,
            });
        }
    }
    strokes
}

/// For every node the child from which the tree reaches farthest, the first of equals.
fn goes_on_in(branches: &BranchGraph) -> Vec<Option<usize>> {
    let nodes = &branches.nodes;
    let mut beyond_px = vec![0.0_f64; nodes.len()];
    let mut goes_on = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        let Some(parent) = node.parent else { continue };
        let reach_px = beyond_px[i] + (node.position_px - nodes[parent].position_px).norm();
        if reach_px >= beyond_px[parent] {
            (beyond_px[parent], goes_on[parent]) = (reach_px, Some(i));
        }
    }
    goes_on
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{NodeKind, WoodNode};

    /// A trunk that goes on straight, and a branch that leaves it on its way, whose width is not seen.
    fn graph() -> BranchGraph {
        let mut nodes = vec![
            WoodNode::made_up(None, 100.0, 300.0),
            WoodNode::made_up(Some(0), 100.0, 200.0),
            WoodNode::made_up(Some(1), 100.0, 60.0),
            WoodNode::made_up(Some(1), 160.0, 140.0),
        ];
        nodes[2].radius_px = 2.0;
        nodes[3].radius_px = 0.0;
        BranchGraph { nodes }
    }

    #[test]
    fn branches_become_a_tree_with_the_radii_that_are_seen() {
        let flat = traced(&graph(), Size::new(640, 360), &[]).expect("a tree");
        let nodes = &flat.skeleton.nodes;
        assert_eq!(nodes.len(), 4);
        assert!(nodes.iter().all(|n| n.kind == NodeKind::Traced));
        let at = |u: f64, v: f64| {
            let node = nodes.iter().find(|n| {
                (flat.skeleton.image_from_model(&n.position) - Point2::new(u, v)).norm() < 1e-6
            });
            node.expect("a node there")
        };
        assert_eq!(at(100.0, 200.0).radius, 4.25);
        assert_eq!(at(100.0, 60.0).radius, 2.0);
        assert_eq!(at(160.0, 140.0).radius, RADIUS_SHARE * 4.25);
        assert_eq!(flat.trunk_px.len(), 3, "{:?}", flat.trunk_px);
        assert!(traced(&BranchGraph::default(), Size::new(640, 360), &[]).is_err());
    }
}
