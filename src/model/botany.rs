//! Botanical branches: axes from the fork where they begin to their tips, with order and name.
//!
//! The order is Gravelius' (1914), as botany counts it: the trunk has order 0, what leaves it 1,
//! and so on. At every fork one child goes on with the axis and the others begin branches of the
//! next order.

use super::{NodeId, Skeleton};
use nalgebra::Vector3;

/// What the trunk is called.
pub const TRUNK: &str = "trunk";
/// What the joint of the foot is called, from which the whole tree hangs.
pub const TREE: &str = "tree";

/// A branch from the place where it leaves another one to its tip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BotanicalBranch {
    /// 0 for the trunk, one more than the branch that carries it for all others.
    pub order: u32,
    /// The place of that branch among all; `None` for the trunk.
    pub carrier: Option<usize>,
    /// Its number among the branches of its carrier, from 1; 0 for the trunk.
    pub number: u32,
    /// Its nodes from below; those of the trunk begin with the foot.
    pub nodes: Vec<NodeId>,
}

/// The branches of a tree, the trunk first, each after its carrier.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BotanicalBranches {
    pub all: Vec<BotanicalBranch>,
    /// The branch of every node, by node index.
    of_node: Vec<usize>,
    /// Which node of its branch every node is, from 0.
    place: Vec<usize>,
}

impl BotanicalBranches {
    /// The place among all of the branch that a node is on; the trunk for a node that is not there.
    pub fn of(&self, node: NodeId) -> usize {
        self.of_node.get(node.index()).copied().unwrap_or(0)
    }

    /// The order of a node's branch.
    pub fn order(&self, node: NodeId) -> u32 {
        self.all.get(self.of(node)).map_or(0, |b| b.order)
    }

    /// The place among all of the limb that a node is on or is carried by; the trunk for a node of
    /// the trunk.
    pub fn limb(&self, node: NodeId) -> usize {
        let mut limb = self.of(node);
        while let Some(carrier) = self.all.get(limb).and_then(|b| b.carrier)
            && carrier != 0
        {
            limb = carrier;
        }
        limb
    }

    /// The name of a node's branch: `trunk`, `limb_1`, `limb_1.2`, ...
    pub fn name(&self, node: NodeId) -> String {
        let mut numbers: Vec<String> = Vec::new();
        let mut at = self.all.get(self.of(node));
        while let Some(branch) = at
            && let Some(carrier) = branch.carrier
        {
            numbers.push(branch.number.to_string());
            at = self.all.get(carrier);
        }
        if numbers.is_empty() {
            return TRUNK.to_owned();
        }
        numbers.reverse();
        format!("limb_{}", numbers.join("."))
    }

    /// The name of the piece of a branch that ends in a node: the first is called as the branch,
    /// the others are `trunk-2`, `limb_1.2-3`, ... The foot, in which nothing ends, is `tree`.
    pub fn piece_name(&self, node: NodeId) -> String {
        let place = self.place.get(node.index()).copied().unwrap_or(0);
        let is_trunk = self.of(node) == 0;
        match place + usize::from(!is_trunk) {
            0 => TREE.to_owned(),
            1 => self.name(node),
            piece => format!("{}-{piece}", self.name(node)),
        }
    }

    /// [`piece_name`](Self::piece_name) of every node, by node index.
    pub fn piece_names(&self) -> Vec<String> {
        let nodes = (0..self.of_node.len() as u32).map(NodeId);
        nodes.map(|n| self.piece_name(n)).collect()
    }
}

impl Skeleton {
    /// The botanical branches.
    ///
    /// At a fork the axis goes on in the child that has the most wood above it (the length of all
    /// branches, which the pipe model makes the thickest, too), one that turns aside counting less
    /// (Horton 1945 takes the straightest, and of those alike the longest). The wood counts by
    /// `(1 + cos of the turn) / 2`, so that nothing changes at once where a tree changes little. A
    /// bend goes on in the limb that it moves with.
    ///
    /// Copies go on as their originals do, and never go on in a measured branch.
    ///
    /// Branches are numbered along the axis that carries them from below, those that leave it at
    /// one place from left to right; all copies after all others, so that a tree has the same names
    /// without them.
    pub fn botanical_branches(&self) -> BotanicalBranches {
        let axes = Axes::of(self);
        let n = self.nodes.len();
        let mut out = BotanicalBranches {
            all: Vec::new(),
            of_node: vec![0; n],
            place: vec![0; n],
        };
        if n == 0 {
            return out;
        }
        out.all.push(BotanicalBranch {
            order: 0,
            carrier: None,
            number: 0,
            nodes: vec![NodeId(0)],
        });
        let mut at = 0;
        while at < out.all.len() {
            axes.follow(&mut out, at);
            at += 1;
        }
        out
    }
}

/// How much speaks for a child to go on with the axis.
#[derive(Clone, Copy, Debug, Default)]
struct Claim {
    /// Length of the wood above, px, less where it turns aside.
    wood_px: f64,
    /// Nodes above, its own among them, where there is no wood to tell.
    nodes: usize,
}

/// Which node every axis goes on in.
struct Axes<'a> {
    skeleton: &'a Skeleton,
    /// By node index, in the order of the nodes.
    children: Vec<Vec<usize>>,
    /// By node index.
    goes_on: Vec<Option<usize>>,
}

impl<'a> Axes<'a> {
    fn of(skeleton: &'a Skeleton) -> Self {
        let n = skeleton.nodes.len();
        let mut axes = Self {
            skeleton,
            children: vec![Vec::new(); n],
            goes_on: vec![None; n],
        };
        for i in 1..n {
            let parent = axes.parent(i);
            axes.children[parent].push(i);
        }
        let claims = axes.claims();
        for i in 0..n {
            axes.goes_on[i] = axes.strongest(i, &claims);
        }
        axes.keep_limbs_whole();
        axes
    }

    /// What carries a node that is not the foot; the foot for one that a file hangs on nothing.
    fn parent(&self, i: usize) -> usize {
        let parent = self.skeleton.nodes[i].parent.map(NodeId::index);
        parent.filter(|p| *p < i).unwrap_or(0)
    }

    fn is_copy(&self, i: usize) -> bool {
        self.skeleton.nodes[i].copy_of.is_some()
    }

    /// The way of the piece that ends in a node; upwards for the foot.
    fn way(&self, i: usize) -> Vector3<f64> {
        let nodes = &self.skeleton.nodes;
        if i == 0 {
            return Vector3::y();
        }
        nodes[i].position - nodes[self.parent(i)].position
    }

    /// By node index; of a copy that of its original.
    fn claims(&self) -> Vec<Claim> {
        let n = self.skeleton.nodes.len();
        let mut above = vec![Claim::default(); n];
        for i in (1..n).rev().filter(|i| !self.is_copy(*i)) {
            let length = self.way(i).norm();
            above[i].wood_px += if length.is_finite() { length } else { 0.0 };
            above[i].nodes += 1;
            let (own, parent) = (above[i], self.parent(i));
            above[parent].wood_px += own.wood_px;
            above[parent].nodes += own.nodes;
        }
        for (i, claim) in above.iter_mut().enumerate().skip(1) {
            claim.wood_px *= self.straightness(i);
        }
        for (i, node) in self.skeleton.nodes.iter().enumerate().skip(1) {
            if let Some(original) = node.copy_of {
                above[i] = above.get(original.index()).copied().unwrap_or_default();
            }
        }
        above
    }

    /// 1 for a child that goes straight on, 0 for one that turns back.
    fn straightness(&self, i: usize) -> f64 {
        let before = self.way(self.parent(i)).try_normalize(1e-12);
        let own = self.way(i).try_normalize(1e-12);
        let cos = before.zip(own).map_or(0.0, |(a, b)| a.dot(&b));
        if cos.is_finite() {
            0.5 + 0.5 * cos.clamp(-1.0, 1.0)
        } else {
            0.5
        }
    }

    /// The child of a node that claims the axis most; the first of those alike.
    fn strongest(&self, i: usize, claims: &[Claim]) -> Option<usize> {
        let mut best: Option<usize> = None;
        for &child in &self.children[i] {
            if self.is_copy(child) != self.is_copy(i) {
                continue;
            }
            let is_stronger = best.is_none_or(|best| {
                let (own, other) = (claims[child], claims[best]);
                let by_wood = own.wood_px.total_cmp(&other.wood_px);
                by_wood.then(own.nodes.cmp(&other.nodes)).is_gt()
            });
            if is_stronger {
                best = Some(child);
            }
        }
        best
    }

    /// Lets every bend go on in the limb that it is a part of.
    fn keep_limbs_whole(&mut self) {
        for i in (1..self.skeleton.nodes.len() as u32).map(NodeId) {
            if self.skeleton.mover(i) != i {
                continue;
            }
            let mut child = i;
            for part in self.skeleton.ancestors(i) {
                if self.skeleton.mover(part) != i {
                    break;
                }
                self.goes_on[part.index()] = Some(child.index());
                child = part;
            }
        }
    }

    /// Follows branch `at` from its first node to its tip, and adds the branches that leave it.
    fn follow(&self, out: &mut BotanicalBranches, at: usize) {
        let first = out.all[at].nodes[0].index();
        let mut nodes = vec![NodeId(first as u32)];
        let mut node = first;
        while let Some(next) = self.goes_on[node] {
            nodes.push(NodeId(next as u32));
            node = next;
        }
        for (place, node) in nodes.iter().enumerate() {
            (out.of_node[node.index()], out.place[node.index()]) = (at, place);
        }
        let order = out.all[at].order + 1;
        for (number, begin) in (1..).zip(self.leaving(&nodes)) {
            out.all.push(BotanicalBranch {
                order,
                carrier: Some(at),
                number,
                nodes: vec![NodeId(begin as u32)],
            });
        }
        out.all[at].nodes = nodes;
    }

    /// The first nodes of the branches that leave an axis, in the order of their numbers.
    fn leaving(&self, axis: &[NodeId]) -> Vec<usize> {
        let mut measured = Vec::new();
        let mut copies = Vec::new();
        for node in axis.iter().map(|n| n.index()) {
            let mut here = self.children[node].clone();
            here.retain(|c| self.goes_on[node] != Some(*c));
            here.sort_by(|a, b| self.x(*a).total_cmp(&self.x(*b)).then(a.cmp(b)));
            for child in here {
                if self.is_copy(child) && !self.is_copy(node) {
                    copies.push(child);
                } else {
                    measured.push(child);
                }
            }
        }
        measured.append(&mut copies);
        measured
    }

    /// Place of a node from left to right.
    fn x(&self, i: usize) -> f64 {
        self.skeleton.nodes[i].position.x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, NodeName, Size};
    use nalgebra::Point2;

    /// Nodes by parent and place (x, y).
    fn tree(nodes: &[(Option<u32>, [f64; 2])]) -> Skeleton {
        let mut out = Vec::new();
        for (i, (parent, [x, y])) in (0..).zip(nodes) {
            out.push(Node::made_up(10 + i, *parent, [*x, *y, 0.0]));
        }
        Skeleton {
            nodes: out,
            foot_px: Point2::origin(),
            image_size: Size::new(64, 64),
        }
    }

    fn copy(skeleton: &mut Skeleton, original: u32, parent: u32) {
        let mut node = skeleton.nodes[original as usize].clone();
        node.name = NodeName(10 + skeleton.nodes.len() as u32);
        (node.copy_of, node.parent) = (Some(NodeId(original)), Some(NodeId(parent)));
        node.position.x = -node.position.x;
        skeleton.nodes.push(node);
    }

    /// A trunk of three pieces (1, 2, 5) with limbs to both sides (3, 4) below its top, the left
    /// one (3) of two pieces (6) with a branch (7).
    fn small() -> Skeleton {
        tree(&[
            (None, [0.0, 0.0]),
            (Some(0), [0.0, 10.0]),
            (Some(1), [0.0, 20.0]),
            (Some(1), [-8.0, 16.0]),
            (Some(2), [6.0, 26.0]),
            (Some(2), [0.0, 40.0]),
            (Some(3), [-14.0, 21.0]),
            (Some(3), [-10.0, 20.0]),
        ])
    }

    fn names(skeleton: &Skeleton) -> Vec<String> {
        skeleton.botanical_branches().piece_names()
    }

    const SMALL: [&str; 8] = [
        "tree", "trunk", "trunk-2", "limb_1", "limb_2", "trunk-3", "limb_1-2", "limb_1.1",
    ];

    #[test]
    fn a_branch_runs_from_its_fork_to_its_tip() {
        let skeleton = small();
        assert_eq!(names(&skeleton), SMALL);
        let branches = skeleton.botanical_branches();
        let orders: Vec<u32> = (0..8).map(|n| branches.order(NodeId(n))).collect();
        assert_eq!(orders, [0, 0, 0, 1, 1, 0, 1, 2]);
        assert_eq!(branches.name(NodeId(6)), "limb_1");
        assert_eq!(branches.name(NodeId(0)), "trunk");
        assert_eq!(branches.all[1].nodes, [NodeId(3), NodeId(6)]);
    }

    #[test]
    fn small_disturbances_change_no_name() {
        for k in 0..50_u32 {
            let mut skeleton = small();
            for (i, node) in skeleton.nodes.iter_mut().enumerate().skip(1) {
                let phase = f64::from(k * 7 + i as u32);
                node.position.x += 0.8 * phase.sin();
                node.position.z += 0.8 * (3.0 * phase).cos();
            }
            assert_eq!(names(&skeleton), SMALL, "{k}");
        }
    }

    #[test]
    fn the_straighter_of_two_alike_goes_on() {
        let skeleton = tree(&[
            (None, [0.0, 0.0]),
            (Some(0), [0.0, 10.0]),
            (Some(1), [10.0, 10.0]),
            (Some(1), [0.0, 20.0]),
        ]);
        assert_eq!(names(&skeleton), ["tree", "trunk", "limb_1", "trunk-2"]);
    }

    #[test]
    fn copies_are_named_last_and_go_on_as_their_originals() {
        let mut skeleton = small();
        for (original, parent) in [(3, 1), (6, 8), (7, 8)] {
            copy(&mut skeleton, original, parent);
        }
        let named = names(&skeleton);
        assert_eq!(named[..8], SMALL);
        assert_eq!(named[8..], ["limb_3", "limb_3-2", "limb_3.1"]);
    }

    /// The branch (3) that leaves the bend (2) is longer than what is left of the limb (4).
    #[test]
    fn a_bend_goes_on_in_its_limb() {
        let mut skeleton = tree(&[
            (None, [0.0, 0.0]),
            (Some(0), [0.0, 10.0]),
            (Some(1), [5.0, 15.0]),
            (Some(2), [40.0, 50.0]),
            (Some(2), [9.0, 15.0]),
            (Some(1), [0.0, 90.0]),
        ]);
        assert_eq!(names(&skeleton)[3..5], ["limb_1-2", "limb_1.1"]);
        skeleton.nodes[2].moves_with = Some(NodeId(4));
        assert_eq!(names(&skeleton)[3..5], ["limb_1.1", "limb_1-2"]);
    }

    #[test]
    fn what_a_file_may_hold_has_names_too() {
        assert!(names(&tree(&[])).is_empty());
        assert_eq!(names(&tree(&[(None, [0.0; 2])])), ["tree"]);
        let odd = tree(&[
            (None, [0.0; 2]),
            (Some(7), [f64::NAN; 2]),
            (None, [0.0; 2]),
            (Some(2), [f64::INFINITY; 2]),
            (Some(4), [0.0; 2]),
        ]);
        let mut all = names(&odd);
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 5, "every name once");
    }
}
