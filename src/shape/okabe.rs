//! Branches in space so that they lie as far apart as they can (Okabe et al. 2005, as Tan et al. 2008
//! sect. 3.1 use it): the other way than the push from a flat tree to one in space.

use crate::model::{MovingBranch, NodeId, Skeleton};
use nalgebra::{Point3, Vector3};

/// Directions that are tried, evenly from the steepest towards the viewer to the steepest away.
const DIRECTIONS: i32 = 36;
/// The steepest, degrees out of the plane of the picture.
const STEEPEST_DEG: f64 = 60.0;
/// Shares of a branch's length at which it is looked at how near others are.
const LOOKED_AT: [f64; 2] = [0.5, 1.0];
/// Places along a branch that others keep away from.
const SAMPLES: u32 = 4;

/// Gives every branch but the trunk the depth that makes its least distance to those which have one
/// the greatest, from the trunk outwards. Places in the picture stay. `tree` has no copies; all of
/// its depths are given anew, `trunk` says which nodes keep the depth 0.
pub fn set_depths_apart(tree: &mut Skeleton, trunk: &[bool]) {
    for node in &mut tree.nodes {
        node.position.z = 0.0;
    }
    let mut placed: Vec<Point3<f64>> = Vec::new();
    for branch in tree.moving_branches() {
        let lengths_px = lengths_px(tree, &branch);
        let is_trunk = trunk.get(branch.node.index()).is_some_and(|is_in| *is_in);
        let slope = match is_trunk {
            true => 0.0,
            false => most_apart(tree, &branch, &lengths_px, &placed),
        };
        let from_z = tree.nodes[branch.begin.index()].position.z;
        for part in &lengths_px {
            tree.nodes[part.node.index()].position.z = from_z + slope * part.length_px;
        }
        let (from, way) = (
            tree.nodes[branch.begin.index()].position,
            branch.vector(tree),
        );
        placed.extend((1..=SAMPLES).map(|k| from + way * (f64::from(k) / f64::from(SAMPLES))));
    }
}

/// Gives every measured branch whose end a depth camera has seen that depth, evenly along its way from
/// where it begins; `seen_z_px` says where the end in a node is, px.
pub fn set_depths_seen(tree: &mut Skeleton, seen_z_px: impl Fn(NodeId) -> Option<f64>) {
    for branch in tree.moving_branches() {
        let is_copy = tree.nodes[branch.node.index()].copy_of.is_some();
        let Some(end_z) = seen_z_px(branch.node).filter(|_| !is_copy) else {
            continue;
        };
        let lengths_px = lengths_px(tree, &branch);
        let own = lengths_px.iter().find(|part| part.node == branch.node);
        let length_px = own.map_or(0.0, |part| part.length_px);
        let from_z = tree.nodes[branch.begin.index()].position.z;
        let slope = (end_z - from_z) / length_px.max(f64::MIN_POSITIVE);
        for part in lengths_px.iter().filter(|_| length_px > 0.0) {
            tree.nodes[part.node.index()].position.z = from_z + slope * part.length_px;
        }
    }
}

/// A part of a branch, and how far along the branch it is in the picture.
struct Part {
    node: NodeId,
    length_px: f64,
}

/// The parts of a branch, each after the one that carries it.
fn lengths_px(tree: &Skeleton, branch: &MovingBranch) -> Vec<Part> {
    let mut nodes: Vec<NodeId> = branch.parts().collect();
    nodes.sort();
    let mut parts: Vec<Part> = Vec::with_capacity(nodes.len());
    for node in nodes {
        let Some(parent) = tree.nodes[node.index()].parent else {
            continue;
        };
        let piece = tree.nodes[node.index()].position - tree.nodes[parent.index()].position;
        let below = parts.iter().find(|part| part.node == parent);
        let length_px = below.map_or(0.0, |part| part.length_px) + piece.xy().norm();
        parts.push(Part { node, length_px });
    }
    parts
}

/// Depth for each pixel of length at which a branch is farthest from all that is placed; the
/// flattest of equals.
fn most_apart(
    tree: &Skeleton,
    branch: &MovingBranch,
    parts: &[Part],
    placed: &[Point3<f64>],
) -> f64 {
    let from = tree.nodes[branch.begin.index()].position;
    let flat = tree.nodes[branch.node.index()].position.xy() - from.xy();
    let own = parts.iter().find(|part| part.node == branch.node);
    let length_px = own.map_or(0.0, |part| part.length_px);
    let (mut best, mut most_sq) = (0.0, f64::NEG_INFINITY);
    for k in 0..=DIRECTIONS {
        // 0, then to and fro, ever steeper.
        let step = (k + 1) / 2 * if k % 2 == 0 { 1 } else { -1 };
        let angle_deg = STEEPEST_DEG * f64::from(step) / f64::from(DIRECTIONS / 2);
        let slope = angle_deg.to_radians().tan();
        let way = Vector3::new(flat.x, flat.y, slope * length_px);
        let least_sq = LOOKED_AT
            .iter()
            .flat_map(|share| {
                let at = from + *share * way;
                placed.iter().map(move |other| (other - at).norm_squared())
            })
            .fold(f64::INFINITY, f64::min);
        if least_sq > most_sq + 1e-6 {
            (best, most_sq) = (slope, least_sq);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Node;

    /// A trunk with branches that all lie on each other in the picture, on one side.
    fn one_sided(count: u32) -> Skeleton {
        let mut tree = Skeleton::forked();
        tree.nodes.truncate(2);
        for k in 0..count {
            let mut node = Node::made_up(20 + k, Some(1), [60.0, 130.0 + f64::from(k), 0.0]);
            node.level = 2;
            tree.nodes.push(node);
        }
        tree
    }

    #[test]
    fn branches_that_lie_on_each_other_part_in_depth_and_stay_in_the_picture() {
        let flat = one_sided(3);
        let mut tree = flat.clone();
        set_depths_apart(&mut tree, &[true, true]);
        assert!(tree.nodes[..2].iter().all(|n| n.position.z == 0.0));
        for (node, before) in tree.nodes.iter().zip(&flat.nodes) {
            assert_eq!(node.position.xy(), before.position.xy());
        }
        let ends: Vec<Point3<f64>> = tree.nodes[2..].iter().map(|n| n.position).collect();
        for (i, a) in ends.iter().enumerate() {
            let length = (a.xy() - flat.nodes[1].position.xy()).norm();
            assert!(a.z.abs() <= STEEPEST_DEG.to_radians().tan() * length + 1e-9);
            for b in &ends[i + 1..] {
                assert!((a - b).norm() > 40.0, "{ends:?}");
            }
        }
    }
}
