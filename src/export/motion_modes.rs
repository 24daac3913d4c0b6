//! The motion of a tree as a few displacements of its rest, each with a weight over time: what a
//! mesh without joints can show (M. Alexa, W. Müller, Representing animations by principal
//! components, 2000).
//!
//! The displacements of all nodes in all frames are a matrix `D` (frames by coordinates). The
//! eigenvectors `u_k` of `D D^T` with the largest eigenvalues are the weights over time; the
//! displacement of a vertex that goes with one of them is the sum over the frames of `u_k` times
//! what the joints do to the vertex (linear blend skinning), which is linear in the motion of the
//! joints: it is summed for the joints, once.

use super::joints::usable;
use crate::geometry::Mesh;
use crate::model::{JointMotion, Pose, Skeleton};
use nalgebra::{DMatrix, Matrix3, SymmetricEigen, Vector3};

/// Frames that are looked at, at most, beside the first.
const MOST_FRAMES: usize = 300;

/// A motion in few numbers.
pub(super) struct MotionModes {
    /// Of the keys, s from the first on, strictly growing also as `f32`.
    pub times_s: Vec<f32>,
    /// Those of the largest displacements first.
    pub modes: Vec<MotionMode>,
}

/// A displacement of the tree, and how much of it there is over time.
pub(super) struct MotionMode {
    /// One a key, -1 to 1.
    pub weights: Vec<f32>,
    /// What it adds to a point that hangs on a joint, by node index: `p` is displaced by
    /// `turn p + shift`.
    joints: Vec<JointMotion>,
}

impl MotionModes {
    /// At most so many modes of a motion; none where nothing moves.
    pub fn of(skeleton: &Skeleton, all: &[Pose], most: usize) -> Self {
        let (kept, times_s) = usable(all);
        let last = kept.len().saturating_sub(1);
        let stride = last.div_ceil(MOST_FRAMES).max(1);
        // The last one too: it is the first of a loop again.
        let keys: Vec<usize> = (0..last).step_by(stride).chain([last]).collect();
        let fits = |pose: &&Pose| pose.joints.len() == skeleton.nodes.len();
        let poses = keys.iter().filter_map(|k| all.get(*kept.get(*k)?));
        let poses: Vec<&Pose> = poses.filter(fits).collect();
        if poses.len() < 2 || poses.len() != keys.len() {
            return Self {
                times_s: Vec::new(),
                modes: Vec::new(),
            };
        }
        let moved = displacements(skeleton, &poses);
        let eigen = SymmetricEigen::new(&moved * moved.transpose());
        let mut order: Vec<usize> = (0..poses.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let largest = order.first().map_or(0.0, |k| eigen.eigenvalues[*k]);
        // What is left below this is rounding.
        order.retain(|k| eigen.eigenvalues[*k] > 1e-12 * largest);
        order.truncate(most);
        let motions = joint_motions(skeleton, &poses);
        let modes = order.iter().map(|k| {
            let over_time: Vec<f64> = eigen.eigenvectors.column(*k).iter().copied().collect();
            MotionMode::of(&over_time, &motions)
        });
        Self {
            modes: modes.collect(),
            times_s: keys.iter().map(|k| times_s[*k] as f32).collect(),
        }
    }
}

impl MotionMode {
    /// The mode with these weights, of length 1, over the frames of `motions`.
    fn of(over_time: &[f64], motions: &[Vec<JointMotion>]) -> Self {
        let peak = over_time.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let joints = motions.first().map_or(0, Vec::len);
        let none = JointMotion {
            turn: Matrix3::zeros(),
            shift: Vector3::zeros(),
        };
        let mut sums = vec![none; joints];
        for (weight, motion) in over_time.iter().zip(motions) {
            for (sum, joint) in sums.iter_mut().zip(motion) {
                sum.turn += (joint.turn - Matrix3::identity()) * (weight * peak);
                sum.shift += joint.shift * (weight * peak);
            }
        }
        Self {
            weights: over_time.iter().map(|x| (x / peak) as f32).collect(),
            joints: sums,
        }
    }

    /// By how much every vertex is displaced at weight 1, px.
    pub fn displacements(&self, mesh: &Mesh) -> Vec<[f32; 3]> {
        let skins = mesh.joints.iter().zip(&mesh.weights);
        let places = mesh.positions.iter().zip(skins);
        let moved = places.map(|(place, (joints, weights))| {
            let at = Vector3::from(*place).cast::<f64>();
            let mut by = Vector3::zeros();
            for (joint, weight) in joints.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
                if let Some(joint) = self.joints.get(usize::from(*joint)) {
                    by += (joint.turn * at + joint.shift) * f64::from(*weight);
                }
            }
            by.cast::<f32>().into()
        });
        moved.collect()
    }
}

/// How far every node is from its rest, px: a row a frame, three columns a node.
fn displacements(skeleton: &Skeleton, poses: &[&Pose]) -> DMatrix<f64> {
    DMatrix::from_fn(poses.len(), 3 * skeleton.nodes.len(), |frame, column| {
        let (node, axis) = (column / 3, column % 3);
        let by = poses[frame].joints[node].position - skeleton.nodes[node].position;
        if by[axis].is_finite() { by[axis] } else { 0.0 }
    })
}

/// What the joints do in every frame; nothing where a number is missing.
fn joint_motions(skeleton: &Skeleton, poses: &[&Pose]) -> Vec<Vec<JointMotion>> {
    let still = JointMotion {
        turn: Matrix3::identity(),
        shift: Vector3::zeros(),
    };
    let mut all = Vec::with_capacity(poses.len());
    for pose in poses {
        let joints = 0..skeleton.nodes.len();
        let joints = joints.map(|i| pose.joint_motion(skeleton, i).unwrap_or(still));
        all.push(joints.collect());
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{JointPose, Node, Size};
    use nalgebra::UnitQuaternion;
    use std::f64::consts::TAU;

    /// A trunk with two branches, 100 px each.
    fn tree() -> Skeleton {
        let nodes = [
            (None, [0.0, 0.0, 0.0]),
            (Some(0), [0.0, 100.0, 0.0]),
            (Some(1), [80.0, 160.0, 0.0]),
            (Some(1), [-80.0, 160.0, 0.0]),
        ];
        let nodes = (0..).zip(nodes);
        Skeleton {
            nodes: nodes
                .map(|(i, (parent, at))| Node::made_up(i, parent, at))
                .collect(),
            foot_px: [0.0; 2].into(),
            image_size: Size::new(640, 480),
        }
    }

    /// A loop of ten seconds in which the trunk sways and each branch about its own end of it.
    fn sway(skeleton: &Skeleton) -> Vec<Pose> {
        const SWINGS: [(f64, f64); 4] = [(0.0, 0.0), (0.5, 0.1), (0.9, 0.15), (1.3, 0.2)];
        let mut poses = Vec::new();
        for frame in 0..=300 {
            let time_s = f64::from(frame) / 30.0;
            let mut joints: Vec<JointPose> = Vec::new();
            for (node, (hz, rad)) in skeleton.nodes.iter().zip(SWINGS) {
                let angle = rad * (TAU * hz * time_s).sin();
                let Some(parent) = node.parent.map(|p| p.index()) else {
                    joints.push(JointPose::at_rest(node.position));
                    continue;
                };
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
                let rotation = joints[parent].rotation * turn;
                let way = node.position - skeleton.nodes[parent].position;
                joints.push(JointPose {
                    position: joints[parent].position + rotation * way,
                    rotation,
                });
            }
            poses.push(Pose {
                frame: frame as u64,
                time_s,
                joints,
            });
        }
        poses
    }

    /// Its three ends, each on its own branch.
    fn ends(skeleton: &Skeleton) -> Mesh {
        let mut mesh = Mesh::default();
        for (i, node) in skeleton.nodes.iter().enumerate().skip(1) {
            mesh.positions
                .push(node.position.coords.cast::<f32>().into());
            mesh.joints.push([i as u16, 0, 0, 0]);
            mesh.weights.push([1.0, 0.0, 0.0, 0.0]);
        }
        mesh
    }

    /// The farthest that the sum of the modes is from a node in any frame, px.
    fn worst_px(most: usize) -> f32 {
        let (skeleton, poses) = (tree(), sway(&tree()));
        let motion = MotionModes::of(&skeleton, &poses, most);
        assert!(motion.modes.len() <= most);
        assert_eq!(motion.times_s.len(), poses.len());
        let mesh = ends(&skeleton);
        let by: Vec<Vec<[f32; 3]>> = motion
            .modes
            .iter()
            .map(|mode| mode.displacements(&mesh))
            .collect();
        let mut worst = 0.0_f32;
        for (key, pose) in poses.iter().enumerate() {
            for (vertex, rest) in mesh.positions.iter().enumerate() {
                let mut at = Vector3::from(*rest);
                for (mode, by) in motion.modes.iter().zip(&by) {
                    assert!(mode.weights[key].abs() <= 1.0 + 1e-6);
                    at += Vector3::from(by[vertex]) * mode.weights[key];
                }
                let wanted = pose.joints[vertex + 1].position.coords.cast::<f32>();
                worst = worst.max((at - wanted).norm());
            }
        }
        worst
    }

    #[test]
    fn a_few_displacements_move_a_mesh_as_its_joints_do() {
        // Ends go up to 45 px from their rest. One mode shows the trunk's sway and little else.
        let [one, three, eight] = [1, 3, 8].map(worst_px);
        assert!(one > 8.0, "{one}");
        assert!(three < 5.0, "{three}");
        assert!(eight < 0.05, "{eight}");
    }

    #[test]
    fn what_stands_still_has_no_modes() {
        let skeleton = tree();
        let still = Pose {
            frame: 0,
            time_s: 0.0,
            joints: skeleton
                .nodes
                .iter()
                .map(|n| JointPose::at_rest(n.position))
                .collect(),
        };
        let later = Pose {
            time_s: 1.0,
            ..still.clone()
        };
        for poses in [vec![], vec![still.clone()], vec![still, later]] {
            assert!(MotionModes::of(&skeleton, &poses, 4).modes.is_empty());
        }
    }
}
