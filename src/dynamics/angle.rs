//! How a branch turns against the one that carries it, as it is seen in the picture.

use crate::model::{NodeId, Pose, Skeleton};
use crate::signal::principal::{PrincipalComponents, symmetric};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// Projections shorter than this have no direction, px.
const SHORTEST_PX: f64 = 1e-6;

/// The angle between the branch that ends in `node` and its parent branch in every pose, degrees:
/// that of Hu et al. eq. 1 in the picture's plane, where it is measured, and signed,
/// counterclockwise for the viewer. It is continuous in time, so that it may leave ±180°.
///
/// The parent branch is the nearest one below that has a length in the picture at rest; upright,
/// where there is none. NaN for poses of another skeleton and those in which one of the two
/// branches has no direction.
pub fn angle_to_parent_deg(skeleton: &Skeleton, poses: &[Pose], node: NodeId) -> Vec<f64> {
    let mut follower = AngleToParent::new(skeleton, node);
    poses.iter().map(|pose| follower.step(pose)).collect()
}

/// [`angle_to_parent_deg`] frame by frame.
#[derive(Clone, Debug)]
pub struct AngleToParent {
    /// Number of nodes of the skeleton that poses must be of.
    nodes: usize,
    /// Start and end of the branch.
    own: Option<[NodeId; 2]>,
    /// Start and end of the branch that it is measured against; upright, where there is none.
    carrier: Option<(NodeId, NodeId)>,
    last_deg: Option<f64>,
}

impl AngleToParent {
    /// Follows the branch that ends in `node`, or that `node` moves with.
    pub fn new(skeleton: &Skeleton, node: NodeId) -> Self {
        let end = skeleton.mover(node);
        let begin = skeleton.begin(end);
        let carrier = skeleton
            .moving_parent(end)
            .and_then(|p| carrier(skeleton, p));
        Self {
            nodes: skeleton.nodes.len(),
            own: begin.map(|begin| [begin, end]),
            carrier,
            last_deg: None,
        }
    }

    /// The angle in the next pose, degrees; NaN where it has none.
    pub fn step(&mut self, pose: &Pose) -> f64 {
        let Some([begin, end]) = self.own.filter(|_| pose.joints.len() == self.nodes) else {
            return f64::NAN;
        };
        let base = self.carrier.map_or(Vector2::y(), |(from, to)| {
            direction_in_picture(pose, from, to)
        });
        let own = direction_in_picture(pose, begin, end);
        if !is_direction(base.norm()) || !is_direction(own.norm()) {
            return f64::NAN;
        }
        let angle = base.perp(&own).atan2(base.dot(&own)).to_degrees();
        let angle = self.last_deg.map_or(angle, |before| {
            angle - 360.0 * ((angle - before) / 360.0).round()
        });
        self.last_deg = Some(angle);
        angle
    }
}

/// The same angle in space: how far the branch has turned from where its carrier would have taken
/// it, degrees, signed along the direction in which it sways most. Unlike the arc cosine of Hu et
/// al. eq. 1 it tells the two sides of a branch that goes on straight. NaN for poses of another
/// skeleton and those in which the branch or its carrier has no direction.
pub fn angle_in_space_deg(skeleton: &Skeleton, poses: &[Pose], node: NodeId) -> Vec<f64> {
    let end = skeleton.mover(node);
    let Some(begin) = skeleton.begin(end) else {
        return vec![f64::NAN; poses.len()];
    };
    let own = skeleton.nodes[end.index()].position - skeleton.nodes[begin.index()].position;
    let parent = skeleton.moving_parent(end);
    let carrier = parent.filter(|p| skeleton.begin(*p).is_some());
    let mut turns: Vec<Option<Vector3<f64>>> = Vec::with_capacity(poses.len());
    for pose in poses {
        let is_of_skeleton = pose.joints.len() == skeleton.nodes.len();
        let carried = is_of_skeleton.then(|| carried_direction(pose, begin, end, carrier));
        turns.push(carried.and_then(|carried| turn(&own, &carried)));
    }
    let seen: Vec<Vector3<f64>> = turns.iter().copied().flatten().collect();
    let mean = seen.iter().sum::<Vector3<f64>>() / (seen.len() as f64).max(1.0);
    let spread = symmetric(3, |a, b| {
        seen.iter()
            .map(|v| (v[a] - mean[a]) * (v[b] - mean[b]))
            .sum()
    });
    let main = &PrincipalComponents::of_products(spread).directions[0];
    let axis = Vector3::new(main[0], main[1], main[2]);
    // Towards the viewer, as counterclockwise is in the picture.
    let axis = if axis.z < 0.0 { -axis } else { axis };
    turns
        .iter()
        .map(|t| t.map_or(f64::NAN, |t| t.dot(&axis).to_degrees()))
        .collect()
}

/// Whether a way of this length leads anywhere; one to a place that is not known does not.
fn is_direction(length_px: f64) -> bool {
    length_px.is_finite() && length_px >= SHORTEST_PX
}

fn direction_in_picture(pose: &Pose, from: NodeId, to: NodeId) -> Vector2<f64> {
    let [from, to] = [from, to].map(|n| pose.joints[n.index()].position);
    (to - from).xy()
}

/// The branch from `from` to `to` as it would be if its carrier, if it has one, did not turn.
fn carried_direction(
    pose: &Pose,
    from: NodeId,
    to: NodeId,
    carrier: Option<NodeId>,
) -> Vector3<f64> {
    let now = pose.joints[to.index()].position - pose.joints[from.index()].position;
    match carrier {
        Some(carrier) => pose.joints[carrier.index()].rotation.inverse() * now,
        None => now,
    }
}

/// The rotation between two directions as a vector along its axis.
fn turn(from: &Vector3<f64>, to: &Vector3<f64>) -> Option<Vector3<f64>> {
    // Of what has no direction it would be the rotation that turns nothing.
    if !is_direction(from.norm()) || !is_direction(to.norm()) {
        return None;
    }
    UnitQuaternion::rotation_between(from, to).map(|q| q.scaled_axis())
}

/// The nearest branch at or below the one that ends in `node` that has a direction in the picture.
fn carrier(skeleton: &Skeleton, node: NodeId) -> Option<(NodeId, NodeId)> {
    let (mut end, nodes) = (node, &skeleton.nodes);
    while let (Some(begin), Some(parent)) = (skeleton.begin(end), skeleton.moving_parent(end)) {
        let way = nodes[end.index()].position - nodes[begin.index()].position;
        if is_direction(way.x.hypot(way.y)) {
            return Some((begin, end));
        }
        end = parent;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{JointPose, Node, Size};
    use nalgebra::{Point3, UnitQuaternion};

    /// A chain of nodes from the foot up.
    fn chain(at: &[[f64; 3]]) -> Skeleton {
        let mut nodes = Vec::new();
        for (i, place) in (0_u32..).zip(at) {
            nodes.push(Node {
                level: i as u8,
                ..Node::made_up(i, i.checked_sub(1), *place)
            });
        }
        Skeleton {
            nodes,
            foot_px: [0.0, 0.0].into(),
            image_size: Size {
                width: 64,
                height: 64,
            },
        }
    }

    fn pose(at: &[[f64; 3]]) -> Pose {
        let mut joints = Vec::new();
        for p in at {
            joints.push(JointPose {
                position: Point3::from(*p),
                rotation: UnitQuaternion::identity(),
            });
        }
        Pose {
            frame: 0,
            time_s: 0.0,
            joints,
        }
    }

    fn close(found: f64, wanted: f64) {
        assert!((found - wanted).abs() < 1e-9, "{found}, not {wanted}");
    }

    #[test]
    fn a_branch_to_the_left_of_its_parent_has_a_positive_angle() {
        let rest = [[0.0, 0.0, 0.0], [0.0, 10.0, 0.0], [-10.0, 20.0, 5.0]];
        let tree = chain(&rest);
        // The trunk leans by 45° to the right, the branch goes along: nothing changes between the
        // two.
        let leaning = [[0.0, 0.0, 0.0], [10.0, 10.0, 0.0], [10.0, 24.0, 5.0]];
        let angles = angle_to_parent_deg(&tree, &[pose(&rest), pose(&leaning)], NodeId(2));
        close(angles[0], 45.0);
        close(angles[1], 45.0);
        // The trunk itself is measured against the upright.
        close(
            angle_to_parent_deg(&tree, &[pose(&leaning)], NodeId(1))[0],
            -45.0,
        );
    }

    /// A branch that sways towards the viewer hardly turns in the picture; in space it does.
    #[test]
    fn a_sway_in_depth_is_an_angle_in_space() {
        let rest = [[0.0; 3], [0.0, 10.0, 0.0], [0.0, 20.0, 0.0]];
        let tree = chain(&rest);
        let mut poses = Vec::new();
        for deg in [0.0_f64, 8.0, -8.0, 3.0] {
            let (s, c) = deg.to_radians().sin_cos();
            let end = [0.0, 10.0 + 10.0 * c, 10.0 * s];
            poses.push(pose(&[[0.0; 3], [0.0, 10.0, 0.0], end]));
        }
        let (space, plane) = (
            angle_in_space_deg(&tree, &poses, NodeId(2)),
            angle_to_parent_deg(&tree, &poses, NodeId(2)),
        );
        assert!(
            (space[1] - space[2]).abs() > 15.9 && (space[1] - space[0]).abs() > 7.9,
            "{space:?}"
        );
        assert!(plane.iter().all(|a| a.abs() < 1e-6), "{plane:?}");
        assert!(angle_in_space_deg(&tree, &[pose(&rest[..2])], NodeId(2))[0].is_nan());
    }

    /// One frame without a place once took the angle of all later ones.
    #[test]
    fn a_place_that_is_not_known_takes_the_angle_of_its_frame_only() {
        let rest = [[0.0; 3], [0.0, 10.0, 0.0], [-1.0, 20.0, 1.0]];
        let nowhere = [rest[0], rest[1], [f64::NAN; 3]];
        let turned = [rest[0], rest[1], [1.0, 20.0, 1.0]];
        let poses = [pose(&rest), pose(&nowhere), pose(&turned)];
        for angle_deg in [angle_to_parent_deg, angle_in_space_deg] {
            let angles = angle_deg(&chain(&rest), &poses, NodeId(2));
            assert!(angles[1].is_nan(), "{angles:?}");
            assert!((angles[0] - angles[2]).abs() > 10.0, "{angles:?}");
        }
    }

    #[test]
    fn an_angle_that_passes_180_degrees_does_not_jump() {
        let tree = chain(&[[0.0; 3], [0.0, 10.0, 0.0], [-1.0, 0.0, 0.0]]);
        let angles = angle_to_parent_deg(
            &tree,
            &[170.0_f64, 178.0, 186.0, 175.0].map(|deg| {
                let (s, c) = deg.to_radians().sin_cos();
                let end = [-10.0 * s, 10.0 + 10.0 * c, 0.0];
                pose(&[[0.0; 3], [0.0, 10.0, 0.0], end])
            }),
            NodeId(2),
        );
        for (found, wanted) in angles.iter().zip([170.0, 178.0, 186.0, 175.0]) {
            close(*found, wanted);
        }
    }

    #[test]
    fn what_has_no_direction_has_no_angle_and_a_parent_without_length_is_passed_over() {
        let rest = [
            [0.0; 3],
            [0.0, 10.0, 0.0],
            [0.0, 10.0, 0.0],
            [10.0, 10.0, 0.0],
        ];
        let tree = chain(&rest);
        close(
            angle_to_parent_deg(&tree, &[pose(&rest)], NodeId(3))[0],
            -90.0,
        );
        assert!(angle_to_parent_deg(&tree, &[pose(&rest)], NodeId(2))[0].is_nan());
        assert!(angle_to_parent_deg(&tree, &[pose(&rest)], NodeId(0))[0].is_nan());
        assert!(angle_to_parent_deg(&tree, &[pose(&rest[..2])], NodeId(3))[0].is_nan());
        assert_eq!(
            angle_to_parent_deg(&tree, &[pose(&rest)], NodeId(9)).len(),
            1
        );
    }
}
