//! The tree as its sway is looked at: the branches that move on their own.
//!
//! What moves with another node says nothing of its own. In an analysis a [`NodeId`] numbers the
//! branches of this tree, each after the one that carries it; where every node moves on its own
//! these are the numbers of the skeleton.

use super::film::{Film, FilmTrack};
use crate::model::{NodeId, Skeleton, Swaying, Unidentified};
use nalgebra::Point2;
use std::borrow::Cow;

/// A branch that moves on its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TreeBranch {
    /// The node of the skeleton that it ends in.
    pub node: NodeId,
    /// The branch that carries it; `None` for the foot.
    pub parent: Option<NodeId>,
    /// Where it begins and ends at rest, px.
    pub base_px: Point2<f64>,
    pub end_px: Point2<f64>,
}

/// The measured branches, the foot first.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BranchTree {
    pub branches: Vec<TreeBranch>,
    /// The branch of every measured node of the skeleton.
    branch_of: Vec<NodeId>,
}

impl BranchTree {
    pub fn of(skeleton: &Skeleton) -> Self {
        let measured = skeleton.measured();
        let mut tree = Self {
            branches: Vec::with_capacity(measured),
            branch_of: vec![NodeId(0); measured],
        };
        if let Some(foot) = skeleton.nodes.first() {
            let foot_px = skeleton.image_from_model(&foot.position);
            tree.branches.push(TreeBranch {
                node: NodeId(0),
                parent: None,
                base_px: foot_px,
                end_px: foot_px,
            });
        }
        for branch in skeleton.moving_branches() {
            if branch.node.index() >= measured {
                continue;
            }
            let [base_px, end_px] = [branch.begin, branch.node]
                .map(|n| skeleton.image_from_model(&skeleton.nodes[n.index()].position));
            let own = NodeId(tree.branches.len() as u32);
            let parent = tree.branch_of(branch.parent);
            for part in branch.parts() {
                if let Some(branch) = tree.branch_of.get_mut(part.index()) {
                    *branch = own;
                }
            }
            tree.branches.push(TreeBranch {
                node: branch.node,
                parent: Some(parent.unwrap_or_default()),
                base_px,
                end_px,
            });
        }
        tree
    }

    pub fn len(&self) -> usize {
        self.branches.len()
    }

    /// The branches that carry one, nearest first, the foot last.
    pub fn carriers(&self, branch: NodeId) -> impl Iterator<Item = NodeId> {
        let below = |b: &NodeId| self.branches.get(b.index())?.parent;
        std::iter::successors(below(&branch), below)
    }

    /// The same, and last `trunk` where it is not among them, as the whole tree sways with it: what seems
    /// to stand beside it on the foot, by a skeleton that need not be right, may well be carried by it.
    pub fn carriers_with(&self, trunk: NodeId, branch: NodeId) -> Vec<NodeId> {
        let mut carriers: Vec<NodeId> = self.carriers(branch).collect();
        if branch != trunk && !carriers.contains(&trunk) {
            carriers.push(trunk);
        }
        carriers
    }

    /// The points of `film`, which are on nodes of the skeleton, on branches of this tree.
    pub fn film<'a>(&self, film: &'a Film) -> Cow<'a, Film> {
        let is_same = |t: &FilmTrack| self.branch_of(t.node).is_none_or(|b| b == t.node);
        if film.tracks.iter().all(is_same) {
            return Cow::Borrowed(film);
        }
        let mut film = film.clone();
        for track in &mut film.tracks {
            // One that is on no measured node is on no branch, either.
            track.node = self.branch_of(track.node).unwrap_or(track.node);
        }
        Cow::Owned(film)
    }

    fn branch_of(&self, node: NodeId) -> Option<NodeId> {
        self.branch_of.get(node.index()).copied()
    }

    /// Values of all branches by measured node; `none` for what moves with another node.
    pub fn values_by_node<T: Copy>(&self, values: &[T], none: T) -> Vec<T> {
        let mut out = vec![none; self.branch_of.len()];
        for (branch, value) in self.branches.iter().zip(values) {
            out[branch.node.index()] = *value;
        }
        out
    }

    /// The answers for all branches by measured node. There is none for what moves with another
    /// node.
    pub fn by_node(&self, sways: &[Swaying]) -> Vec<Swaying> {
        self.values_by_node(sways, Err(Unidentified::NotMeasured))
    }
}
