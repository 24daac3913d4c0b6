//! Branches that lead out of the picture's plane evenly.

use super::okabe::piece_px;
use crate::model::{NodeId, Skeleton};

/// Lets every botanical branch go on out of the picture's plane as steeply as it begins, to its tip. Places in
/// the picture stay, and what a branch carries goes along.
///
/// The push turns a limb anew at each place where a branch leaves it. From the front nothing of that is seen;
/// from the side the limb goes to and fro.
pub fn make_depths_even(tree: &mut Skeleton) {
    let mut slopes = vec![0.0; tree.nodes.len()];
    for branch in tree.botanical_branches().all {
        let nodes = branch.nodes.iter().map(|node| node.index());
        let nodes: Vec<usize> = nodes.filter(|i| *i > 0).collect();
        let slope = nodes.iter().find_map(|node| slope(tree, *node));
        for node in nodes {
            slopes[node] = slope.unwrap_or(0.0);
        }
    }
    for (i, slope) in slopes.into_iter().enumerate().skip(1) {
        let parent = tree.nodes[i].parent.map_or(0, NodeId::index);
        tree.nodes[i].position.z = tree.nodes[parent].position.z + slope * piece_px(tree, i);
    }
}

/// Depth of the piece that ends in a node for each pixel of its length in the picture; `None` without length.
fn slope(tree: &Skeleton, i: usize) -> Option<f64> {
    let length_px = piece_px(tree, i);
    let parent = tree.nodes[i].parent.map_or(0, NodeId::index);
    let deep_px = tree.nodes[i].position.z - tree.nodes[parent].position.z;
    (length_px > 0.0).then(|| deep_px / length_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Node;

    /// A limb that goes to and fro, and carries a branch.
    #[test]
    fn a_limb_leads_out_of_the_picture_evenly_and_takes_along_what_it_carries() {
        let mut tree = Skeleton::forked();
        tree.nodes.truncate(2);
        for (name, parent, at) in [
            (20, 1, [40.0, 160.0, 30.0]),
            (21, 2, [80.0, 190.0, 10.0]),
            (22, 3, [120.0, 220.0, 50.0]),
            (23, 3, [80.0, 210.0, 30.0]),
            (24, 1, [0.0, 300.0, 0.0]),
        ] {
            tree.nodes.push(Node::made_up(name, Some(parent), at));
        }
        let before = tree.clone();
        make_depths_even(&mut tree);
        for (node, before) in tree.nodes.iter().zip(&before.nodes) {
            assert_eq!(node.position.xy(), before.position.xy());
        }
        let slope = |from: usize, to: usize| {
            let way = tree.nodes[to].position - tree.nodes[from].position;
            way.z / way.xy().norm()
        };
        assert!((tree.nodes[2].position.z - 30.0).abs() < 1e-9, "{tree:?}");
        assert!((slope(1, 2) - slope(2, 3)).abs() < 1e-9, "{tree:?}");
        assert!((slope(1, 2) - slope(3, 4)).abs() < 1e-9, "{tree:?}");
        // A branch of one piece keeps its own slope.
        assert!((slope(3, 5) - 1.0).abs() < 1e-9, "{tree:?}");
        let mut flat = Skeleton::forked();
        let before = flat.clone();
        make_depths_even(&mut flat);
        assert_eq!(flat, before);
    }
}
