//! A posture between two.

use crate::model::{JointPose, Pose, Skeleton};

/// The pose that is `share` (0 to 1) of the way from `a` to `b`, of frame and time of `a`: every branch turns evenly, and
/// keeps its length. Joints that one of them lacks are at rest.
pub fn between(skeleton: &Skeleton, a: &Pose, b: &Pose, share: f64) -> Pose {
    let mut joints: Vec<JointPose> = Vec::with_capacity(skeleton.nodes.len());
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let turned = a.joints.get(i).zip(b.joints.get(i));
        // Opposite rotations have no shortest way between them; either is as good.
        let rotation = turned.map(|(a, b)| a.rotation.try_slerp(&b.rotation, share, 1e-9).unwrap_or(a.rotation));
        let rotation = rotation.unwrap_or_default();
        let position = match node.parent.filter(|p| p.index() < i) {
            Some(parent) => {
                let way = node.position - skeleton.nodes[parent.index()].position;
                joints[parent.index()].position + rotation * way
            }
            None => a.joints.get(i).map_or(node.position, |j| j.position),
        };
        joints.push(JointPose { position, rotation });
    }
    Pose { frame: a.frame, time_s: a.time_s, joints }
}
