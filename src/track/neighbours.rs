//! Where a point should be by the points around it: a robust local affine fit of displacements.

use super::register::Warp;
use crate::signal::median;
use nalgebra::{Matrix3, Matrix3x2, RowVector2, Vector3};
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
pub fn nearest(points: &[[f32; 2]], known: &[[f32; 2]]) -> Vec<Vec<u32>> {
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
fn nearer(p: &[f32; 2], known: &[[f32; 2]], a: u32, b: u32) -> Ordering {
    distance_sq(p, &known[a as usize]).total_cmp(&distance_sq(p, &known[b as usize]))
}

fn distance_sq(a: &[f32; 2], b: &[f32; 2]) -> f32 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

/// What a neighbour says.
#[derive(Clone, Copy, Debug, Default)]
pub struct Witness {
    /// Its offset from the point when that was detected, and its displacement since, px.
    pub offset: [f64; 2],
    pub displacement: [f64; 2],
    /// Its weight, above 0 to 1.
    pub weight: f64,
}

/// How the surroundings of a point have moved since it was detected.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Displacement at the point itself, px.
    pub displacement: [f64; 2],
    /// How a small offset from the point is turned and stretched.
    pub warp: Warp,
}

impl Witness {
    /// Square of what the displacement differs from `affine` by, px^2.
    fn miss_sq(&self, affine: &Affine) -> f64 {
        let miss = [0, 1].map(|c| {
            let fitted =
                affine[(0, c)] + affine[(1, c)] * self.offset[0] + affine[(2, c)] * self.offset[1];
            self.displacement[c] - fitted
        });
        miss[0].powi(2) + miss[1].powi(2)
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
    let slopes = [0, 1].map(|of| [1, 2].map(|along| affine[(along, of)] as f32));
    Some(Fit {
        displacement: [affine[(0, 0)], affine[(0, 1)]],
        warp: [
            [1.0 + slopes[0][0], slopes[0][1]],
            [slopes[1][0], 1.0 + slopes[1][1]],
        ],
    })
}

fn weighted_fit(witnesses: &[Witness], weights: &[f64]) -> Option<Affine> {
    let mut normal = Matrix3::from_diagonal(&Vector3::new(1e-3, 30.0, 30.0));
    let mut right = Affine::zeros();
    for (witness, &w) in witnesses.iter().zip(weights) {
        let [offset_u, offset_v] = witness.offset;
        let row = Vector3::new(1.0, offset_u, offset_v);
        normal += w * row * row.transpose();
        right += w * row * RowVector2::from(witness.displacement);
    }
    Some(normal.cholesky()?.solve(&right))
}
