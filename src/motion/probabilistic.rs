//! The probabilistic solution: the rotation that best trades the tracked position against the branch's own shape, within
//! bounds (Li et al. section 4.2, eq. 7-10).

use nalgebra::{Matrix2, Rotation3, Unit, UnitQuaternion, UnitVector3, Vector2, Vector3};

/// Steps of the search at most; it ends when the cost no longer falls, mostly after three to five.
const ITERATIONS: usize = 40;

/// What is known of one branch in one frame. Directions are in the axes of the parent branch at rest.
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
    /// Standard deviation of the change of the direction's component along the line of sight since the frame before
    /// or, in the first frame, since the rest (a sine, so without a unit); `None`: as the paper has it, without this term.
    pub sigma_depth: Option<f64>,
    /// Largest angle from the previous direction, and from the rest direction, radians; outside the prior is 0.
    pub max_step: f64,
    pub max_total: f64,
}

impl Problem {
    /// Minus the logarithm of the posterior of eq. 7, up to a constant, for a direction within the bounds.
    pub fn cost(&self, d: &UnitVector3<f64>) -> f64 {
        let (track, shape, depth) = self.residuals(d);
        0.5 * (track.norm_squared() + shape * shape + depth * depth)
    }

    /// (y' - x') / sigma_track of eq. 8, (alpha - alpha(1)) / sigma_shape of eq. 10, and the change in depth.
    ///
    /// The last is ours: the picture hardly shows how far a branch leans towards the viewer, so that a tenth of a pixel
    /// of tracking noise moves it by pixels in depth. The paper's uniform prior lets that through and the tree trembles
    /// when seen from the side; a normal prior on the change in depth, and in depth only, holds it still and takes
    /// nothing from what the film shows.
    fn residuals(&self, d: &UnitVector3<f64>) -> (Vector2<f64>, f64, f64) {
        let track = match self.target {
            Some(t) => {
                let y = self.parent_rotation * d.into_inner() * self.length;
                Vector2::new(y.x - t[0], y.y - t[1]) / self.sigma_track_px
            }
            None => Vector2::zeros(),
        };
        let shape =
            self.parent_direction.map_or(0.0, |p| (p.angle(d) - p.angle(&self.rest_direction)) / self.sigma_shape);
        let before = || (self.parent_rotation * self.previous_direction.into_inner()).z;
        let depth = self.sigma_depth.map_or(0.0, |s| ((self.parent_rotation * d.into_inner()).z - before()) / s);
        (track, shape, depth)
    }

    /// The most probable direction: Levenberg-Marquardt on the sphere, started from the previous and from the rest
    /// direction, every step held within the bounds. (The paper tries values exhaustively.)
    pub fn solve(&self) -> UnitVector3<f64> {
        if self.target.is_none() {
            // Nothing was seen: eq. 10 alone is satisfied by the branch keeping its angle.
            return self.bounded(&self.previous_direction);
        }
        let from_previous = self.descend(self.bounded(&self.previous_direction));
        let from_rest = self.descend(self.bounded(&self.rest_direction));
        if from_rest.1 < from_previous.1 - 1e-9 { from_rest.0 } else { from_previous.0 }
    }

    fn descend(&self, start: UnitVector3<f64>) -> (UnitVector3<f64>, f64) {
        let (mut d, mut cost, mut damping) = (start, self.cost(&start), 1e-3);
        for _ in 0..ITERATIONS {
            let (tangent_a, tangent_b) = tangents(&d);
            let (track, shape, depth) = self.residuals(&d);
            let y_of = |t: &Vector3<f64>| {
                let y = self.parent_rotation * t * self.length / self.sigma_track_px;
                Vector2::new(y.x, y.y)
            };
            let (ja, jb) = (y_of(&tangent_a), y_of(&tangent_b));
            // d(alpha)/d(d) = -p / sin(alpha); where the branch goes straight on alpha has no slope.
            let (sa, sb) = match self.parent_direction {
                Some(p) if p.cross(&d).norm() > 1e-3 => {
                    let slope = -1.0 / (p.cross(&d).norm() * self.sigma_shape);
                    (slope * p.dot(&tangent_a), slope * p.dot(&tangent_b))
                }
                _ => (0.0, 0.0),
            };
            let z_of = |t: &Vector3<f64>| self.sigma_depth.map_or(0.0, |s| (self.parent_rotation * t).z / s);
            let (za, zb) = (z_of(&tangent_a), z_of(&tangent_b));
            let off = ja.dot(&jb) + sa * sb + za * zb;
            let (aa, bb) = (ja.norm_squared() + sa * sa + za * za, jb.norm_squared() + sb * sb + zb * zb);
            let normal = Matrix2::new(aa, off, off, bb);
            let gradient =
                Vector2::new(ja.dot(&track) + sa * shape + za * depth, jb.dot(&track) + sb * shape + zb * depth);
            let damped = normal + Matrix2::from_diagonal_element(damping * normal.trace().max(1e-9));
            let Some(inverse) = damped.try_inverse() else { break };
            let step = -(inverse * gradient);
            let moved = d.into_inner() + tangent_a * step.x + tangent_b * step.y;
            let Some(candidate) = Unit::try_new(moved, 1e-9) else { break };
            let candidate = self.bounded(&candidate);
            let candidate_cost = self.cost(&candidate);
            if candidate_cost < cost {
                let done = cost - candidate_cost < 1e-9;
                (d, cost, damping) = (candidate, candidate_cost, damping * 0.2);
                if done {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 {
                    break;
                }
            }
        }
        (d, cost)
    }

    /// The nearest direction to `d` within both bounds; the accumulated bound holds in any case.
    fn bounded(&self, d: &UnitVector3<f64>) -> UnitVector3<f64> {
        let stepped = within(d, &self.previous_direction, self.max_step);
        within(&stepped, &self.rest_direction, self.max_total)
    }
}

/// `d`, or where it is more than `angle` away from `centre`, the direction on the way to it that is not.
fn within(d: &UnitVector3<f64>, centre: &UnitVector3<f64>, angle: f64) -> UnitVector3<f64> {
    let apart = centre.angle(d);
    if apart <= angle {
        return *d;
    }
    // Opposite directions have no shortest way; any is as good, and staying is safest.
    centre.try_slerp(d, angle / apart, 1e-9).unwrap_or(*centre)
}

/// Two unit vectors at right angles to `d` and to each other.
fn tangents(d: &UnitVector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let other = if d.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let a = d.cross(&other).normalize();
    (a, d.cross(&a))
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
