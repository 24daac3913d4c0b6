//! The branches that a photograph shows, as a flat tree: each is a stroke from where it leaves
//! another one to its tip.

use super::error::ImportError;
use super::flat_tree::FlatTree;
use super::join::joined;
use super::sketch::{Sketch, Stroke};
use crate::model::{BranchGraph, Size};
use nalgebra::Point2;

/// The flat tree of the branches that were traced in a picture of this `size`, with the radii that
/// are seen, and 0 where none is. Its crown has these corners, px.
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
    assign_seen(&mut flat, branches);
    flat.has_radii = true;
    Ok(flat)
}

/// The radius that is seen of the branch that ends in each node, px; 0 where none is.
fn assign_seen(flat: &mut FlatTree, branches: &BranchGraph) {
    let size = flat.skeleton.image_size;
    for i in 0..flat.skeleton.nodes.len() {
        let at_px = flat
            .skeleton
            .image_from_model(&flat.skeleton.nodes[i].position);
        let piece = branches.piece_at(at_px, size);
        let seen_px = piece.map_or(0.0, |piece| branches.nodes[piece].radius_px);
        flat.skeleton.nodes[i].radius = seen_px;
    }
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
        assert_eq!(at(160.0, 140.0).radius, 0.0);
        assert_eq!(flat.trunk_px.len(), 3, "{:?}", flat.trunk_px);
        assert!(traced(&BranchGraph::default(), Size::new(640, 360), &[]).is_err());
    }
}
