//! The shape of forks, whatever their place, direction and size (Li 2011 sect. 5.1).

use crate::skeleton::Node2d;
use nalgebra::Vector2;
use std::cmp::Ordering;
use std::f64::consts::TAU;

/// A branch shorter than this share of its fork has no direction.
const SHORTEST: f64 = 1e-6;

/// A fork of one branch, the stem, into two, seen with the stem below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bifurcation {
    /// Sectors about the apex as shares of a full turn: from the stem clockwise to the left branch,
    /// from that to the right one, and from that to the stem. They add up to 1.
    pub angles: [f64; 3],
    /// Lengths of stem, left and right branch as shares of their sum.
    pub lengths: [f64; 3],
}

impl Bifurcation {
    /// Its mirror image.
    pub fn mirrored(&self) -> Self {
        let [left, between, right] = self.angles;
        let [stem, length_left, length_right] = self.lengths;
        Self {
            angles: [right, between, left],
            lengths: [stem, length_right, length_left],
        }
    }
}

/// A bifurcation of a tree, and how many forks into two its left and right branch carry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fork {
    pub shape: Bifurcation,
    pub carried: [usize; 2],
}

impl Fork {
    /// With the branch that carries more on the left, twice; where both carry as much either is.
    pub fn leading_left(&self) -> [Bifurcation; 2] {
        let [own, mirrored] = [self.shape, self.shape.mirrored()];
        match self.carried[0].cmp(&self.carried[1]) {
            Ordering::Greater => [own, own],
            Ordering::Less => [mirrored, mirrored],
            Ordering::Equal => [own, mirrored],
        }
    }
}

/// The bifurcations of a flat tree, by the place of their apex, from left to right.
///
/// Where more than two branches leave, every two neighbours make one with the stem. What leaves
/// from the foot has no stem; a fork with a branch without length, or at a place that is no number,
/// is left out.
pub fn bifurcations(tree: &[Node2d]) -> Vec<Bifurcation> {
    let children = children(tree);
    let carried = carried_forks(tree, &children);
    let forks = forks(tree, &children, &carried);
    forks.into_iter().map(|fork| fork.shape).collect()
}

/// The same with what they carry, from the [`children`] and [`carried_forks`] of the nodes.
pub(super) fn forks(tree: &[Node2d], children: &[Vec<usize>], carried: &[usize]) -> Vec<Fork> {
    let mut found = Vec::new();
    for (i, node) in tree.iter().enumerate() {
        let Some(parent) = node.parent else { continue };
        let apex = node.position_px;
        let down = tree[parent].position_px - apex;
        let mut branches: Vec<Branch> = Vec::with_capacity(children[i].len());
        for &child in &children[i] {
            branches.push(Branch::of(
                down,
                tree[child].position_px - apex,
                carried[child],
            ));
        }
        branches.sort_by(|a, b| a.bearing.total_cmp(&b.bearing));
        let pairs = branches.windows(2);
        found.extend(pairs.filter_map(|pair| fork(down.norm(), pair[0], pair[1])));
    }
    found
}

/// The children of every node, in order.
pub(super) fn children(tree: &[Node2d]) -> Vec<Vec<usize>> {
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); tree.len()];
    for (i, node) in tree.iter().enumerate() {
        if let Some(parent) = node.parent {
            children[parent].push(i);
        }
    }
    children
}

/// Number of forks into two at and above every node; a fork into more counts as one less than it has
/// branches.
pub(super) fn carried_forks(tree: &[Node2d], children: &[Vec<usize>]) -> Vec<usize> {
    with_all_above(
        tree,
        children.iter().map(|c| c.len().saturating_sub(1)).collect(),
    )
}

/// The sum of a count of every node and of those of all nodes above it.
pub(super) fn with_all_above(tree: &[Node2d], mut counts: Vec<usize>) -> Vec<usize> {
    for i in (1..tree.len()).rev() {
        if let Some(parent) = tree[i].parent {
            counts[parent] += counts[i];
        }
    }
    counts
}

/// A branch that leaves a fork.
#[derive(Clone, Copy, Debug)]
struct Branch {
    /// From the direction of the stem clockwise (u to the right, v down) to that of the branch, rad
    /// from 0 to 2 pi.
    bearing: f64,
    length_px: f64,
    /// Number of forks into two that it carries.
    carried: usize,
}

impl Branch {
    fn of(down: Vector2<f64>, way: Vector2<f64>, carried: usize) -> Self {
        Self {
            bearing: down.perp(&way).atan2(down.dot(&way)).rem_euclid(TAU),
            length_px: way.norm(),
            carried,
        }
    }
}

fn fork(stem_px: f64, left: Branch, right: Branch) -> Option<Fork> {
    let lengths = [stem_px, left.length_px, right.length_px];
    let all: f64 = lengths.iter().sum();
    let has_shape = all.is_finite() && lengths.iter().all(|l| *l > SHORTEST * all);
    has_shape.then(|| Fork {
        shape: Bifurcation {
            angles: [
                left.bearing / TAU,
                (right.bearing - left.bearing) / TAU,
                1.0 - right.bearing / TAU,
            ],
            lengths: lengths.map(|l| l / all),
        },
        carried: [left.carried, right.carried],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation2, Similarity2, Translation2};

    /// A tree of a parent and a place for every node, px.
    fn tree(nodes: &[(Option<usize>, [f64; 2])]) -> Vec<Node2d> {
        let mut tree: Vec<Node2d> = Vec::new();
        for &(parent, at) in nodes {
            tree.push(Node2d {
                parent,
                level: parent.map_or(0, |p| tree[p].level + 1),
                cluster: None,
                position_px: at.into(),
                certainty: 1.0,
            });
        }
        tree
    }

    /// A stem of 4 up, 3 to the left, 5 straight up.
    fn fork() -> Vec<Node2d> {
        tree(&[
            (None, [10.0, 20.0]),
            (Some(0), [10.0, 16.0]),
            (Some(1), [10.0, 11.0]),
            (Some(1), [7.0, 16.0]),
        ])
    }

    fn assert_near(found: &Bifurcation, angles: [f64; 3], lengths: [f64; 3]) {
        let pairs = found.angles.iter().zip(angles);
        for (a, b) in pairs.chain(found.lengths.iter().zip(lengths)) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn a_known_fork_has_its_angles_and_lengths() {
        let found = bifurcations(&fork());
        assert_eq!(found.len(), 1);
        let lengths = [1.0 / 3.0, 0.25, 5.0 / 12.0];
        assert_near(&found[0], [0.25, 0.25, 0.5], lengths);
        let other = [1.0 / 3.0, 5.0 / 12.0, 0.25];
        assert_near(&found[0].mirrored(), [0.5, 0.25, 0.25], other);
    }

    #[test]
    fn place_direction_and_size_do_not_count() {
        let moved = Similarity2::from_parts(
            Translation2::new(-30.0, 7.0),
            Rotation2::new(2.1).into(),
            3.7,
        );
        let mut other = fork();
        for node in &mut other {
            node.position_px = moved * node.position_px;
        }
        let [own, other] = [bifurcations(&fork())[0], bifurcations(&other)[0]];
        assert_near(&other, own.angles, own.lengths);
    }

    #[test]
    fn three_branches_make_two_pairs_of_neighbours() {
        let mut three = fork();
        let right = Node2d {
            position_px: [16.0, 16.0].into(),
            ..three[3].clone()
        };
        three.push(right);
        let found = bifurcations(&three);
        assert_eq!(found.len(), 2);
        let angles = [found[0].angles, found[1].angles];
        assert_eq!(angles, [[0.25, 0.25, 0.5], [0.5, 0.25, 0.25]]);
    }

    #[test]
    fn what_has_no_shape_is_left_out() {
        let mut stump = fork();
        stump[3].position_px = stump[1].position_px;
        assert_eq!(bifurcations(&stump), []);
        stump[3].position_px.x = f64::NAN;
        assert_eq!(bifurcations(&stump), []);
        let from_foot = tree(&[
            (None, [10.0, 20.0]),
            (Some(0), [9.0, 10.0]),
            (Some(0), [12.0, 10.0]),
        ]);
        assert_eq!(bifurcations(&from_foot), []);
        assert_eq!(bifurcations(&[]), []);
    }
}
