//! How much of the way from the foot two points have in common: the affinity of the default method.
//!
//! Two points of a tree are as near kin as their ways from the foot part late. The ways are not
//! seen, but steps between points that are near each other and move alike are likely to lie on
//! them: a minimum spanning tree, rooted at the foot, joins all points by such steps. One false
//! step takes a whole branch along, so the tree is drawn many times from part of the points with
//! costs that are off by chance, and what the trees say is averaged (Felsenstein's bootstrap of
//! 1985 for trees of descent).
//!
//! Chosen by measurement, see `docs/sweep.md`: normalised cuts, average linkage of correlations and
//! shortest paths in place of the spanning tree all did worse on trees whose branches leave one
//! trunk.

use super::rest::{crown_begins, distance_sq};
use crate::random::generator;
use crate::signal::median;
use nalgebra::DMatrix;
use rand::RngExt;
use rand::seq::IndexedRandom;

/// Trees drawn; the first from all points.
const TREES: u64 = 20;
/// Share of the points that each of the others is drawn from.
const SHARE: f64 = 0.7;
/// The trees are the same in every run.
const SEED: u64 = 0;
/// Standard deviation of the logarithm of what a cost is off by.
const COST_DEVIATION: f64 = 0.3;

/// What the spanning trees say of all points.
pub struct Ways {
    /// Mean common way of all pairs, in px of cost; on the diagonal the whole way from the foot.
    pub common: DMatrix<f32>,
    /// The tree of all points at their own costs: from which point each is reached, `None` from the
    /// foot, in an order in which that one comes first.
    pub reached: Vec<(usize, Option<usize>)>,
}

/// The ways from the foot to all points.
///
/// `apart` holds the root mean square difference of the motion of all pairs, and on the diagonal
/// that of a point's own motion, in whatever unit. Going between two points costs sqrt(d^2 + (h
/// m)^2), with d their distance, h the way from the foot to the farthest point and m their
/// difference over the median of the diagonal.
pub fn ways(apart: &DMatrix<f32>, rest_px: &[[f64; 2]], foot_px: [f64; 2]) -> Ways {
    let n = rest_px.len();
    let costs = costs(apart, rest_px, foot_px);
    let off_by = off_by_table();
    let (mut sum, mut count) = (DMatrix::<f32>::zeros(n, n), DMatrix::<f32>::zeros(n, n));
    for tree in 0..TREES {
        let mut random = generator(SEED, tree);
        let drawn: Vec<usize> = (0..n)
            .filter(|_| tree == 0 || random.random_bool(SHARE))
            .collect();
        // The spanning tree asks for the cost of each step once.
        let common = common_ways(&spanning_tree(&drawn, n, |a, b| {
            costs[(a, b)] * off_by.choose(&mut random).copied().unwrap_or(1.0)
        }));
        for (k, &b) in drawn.iter().enumerate() {
            for (j, &a) in drawn.iter().enumerate() {
                sum[(a, b)] += common[(j, k)];
                count[(a, b)] += 1.0;
            }
        }
    }
    let all: Vec<usize> = (0..n).collect();
    // Over a trunk without points the way that costs least leads to whatever moves least.
    let top = crown_begins(rest_px, foot_px);
    let tree = spanning_tree(&all, n, |a, b| match top {
        Some(top) if a == n => distance_sq(top, rest_px[b]).sqrt() as f32,
        _ => costs[(a, b)],
    });
    let reached = tree
        .iter()
        .map(|r| (r.drawn, r.parent.map(|p| tree[p].drawn)))
        .collect();
    Ways {
        common: sum.component_div(&count),
        reached,
    }
}

/// Costs of all steps; the last row and column are the foot, which rests.
fn costs(apart: &DMatrix<f32>, rest_px: &[[f64; 2]], foot_px: [f64; 2]) -> DMatrix<f32> {
    let n = rest_px.len();
    let own: Vec<f32> = (0..n).map(|i| apart[(i, i)]).collect();
    let median = median(own, f32::total_cmp)
        .map_or(0.0, f64::from)
        .max(f64::MIN_POSITIVE);
    let height = rest_px
        .iter()
        .map(|&p| distance_sq(p, foot_px).sqrt())
        .fold(1.0, f64::max);
    let px_of = height / median;
    DMatrix::from_fn(n + 1, n + 1, |a, b| {
        let at = |i: usize| rest_px.get(i).copied().unwrap_or(foot_px);
        let motion = match (a < n, b < n) {
            (true, true) => apart[(a, b)],
            (true, false) => apart[(a, a)],
            (false, true) => apart[(b, b)],
            (false, false) => 0.0,
        };
        let cost = (distance_sq(at(a), at(b)) + (px_of * f64::from(motion)).powi(2)).sqrt() as f32;
        // What is no number would end the tree early; it is a step that nobody would take.
        if cost.is_finite() {
            cost
        } else {
            f32::MAX.sqrt()
        }
    })
}

/// A point of the tree: its index among those drawn, the position of its parent in the list
/// (`None`: the foot), and the way from the foot.
struct Reached {
    drawn: usize,
    parent: Option<usize>,
    way: f32,
}

/// The minimum spanning tree of the points `drawn` and the root (Prim), in the order in which they
/// are reached.
fn spanning_tree(
    drawn: &[usize],
    root: usize,
    mut cost: impl FnMut(usize, usize) -> f32,
) -> Vec<Reached> {
    let mut reached: Vec<Reached> = Vec::with_capacity(drawn.len());
    // For every point that is left: the cheapest step to it, and from where.
    let mut left: Vec<(usize, f32, Option<usize>)> = drawn
        .iter()
        .enumerate()
        .map(|(k, &i)| (k, cost(root, i), None))
        .collect();
    while let Some(cheapest) = (0..left.len()).min_by(|&a, &b| left[a].1.total_cmp(&left[b].1)) {
        let (point, step, parent) = left.swap_remove(cheapest);
        let way = step + parent.map_or(0.0, |p: usize| reached[p].way);
        let at = Some(reached.len());
        reached.push(Reached {
            drawn: point,
            parent,
            way,
        });
        for (k, best, from) in &mut left {
            let through = cost(drawn[point], drawn[*k]);
            if through < *best {
                (*best, *from) = (through, at);
            }
        }
    }
    reached
}

/// The way from the foot that each pair has in common; rows and columns as the points were drawn.
fn common_ways(tree: &[Reached]) -> DMatrix<f32> {
    let mut common = DMatrix::zeros(tree.len(), tree.len());
    for (k, point) in tree.iter().enumerate() {
        let i = point.drawn;
        // A point parts from all that were reached before it where its parent does.
        if let Some(parent) = point.parent {
            for other in &tree[..k] {
                let shared = common[(other.drawn, tree[parent].drawn)];
                common[(other.drawn, i)] = shared;
                common[(i, other.drawn)] = shared;
            }
        }
        common[(i, i)] = point.way;
    }
    common
}

/// Quantiles of what costs are multiplied by.
fn off_by_table() -> Vec<f32> {
    // Sums of three evenly spread numbers are near enough to a normal distribution: variance 3/12.
    const SIDE: usize = 10;
    let evenly = |k: usize| (k as f64 + 0.5) / SIDE as f64 - 0.5;
    let normal =
        |k: usize| 2.0 * (evenly(k % SIDE) + evenly(k / SIDE % SIDE) + evenly(k / SIDE / SIDE));
    (0..SIDE * SIDE * SIDE)
        .map(|k| (COST_DEVIATION * normal(k)).exp() as f32)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A trunk with a branch to each side whose tips come near each other again; the branches move
    /// differently.
    fn two_branches() -> (DMatrix<f32>, Vec<[f64; 2]>) {
        let trunk = (1..8).map(|k| ([0.0, -10.0 * f64::from(k)], [0.1f32, 0.0]));
        let branch = |side: f64| {
            let motion = if side < 0.0 {
                [1.0f32, 0.0]
            } else {
                [0.0, 1.0]
            };
            (1..12).map(move |k| {
                let out = f64::from(if k < 6 { k } else { 11 - k });
                (
                    [side * (8.0 * out + 3.0), -70.0 - 8.0 * f64::from(k)],
                    motion,
                )
            })
        };
        let points: Vec<([f64; 2], [f32; 2])> =
            trunk.chain(branch(-1.0)).chain(branch(1.0)).collect();
        let apart = DMatrix::from_fn(points.len(), points.len(), |a, b| {
            let (p, q) = (points[a].1, if a == b { [0.0; 2] } else { points[b].1 });
            ((p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)).sqrt()
        });
        (apart, points.iter().map(|p| p.0).collect())
    }

    #[test]
    fn tips_that_touch_are_no_kin_if_they_move_differently() {
        let (apart, rest_px) = two_branches();
        let common = ways(&apart, &rest_px, [0.0, 0.0]).common;
        let (left_tip, right_tip, left_base) = (7 + 10, 7 + 11 + 10, 7 + 1);
        assert!(common[(left_tip, left_base)] > 1.2 * common[(left_tip, right_tip)]);
        // Everything on the branches has the trunk in common, which its own lower points have not.
        assert!(common[(left_tip, right_tip)] > common[(0, right_tip)]);
    }

    #[test]
    fn the_same_points_give_the_same_numbers() {
        let (apart, rest_px) = two_branches();
        let common = || ways(&apart, &rest_px, [0.0, 0.0]).common;
        assert_eq!(common(), common());
    }

    /// Points that rest, coincide or were never seen together must neither hang it nor come out as
    /// no numbers.
    #[test]
    fn useless_motion_still_gives_numbers() {
        for value in [0.0, f32::NAN, f32::INFINITY] {
            for n in 0..4 {
                let common = ways(
                    &DMatrix::from_element(n, n, value),
                    &vec![[5.0, 5.0]; n],
                    [5.0, 9.0],
                )
                .common;
                assert!(
                    common.iter().all(|c| c.is_finite()),
                    "{n} points of {value}"
                );
            }
        }
    }
}
