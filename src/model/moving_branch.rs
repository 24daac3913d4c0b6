//! The branches that move on their own, and what moves with them as one rigid body.
//!
//! A traced bend, or a side branch on which no point is followed, has no motion of its own: it is a
//! part of the branch that ends in its mover ([`Node::moves_with`](super::Node::moves_with)).

use super::{JointPose, NodeId, Pose, Skeleton};
use nalgebra::{UnitQuaternion, Vector3};

/// A branch that moves on its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MovingBranch {
    /// The node that it ends in.
    pub node: NodeId,
    /// The node about which it turns: the end or a part of the branch that carries it.
    pub begin: NodeId,
    /// The branch that carries it, as the node in which that ends.
    pub parent: NodeId,
    /// The nodes that move with it, in their order.
    pub riders: Vec<NodeId>,
}

impl MovingBranch {
    /// From where it begins to its end at rest, model axes, px.
    pub fn vector(&self, skeleton: &Skeleton) -> Vector3<f64> {
        skeleton.nodes[self.node.index()].position - skeleton.nodes[self.begin.index()].position
    }

    /// Its end and the nodes that move with it.
    pub fn parts(&self) -> impl Iterator<Item = NodeId> {
        std::iter::once(self.node).chain(self.riders.iter().copied())
    }

    /// How it has turned in a pose of its tree against the branch that carries it, as an axis
    /// (model axes at rest) times an angle, radians; 0 where the pose holds no number.
    pub fn own_turn(&self, pose: &Pose) -> Vector3<f64> {
        let [turned, carried] = [self.node, self.parent].map(|n| pose.joints[n.index()]);
        let own = (carried.rotation.inverse() * turned.rotation).scaled_axis();
        if own.iter().all(|x| x.is_finite()) {
            own
        } else {
            Vector3::zeros()
        }
    }

    /// Turns the branch about the place in `joints` where it begins, with all that moves with it.
    /// `rotation` is from rest, in model axes; `joints` are by node.
    pub fn place(
        &self,
        skeleton: &Skeleton,
        rotation: UnitQuaternion<f64>,
        joints: &mut [JointPose],
    ) {
        let from = skeleton.nodes[self.begin.index()].position;
        let base = joints[self.begin.index()].position;
        for part in self.parts() {
            let way = skeleton.nodes[part.index()].position - from;
            joints[part.index()] = JointPose {
                position: base + rotation * way,
                rotation,
            };
        }
    }
}

impl Skeleton {
    /// All branches that move on their own, each after the one that carries it; otherwise in the
    /// order of the nodes. The foot is none, nor is a node that a file hangs on nothing.
    pub fn moving_branches(&self) -> Vec<MovingBranch> {
        let mut place: Vec<Option<usize>> = vec![None; self.nodes.len()];
        let mut out: Vec<MovingBranch> = Vec::with_capacity(self.nodes.len());
        for i in (0..self.nodes.len() as u32).map(NodeId) {
            let mut waiting: Vec<MovingBranch> = Vec::new();
            let mut at = i;
            // Carriers begin ever lower, so that this ends.
            while self.mover(at) == at
                && place[at.index()].is_none()
                && let Some(branch) = self.moving_branch(at)
            {
                at = branch.parent;
                waiting.push(branch);
            }
            for branch in waiting.into_iter().rev() {
                place[branch.node.index()] = Some(out.len());
                out.push(branch);
            }
        }
        for i in (0..self.nodes.len() as u32).map(NodeId) {
            let mover = self.mover(i);
            if mover != i
                && let Some(k) = place[mover.index()]
            {
                out[k].riders.push(i);
            }
        }
        out
    }

    /// The tree with its `branches` turned as [`MovingBranch::own_turn`] says: each turns about its
    /// base, and keeps its length. `branches` are all of them, in the order of
    /// [`moving_branches`](Self::moving_branches), and `turns` one for each.
    pub fn posed(
        &self,
        branches: &[MovingBranch],
        turns: &[Vector3<f64>],
        frame: u64,
        time_s: f64,
    ) -> Pose {
        let mut joints = self.joints_at_rest();
        for (branch, turn) in branches.iter().zip(turns) {
            let own = UnitQuaternion::from_scaled_axis(*turn);
            let carried = joints[branch.parent.index()].rotation;
            let rotation = UnitQuaternion::new_normalize((carried * own).into_inner());
            branch.place(self, rotation, &mut joints);
        }
        Pose {
            frame,
            time_s,
            joints,
        }
    }

    /// The branch that ends in `node`, without the nodes that move with it.
    fn moving_branch(&self, node: NodeId) -> Option<MovingBranch> {
        Some(MovingBranch {
            node,
            begin: self.begin(node)?,
            parent: self.moving_parent(node)?,
            riders: Vec::new(),
        })
    }
}
