//! Shared path length: how far the paths from the foot to two points run together. The affinity of
//! the default method.
//!
//! Two points of a tree are the more closely related the later their paths from the foot part. The
//! paths are not seen, but steps between points that are near each other and move alike are likely
//! to lie on them: a minimum spanning tree, rooted at the foot, joins all points by such steps. One
//! false step takes a whole branch along, so the tree is drawn many times from part of the points
//! with randomly perturbed costs, and the shared lengths are averaged (Felsenstein's bootstrap of
//! 1985 for phylogenetic trees).
//!
//! Chosen by measurement, see `docs/sweep.md`: normalised cuts, average linkage of correlations and
//! shortest paths in place of the spanning tree all did worse on trees whose branches leave one
//! trunk.

use super::rest::crown_begins;
use crate::signal::median;
use nalgebra::{DMatrix, Point2};

/// Trees drawn; the first from all points.
const TREES: u32 = 20;
/// Share of the points that each of the others is drawn from.
const SHARE: f64 = 0.7;
/// Standard deviation of the logarithm of the factor by which costs are perturbed.
const COST_DEVIATION: f64 = 0.3;

/// The paths from the foot to all points.
pub struct RootPaths {
    /// Mean shared path length of all pairs, px of cost; on the diagonal the length of a point's
    /// own path.
    pub shared: DMatrix<f32>,
    /// The tree of all points at their own costs; each point stands after the one it is reached
    /// from.
    pub edges: Vec<Edge>,
}

/// An edge of the spanning tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    pub point: usize,
    /// The point from which it is reached; `None`: from the foot.
    pub from: Option<usize>,
}

/// The paths from the foot to all points.
///
/// `apart` holds the root mean square difference of the motion of all pairs, and on the diagonal
/// that of a point's own motion, in whatever unit. A step between two points costs sqrt(d^2 + (h
/// m)^2), with d their distance, h the distance from the foot to the farthest point and m their
/// difference over the median of the diagonal.
pub fn root_paths(
    apart: &DMatrix<f32>,
    rest_px: &[Point2<f64>],
    foot_px: Point2<f64>,
) -> RootPaths {
    let n = rest_px.len();
    let costs = costs(apart, rest_px, foot_px);
    let factors = perturbation_quantiles();
    let (mut sum, mut count) = (DMatrix::<f32>::zeros(n, n), DMatrix::<f32>::zeros(n, n));
    for tree in 0..TREES {
        let drawn: Vec<usize> = (0..n)
            .filter(|&i| tree == 0 || below(hash(tree, i, i), SHARE))
            .collect();
        let spanning = spanning_tree(&drawn, n, |a, b| {
            let chance = hash(tree, a.min(b), a.max(b)) as usize % factors.len();
            costs[(a, b)] * factors[chance]
        });
        let shared = shared_path_lengths(&spanning);
        for (k, &b) in drawn.iter().enumerate() {
            for (j, &a) in drawn.iter().enumerate() {
                sum[(a, b)] += shared[(j, k)];
                count[(a, b)] += 1.0;
            }
        }
    }
    let all: Vec<usize> = (0..n).collect();
    // Over a trunk without points the path that costs least leads to whatever moves least.
    let top = crown_begins(rest_px, foot_px);
    let tree = spanning_tree(&all, n, |a, b| match top {
        Some(top) if a == n => (top - rest_px[b]).norm() as f32,
        _ => costs[(a, b)],
    });
    let edges = tree.iter().map(|reached| Edge {
        point: reached.drawn,
        from: reached.parent.map(|p| tree[p].drawn),
    });
    RootPaths {
        shared: sum.component_div(&count),
        edges: edges.collect(),
    }
}

/// Costs of all steps; the last row and column are the foot, which rests.
fn costs(apart: &DMatrix<f32>, rest_px: &[Point2<f64>], foot_px: Point2<f64>) -> DMatrix<f32> {
    let n = rest_px.len();
    let own: Vec<f32> = (0..n).map(|i| apart[(i, i)]).collect();
    let median = median(own, f32::total_cmp)
        .map_or(0.0, f64::from)
        .max(f64::MIN_POSITIVE);
    let height = rest_px
        .iter()
        .map(|p| (p - foot_px).norm())
        .fold(1.0, f64::max);
    let px_of = height / median;
    let mut places_px = rest_px.to_vec();
    places_px.push(foot_px);
    DMatrix::from_fn(n + 1, n + 1, |a, b| {
        let motion = match (a < n, b < n) {
            (true, true) => apart[(a, b)],
            (true, false) => apart[(a, a)],
            (false, true) => apart[(b, b)],
            (false, false) => 0.0,
        };
        let distance_sq = (places_px[a] - places_px[b]).norm_squared();
        let cost = (distance_sq + (px_of * f64::from(motion)).powi(2)).sqrt() as f32;
        // A cost that is not a number would end the tree early; a very high one is never taken.
        if cost.is_finite() {
            cost
        } else {
            f32::MAX.sqrt()
        }
    })
}

/// A point of the spanning tree.
struct Reached {
    /// Its index among those drawn.
    drawn: usize,
    /// Index of its parent in the list; `None`: the foot.
    parent: Option<usize>,
    /// Length of the path from the foot.
    length: f32,
}

/// The cheapest step to a point that is not in the tree yet.
struct Step {
    /// Index among those drawn.
    drawn: usize,
    cost: f32,
    /// From where, as an index into the list of those reached; `None`: from the foot.
    from: Option<usize>,
}

/// The minimum spanning tree of the points `drawn` and the root (Prim), in the order in which they
/// are reached.
fn spanning_tree(drawn: &[usize], root: usize, cost: impl Fn(usize, usize) -> f32) -> Vec<Reached> {
    let mut reached: Vec<Reached> = Vec::with_capacity(drawn.len());
    let mut left: Vec<Step> = Vec::with_capacity(drawn.len());
    for (k, &point) in drawn.iter().enumerate() {
        left.push(Step {
            drawn: k,
            cost: cost(root, point),
            from: None,
        });
    }
    while let Some(cheapest) =
        (0..left.len()).min_by(|&a, &b| left[a].cost.total_cmp(&left[b].cost))
    {
        let step = left.swap_remove(cheapest);
        let length = step.cost + step.from.map_or(0.0, |p| reached[p].length);
        let at = reached.len();
        reached.push(Reached {
            drawn: step.drawn,
            parent: step.from,
            length,
        });
        for other in &mut left {
            let through = cost(drawn[step.drawn], drawn[other.drawn]);
            if through < other.cost {
                (other.cost, other.from) = (through, Some(at));
            }
        }
    }
    reached
}

/// The shared path length of each pair; rows and columns as the points were drawn.
fn shared_path_lengths(tree: &[Reached]) -> DMatrix<f32> {
    let mut all = DMatrix::zeros(tree.len(), tree.len());
    for (k, point) in tree.iter().enumerate() {
        let i = point.drawn;
        // A point parts from all that were reached before it where its parent does.
        if let Some(parent) = point.parent {
            for other in &tree[..k] {
                let shared = all[(other.drawn, tree[parent].drawn)];
                all[(other.drawn, i)] = shared;
                all[(i, other.drawn)] = shared;
            }
        }
        all[(i, i)] = point.length;
    }
    all
}

/// Values of one evenly spread number in [`perturbation_quantiles`].
const EVENLY: usize = 10;

/// Quantiles of the factor by which costs are perturbed.
fn perturbation_quantiles() -> Vec<f32> {
    (0..EVENLY * EVENLY * EVENLY)
        .map(|k| (COST_DEVIATION * nearly_normal(k)).exp() as f32)
        .collect()
}

/// Number `k` of the 1000 sums of three evenly spread numbers, scaled to a standard deviation of 1:
/// near enough to a normal distribution (the variance of the sums is 3/12).
fn nearly_normal(k: usize) -> f64 {
    2.0 * (evenly_spread(k % EVENLY)
        + evenly_spread(k / EVENLY % EVENLY)
        + evenly_spread(k / EVENLY / EVENLY))
}

/// Number `k` of [`EVENLY`] numbers between -0.5 and 0.5.
fn evenly_spread(k: usize) -> f64 {
    (k as f64 + 0.5) / EVENLY as f64 - 0.5
}

fn below(hash: u64, share: f64) -> bool {
    (hash as f64) < share * u64::MAX as f64
}

/// A random number that is the same at every run and in any order: the finaliser of SplitMix64.
fn hash(tree: u32, a: usize, b: usize) -> u64 {
    let mut x = (u64::from(tree) << 48) ^ ((a as u64) << 24) ^ b as u64;
    x = (x ^ (x >> 30))
        .wrapping_add(0x9e37_79b9_7f4a_7c15)
        .wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// Places and motion of the points of a branch to the `side`.
    fn branch(
        side: f64,
        motion: Vector2<f32>,
    ) -> impl Iterator<Item = (Point2<f64>, Vector2<f32>)> {
        (1..12).map(move |k| {
            let out = f64::from(if k < 6 { k } else { 11 - k });
            let place = Point2::new(side * (8.0 * out + 3.0), -70.0 - 8.0 * f64::from(k));
            (place, motion)
        })
    }

    /// A trunk with a branch to each side whose tips come near each other again; the branches move
    /// differently.
    fn two_branches() -> (DMatrix<f32>, Vec<Point2<f64>>) {
        let trunk = (1..8).map(|k| {
            (
                Point2::new(0.0, -10.0 * f64::from(k)),
                Vector2::new(0.1, 0.0),
            )
        });
        let points: Vec<(Point2<f64>, Vector2<f32>)> = trunk
            .chain(branch(-1.0, Vector2::x()))
            .chain(branch(1.0, Vector2::y()))
            .collect();
        let apart = DMatrix::from_fn(points.len(), points.len(), |a, b| {
            let rest = Vector2::zeros();
            let (p, q) = (points[a].1, if a == b { rest } else { points[b].1 });
            (p - q).norm()
        });
        (apart, points.iter().map(|p| p.0).collect())
    }

    #[test]
    fn tips_that_touch_are_not_related_if_they_move_differently() {
        let (apart, rest_px) = two_branches();
        let shared = root_paths(&apart, &rest_px, Point2::origin()).shared;
        let (left_tip, right_tip, left_base) = (7 + 10, 7 + 11 + 10, 7 + 1);
        assert!(shared[(left_tip, left_base)] > 1.2 * shared[(left_tip, right_tip)]);
        // Everything on the branches has the trunk in common, which its own lower points have not.
        assert!(shared[(left_tip, right_tip)] > shared[(0, right_tip)]);
    }

    #[test]
    fn the_same_points_give_the_same_numbers() {
        let (apart, rest_px) = two_branches();
        let once = root_paths(&apart, &rest_px, Point2::origin()).shared;
        let again = root_paths(&apart, &rest_px, Point2::origin()).shared;
        assert_eq!(once, again);
    }

    /// Points that rest, coincide or were never seen together must neither hang it nor come out as
    /// no numbers.
    #[test]
    fn useless_motion_still_gives_numbers() {
        for value in [0.0, f32::NAN, f32::INFINITY] {
            for n in 0..4 {
                let motion = DMatrix::from_element(n, n, value);
                let shared = root_paths(
                    &motion,
                    &vec![Point2::new(5.0, 5.0); n],
                    Point2::new(5.0, 9.0),
                )
                .shared;
                assert!(
                    shared.iter().all(|c| c.is_finite()),
                    "{n} points of {value}"
                );
            }
        }
    }
}
