//! Skin and leaves in one pose.

use crate::geometry::{FoliageGroup, Mesh};
use crate::model::{LeafSwing, Pose, Skeleton};
use nalgebra::{Matrix3, Vector3};

/// How every joint moves what hangs on it: `p` goes to `turn p + shift`.
///
/// Joint `i` turns about its parent node by the branch's rotation, as the joints of the model's
/// file do.
pub(super) struct Joints(Vec<(Matrix3<f32>, Vector3<f32>)>);

impl Joints {
    /// `None` stands for the rest pose, as does a pose of another tree or a joint with no number in
    /// it.
    pub fn new(skeleton: &Skeleton, pose: Option<&Pose>) -> Self {
        let pose = pose.filter(|p| p.joints.len() == skeleton.nodes.len());
        let still = (Matrix3::identity(), Vector3::zeros());
        let mut joints = vec![still; skeleton.nodes.len().max(1)];
        if let Some(pose) = pose {
            for (i, joint) in joints.iter_mut().enumerate() {
                let motion = pose.joint_motion(skeleton, i);
                *joint = motion.map_or(still, |m| (m.turn.cast(), m.shift.cast()));
            }
        }
        Self(joints)
    }

    /// Moves a vertex and its normal by the shares of its joints (linear blend skinning).
    fn carry(
        &self,
        at: Vector3<f32>,
        normal: Vector3<f32>,
        joints: [u16; 4],
        weights: [f32; 4],
    ) -> [[f32; 3]; 2] {
        let (mut p, mut n) = (Vector3::zeros(), Vector3::zeros());
        for (joint, weight) in joints.into_iter().zip(weights).filter(|(_, w)| *w > 0.0) {
            let Some((turn, shift)) = self.0.get(usize::from(joint)) else {
                continue;
            };
            p += (turn * at + shift) * weight;
            n += turn * normal * weight;
        }
        [p.into(), n.into()]
    }

    /// Positions and normals of a mesh.
    pub fn wood(&self, mesh: &Mesh) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        self.all(mesh, |i| Vector3::from(mesh.positions[i]))
    }

    /// The same of leaves, swung by their two parts (see [`FoliageGroup`]), rad.
    pub fn leaves(&self, group: &FoliageGroup, swing: LeafSwing) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        self.all(&group.mesh, |i| {
            Vector3::from(group.mesh.positions[i])
                + displacement(&group.sine, i) * swing.sine
                + displacement(&group.cosine, i) * swing.cosine
        })
    }

    fn all(
        &self,
        mesh: &Mesh,
        at: impl Fn(usize) -> Vector3<f32>,
    ) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
        let n = mesh.positions.len();
        let parts = mesh
            .normals
            .iter()
            .zip(mesh.joints.iter().zip(&mesh.weights))
            .take(n)
            .enumerate();
        let moved = parts.map(|(i, (normal, (joints, weights)))| {
            let [p, n] = self.carry(at(i), Vector3::from(*normal), *joints, *weights);
            (p, n)
        });
        moved.unzip()
    }
}

/// Displacement of a vertex; none where there are fewer than vertices.
fn displacement(of: &[[f32; 3]], i: usize) -> Vector3<f32> {
    of.get(i).map_or_else(Vector3::zeros, |d| Vector3::from(*d))
}
