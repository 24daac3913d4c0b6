//! Branches in space so that they lie as far apart as they can (Okabe et al. 2005, as Tan et al. 2008
//! sect. 3.1 use it): the other way than the push from a flat tree to one in space.

use crate::model::{MovingBranch, NodeId, Skeleton};
use nalgebra::{Point3, Vector2, Vector3};
use std::collections::BTreeMap;

/// Directions that are tried, evenly from the steepest towards the viewer to the steepest away.
const DIRECTIONS: i32 = 36;
/// The steepest, degrees out of the plane of the picture.
const STEEPEST_DEG: f64 = 60.0;
/// The steepest of side wood: no deeper than it is long in the picture. With 60 degrees the crowns of nine
/// made bare trees were 1.7 times as deep as the true ones, with 45 degrees 1.1 times, without any 0.8.
const STEEPEST_SIDE_DEG: f64 = 45.0;
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
            false => {
                let way = Way::of(tree, &branch, &lengths_px);
                way.most_apart(STEEPEST_DEG, &placed)
            }
        };
        let from_z = tree.nodes[branch.begin.index()].position.z;
        for part in &lengths_px {
            tree.nodes[part.node.index()].position.z = from_z + slope * part.length_px;
        }
        let (from, way) = (
            tree.nodes[branch.begin.index()].position,
            branch.vector(tree),
        );
        placed.extend(samples(from, way));
    }
}

/// Gives side wood, which was flat, the depth that makes its least distance to all that has one the
/// greatest, stroke by stroke: a stroke goes on along the side wood that reaches farthest. Places in the
/// picture stay; what hangs on side wood goes along. `tree` has no copies.
pub fn set_side_depths_apart(tree: &mut Skeleton) {
    let mut is_side = vec![false; tree.nodes.len()];
    for (i, is_side) in is_side.iter_mut().enumerate() {
        let node = NodeId(i as u32);
        *is_side = tree.mover(node) != node && !tree.is_bend(node);
    }
    if !is_side.contains(&true) {
        return;
    }
    let mut strokes = side_strokes(tree, &is_side);
    let flat = tree.clone();
    let mut placed: Vec<Point3<f64>> = Vec::new();
    for (node, is_side) in flat.nodes.iter().zip(&is_side) {
        if let Some(parent) = node.parent.filter(|_| !is_side) {
            let from = flat.nodes[parent.index()].position;
            placed.extend(samples(from, node.position - from));
        }
    }
    let mut slopes = vec![0.0; flat.nodes.len()];
    for i in 1..flat.nodes.len() {
        let Some(parent) = flat.nodes[i].parent.map(|p| p.index()) else {
            continue;
        };
        let piece = flat.nodes[i].position - flat.nodes[parent].position;
        if let Some(stroke) = strokes.remove(&i) {
            let from = tree.nodes[parent].position;
            let way = Way {
                from,
                flat: (flat.nodes[stroke.end()].position - flat.nodes[parent].position).xy(),
                length_px: stroke.length_px,
            };
            let slope = way.most_apart(STEEPEST_SIDE_DEG, &placed);
            placed.extend(samples(from, way.at_slope(slope)));
            for node in stroke.nodes {
                slopes[node] = slope;
            }
        }
        tree.nodes[i].position.z =
            tree.nodes[parent].position.z + piece.z + slopes[i] * piece.xy().norm();
    }
}

/// Side wood from where it leaves to a tip.
struct SideStroke {
    nodes: Vec<usize>,
    /// In the picture.
    length_px: f64,
}

impl SideStroke {
    fn end(&self) -> usize {
        self.nodes.last().copied().unwrap_or(0)
    }
}

/// The strokes of side wood, by the node in which the first piece of each ends.
fn side_strokes(tree: &Skeleton, is_side: &[bool]) -> BTreeMap<usize, SideStroke> {
    // How far side wood reaches from each node on, and by which child it reaches farthest.
    let mut farthest: Vec<(f64, Option<usize>)> = vec![(0.0, None); tree.nodes.len()];
    for i in (1..tree.nodes.len()).rev().filter(|i| is_side[*i]) {
        let reach_px = piece_px(tree, i) + farthest[i].0;
        // A file may hang a node on a later one.
        if let Some(parent) = tree.nodes[i].parent.map(|p| p.index()).filter(|p| *p < i)
            && reach_px >= farthest[parent].0
        {
            farthest[parent] = (reach_px, Some(i));
        }
    }
    let mut strokes = BTreeMap::new();
    for i in (1..tree.nodes.len()).filter(|i| is_side[*i]) {
        let parent = tree.nodes[i].parent.map_or(0, |p| p.index());
        if is_side[parent] && farthest[parent].1 == Some(i) {
            continue;
        }
        let mut nodes = vec![i];
        while let Some(next) = farthest[nodes[nodes.len() - 1]].1 {
            nodes.push(next);
        }
        let length_px = nodes.iter().map(|node| piece_px(tree, *node)).sum();
        strokes.insert(i, SideStroke { nodes, length_px });
    }
    strokes
}

/// From a node's parent to the node, in the picture.
pub(super) fn piece_px(tree: &Skeleton, i: usize) -> f64 {
    let node = &tree.nodes[i];
    let below = node.parent.map_or(node, |p| &tree.nodes[p.index()]);
    (node.position - below.position).xy().norm()
}

/// Places along a straight way.
fn samples(from: Point3<f64>, way: Vector3<f64>) -> impl Iterator<Item = Point3<f64>> {
    (1..=SAMPLES).map(move |k| from + way * (f64::from(k) / f64::from(SAMPLES)))
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

/// The way of a branch in the picture, and where it begins in space.
struct Way {
    from: Point3<f64>,
    flat: Vector2<f64>,
    /// Along its bends.
    length_px: f64,
}

impl Way {
    fn of(tree: &Skeleton, branch: &MovingBranch, parts: &[Part]) -> Self {
        let [from, end] = [branch.begin, branch.node].map(|n| tree.nodes[n.index()].position);
        let own = parts.iter().find(|part| part.node == branch.node);
        Self {
            from,
            flat: (end - from).xy(),
            length_px: own.map_or(0.0, |part| part.length_px),
        }
    }

    /// The way in space with so much depth for each pixel of length.
    fn at_slope(&self, slope: f64) -> Vector3<f64> {
        Vector3::new(self.flat.x, self.flat.y, slope * self.length_px)
    }

    /// Depth for each pixel of length at which it is farthest from all that is placed, no steeper than
    /// so many degrees; the flattest of equals.
    fn most_apart(&self, steepest_deg: f64, placed: &[Point3<f64>]) -> f64 {
        let (mut best, mut most_sq) = (0.0, f64::NEG_INFINITY);
        for k in 0..=DIRECTIONS {
            // 0, then to and fro, ever steeper.
            let step = (k + 1) / 2 * if k % 2 == 0 { 1 } else { -1 };
            let angle_deg = steepest_deg * f64::from(step) / f64::from(DIRECTIONS / 2);
            let slope = angle_deg.to_radians().tan();
            let way = self.at_slope(slope);
            let least_sq = LOOKED_AT
                .iter()
                .flat_map(|share| {
                    let at = self.from + *share * way;
                    placed.iter().map(move |other| (other - at).norm_squared())
                })
                .fold(f64::INFINITY, f64::min);
            if least_sq > most_sq + 1e-6 {
                (best, most_sq) = (slope, least_sq);
            }
        }
        best
    }
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

    /// A limb with side wood of two pieces along it, of which the first carries a branch and a twig.
    #[test]
    fn side_wood_gets_depth_and_takes_along_what_hangs_on_it() {
        let mut tree = Skeleton::forked();
        let limb = NodeId(2);
        for (name, parent, at, rides) in [
            (20, 2, [-60.0, 175.0, 0.0], true),
            (21, 4, [-80.0, 195.0, 0.0], true),
            (22, 4, [-75.0, 170.0, 9.0], false),
            (23, 4, [-60.0, 182.0, 0.0], true),
        ] {
            let mut node = Node::made_up(name, Some(parent), at);
            node.moves_with = rides.then_some(limb);
            tree.nodes.push(node);
        }
        let flat = tree.clone();
        set_side_depths_apart(&mut tree);
        for (node, before) in tree.nodes.iter().zip(&flat.nodes) {
            assert_eq!(node.position.xy(), before.position.xy());
        }
        let depths: Vec<f64> = tree.nodes.iter().map(|n| n.position.z).collect();
        assert_eq!(depths[..4], [0.0; 4]);
        let slope = |from: usize, to: usize| {
            let way = flat.nodes[to].position - flat.nodes[from].position;
            (depths[to] - depths[from]) / way.xy().norm()
        };
        let steepest = STEEPEST_SIDE_DEG.to_radians().tan();
        // Both pieces of the stroke have one slope, and the branch keeps its own depth on it.
        assert!(depths[4] != 0.0 && slope(2, 4).abs() <= steepest + 1e-9);
        assert!((slope(2, 4) - slope(4, 5)).abs() < 1e-9, "{depths:?}");
        assert!((depths[6] - depths[4] - 9.0).abs() < 1e-9, "{depths:?}");
        // The twig parts from what it lies along.
        assert!((slope(4, 7) - slope(4, 5)).abs() > 0.1, "{depths:?}");
    }

    /// A file may say anything.
    #[test]
    fn side_wood_in_a_circle_comes_to_an_end() {
        let mut tree = Skeleton::forked();
        for (name, parent) in [(20, 5), (21, 4)] {
            let mut node = Node::made_up(name, Some(parent), [-60.0, 175.0, 0.0]);
            node.moves_with = Some(NodeId(2));
            tree.nodes.push(node);
        }
        set_side_depths_apart(&mut tree);
        assert_eq!(tree.nodes.len(), 6);
    }

    #[test]
    fn a_tree_without_side_wood_stays_as_it_is() {
        let mut tree = one_sided(2);
        tree.nodes[2].position.z = 7.0;
        let before = tree.clone();
        set_side_depths_apart(&mut tree);
        assert_eq!(tree, before);
    }
}
