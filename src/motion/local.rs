//! How a place moves, by the points around it.

use crate::signal::median;
use nalgebra::Vector2;
use std::cmp::Ordering;

/// A point's displacement in a frame, and where it rests as seen from the place, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearby {
    pub displacement: Vector2<f64>,
    pub offset: Vector2<f64>,
}

/// So many points are within one standard deviation of the weights, and twice as many count.
pub(super) const POINTS: usize = 16;
/// Rounds in which points that disagree lose weight: some tracks are always wrong.
const ROUNDS: usize = 3;
/// Where there is little to tell the slopes by they are taken for small: as if points of this
/// weight stood at one standard deviation to all sides and moved alike. Motions have small slopes;
/// those of a depth over the picture are not small, and this is just enough for points on a line.
const SLOPES: f64 = 2.0;
const SLOPES_OF_DEPTH: f64 = 0.02;
/// A point that misses by this many times the median has half its weight (Cauchy).
const HALF_AT: f64 = 2.0;
/// Misses of tracking itself, px: below it nobody disagrees.
const FLOOR_PX: f64 = 0.05;

/// Displacement of the place, px: that of a field that is linear in the picture, fitted to the
/// points around it with weights that fall off as a normal distribution; `None` without points.
/// `least_px`: no weights are narrower. Reorders `points`.
///
/// A branch that turns moves its points the farther the farther out they are. Their mean is the
/// motion of their middle, and the node, a fork or a tip, stands at their edge; the slopes take it
/// there.
pub(super) fn displacement(points: &mut [Nearby], least_px: f64) -> Option<Vector2<f64>> {
    at_place(points, least_px, SLOPES)
}

/// How far the place is towards the viewer, px, by the points around it, whose depths are the first
/// parts of their displacements; else as [`displacement`].
pub fn depth(points: &mut [Nearby], least_px: f64) -> Option<f64> {
    Some(at_place(points, least_px, SLOPES_OF_DEPTH)?.x)
}

fn at_place(points: &mut [Nearby], least_px: f64, slopes: f64) -> Option<Vector2<f64>> {
    let used = points.len().min(2 * POINTS);
    if used == 0 {
        return None;
    }
    if used < points.len() {
        points.select_nth_unstable_by(used - 1, nearer);
    }
    let points = &mut points[..used];
    let rank = used.min(POINTS) - 1;
    points.select_nth_unstable_by(rank, nearer);
    let variance = points[rank]
        .offset
        .norm_squared()
        .max(least_px * least_px)
        .max(1e-6);
    let mut near = [0.0; 2 * POINTS];
    for (weight, p) in near.iter_mut().zip(points.iter()) {
        *weight = (-0.5 * p.offset.norm_squared() / variance).exp();
    }
    let (mut weights, mut misses) = (near, [0.0; 2 * POINTS]);
    let mut field = fitted(points, &weights, slopes * variance);
    for _ in 1..ROUNDS {
        for (miss, p) in misses.iter_mut().zip(points.iter()) {
            let off = Vector2::from_fn(|c, _| {
                let [at, slope_u, slope_v] = field[c];
                p.displacement[c] - at - slope_u * p.offset.x - slope_v * p.offset.y
            });
            *miss = off.norm();
        }
        let median = median(misses[..used].to_vec(), f64::total_cmp)?;
        let scale = HALF_AT * median + FLOOR_PX;
        for ((weight, near), miss) in weights.iter_mut().zip(&near).zip(&misses) {
            *weight = near / (1.0 + (miss / scale).powi(2));
        }
        field = fitted(points, &weights, slopes * variance);
    }
    Some(Vector2::new(field[0][0], field[1][0]))
}

/// The order of points by their distance from the place.
fn nearer(a: &Nearby, b: &Nearby) -> Ordering {
    a.offset.norm_squared().total_cmp(&b.offset.norm_squared())
}

/// For either coordinate: displacement at the place, and its slopes along u and v, which are small by
/// `ridge_px2`.
fn fitted(points: &[Nearby], weights: &[f64], ridge_px2: f64) -> [[f64; 3]; 2] {
    let (mut s, mut su, mut sv, mut suu, mut suv, mut svv) =
        (0.0, 0.0, 0.0, ridge_px2, 0.0, ridge_px2);
    let mut right = [[0.0; 3]; 2];
    for (p, w) in points.iter().zip(weights) {
        let (u, v) = (p.offset.x, p.offset.y);
        s += w;
        su += w * u;
        sv += w * v;
        suu += w * u * u;
        suv += w * u * v;
        svv += w * v * v;
        for (r, d) in right.iter_mut().zip(&p.displacement) {
            r[0] += w * d;
            r[1] += w * u * d;
            r[2] += w * v * d;
        }
    }
    // By elimination: there is always some weight, and the slopes' diagonal is never 0.
    let s = s.max(1e-12);
    let (a, b, c) = (suu - su * su / s, suv - su * sv / s, svv - sv * sv / s);
    let determinant = (a * c - b * b).max(1e-12);
    right.map(|[r, ru, rv]| {
        let (ru, rv) = (ru - su * r / s, rv - sv * r / s);
        let (slope_u, slope_v) = (
            (c * ru - b * rv) / determinant,
            (a * rv - b * ru) / determinant,
        );
        [(r - slope_u * su - slope_v * sv) / s, slope_u, slope_v]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points along a branch that begins at the place `from` px below it and turns by `angle` about
    /// its beginning.
    fn branch(n: usize, from: f64, angle: f64) -> Vec<Nearby> {
        let mut points = Vec::with_capacity(n);
        for k in 1..=n {
            let out = from * k as f64 / n as f64;
            points.push(Nearby {
                displacement: Vector2::new(angle * out, 0.0),
                offset: Vector2::new(0.0, from - out),
            });
        }
        points
    }

    #[test]
    fn a_tip_moves_as_the_tip_and_not_as_the_middle_of_its_branch() {
        let moved = displacement(&mut branch(12, 100.0, 0.1), 6.0).expect("points");
        // Their middle moves by 5.4 px.
        assert!(
            (6.8..=10.0).contains(&moved.x) && moved.y.abs() < 1e-9,
            "{moved:?} of 10 px"
        );
    }

    #[test]
    fn the_depth_of_a_tip_is_that_of_its_line() {
        let at_tip = depth(&mut branch(25, 150.0, 0.6), 5.0).expect("points");
        assert!((at_tip - 90.0).abs() < 1.0, "{at_tip} of 90 px");
    }

    #[test]
    fn a_tree_that_is_shifted_as_a_whole_is_followed_to_the_last_bit() {
        let mut points = branch(30, 80.0, 0.0);
        points
            .iter_mut()
            .for_each(|p| p.displacement = Vector2::new(2.5, -1.25));
        let moved = displacement(&mut points, 6.0).expect("points");
        assert!(
            (moved.x - 2.5).abs() < 1e-9 && (moved.y + 1.25).abs() < 1e-9,
            "{moved:?}"
        );
    }

    #[test]
    fn a_few_wrong_tracks_hardly_matter() {
        let mut points = branch(12, 100.0, 0.1);
        let right = displacement(&mut points.clone(), 6.0).expect("points");
        for k in [1, 6, 9] {
            points[k].displacement = Vector2::new(-25.0, 40.0);
        }
        // Their mean would be carried off by 12 px.
        let moved = displacement(&mut points, 6.0).expect("points");
        let off = moved - right;
        assert!(
            off.x.hypot(off.y) < 2.5,
            "{moved:?} and without them {right:?}"
        );
    }

    #[test]
    fn one_point_or_many_in_one_place_are_enough_and_none_is_nothing() {
        let one = Nearby {
            displacement: Vector2::new(3.0, 4.0),
            offset: Vector2::new(10.0, 0.0),
        };
        let moved = displacement(&mut [one], 6.0).expect("a point");
        assert!(
            (moved.x - 3.0).abs() < 1e-6 && (moved.y - 4.0).abs() < 1e-6,
            "{moved:?}"
        );
        let moved = displacement(
            &mut [Nearby {
                offset: Vector2::zeros(),
                ..one
            }; 40],
            0.0,
        )
        .expect("points");
        assert!(
            (moved.x - 3.0).abs() < 1e-6 && (moved.y - 4.0).abs() < 1e-6,
            "{moved:?}"
        );
        assert_eq!(displacement(&mut [], 6.0), None);
    }
}
