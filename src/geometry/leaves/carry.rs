//! Where a pose carries what sits on the tree: linear blend skinning, as every viewer does it.

use crate::model::{Pose, Skeleton};
use crate::shape::SkinWeights;
use nalgebra::{Matrix3, Point3, Vector3};

/// A point at rest goes to `turn` times it plus `way`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Carried {
    pub turn: Matrix3<f64>,
    pub way: Vector3<f64>,
}

impl Carried {
    pub fn by(skin: &SkinWeights, skeleton: &Skeleton, pose: Option<&Pose>) -> Self {
        let still = Self {
            turn: Matrix3::identity(),
            way: Vector3::zeros(),
        };
        let Some(pose) = pose.filter(|p| p.joints.len() == skeleton.nodes.len()) else {
            return still;
        };
        let (mut turn, mut way) = (Matrix3::zeros(), Vector3::zeros());
        for (&joint, &weight) in skin
            .joints
            .iter()
            .zip(&skin.weights)
            .filter(|(_, w)| **w > 0.0)
        {
            let Some(node) = skeleton.nodes.get(usize::from(joint)) else {
                return still;
            };
            // The joint turns about its parent node (`JointPose`).
            let pivot = node.parent.map_or(usize::from(joint), |p| p.index());
            let rotation = pose.joints[usize::from(joint)]
                .rotation
                .to_rotation_matrix()
                .into_inner();
            let weight = f64::from(weight);
            turn += rotation * weight;
            way += (pose.joints[pivot].position.coords
                - rotation * skeleton.nodes[pivot].position.coords)
                * weight;
        }
        let finite = turn.iter().chain(way.iter()).all(|x| x.is_finite());
        if finite { Self { turn, way } } else { still }
    }

    pub fn posed(&self, p: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.turn * p.coords + self.way)
    }

    pub fn to_rest(self, p: &Point3<f64>) -> Point3<f64> {
        let moved = p.coords - self.way;
        // Two branches that turn against each other by half a circle would leave nothing to invert.
        Point3::from(
            self.turn
                .try_inverse()
                .map_or(moved, |inverse| inverse * moved),
        )
    }
}

/// Between two skins, with share `t` (0 to 1) of the second.
pub(super) fn between(a: &SkinWeights, b: &SkinWeights, t: f64) -> SkinWeights {
    let mut shares: Vec<(u16, f32)> = Vec::with_capacity(8);
    for (skin, part) in [(a, 1.0 - t as f32), (b, t as f32)] {
        for (&joint, &weight) in skin
            .joints
            .iter()
            .zip(&skin.weights)
            .filter(|(_, w)| **w * part > 1e-4)
        {
            match shares.iter_mut().find(|(j, _)| *j == joint) {
                Some((_, share)) => *share += weight * part,
                None => shares.push((joint, weight * part)),
            }
        }
    }
    shares.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
    shares.truncate(4);
    let sum: f32 = shares.iter().map(|s| s.1).sum();
    let mut skin = SkinWeights {
        joints: [0; 4],
        weights: [0.0; 4],
    };
    for (k, (joint, share)) in shares.into_iter().enumerate() {
        (skin.joints[k], skin.weights[k]) = (joint, share / sum.max(f32::MIN_POSITIVE));
    }
    skin
}
