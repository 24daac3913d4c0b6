//! A posture between two.

use crate::model::{JointPose, Pose, Skeleton};
use nalgebra::UnitQuaternion;

/// The pose that is `share` (0 to 1) of the way from `a` to `b`, of frame and time of `a`: every
/// branch turns evenly, and keeps its length. Joints that one of them lacks are at rest.
pub fn between(skeleton: &Skeleton, a: &Pose, b: &Pose, share: f64) -> Pose {
    let mut joints: Vec<JointPose> = Vec::with_capacity(skeleton.nodes.len());
    for (i, node) in skeleton.nodes.iter().enumerate() {
        joints.push(JointPose {
            position: a.joints.get(i).map_or(node.position, |j| j.position),
            rotation: rotation_between(a, b, i, share),
        });
    }
    for branch in skeleton.moving_branches() {
        let rotation = joints[branch.node.index()].rotation;
        branch.place(skeleton, rotation, &mut joints);
    }
    Pose {
        frame: a.frame,
        time_s: a.time_s,
        joints,
    }
}

/// That of joint `i`; none where a pose lacks it.
fn rotation_between(a: &Pose, b: &Pose, i: usize, share: f64) -> UnitQuaternion<f64> {
    let Some((a, b)) = a.joints.get(i).zip(b.joints.get(i)) else {
        return UnitQuaternion::identity();
    };
    // Opposite rotations have no shortest way between them; either is as good.
    a.rotation
        .try_slerp(&b.rotation, share, 1e-9)
        .unwrap_or(a.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Node, Size};
    use nalgebra::{Point3, Vector3};
    use std::f64::consts::PI;

    fn node(k: u32, parent: Option<u32>, position: Point3<f64>) -> Node {
        Node {
            level: k as u8,
            ..Node::made_up(k, parent, position.into())
        }
    }

    /// Foot, trunk and a branch to the side.
    fn skeleton() -> Skeleton {
        let nodes = vec![
            node(0, None, Point3::origin()),
            node(1, Some(0), Point3::new(0.0, 100.0, 0.0)),
            node(2, Some(1), Point3::new(30.0, 140.0, 20.0)),
        ];
        Skeleton {
            nodes,
            foot_px: [50.0, 200.0].into(),
            image_size: Size::new(100, 220),
        }
    }

    /// Trunk and branch turned by these angles about the line of sight.
    fn pose(frame: u64, skeleton: &Skeleton, angles: &[f64]) -> Pose {
        let mut joints = vec![JointPose {
            position: Point3::origin(),
            rotation: UnitQuaternion::identity(),
        }];
        for (i, angle) in angles.iter().enumerate() {
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *angle);
            let way = skeleton.nodes[i + 1].position - skeleton.nodes[i].position;
            joints.push(JointPose {
                position: joints[i].position + rotation * way,
                rotation,
            });
        }
        Pose {
            frame,
            time_s: frame as f64 / 30.0,
            joints,
        }
    }

    fn near(is: &Pose, want: &Pose) -> bool {
        is.joints.len() == want.joints.len()
            && is.joints.iter().zip(&want.joints).all(|(a, b)| {
                (a.position - b.position).norm() < 1e-9 && a.rotation.angle_to(&b.rotation) < 1e-9
            })
    }

    #[test]
    fn it_starts_at_the_one_ends_at_the_other_and_is_half_way_in_the_middle() {
        let tree = skeleton();
        let (a, b) = (pose(3, &tree, &[0.0, 0.2]), pose(7, &tree, &[0.6, 1.4]));
        assert!(near(&between(&tree, &a, &b, 0.0), &a));
        assert!(near(&between(&tree, &a, &b, 1.0), &b));
        let middle = between(&tree, &a, &b, 0.5);
        assert!(near(&middle, &pose(3, &tree, &[0.3, 0.8])));
        assert_eq!(
            (middle.frame, middle.time_s),
            (3, 0.1),
            "the moment is that of the first"
        );
    }

    #[test]
    fn no_branch_changes_its_length_on_the_way() {
        let tree = skeleton();
        let (a, b) = (pose(0, &tree, &[-1.0, 2.5]), pose(1, &tree, &[1.2, -0.4]));
        for share in [0.1, 0.5, 0.9] {
            let pose = between(&tree, &a, &b, share);
            for i in 1..3 {
                let was = (tree.nodes[i].position - tree.nodes[i - 1].position).norm();
                let is = (pose.joints[i].position - pose.joints[i - 1].position).norm();
                assert!(
                    (is - was).abs() < 1e-9,
                    "branch {i} at {share}: {was} became {is}"
                );
            }
        }
    }

    #[test]
    fn a_pose_that_lacks_joints_or_is_turned_right_round_still_gives_one() {
        let tree = skeleton();
        let (short, whole) = (pose(0, &tree, &[0.3]), pose(1, &tree, &[0.3, 0.5]));
        assert!(
            near(
                &between(&tree, &short, &whole, 0.5),
                &pose(0, &tree, &[0.3, 0.0])
            ),
            "at rest where one is missing"
        );
        let (there, back) = (pose(0, &tree, &[0.0, 0.0]), pose(1, &tree, &[PI, 0.0]));
        let pose = between(&tree, &there, &back, 0.5);
        assert!(
            pose.joints
                .iter()
                .all(|j| j.position.iter().all(|c| c.is_finite()))
        );
    }
}
