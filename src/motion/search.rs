//! The search for the most probable direction of a branch.
//!
//! Levenberg-Marquardt on the sphere, every step held within the bounds, from the direction before,
//! from the rest, and from the two directions that are seen where the branch is seen (of a branch
//! in the picture's plane neither is found from the others: to both sides the slope is 0). Where
//! the best of these lies on a bound, along which such steps cannot slide, both borders are
//! searched all round. `tests/library/pose.rs` holds it against trying everything, as the paper does.
//!
//! It does not use the solver of the sway (`signal/least_squares.rs`): that one has boxes as bounds
//! and one set of parameters, while here every step has axes of its own on the sphere, is turned
//! back into two cones, and counts the bend of the sphere in the curvature.
//!
//! All is in model axes, so that nothing has to be turned on the way.

use super::border;
use super::probabilistic::Problem;
use super::rotation::tangents;
use nalgebra::{Unit, UnitVector3, Vector2, Vector3};

/// Steps at most; it ends when the cost no longer falls, mostly after three to five.
const ITERATIONS: usize = 40;
/// A start as near as this to where one has led before, radians, leads there, too.
const SAME: f64 = 1e-3;

impl Problem {
    /// The most probable direction, in the axes of the parent branch at rest. (The paper tries
    /// values exhaustively.)
    pub fn solve(&self) -> UnitVector3<f64> {
        best(self)
    }
}

fn best(problem: &Problem) -> UnitVector3<f64> {
    let back = problem.parent_rotation.inverse();
    let Some(target) = problem.target else {
        // Nothing was seen: eq. 10 alone is satisfied by the branch keeping its angle.
        return within(
            &problem.previous_direction,
            &problem.rest_direction,
            problem.max_total,
        );
    };
    let search = Search::new(problem, target);
    let mut best = search.descend(search.bounded(&search.previous));
    for start in search.seen_at().into_iter().chain([search.rest]) {
        let start = search.bounded(&start);
        if start.dot(&best.0) < 1.0 - 0.5 * SAME * SAME {
            let other = search.descend(start);
            if other.1 < best.1 - 1e-9 {
                best = other;
            }
        }
    }
    if search.on_a_bound(&best.0) {
        let borders = [
            (search.previous, problem.max_step),
            (search.rest, problem.max_total),
        ];
        let other = border::best(&borders, |d| {
            let d = search.bounded(d);
            (d, search.at(&d).cost())
        });
        best = other.filter(|o| o.1 < best.1 - 1e-9).unwrap_or(best);
    }
    Unit::new_normalize(back * best.0.into_inner())
}

struct Search {
    target: Vector2<f64>,
    length: f64,
    previous: UnitVector3<f64>,
    rest: UnitVector3<f64>,
    parent: Option<Parent>,
    /// One over the standard deviations: of the place, px, of the angle, and of all that is known of
    /// the depth together.
    per_track: f64,
    per_shape: f64,
    per_depth: f64,
    /// One over the standard deviation of the turn from rest; 0 for no prior on it.
    per_turn: f64,
    /// The depth that all this makes most probable, as a sine.
    depth: f64,
    max_step: f64,
    max_total: f64,
}

/// The parent branch.
struct Parent {
    direction: Vector3<f64>,
    /// Angle of the branch to it at rest.
    rest_angle: f64,
}

/// What a direction is off by, in standard deviations.
struct Off {
    track: Vector2<f64>,
    shape: f64,
    depth: f64,
    turn: Vector3<f64>,
}

impl Off {
    /// Minus the logarithm of the posterior, up to a constant.
    fn cost(&self) -> f64 {
        let [track, turn] = [self.track.norm_squared(), self.turn.norm_squared()];
        0.5 * (track + self.shape * self.shape + self.depth * self.depth + turn)
    }
}

impl Search {
    fn new(problem: &Problem, target: Vector2<f64>) -> Self {
        let previous = problem.parent_rotation * problem.previous_direction;
        let rest = problem.parent_rotation * problem.rest_direction;
        let (rate, lean) = (weight(problem.sigma_depth), weight(problem.sigma_lean));
        let mut depth_weight = rate + lean;
        let mut depth_sum = rate * previous.z + lean * rest.z;
        if let Some(seen) = problem.depth {
            let seen_weight = weight(Some(seen.sd_px / problem.length));
            depth_weight += seen_weight;
            depth_sum += seen_weight * seen.z_px / problem.length;
        }
        let parent = problem.parent_direction.map(|p| {
            let direction = (problem.parent_rotation * p).into_inner();
            Parent {
                direction,
                rest_angle: direction.dot(&rest).clamp(-1.0, 1.0).acos(),
            }
        });
        Self {
            target,
            length: problem.length,
            previous,
            rest,
            parent,
            per_track: 1.0 / problem.sigma_track_px,
            per_shape: 1.0 / problem.sigma_shape,
            per_depth: depth_weight.sqrt(),
            per_turn: weight(problem.sigma_turn).sqrt(),
            depth: depth_sum / depth_weight.max(f64::MIN_POSITIVE),
            max_step: problem.max_step,
            max_total: problem.max_total,
        }
    }

    fn at(&self, d: &UnitVector3<f64>) -> Off {
        Off {
            track: (d.xy() * self.length - self.target) * self.per_track,
            shape: self.parent.as_ref().map_or(0.0, |parent| {
                let angle = parent.direction.dot(d).clamp(-1.0, 1.0).acos();
                (angle - parent.rest_angle) * self.per_shape
            }),
            depth: (d.z - self.depth) * self.per_depth,
            turn: (d.into_inner() - self.rest.into_inner()) * self.per_turn,
        }
    }

    /// The directions in which the branch would be seen at the target, or nearest to it: to the
    /// viewer and away.
    fn seen_at(&self) -> [UnitVector3<f64>; 2] {
        let at = self.target / self.length;
        let at = at / at.norm().max(1.0);
        let depth = (1.0 - at.norm_squared()).max(0.0).sqrt();
        [depth, -depth]
            .map(|z| Unit::try_new(Vector3::new(at.x, at.y, z), 1e-9).unwrap_or(self.previous))
    }

    /// The direction to which steps lead from `start`, and its cost.
    fn descend(&self, start: UnitVector3<f64>) -> (UnitVector3<f64>, f64) {
        let mut d = start;
        let mut off = self.at(&d);
        let (mut cost, mut damping) = (off.cost(), 1e-3);
        let scale = self.length * self.per_track;
        for _ in 0..ITERATIONS {
            let (a, b) = tangents(&d);
            let (ta, tb) = (a.xy() * scale, b.xy() * scale);
            // d(alpha)/d(d) = -p / sin(alpha); where the branch goes straight on alpha has no
            // slope.
            let (sa, sb) = match &self.parent {
                Some(Parent { direction: p, .. }) if p.cross(&d).norm_squared() > 1e-6 => {
                    let slope = -self.per_shape / p.cross(&d).norm();
                    (slope * p.dot(&a), slope * p.dot(&b))
                }
                _ => (0.0, 0.0),
            };
            let (pull, stiffness) = (off.depth * self.per_depth, self.per_depth * self.per_depth);
            let (back, per_turn) = (off.turn * self.per_turn, self.per_turn * self.per_turn);
            // The sphere bends away from its tangents: where the target is out of reach that is
            // most of the slope's change.
            let bend = -(off.track.dot(&d.xy()) * scale + pull * d.z);
            let bend = bend.max(0.0);
            let mixed = ta.dot(&tb) + sa * sb + a.z * b.z * stiffness;
            let aa = ta.norm_squared() + sa * sa + a.z * a.z * stiffness + per_turn + bend;
            let bb = tb.norm_squared() + sb * sb + b.z * b.z * stiffness + per_turn + bend;
            let gradient = Vector2::new(
                ta.dot(&off.track) + sa * off.shape + a.z * pull + a.dot(&back),
                tb.dot(&off.track) + sb * off.shape + b.z * pull + b.dot(&back),
            );
            let more = damping * (aa + bb).max(1e-9);
            let determinant = (aa + more) * (bb + more) - mixed * mixed;
            if determinant <= 0.0 {
                break;
            }
            let step_a = (mixed * gradient.y - (bb + more) * gradient.x) / determinant;
            let step_b = (mixed * gradient.x - (aa + more) * gradient.y) / determinant;
            let Some(candidate) = Unit::try_new(d.into_inner() + a * step_a + b * step_b, 1e-9)
            else {
                break;
            };
            let candidate = self.bounded(&candidate);
            let candidate_off = self.at(&candidate);
            let candidate_cost = candidate_off.cost();
            if candidate_cost < cost {
                let done = cost - candidate_cost < 1e-9;
                (d, off, cost, damping) = (candidate, candidate_off, candidate_cost, damping * 0.2);
                if done {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e6 || step_a.abs() + step_b.abs() < 1e-9 {
                    break;
                }
            }
        }
        (d, cost)
    }

    /// The nearest direction to `d` within both bounds; the accumulated bound holds in any case.
    fn bounded(&self, d: &UnitVector3<f64>) -> UnitVector3<f64> {
        let stepped = within(d, &self.previous, self.max_step);
        within(&stepped, &self.rest, self.max_total)
    }

    fn on_a_bound(&self, d: &UnitVector3<f64>) -> bool {
        self.previous.angle(d) > self.max_step - 1e-6 || self.rest.angle(d) > self.max_total - 1e-6
    }
}

/// One over the variance; 0 for none.
fn weight(sigma: Option<f64>) -> f64 {
    sigma.map_or(0.0, |s| 1.0 / (s * s))
}

/// `d`, or where it is more than `angle` away from `centre`, the direction on the way to it that is
/// not.
fn within(d: &UnitVector3<f64>, centre: &UnitVector3<f64>, angle: f64) -> UnitVector3<f64> {
    let apart = centre.dot(d).clamp(-1.0, 1.0).acos();
    if apart <= angle {
        return *d;
    }
    // Opposite directions have no shortest way; any is as good, and staying is safest.
    centre.try_slerp(d, angle / apart, 1e-9).unwrap_or(*centre)
}
