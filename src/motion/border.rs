//! The best direction on the borders of what is allowed.

use super::rotation::tangents;
use nalgebra::{Unit, UnitVector3, Vector3};
use std::f64::consts::TAU;

/// Places that are looked at all round a border before the best ones are refined.
const PLACES: usize = 32;
/// Steps of the golden section: they leave a millionth of the distance between two places.
const STEPS: usize = 28;
const GOLDEN: f64 = 0.618_033_988_749_895;

/// The best direction and its cost, of those on the circles `(centre, angle)`, angles in radians.
/// `within` brings a direction within all bounds and gives its cost; `None` if no cost is a number.
pub(super) fn best(
    circles: &[(UnitVector3<f64>, f64)],
    within: impl Fn(&UnitVector3<f64>) -> (UnitVector3<f64>, f64),
) -> Option<(UnitVector3<f64>, f64)> {
    let mut best: Option<(UnitVector3<f64>, f64)> = None;
    for (centre, angle) in circles {
        let circle = Circle::new(centre, *angle);
        let step = TAU / PLACES as f64;
        let costs: [f64; PLACES] = std::array::from_fn(|k| within(&circle.at(k as f64 * step)).1);
        for k in 0..PLACES {
            let beside = [costs[(k + PLACES - 1) % PLACES], costs[(k + 1) % PLACES]];
            if beside.iter().all(|c| costs[k] <= *c) {
                let turn = lowest(
                    |turn| within(&circle.at(turn)).1,
                    (k as f64 - 1.0) * step,
                    (k as f64 + 1.0) * step,
                );
                let found = within(&circle.at(turn));
                if best.is_none_or(|b| found.1 < b.1) {
                    best = Some(found);
                }
            }
        }
    }
    best
}

/// All directions at one angle from a centre.
struct Circle {
    /// What all directions have along the centre.
    along: Vector3<f64>,
    /// Two unit vectors at right angles to the centre and to each other.
    across: (Vector3<f64>, Vector3<f64>),
    /// The circle's radius: the sine of its angle.
    radius: f64,
}

impl Circle {
    fn new(centre: &UnitVector3<f64>, angle: f64) -> Self {
        Self {
            along: centre.into_inner() * angle.cos(),
            across: tangents(centre),
            radius: angle.sin(),
        }
    }

    /// The direction at `turn` radians round the circle.
    fn at(&self, turn: f64) -> UnitVector3<f64> {
        let (a, b) = self.across;
        Unit::new_normalize(self.along + (a * turn.cos() + b * turn.sin()) * self.radius)
    }
}

/// Where `cost` is lowest between two ends (golden section).
fn lowest(cost: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let (mut left, mut right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut cost_left, mut cost_right) = (cost(left), cost(right));
    for _ in 0..STEPS {
        if cost_left <= cost_right {
            high = right;
            (right, cost_right) = (left, cost_left);
            left = high - GOLDEN * (high - low);
            cost_left = cost(left);
        } else {
            low = left;
            (left, cost_left) = (right, cost_right);
            right = low + GOLDEN * (high - low);
            cost_right = cost(right);
        }
    }
    0.5 * (low + high)
}
