//! A modelled tree as a skeleton, ready to be an example.
//!
//! It is taken as it stands: its picture is the view along the z axis, as that of a tree that was filmed
//! bare, of which all branches are seen.

use super::error::ImportError;
use super::flat_tree::flat_node;
use super::model_tree::ModelTree;
use crate::model::{NOT_FILMED_PX, Node, NodeId, Pose, Skeleton, Swaying};
use nalgebra::{Point2, Point3, UnitQuaternion};

/// The foot, the forks and the tips of a modelled tree, joined by straight branches.
#[derive(Clone, Debug)]
pub struct StandingModel {
    /// No node of it is a copy.
    pub skeleton: Skeleton,
    /// Whether its radii are known; else they are 0.
    pub has_radii: bool,
    /// Metres in a pixel; 0 where they are not known.
    pub metres_per_px: f64,
    /// For every node of the skeleton the one of the model.
    of_model: Vec<usize>,
}

impl StandingModel {
    /// # Errors
    /// The model has no height, is too wide, or has too many forks on one another.
    pub fn of(model: &ModelTree) -> Result<Self, ImportError> {
        let scale = NOT_FILMED_PX / model.height()?;
        let forks = Forks::of(model)?;
        Ok(Self {
            skeleton: forks.skeleton(model, scale),
            has_radii: model.nodes.iter().all(|n| n.wood.radius > 0.0),
            metres_per_px: model.metres_per_unit / scale,
            of_model: forks.of_model,
        })
    }

    /// The pose of the skeleton when the nodes of the model are at `places`, in its own order: each
    /// branch turns as the line between its ends does, at rest at those of `model`.
    pub fn pose(&self, model: &ModelTree, places: &[Point3<f64>], frame: u64, time_s: f64) -> Pose {
        let skeleton = &self.skeleton;
        let mut joints = skeleton.joints_at_rest();
        for branch in skeleton.moving_branches() {
            let [begin, end] = [branch.begin, branch.node].map(|n| self.of_model[n.index()]);
            let rotation = turned(model, places, begin, end);
            branch.place(skeleton, rotation, &mut joints);
        }
        Pose {
            frame,
            time_s,
            joints,
        }
    }

    /// How the branch that ends in each node of the skeleton sways, as far as `model` says: as the last
    /// of its pieces of which that is known.
    pub fn sway(&self, model: &ModelTree) -> Vec<Swaying> {
        let known = model.sways();
        self.of_model.iter().map(|i| known[*i]).collect()
    }
}

/// How the branch between two nodes of a model has turned when its nodes are at `places`.
fn turned(
    model: &ModelTree,
    places: &[Point3<f64>],
    begin: usize,
    end: usize,
) -> UnitQuaternion<f64> {
    let rest = model.nodes[end].position - model.nodes[begin].position;
    let (Some(to), Some(from)) = (places.get(end), places.get(begin)) else {
        return UnitQuaternion::identity();
    };
    // What has turned back altogether has no axis.
    UnitQuaternion::rotation_between(&rest, &(to - from)).unwrap_or_default()
}

/// The foot, the forks and the tips of a model.
struct Forks {
    /// Which nodes of the model they are; parents before children.
    of_model: Vec<usize>,
    parents: Vec<Option<usize>>,
}

impl Forks {
    fn of(model: &ModelTree) -> Result<Self, ImportError> {
        model.refuse_deep(&[])?;
        model.refuse_thick()?;
        let children = model.children();
        let mut forks = Self {
            of_model: Vec::new(),
            parents: Vec::new(),
        };
        let mut below: Vec<Option<usize>> = vec![None; model.nodes.len()];
        for (i, node) in model.nodes.iter().enumerate() {
            let parent = node.parent.and_then(|p| below[p]);
            below[i] = parent;
            if node.parent.is_none() || children[i].len() != 1 {
                below[i] = Some(forks.of_model.len());
                forks.of_model.push(i);
                forks.parents.push(parent);
            }
        }
        Ok(forks)
    }

    /// They as a tree in space, the foot at the origin.
    fn skeleton(&self, model: &ModelTree, scale: f64) -> Skeleton {
        let foot = model.nodes[0].position;
        let mut nodes: Vec<Node> = Vec::with_capacity(self.of_model.len());
        let mut carries = vec![false; self.of_model.len()];
        for parent in self.parents.iter().flatten() {
            carries[*parent] = true;
        }
        for (i, (of_model, parent)) in self.of_model.iter().zip(&self.parents).enumerate() {
            let level = parent.map_or(0, |p| nodes[p].level.saturating_add(1));
            let parent = parent.map(|p| NodeId(p as u32));
            let mut node = flat_node(i, parent, level, Point2::origin(), Point2::origin());
            node.position = Point3::from((model.nodes[*of_model].position - foot) * scale);
            node.radius = model.nodes[*of_model].wood.radius * scale;
            node.certainty = if carries[i] && i > 0 { 1.0 } else { 0.0 };
            nodes.push(node);
        }
        Skeleton::not_filmed(nodes)
    }
}
