//! The middle line of a branch: the path of least jerk of Flash and Hogan, "The coordination of arm
//! movements" (1984).
//!
//! Their path from point to point is a polynomial of the fifth degree; through a point on the way
//! it is two of them that agree in all derivatives up to the fourth (their appendix). The problem
//! is linear in the positions, so sums of such paths are such paths again: one between the ends
//! with the directions there, and one excursion for each via point.

use crate::random::Generator;
use nalgebra::{Point3, Vector3};
use rand::RngExt;
use std::f64::consts::TAU;

/// Greatest distance of a middle line from the straight line between its ends, as a share of their
/// distance, at curl 1: [`BOW`] for each of the two directions at the ends, and both excursions.
pub const CURL_BOUND: f64 = 2.0 * BOW + 2.0 * EXCURSION;
/// Greatest value of `t - 6 t^3 + 8 t^4 - 3 t^5`, which a slope of 1 at one end adds, times the
/// greatest of
/// `slope (1 - slope^2) (1 - slope)`, see [`Bend`].
const BOW: f64 = 0.1971 * 0.2019;
/// Length of each of the two excursions at curl 1.
const EXCURSION: f64 = 0.05;
/// Where on the way the via points are: a third and two thirds make a bow, an S or, out of one
/// plane, a twist.
const VIA: [f64; 2] = [1.0 / 3.0, 2.0 / 3.0];

/// A path from one end of a branch to the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    from: Point3<f64>,
    to: Point3<f64>,
    chord: Vector3<f64>,
    ends: [Bend; 2],
    /// The excursions at [`VIA`].
    via: [Vector3<f64>; 2],
}

/// How a path leaves the straight line at one of its ends.
///
/// A branch bends towards its neighbours only as far as the turn is small: with the tangent of the
/// angle to the straight line, s, both how far it gives way, `1 - s^2`, and the share of its length
/// on which it does, `1 - s`, shrink. From a right angle between two branches on (s = 1) they meet
/// as a fork. Else coarse skeletons, which turn far, make loops.
#[derive(Clone, Copy, Debug)]
struct Bend {
    /// Velocity beyond that of the straight line.
    across: Vector3<f64>,
    /// Share of the way on which it is felt, above 0.
    within: f64,
}

impl Bend {
    fn new(wanted: Vector3<f64>, chord: Vector3<f64>, share: f64) -> Self {
        let length = chord.norm();
        let along = chord / length.max(1e-12);
        let ahead = wanted.dot(&along);
        let across = wanted - along * ahead;
        let slope = if ahead > 0.0 {
            across.norm() / ahead
        } else {
            1.0
        };
        if slope >= 1.0 {
            return Self {
                across: Vector3::zeros(),
                within: 1.0,
            };
        }
        Self {
            across: across * (length * share * (1.0 - slope * slope) / ahead),
            within: 1.0 - slope,
        }
    }

    /// Offset at share `t` of the way from this end.
    fn at(&self, t: f64) -> Vector3<f64> {
        self.across * (self.within * leaving((t / self.within).min(1.0)))
    }
}

impl Curve {
    /// From `from` to `to`, leaving along `leaves` and arriving along `arrives` (of length 1) as
    /// nearly as `curl` (0 to 1) lets it; the excursions are drawn from `random`.
    pub fn new(
        ends: [Point3<f64>; 2],
        leaves: Vector3<f64>,
        arrives: Vector3<f64>,
        curl: f64,
        random: &mut Generator,
    ) -> Self {
        let chord = ends[1] - ends[0];
        let length = chord.norm();
        let along = chord / length.max(1e-12);
        let curl = curl.clamp(0.0, 1.0);
        let share = (2.0 * curl).min(1.0);
        let longest = length * curl * EXCURSION;
        Self {
            from: ends[0],
            to: ends[1],
            chord,
            ends: [
                Bend::new(leaves, chord, share),
                Bend::new(arrives, chord, share),
            ],
            via: [
                across(along, random) * longest,
                across(along, random) * longest,
            ],
        }
    }

    /// The same with `share` of its excursions.
    pub fn calmer(self, share: f64) -> Self {
        Self {
            via: self.via.map(|v| v * share),
            ..self
        }
    }

    /// The point at share `t` of the way; at 0 and 1 the ends themselves, to the last bit.
    pub fn at(&self, t: f64) -> Point3<f64> {
        if t >= 1.0 {
            return self.to;
        }
        let excursions = self.via[0] * passing(VIA[0], t) + self.via[1] * passing(VIA[1], t);
        self.from + self.chord * t + self.ends[0].at(t) - self.ends[1].at(1.0 - t) + excursions
    }
}

/// The path of least jerk that starts with velocity 1 at 0, ends at rest at 0, without acceleration
/// at either end.
fn leaving(t: f64) -> f64 {
    t * (1.0 - t * t * (6.0 - t * (8.0 - 3.0 * t)))
}

/// The path of least jerk from 0 at rest through 1 at time `via` back to 0 at rest, at time `t` of
/// 0..1 (Flash and Hogan, appendix: equations of x-, x+, pi_1 and c_1 with x_0 = x_f = 0, x_1 = 1,
/// t_f = 1).
fn passing(via: f64, t: f64) -> f64 {
    let (a, rest) = (via, (1.0 - via).powi(5));
    let pi = -20.0 / (a.powi(5) * rest);
    let c = (120.0 * a * a - 300.0 * a + 200.0) / (a * a * rest);
    let (t3, t4, t5) = (t.powi(3), t.powi(4), t.powi(5));
    let before = pi
        * (a.powi(4) * (15.0 * t4 - 30.0 * t3) + a.powi(3) * (80.0 * t3 - 30.0 * t4)
            - 60.0 * t3 * a * a
            + 30.0 * t4 * a
            - 6.0 * t5)
        + c * (15.0 * t4 - 10.0 * t3 - 6.0 * t5);
    before / 720.0 + pi * (t - a).max(0.0).powi(5) / 120.0
}

/// A point drawn evenly from the disc of radius 1 that is square to `along` (of length 1).
fn across(along: Vector3<f64>, random: &mut Generator) -> Vector3<f64> {
    let turn = random.random_range(0.0..TAU);
    let far = random.random::<f64>().sqrt();
    let side = square_to(along);
    (side * turn.cos() + along.cross(&side) * turn.sin()) * far
}

/// Some direction square to `along`, always the same one.
pub(crate) fn square_to(along: Vector3<f64>) -> Vector3<f64> {
    let axis = if along.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    (axis - along * axis.dot(&along))
        .try_normalize(1e-9)
        .unwrap_or_else(Vector3::y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;

    #[test]
    fn the_path_through_a_point_is_there_in_time_and_smooth_on_the_way() {
        for via in [0.2, 1.0 / 3.0, 0.5, 0.8] {
            assert!((passing(via, via) - 1.0).abs() < 1e-9);
            for t in [0.0, 1.0] {
                let h = 1e-4;
                let inward = if t == 0.0 { h } else { 1.0 - h };
                assert!(passing(via, t).abs() < 1e-9, "{via} {t}");
                assert!(
                    passing(via, inward).abs() < 1e-6,
                    "at rest at both ends: {via} {t}"
                );
            }
        }
    }

    fn direction(random: &mut Generator) -> Vector3<f64> {
        Vector3::from_fn(|_, _| random.random_range(-1.0..1.0))
            .try_normalize(1e-9)
            .unwrap_or_else(Vector3::x)
    }

    #[test]
    fn ends_stay_and_the_bound_holds() {
        let (a, b) = (Point3::new(3.0, 5.0, -2.0), Point3::new(40.0, 60.0, 9.0));
        let along = (b - a).normalize();
        for k in 0..500 {
            let mut random = generator(k, 0);
            let (leaves, arrives) = (direction(&mut random), direction(&mut random));
            let curl = (k % 5) as f64 / 4.0;
            let curve = Curve::new([a, b], leaves, arrives, curl, &mut random);
            assert!((curve.at(0.0) - a).norm() < 1e-9 && (curve.at(1.0) - b).norm() < 1e-9);
            for t in 1..100 {
                let way = curve.at(f64::from(t) / 100.0) - a;
                let off = (way - along * way.dot(&along)).norm() / (b - a).norm();
                assert!(
                    off <= CURL_BOUND * (2.0 * curl).min(1.0) + 1e-9,
                    "{off} at curl {curl}"
                );
                assert!(curl > 0.0 || off < 1e-9, "curl 0 is straight");
            }
        }
    }
}
