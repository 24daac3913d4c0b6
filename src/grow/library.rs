//! Elementary subtrees that a tree is grown of (Tan et al. 2008 sect. 3.1 and fig. 4).

use crate::model::{RADIUS_SHARE, Skeleton};
use nalgebra::{Rotation3, Vector3};

/// Subtrees of a library, at most (Tan et al. 2008 sect. 3.1).
const MOST_SUBTREES: usize = 8;
/// Branches of a subtree, at most.
const MOST_BRANCHES: usize = 10;
/// Fewer subtrees than this are too few, and predefined ones are added.
const FEWEST_SUBTREES: usize = 2;
/// No branch of a subtree is longer than its supporting branch by more than this factor.
const LONGEST: f64 = 1.2;

/// A branch of a subtree, where the supporting branch runs from the origin to (0, 1, 0).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubtreeBranch {
    /// The branch of the subtree on which it stands, an earlier one; `None`: the supporting branch.
    pub on: Option<usize>,
    /// How far along that one it begins, 0 to 1.
    pub at: f64,
    /// From there to its end.
    pub way: Vector3<f64>,
    /// Its radius by that of what carries it.
    pub radius_share: f64,
}

/// The branches that grow on a supporting branch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Subtree {
    /// Each after the one on which it stands.
    pub branches: Vec<SubtreeBranch>,
}

/// Which subtrees are ready-made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SubtreeKind {
    /// Branches grow at the end of the supporting branch (type I).
    AtEnd,
    /// They grow along it (type II).
    Along,
    #[default]
    Both,
}

/// The subtrees that a tree is grown of; one at least.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    subtrees: Vec<Subtree>,
}

impl Library {
    pub fn subtrees(&self) -> &[Subtree] {
        &self.subtrees
    }

    /// The ready-made subtrees of a kind.
    pub fn predefined(kind: SubtreeKind) -> Self {
        let mut subtrees = Vec::new();
        if kind != SubtreeKind::Along {
            // Two and three branches about the end.
            subtrees.push(ready_made(&[
                Stem::new(0.98, 0.0, 30.0, 0.8),
                Stem::new(0.98, 180.0, 40.0, 0.65),
            ]));
            subtrees.push(ready_made(&[
                Stem::new(0.98, 0.0, 25.0, 0.75),
                Stem::new(0.98, 120.0, 45.0, 0.6),
                Stem::new(0.98, 240.0, 50.0, 0.55),
            ]));
        }
        if kind != SubtreeKind::AtEnd {
            // Each turned by the golden angle against the one before, and on two sides.
            subtrees.push(ready_made(&[
                Stem::new(0.4, 0.0, 55.0, 0.55),
                Stem::new(0.6, 137.5, 50.0, 0.5),
                Stem::new(0.8, 275.0, 45.0, 0.45),
                Stem::new(0.98, 52.5, 20.0, 0.5),
            ]));
            subtrees.push(ready_made(&[
                Stem::new(0.5, 0.0, 50.0, 0.6),
                Stem::new(0.75, 180.0, 45.0, 0.5),
            ]));
        }
        Self { subtrees }
    }

    /// The subtrees of a tree in space, its copies included: of every branch what grows on it, and on
    /// that. Those with most branches count. `None` where nothing grows on a branch.
    pub fn like(tree: &Skeleton) -> Option<Self> {
        let mut subtrees = subtrees_of(tree);
        subtrees.sort_by_key(|subtree| std::cmp::Reverse(subtree.branches.len()));
        subtrees.truncate(MOST_SUBTREES);
        (!subtrees.is_empty()).then_some(Self { subtrees })
    }

    /// The same, and where those are too few the ready-made ones of `kind`.
    pub fn of(tree: &Skeleton, kind: SubtreeKind) -> Self {
        let mut subtrees = Self::like(tree).map_or(Vec::new(), |own| own.subtrees);
        if subtrees.len() < FEWEST_SUBTREES {
            subtrees.extend(Self::predefined(kind).subtrees);
        }
        Self { subtrees }
    }
}

/// A branch of a ready-made subtree.
struct Stem {
    /// How far along the supporting branch it begins, 0 to 1.
    at: f64,
    /// Its turn about the supporting branch, and how far it leans away from that, degrees.
    turn_deg: f64,
    lean_deg: f64,
    /// By that of the supporting branch.
    length: f64,
}

impl Stem {
    fn new(at: f64, turn_deg: f64, lean_deg: f64, length: f64) -> Self {
        Self {
            at,
            turn_deg,
            lean_deg,
            length,
        }
    }
}

fn ready_made(stems: &[Stem]) -> Subtree {
    let mut subtree = Subtree::default();
    for stem in stems {
        let (sin, cos) = stem.lean_deg.to_radians().sin_cos();
        let leaning = stem.length * Vector3::new(sin, cos, 0.0);
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), stem.turn_deg.to_radians());
        subtree.branches.push(SubtreeBranch {
            on: None,
            at: stem.at,
            way: turn * leaning,
            radius_share: radius_share(stem.length),
        });
    }
    subtree
}

/// The radius of a new branch by that of what carries it, if it is so long by it.
pub(super) fn radius_share(length: f64) -> f64 {
    RADIUS_SHARE * length.min(1.0).sqrt()
}

/// The subtrees of all branches on which something grows.
fn subtrees_of(tree: &Skeleton) -> Vec<Subtree> {
    let branches = tree.moving_branches();
    let mut carried: Vec<Vec<usize>> = vec![Vec::new(); tree.nodes.len()];
    for (b, branch) in branches.iter().enumerate() {
        carried[branch.parent.index()].push(b);
    }
    let mut subtrees = Vec::new();
    for support in &branches {
        let axis = support.vector(tree);
        let Some(frame) = frame(axis) else { continue };
        let mut subtree = Subtree::default();
        // Each with the branch of the subtree on which it stands.
        let mut waiting: std::collections::VecDeque<(usize, Option<usize>)> = carried
            [support.node.index()]
        .iter()
        .map(|b| (*b, None))
        .collect();
        while let Some((b, on)) = waiting.pop_front() {
            let branch = &branches[b];
            let carrier = match on {
                Some(_) => branch.parent,
                None => support.node,
            };
            let Some(own) = branches.iter().find(|other| other.node == carrier) else {
                continue;
            };
            let begin = tree.nodes[branch.begin.index()].position;
            let from = tree.nodes[own.begin.index()].position;
            let along = own.vector(tree);
            let at = (begin - from).dot(&along) / along.norm_squared().max(1e-9);
            let way = frame * branch.vector(tree) / axis.norm();
            if way.norm() > LONGEST || subtree.branches.len() >= MOST_BRANCHES {
                continue;
            }
            let radii = [branch.node, carrier].map(|n| tree.nodes[n.index()].radius);
            let radius_share = radii[0] / radii[1].max(1e-9);
            subtree.branches.push(SubtreeBranch {
                on,
                at: at.clamp(0.05, 1.0),
                way,
                radius_share: radius_share.clamp(0.2, RADIUS_SHARE),
            });
            let place = subtree.branches.len() - 1;
            if on.is_none() {
                let next = carried[branch.node.index()].iter();
                waiting.extend(next.map(|b| (*b, Some(place))));
            }
        }
        if subtree.branches.len() > 1 {
            subtrees.push(subtree);
        }
    }
    subtrees
}

/// The rotation that brings a direction to y; `None` where it has none.
pub(super) fn frame(axis: Vector3<f64>) -> Option<Rotation3<f64>> {
    let along = axis.try_normalize(1e-9)?;
    let turned = Rotation3::rotation_between(&along, &Vector3::y());
    // Straight down has no shortest turn.
    Some(turned.unwrap_or(Rotation3::from_axis_angle(
        &Vector3::x_axis(),
        std::f64::consts::PI,
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Node;

    #[test]
    fn a_fork_becomes_a_subtree_of_unit_length() {
        let mut tree = Skeleton::forked();
        tree.nodes[1].radius = 4.0;
        let library = Library::of(&tree, SubtreeKind::AtEnd);
        let own = &library.subtrees()[0];
        assert_eq!(own.branches.len(), 2);
        assert_eq!(own.branches[0].way, Vector3::new(-0.4, 0.6, 0.0));
        assert_eq!(own.branches[0].at, 1.0);
        assert_eq!(own.branches[0].radius_share, 0.25);
        // One is too few.
        assert_eq!(library.subtrees().len(), 3);
    }

    #[test]
    fn a_subtree_does_not_depend_on_how_its_branch_stands() {
        let upright = Skeleton::forked();
        let mut lying = upright.clone();
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 1.9);
        for node in &mut lying.nodes {
            node.position = turn * node.position;
        }
        let [a, b] = [&upright, &lying].map(|t| Library::of(t, SubtreeKind::Both));
        let angle = |library: &Library| {
            let branches = &library.subtrees()[0].branches;
            branches[0].way.angle(&branches[1].way)
        };
        assert!((angle(&a) - angle(&b)).abs() < 1e-9);
        for (a, b) in a.subtrees()[0]
            .branches
            .iter()
            .zip(&b.subtrees()[0].branches)
        {
            assert!((a.way.y - b.way.y).abs() < 1e-9, "{a:?} {b:?}");
        }
    }

    #[test]
    fn kinds_differ_in_where_branches_grow() {
        let least_at = |kind| {
            let library = Library::predefined(kind);
            let all = library.subtrees().iter().flat_map(|s| s.branches.clone());
            all.map(|b| b.at).fold(1.0, f64::min)
        };
        assert!(least_at(SubtreeKind::AtEnd) > 0.9);
        assert!(least_at(SubtreeKind::Along) < 0.5);
        assert!(Library::predefined(SubtreeKind::Both).subtrees().len() == 4);
    }

    /// A file may say anything.
    #[test]
    fn a_tree_without_branches_has_the_ready_made_subtrees() {
        let mut tree = Skeleton::forked();
        tree.nodes = vec![Node::made_up(0, None, [0.0; 3])];
        let library = Library::of(&tree, SubtreeKind::Along);
        assert_eq!(library, Library::predefined(SubtreeKind::Along));
    }
}
