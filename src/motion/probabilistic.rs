//! The probabilistic solution: the rotation that best trades the tracked position against the
//! branch's own shape, within bounds (Li et al. section 4.2, eq. 7-10).

use super::search::{self, tangents};
use nalgebra::{Rotation3, Unit, UnitQuaternion, UnitVector3, Vector2};

/// What is known of one branch in one frame. Directions are in the axes of the parent branch at
/// rest.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Rotation of the parent branch: takes this problem's axes to model axes.
    pub parent_rotation: UnitQuaternion<f64>,
    pub length: f64,
    /// Where the node is seen, relative to the local root, model axes, px; `None` where it is not.
    pub target: Option<[f64; 2]>,
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
    /// Largest angle from the previous direction, and from the rest direction, radians; outside the
    /// prior is 0.
    pub max_step: f64,
    pub max_total: f64,
}

impl Problem {
    /// Minus the logarithm of the posterior of eq. 7, up to a constant, for a direction within the
    /// bounds: half the squares of (y' - x') / sigma_track of eq. 8 and (alpha - alpha(1)) /
    /// sigma_shape of eq. 10, and two terms of our own.
    ///
    /// The picture hardly shows how far a branch leans towards the viewer, so that a tenth of a
    /// pixel of tracking noise moves it by pixels in depth. The paper's uniform prior lets that
    /// through and the tree trembles when seen from the side; a normal prior on the change in
    /// depth, and in depth only, holds it still and takes nothing from what the film shows. And a
    /// branch that has lain across the line of sight could go on to its own mirror image and stay
    /// there: eq. 8 cannot tell the two apart, and eq. 10 only as far as the parent leans. A prior
    /// on the depth itself can.
    pub fn cost(&self, d: &UnitVector3<f64>) -> f64 {
        let y = self.parent_rotation * d.into_inner();
        let track = self.target.map_or(0.0, |t| {
            Vector2::new(y.x * self.length - t[0], y.y * self.length - t[1]).norm_squared()
                / self.sigma_track_px.powi(2)
        });
        let shape = self.parent_direction.map_or(0.0, |p| {
            (p.angle(d) - p.angle(&self.rest_direction)) / self.sigma_shape
        });
        let from = |sigma: Option<f64>, d0: &UnitVector3<f64>| {
            sigma.map_or(0.0, |s| {
                (y.z - (self.parent_rotation * d0.into_inner()).z) / s
            })
        };
        let depth = from(self.sigma_depth, &self.previous_direction);
        let lean = from(self.sigma_lean, &self.rest_direction);
        0.5 * (track + shape * shape + depth * depth + lean * lean)
    }

    /// The most probable direction. (The paper tries values exhaustively.)
    pub fn solve(&self) -> UnitVector3<f64> {
        search::best(self)
    }
}

/// The rotation that takes `from` to `to` without twist about the branch.
pub fn shortest_rotation(from: &UnitVector3<f64>, to: &UnitVector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between_axis(from, to).unwrap_or_else(|| {
        let (axis, _) = tangents(from);
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_axis_angle(
            &Unit::new_normalize(axis),
            std::f64::consts::PI,
        ))
    })
}
