//! Where a point should be by the points around it: a robust local affine fit of displacements.

use super::register::Warp;
use crate::signal::median;
use nalgebra::{Matrix3, Matrix3x2, Point2, Vector2, Vector3, distance_squared};
use std::cmp::Ordering;

/// Number of neighbours by which the place of a point is predicted.
pub const NEIGHBOURS: usize = 12;
/// Number of neighbours that a point knows: of those that are on trial, half will go.
const REMEMBERED: usize = 2 * NEIGHBOURS;
/// Fewer neighbours than this say nothing.
const AT_LEAST: usize = 4;
/// Rounds of the robust fit.
const ROUNDS: usize = 4;

/// For every point the indices of its nearest others among all of `known`, at most [`REMEMBERED`],
/// nearest first. The points themselves are the last of `known`.
pub fn nearest(points: &[Point2<f32>], known: &[Point2<f32>]) -> Vec<Vec<u32>> {
    let before = known.len() - points.len();
    let mut all = Vec::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        let mut others: Vec<u32> = (0..known.len() as u32)
            .filter(|&j| j as usize != before + i)
            .collect();
        if others.len() > REMEMBERED {
            others.select_nth_unstable_by(REMEMBERED - 1, |a, b| nearer(p, known, *a, *b));
            others.truncate(REMEMBERED);
        }
        others.sort_unstable_by(|a, b| nearer(p, known, *a, *b));
        all.push(others);
    }
    all
}

/// The order of `known` points by their distance from `p`.
fn nearer(p: &Point2<f32>, known: &[Point2<f32>], a: u32, b: u32) -> Ordering {
    distance_squared(p, &known[a as usize]).total_cmp(&distance_squared(p, &known[b as usize]))
}

/// What a neighbour says.
#[derive(Clone, Copy, Debug, Default)]
pub struct Witness {
    /// Its offset from the point when that was detected, and its displacement since, px.
    pub offset: Vector2<f64>,
    pub displacement: Vector2<f64>,
    /// Its weight, above 0 to 1.
    pub weight: f64,
}

/// How the surroundings of a point have moved since it was detected.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Displacement at the point itself, px.
    pub displacement: Vector2<f64>,
    /// How a small offset from the point is turned and stretched.
    pub warp: Warp,
}

impl Witness {
    /// Square of what the displacement differs from `affine` by, px^2.
    fn miss_sq(&self, affine: &Affine) -> f64 {
        let miss = Vector2::from_fn(|c, _| {
            let fitted =
                affine[(0, c)] + affine[(1, c)] * self.offset.x + affine[(2, c)] * self.offset.y;
            self.displacement[c] - fitted
        });
        miss.norm_squared()
    }
}

/// Displacement at the point itself, and its slopes along u and v (rows), of either coordinate
/// (columns).
type Affine = Matrix3x2<f64>;

/// An affine fit to the displacements of a point's neighbours. Disagreeing neighbours lose their
/// weight (iteratively reweighted least squares with Cauchy-squared weights); the slope is held
/// towards zero, so that few or collinear neighbours still give an answer.
pub fn fit(witnesses: &[Witness]) -> Option<Fit> {
    if witnesses.len() < AT_LEAST {
        return None;
    }
    let used = &witnesses[..witnesses.len().min(NEIGHBOURS)];
    let mut weights: Vec<f64> = used.iter().map(|n| n.weight).collect();
    let mut affine = Affine::zeros();
    for _ in 0..ROUNDS {
        affine = weighted_fit(used, &weights)?;
        let misses_sq: Vec<f64> = used.iter().map(|n| n.miss_sq(&affine)).collect();
        let median_sq = median(misses_sq.clone(), f64::total_cmp)?;
        let scale_sq = (1.5 * 1.5 * median_sq).max(0.3 * 0.3);
        for ((w, miss_sq), n) in weights.iter_mut().zip(misses_sq).zip(used) {
            *w = n.weight * (1.0 + miss_sq / scale_sq).powi(-2);
        }
    }
    let slopes = Warp::from_fn(|of, along| affine[(1 + along, of)] as f32);
    Some(Fit {
        displacement: affine.row(0).transpose(),
        warp: Warp::new(1.0 + slopes.m11, slopes.m12, slopes.m21, 1.0 + slopes.m22),
    })
}

fn weighted_fit(witnesses: &[Witness], weights: &[f64]) -> Option<Affine> {
    let mut normal = Matrix3::from_diagonal(&Vector3::new(1e-3, 30.0, 30.0));
    let mut right = Affine::zeros();
    for (witness, &w) in witnesses.iter().zip(weights) {
        let row = Vector3::new(1.0, witness.offset.x, witness.offset.y);
        normal += w * row * row.transpose();
        right += w * row * witness.displacement.transpose();
    }
    Some(normal.cholesky()?.solve(&right))
}
