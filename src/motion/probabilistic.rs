//! The probabilistic solution: the rotation that best trades the tracked position against the
//! branch's own shape, within bounds (Li 2011 sect. 4.2, eq. 7-10).

use crate::model::NodeDepth;
use nalgebra::{UnitQuaternion, UnitVector3, Vector2};

/// What is known of one branch in one frame. Directions are in the axes of the parent branch at
/// rest.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Rotation of the parent branch: takes this problem's axes to model axes.
    pub parent_rotation: UnitQuaternion<f64>,
    pub length: f64,
    /// Where the node is seen, relative to the local root, model axes, px; `None` where it is not.
    pub target: Option<Vector2<f64>>,
    /// How far towards the viewer the node is seen from the local root, model axes; `None` where that
    /// is not known.
    pub depth: Option<NodeDepth>,
    /// Direction of the parent branch, `None` where there is none.
    pub parent_direction: Option<UnitVector3<f64>>,
    pub rest_direction: UnitVector3<f64>,
    pub previous_direction: UnitVector3<f64>,
    /// Standard deviations of eq. 8 (px) and eq. 10 (radians).
    pub sigma_track_px: f64,
    pub sigma_shape: f64,
    /// Standard deviation of the change of the direction's component along the line of sight since
    /// the frame before or, in the first frame, since the rest (a sine, so without a unit); `None`:
    /// as the paper has it, without this term.
    pub sigma_depth: Option<f64>,
    /// Standard deviation of the same component's difference from that at rest; `None`: as the
    /// paper has it.
    pub sigma_lean: Option<f64>,
    /// Standard deviation of how far the direction has turned from that at rest, as a distance on
    /// the unit sphere; `None`: as the paper has it.
    pub sigma_turn: Option<f64>,
    /// Largest angle from the previous direction, and from the rest direction, radians; outside the
    /// prior is 0.
    pub max_step: f64,
    pub max_total: f64,
}

impl Problem {
    /// Minus the logarithm of the posterior of eq. 7, up to a constant, for a direction within the
    /// bounds: half the squares of (y' - x') / sigma_track of eq. 8 and (alpha - alpha(1)) /
    /// sigma_shape of eq. 10, and three terms of our own.
    ///
    /// The picture hardly shows how far a branch leans towards the viewer, so that a tenth of a
    /// pixel of tracking noise moves it by pixels in depth. The paper's uniform prior lets that
    /// through and the tree trembles when seen from the side; a normal prior on the change in
    /// depth, and in depth only, holds it still and takes nothing from what the film shows. And a
    /// branch that has lain across the line of sight could go on to its own mirror image and stay
    /// there: eq. 8 cannot tell the two apart, and eq. 10 only as far as the parent leans. A prior
    /// on the depth itself can. Eq. 10 is the same all round the parent: a piece of two pixels, which
    /// the tracks can turn by a few, would go over to the parent's other side for nothing, and all
    /// that it carries with it. A prior on the turn itself holds it; a branch that the tracks see
    /// to turn does not feel it. What a depth camera has seen of the node is one more normal term; it
    /// goes before the priors on the depth by its smaller deviation.
    pub fn cost(&self, d: &UnitVector3<f64>) -> f64 {
        let y = self.parent_rotation * d.into_inner();
        let track = self.target.map_or(0.0, |t| {
            (y.xy() * self.length - t).norm_squared() / self.sigma_track_px.powi(2)
        });
        let shape = self.parent_direction.map_or(0.0, |p| {
            (p.angle(d) - p.angle(&self.rest_direction)) / self.sigma_shape
        });
        let depth = self.sigma_depth.map_or(0.0, |sigma| {
            (y.z - self.depth_of(&self.previous_direction)) / sigma
        });
        let lean = self.sigma_lean.map_or(0.0, |sigma| {
            (y.z - self.depth_of(&self.rest_direction)) / sigma
        });
        let turn = self.sigma_turn.map_or(0.0, |sigma| {
            (d.into_inner() - self.rest_direction.into_inner()).norm() / sigma
        });
        let seen = self
            .depth
            .map_or(0.0, |seen| (y.z * self.length - seen.z_px) / seen.sd_px);
        let priors = depth * depth + lean * lean + turn * turn;
        0.5 * (track + shape * shape + priors + seen * seen)
    }

    /// Component of a direction along the line of sight, to the viewer.
    fn depth_of(&self, direction: &UnitVector3<f64>) -> f64 {
        (self.parent_rotation * direction.into_inner()).z
    }
}
