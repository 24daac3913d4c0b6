//! Modes of a whole tree.

use super::{NodeId, Sway};

/// A mode of the whole tree: one frequency and damping, and the points that swing in it.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeMode {
    /// Its frequency, damping and size: as of the branch that swings in it.
    pub sway: Sway,
    /// How much of its motion is one swing of its points, 0 to 1; `None` where that was not looked
    /// at.
    pub collinearity: Option<f64>,
    /// The measured node whose own mode it is; `None` for a branch that the tree lacks.
    pub node: Option<NodeId>,
    /// Points that swing in it.
    pub points: usize,
    /// By measured node: squares of the swing of all points on that node, px².
    pub motion_px2: Vec<f64>,
}

impl TreeMode {
    /// Share of its kinetic energy that is in the points on a node, all points of like mass.
    pub fn energy(&self, node: NodeId) -> f64 {
        let all: f64 = self.motion_px2.iter().sum();
        if all > 0.0 {
            self.motion_px2.get(node.index()).map_or(0.0, |m| m / all)
        } else {
            0.0
        }
    }
}
