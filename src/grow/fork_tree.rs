//! An example as a flat tree of straight branches between forks.

use crate::model::Skeleton;
use crate::signal::distance_to_segment;
use crate::skeleton::Node2d;
use nalgebra::Point2;

/// A branch whose end is nearer than this to another one that begins where it does is a part of
/// that, px: places in a picture are not known better.
const SAME_PLACE_PX: f64 = 1.0;

/// What of `skeleton` is no copy, as it appears in the picture: the foot, the forks and the tips,
/// each on the nearest of them below it. A node with one child is a bend of its branch and is left
/// out. Where two branches begin along the same line they part where the shorter one ends, as a
/// fork with no angle is none. Levels are counted anew: 0 the foot, one more with every fork.
/// Parents stand before their children; empty for a skeleton without nodes.
pub fn fork_tree(skeleton: &Skeleton) -> Vec<Node2d> {
    let measured = &skeleton.nodes[..skeleton.measured()];
    let mut places_px: Vec<Point2<f64>> = Vec::with_capacity(measured.len());
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); measured.len()];
    for (i, node) in measured.iter().enumerate() {
        places_px.push(skeleton.image_from_model(&node.position));
        // What a damaged file hangs on a later node is left out.
        if let Some(parent) = node.parent.map(|p| p.index()).filter(|p| *p < i) {
            children[parent].push(i);
        }
    }
    let mut tree: Vec<Node2d> = Vec::new();
    let mut waiting: Vec<Waiting> = Vec::new();
    waiting.extend((!measured.is_empty()).then_some(Waiting {
        node: 0,
        parent: None,
    }));
    while let Some(Waiting { node, parent }) = waiting.pop() {
        part_where_they_do(node, &places_px, &mut children);
        let is_bend = parent.is_some() && children[node].len() == 1;
        let below = if is_bend { parent } else { Some(tree.len()) };
        if !is_bend {
            tree.push(Node2d {
                parent,
                level: parent.map_or(0, |p| tree[p].level.saturating_add(1)),
                cluster: None,
                position_px: places_px[node],
                certainty: measured[node].certainty,
            });
        }
        waiting.extend(children[node].iter().rev().map(|child| Waiting {
            node: *child,
            parent: below,
        }));
    }
    tree
}

/// A node that is to be looked at, and what of the new tree it hangs on.
struct Waiting {
    node: usize,
    parent: Option<usize>,
}

/// Hangs of two branches that begin along the same line at `node` the longer one on the end of the
/// shorter one, until none do.
fn part_where_they_do(node: usize, places_px: &[Point2<f64>], children: &mut [Vec<usize>]) {
    let from = places_px[node];
    let mut own = std::mem::take(&mut children[node]);
    own.sort_by(|a, b| {
        let [a, b] = [a, b].map(|c| (places_px[*c] - from).norm());
        a.total_cmp(&b)
    });
    let mut kept: Vec<usize> = Vec::with_capacity(own.len());
    for child in own {
        let end = places_px[child];
        // Of several parts of it that which reaches farthest.
        let part =
            kept.iter().rev().copied().find(|shorter| {
                distance_to_segment(places_px[*shorter], from, end) < SAME_PLACE_PX
            });
        match part {
            Some(shorter) => children[shorter].push(child),
            None => kept.push(child),
        }
    }
    children[node] = kept;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeId, NodeName};

    fn parents(tree: &[Node2d]) -> Vec<Option<usize>> {
        tree.iter().map(|n| n.parent).collect()
    }

    #[test]
    fn bends_and_copies_are_left_out() {
        let mut skeleton = Skeleton::forked();
        // A bend between trunk and left limb, and a copy of the right limb.
        let bend = Node {
            moves_with: Some(NodeId(3)),
            ..Node::made_up(20, Some(1), [-10.0, 140.0, 0.0])
        };
        skeleton.nodes.insert(2, bend);
        skeleton.nodes[3].parent = Some(NodeId(2));
        let copy = Node {
            name: NodeName(30),
            copy_of: Some(NodeId(4)),
            ..skeleton.nodes[4].clone()
        };
        skeleton.nodes.push(copy);
        let tree = fork_tree(&skeleton);
        assert_eq!(parents(&tree), [None, Some(0), Some(1), Some(1)]);
        let levels: Vec<u8> = tree.iter().map(|n| n.level).collect();
        assert_eq!(levels, [0, 1, 2, 2]);
        let places: Vec<Point2<f64>> = tree[2..].iter().map(|n| n.position_px).collect();
        let [left, right] = [Point2::new(280.0, 140.0), Point2::new(325.0, 110.0)];
        assert!(places.contains(&left) && places.contains(&right));
    }

    /// Two branches of 30 and 90 px along one line, and one of 60 px beside it: the long one leaves
    /// the end of the short one.
    #[test]
    fn branches_along_one_line_part_where_the_shorter_one_ends() {
        let mut skeleton = Skeleton::forked();
        skeleton.nodes.truncate(2);
        for (name, [x, y]) in [(2, [0.0, 190.0]), (3, [40.0, 140.0]), (4, [0.3, 130.0])] {
            let node = Node::made_up(name, Some(1), [x, y, 0.0]);
            skeleton.nodes.push(node);
        }
        let fork = Node::made_up(5, Some(4), [-20.0, 150.0, 0.0]);
        skeleton.nodes.push(fork);
        let tree = fork_tree(&skeleton);
        let place_of = |x: f64, y: f64| {
            let wanted = Point2::new(320.0 + x, 300.0 - y);
            tree.iter()
                .position(|n| (n.position_px - wanted).norm() < 1e-9)
        };
        let [short, long] = [place_of(0.3, 130.0), place_of(0.0, 190.0)];
        assert!(short.is_some());
        assert_eq!(tree[long.expect("long")].parent, short);
        assert_eq!(tree[place_of(40.0, 140.0).expect("beside")].parent, Some(1));
        assert_eq!(tree.len(), 6);
    }

    #[test]
    fn nothing_gives_nothing_and_damage_no_panic() {
        let nobody = Skeleton {
            nodes: Vec::new(),
            ..Skeleton::forked()
        };
        assert_eq!(fork_tree(&nobody), []);
        let mut damaged = Skeleton::forked();
        damaged.nodes[1].parent = Some(NodeId(3));
        damaged.nodes[2].position.x = f64::NAN;
        assert!(fork_tree(&damaged).len() <= 4);
    }
}
