//! Linear blend skinning: which joints move a point of the wood or of a leaf.

use crate::model::NodeId;

/// Which joints move a point, and their shares: joint `i` is node `i` of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinWeights {
    /// Unused entries are 0.
    pub joints: [u16; 4],
    /// Add up to 1; unused entries are 0.
    pub weights: [f32; 4],
}

impl SkinWeights {
    /// Between the branch of `parent` and that of `node`, with share `own` (0 to 1) of the latter.
    pub fn between(parent: NodeId, node: NodeId, own: f32) -> Self {
        // A joint that has no share must be 0, or validators warn.
        let (joints, weights) = if own <= 0.0 {
            ([parent.0 as u16, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])
        } else if own >= 1.0 {
            ([node.0 as u16, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])
        } else {
            (
                [node.0 as u16, parent.0 as u16, 0, 0],
                [own, 1.0 - own, 0.0, 0.0],
            )
        };
        Self { joints, weights }
    }

    /// Share `t` of the way from `self` to `other`, where they name the same joints or one each;
    /// else the nearer one.
    pub(crate) fn towards(self, other: Self, t: f32) -> Self {
        if self == other || t <= 0.0 {
            return self;
        }
        if t >= 1.0 {
            return other;
        }
        let first = self.joints[0].max(other.joints[0]);
        let mut second = None;
        for joint in self.used_joints().chain(other.used_joints()) {
            if joint == first || second == Some(joint) {
                continue;
            }
            if second.is_some() {
                return if t < 0.5 { self } else { other };
            }
            second = Some(joint);
        }
        let Some(second) = second else {
            return self;
        };
        let share = self.weight_of(first) * (1.0 - t) + other.weight_of(first) * t;
        Self::between(NodeId(second.into()), NodeId(first.into()), share)
    }

    fn used_joints(self) -> impl Iterator<Item = u16> {
        let pairs = self.joints.into_iter().zip(self.weights);
        pairs.filter(|(_, weight)| *weight > 0.0).map(|(j, _)| j)
    }

    fn weight_of(&self, joint: u16) -> f32 {
        for (&j, &weight) in self.joints.iter().zip(&self.weights) {
            if j == joint && weight > 0.0 {
                return weight;
            }
        }
        0.0
    }
}
