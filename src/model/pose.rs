//! The tree's posture in one frame.

use nalgebra::{Point3, UnitQuaternion};

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
