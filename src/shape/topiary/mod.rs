//! Topiary: the tree in a drawn shape (Li 2011 sect. 6 and fig. 11, Zeng 2015 sect. 6.4).

mod cover;
mod cut;
mod drawn;
mod grow;

pub use cover::coverage;
pub use drawn::{Drawn, TopiaryError};

use super::envelope::Envelope;
use super::term_weights::tune_term_weights;
use super::trunk::is_trunk;
use crate::config;
use crate::model::{JointPose, MovingBranch, NodeId, Outline, Pose, Skeleton};
use grow::DrawnSpace;
use nalgebra::{Point3, UnitQuaternion, Vector3};

/// A shape that leaves out no more of the outline than this share holds the tree: nobody draws to
/// the last pixel.
const LARGER: f64 = 0.01;

/// A tree that was cut to a shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Topiary {
    pub skeleton: Skeleton,
    /// The shape where it stands in the picture.
    pub shape: Outline,
    pub cut: Cut,
    /// For every node the measured node of the tree before, whose motion against its own parent it
    /// repeats.
    pub moves_as: Vec<NodeId>,
}

/// What was done to the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cut {
    /// The shape holds the whole outline: nothing was changed.
    pub larger: bool,
    /// Branches that are gone, that end at the border, and that were added to fill the shape.
    pub gone: usize,
    pub shortened: usize,
    pub grown: usize,
    /// Share of the shape that the tree covers as seen from the front ([`coverage`]), 0 to 1.
    pub coverage: f64,
}

/// Cuts `skeleton` to what of it is inside `drawn`, pushes the rest to fill the shape, and adds
/// smaller copies of the tree's own subtrees where the shape is still bare. The trunk stays. What
/// is drawn at random (which of the subtrees, how deep) comes from `seed`. A shape that holds the
/// whole `outline` of the tree changes nothing (Zeng 2015 sect. 6.4).
///
/// # Errors
/// The shape lies off the tree.
pub fn topiary(
    skeleton: &Skeleton,
    outline: &Outline,
    drawn: &Drawn,
    settings: &config::Shape,
    seed: u64,
) -> Result<Topiary, TopiaryError> {
    let shape = drawn.placed(outline, skeleton.foot_px)?;
    if holds(&shape, outline) {
        return Ok(unchanged(skeleton, shape));
    }
    let envelope = Envelope::of_drawn(&shape, skeleton.foot_px);
    let cut::Pruned {
        skeleton: mut pruned,
        kept,
        shortened,
    } = cut::cut(skeleton, &envelope)?;
    let was_trunk = is_trunk(skeleton);
    let trunk: Vec<bool> = kept.iter().map(|&i| was_trunk[i]).collect();
    tune_term_weights(&mut pruned, &trunk, &envelope, settings);
    let left = pruned.nodes.len();
    // What was cut keeps its number: no other branch gets it.
    let last = skeleton.nodes.iter().map(|n| n.name.0).max().unwrap_or(0);
    let space = DrawnSpace {
        shape: &shape,
        envelope: &envelope,
    };
    grow::grow(&mut pruned, &space, last, settings, seed);
    let cut = Cut {
        larger: false,
        gone: skeleton.nodes.len() - left,
        shortened,
        grown: pruned.nodes.len() - left,
        coverage: coverage(&pruned, &shape),
    };
    Ok(Topiary {
        moves_as: moves_as(skeleton, &pruned, &kept),
        skeleton: pruned,
        shape,
        cut,
    })
}

/// Whether `shape` holds all of `outline` but [`LARGER`] of it.
fn holds(shape: &Outline, outline: &Outline) -> bool {
    let tree = outline.mask.iter().filter(|m| **m != 0).count();
    let outside = outline
        .mask
        .iter()
        .zip(&shape.mask)
        .filter(|(tree, shape)| **tree != 0 && **shape == 0)
        .count();
    outside as f64 <= LARGER * tree as f64
}

/// The tree as it is, in a shape that holds all of it.
fn unchanged(skeleton: &Skeleton, shape: Outline) -> Topiary {
    let cut = Cut {
        larger: true,
        coverage: coverage(skeleton, &shape),
        ..Cut::default()
    };
    Topiary {
        skeleton: skeleton.clone(),
        shape,
        cut,
        moves_as: (0..skeleton.nodes.len())
            .map(|i| measured_of(skeleton, i))
            .collect(),
    }
}

/// The measured node that node `i` is a copy of, or itself.
fn measured_of(skeleton: &Skeleton, i: usize) -> NodeId {
    skeleton.nodes[i].copy_of.unwrap_or(NodeId(i as u32))
}

/// For every node of `cut` the measured node of the tree before, `skeleton`, that it moves as.
/// `kept` says which node of that each of the first ones was.
fn moves_as(skeleton: &Skeleton, cut: &Skeleton, kept: &[usize]) -> Vec<NodeId> {
    let mut moves_as = Vec::with_capacity(cut.nodes.len());
    for (n, node) in cut.nodes.iter().enumerate() {
        moves_as.push(match (node.copy_of, kept.get(n)) {
            (Some(original), _) => NodeId(kept.get(original.index()).map_or(0, |&k| k as u32)),
            (None, Some(&i)) => measured_of(skeleton, i),
            (None, None) => NodeId(0),
        });
    }
    moves_as
}

impl Topiary {
    /// The pose of the cut tree in a frame in which the tree before, `skeleton`, stands as `whole`
    /// says. Every branch turns against its parent as the measured one does of which it is a copy,
    /// in its own plane.
    pub fn pose(&self, skeleton: &Skeleton, whole: &Pose) -> Pose {
        let still = JointPose::at_rest(Point3::origin());
        let foot = whole.joints.first().copied().unwrap_or(still);
        let mut joints = vec![foot; self.skeleton.nodes.len()];
        for branch in self.skeleton.moving_branches() {
            let node = &self.skeleton.nodes[branch.node.index()];
            let original = self.original_of(branch.node);
            let above = skeleton
                .nodes
                .get(self.original_of(self.first_part(&branch)).index())
                .and_then(|n| n.parent)
                .map_or(0, |p| p.index());
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), node.plane_angle);
            let against_parent =
                rotation(whole, above).inverse() * rotation(whole, original.index());
            let own = turn * against_parent * turn.inverse();
            let parent = joints[branch.parent.index()].rotation;
            let rotation = UnitQuaternion::new_normalize((parent * own).into_inner());
            branch.place(&self.skeleton, rotation, &mut joints);
        }
        Pose {
            frame: whole.frame,
            time_s: whole.time_s,
            joints,
        }
    }

    /// The measured node of the tree before that `node` moves as.
    fn original_of(&self, node: NodeId) -> NodeId {
        self.moves_as.get(node.index()).copied().unwrap_or_default()
    }

    /// The lowest part of a branch on the way to its end: the one that begins where it does.
    fn first_part(&self, branch: &MovingBranch) -> NodeId {
        let below = self.skeleton.ancestors(branch.node);
        below
            .take_while(|n| *n != branch.begin)
            .last()
            .unwrap_or(branch.node)
    }
}

/// Rotation of joint `i`; none where the pose does not have it.
fn rotation(pose: &Pose, i: usize) -> UnitQuaternion<f64> {
    pose.joints
        .get(i)
        .map_or_else(UnitQuaternion::identity, |j| j.rotation)
}
