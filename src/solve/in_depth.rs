//! A tree along its wood that is given another depth.

use super::bent_tree::{BentTree, Names, share_of_push, way_of};
use crate::model::{NodeId, Skeleton};

/// The tree `along` its wood in the depth of `straight`, which has the same branches without their
/// bends, stood up anew, and copies of its own.
pub fn in_depth_of(straight: &Skeleton, along: &Skeleton, first_name: u32) -> Skeleton {
    let mut tree = BentTree::on_foot_of(straight);
    push_measured(&mut tree, straight, along);
    tree.set_side_depths(straight);
    let mut names = Names {
        next: first_name,
        prior: None,
    };
    tree.copy_into_planes(straight, straight, &mut names);
    Skeleton {
        nodes: tree.nodes,
        ..along.clone()
    }
}

/// The measured nodes of `along` with their places in the picture.
fn push_measured(tree: &mut BentTree, straight: &Skeleton, along: &Skeleton) {
    let branches = along.foot_and_branches();
    let lengths_px = lengths_px(along, &branches);
    for node in (1..along.measured() as u32).map(NodeId) {
        let branch = branch_of(along, &branches, node).unwrap_or(0);
        let pushed = way_of(straight, branch);
        let share = if is_on_way(along, node) {
            share_of_push(&pushed, length_px(along, node), lengths_px[branch])
        } else {
            0.0
        };
        let mut new = along.nodes[node.index()].clone();
        let below = new.parent.and_then(|p| tree.nodes.get(p.index()));
        new.position.z = below.map_or(0.0, |below| below.position.z) + share * pushed.z;
        tree.push(new, branch, share, None);
    }
}

/// Length of each of the `branches` in the picture along its bends, px.
fn lengths_px(along: &Skeleton, branches: &[NodeId]) -> Vec<f64> {
    let mut lengths_px = vec![0.0; branches.len()];
    for node in (1..along.measured() as u32).map(NodeId) {
        if let Some(branch) = branch_of(along, branches, node)
            && is_on_way(along, node)
        {
            lengths_px[branch] += length_px(along, node);
        }
    }
    lengths_px
}

/// The place among `branches` of the one that a node is the end or a part of.
fn branch_of(along: &Skeleton, branches: &[NodeId], node: NodeId) -> Option<usize> {
    let mover = along.mover(node);
    branches.iter().position(|branch| *branch == mover)
}

/// Whether a node is on the way of its branch: its end or a bend.
fn is_on_way(along: &Skeleton, node: NodeId) -> bool {
    along.mover(node) == node || along.is_bend(node)
}

/// Length in the picture from a node's parent to the node, px.
fn length_px(along: &Skeleton, node: NodeId) -> f64 {
    way_of(along, node.index()).xy().norm()
}
