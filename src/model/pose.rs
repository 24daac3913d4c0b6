//! The tree's posture in one frame.

use super::Skeleton;
use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};

/// Where one node is, and how the branch that ends in it has turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPose {
    /// Model axes, px.
    pub position: Point3<f64>,
    /// Rotation of the branch from its rest direction, in model axes; the branch turns about its
    /// parent node, so
    /// `position = parent.position + rotation * (rest - parent rest)`. A node that moves with
    /// another one has the rotation of that.
    pub rotation: UnitQuaternion<f64>,
}

impl JointPose {
    /// Of a node that stands at `position`, not turned.
    pub fn at_rest(position: Point3<f64>) -> Self {
        Self {
            position,
            rotation: UnitQuaternion::identity(),
        }
    }
}

/// One posture: a [`JointPose`] for every node of the skeleton, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    pub frame: u64,
    pub time_s: f64,
    pub joints: Vec<JointPose>,
}

/// How a joint moves what hangs on it: a point `p` goes to `turn p + shift`. Model axes, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    pub turn: Matrix3<f64>,
    pub shift: Vector3<f64>,
}

impl Pose {
    /// How joint `i` moves what hangs on it: it turns about its parent node by the rotation of its
    /// branch, as the joints of the model's file do. `None` if it has no parent or a number is
    /// missing.
    pub fn joint_motion(&self, skeleton: &Skeleton, i: usize) -> Option<JointMotion> {
        let pivot = skeleton.nodes.get(i)?.parent?.index();
        let rest = skeleton.nodes.get(pivot)?.position;
        let now = self.joints.get(pivot)?.position;
        let rotation = self.joints.get(i)?.rotation;
        let turn = rotation.to_rotation_matrix().into_inner();
        let shift = now.coords - turn * rest.coords;
        let mut numbers = turn.iter().chain(shift.iter());
        let sound = numbers.all(|x| x.is_finite());
        sound.then_some(JointMotion { turn, shift })
    }
}
