//! What the points around a point say of where it should be: a robust local affine fit of
//! displacements.

use super::register::Warp;
use nalgebra::{Matrix3, Matrix3x2, Vector3};

/// Number of neighbours that vouch for a point.
pub const NEIGHBOURS: usize = 12;
/// Number of neighbours that a point knows: of those that are on trial, half will go.
pub const REMEMBERED: usize = 2 * NEIGHBOURS;
/// Fewer neighbours than this say nothing.
const AT_LEAST: usize = 4;

/// For every point the indices of its nearest others among all of `known`, at most [`REMEMBERED`],
/// nearest first. The points themselves are the last of `known`.
pub fn nearest(points: &[[f32; 2]], known: &[[f32; 2]]) -> Vec<Vec<u32>> {
    let distance_sq = |a: &[f32; 2], b: &[f32; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let before = known.len() - points.len();
    let mut order: Vec<u32> = Vec::new();
    points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            order.clear();
            order.extend((0..known.len() as u32).filter(|&j| j as usize != before + i));
            let by_distance = |a: &u32, b: &u32| {
                distance_sq(p, &known[*a as usize]).total_cmp(&distance_sq(p, &known[*b as usize]))
            };
            if order.len() > REMEMBERED {
                order.select_nth_unstable_by(REMEMBERED - 1, by_distance);
                order.truncate(REMEMBERED);
            }
            order.sort_unstable_by(by_distance);
            order.clone()
        })
        .collect()
}

/// What a neighbour says.
#[derive(Clone, Copy, Debug, Default)]
pub struct Witness {
    /// Its offset from the point when that was detected, and its displacement since, px.
    pub offset: [f64; 2],
    pub displacement: [f64; 2],
    /// How far it is to be believed, above 0 to 1.
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

/// An affine fit to the displacements of a point's neighbours. Disagreeing neighbours lose their
/// weight (iteratively reweighted least squares with Cauchy-squared weights); the slope is held
/// towards zero, so that few or collinear neighbours still give an answer.
pub fn fit(witnesses: &[Witness]) -> Option<Fit> {
    if witnesses.len() < AT_LEAST {
        return None;
    }
    let used = &witnesses[..witnesses.len().min(NEIGHBOURS)];
    let mut weights = [0.0; NEIGHBOURS];
    weights
        .iter_mut()
        .zip(used)
        .for_each(|(w, n)| *w = n.weight);
    let mut fit = Matrix3x2::zeros();
    for _ in 0..4 {
        let mut normal = Matrix3::from_diagonal(&Vector3::new(1e-3, 30.0, 30.0));
        let mut right = Matrix3x2::zeros();
        for (
            Witness {
                offset,
                displacement,
                ..
            },
            &w,
        ) in used.iter().zip(&weights)
        {
            let row = Vector3::new(1.0, offset[0], offset[1]);
            normal += w * row * row.transpose();
            right += w * row * nalgebra::RowVector2::new(displacement[0], displacement[1]);
        }
        fit = normal.cholesky()?.solve(&right);
        let square = |Witness {
                          offset,
                          displacement,
                          ..
                      }: &Witness| {
            let at = |c: usize| fit[(0, c)] + fit[(1, c)] * offset[0] + fit[(2, c)] * offset[1];
            (displacement[0] - at(0)).powi(2) + (displacement[1] - at(1)).powi(2)
        };
        let mut squares: [f64; NEIGHBOURS] = [0.0; NEIGHBOURS];
        for (r, n) in squares.iter_mut().zip(used) {
            *r = square(n);
        }
        let mut sorted = squares;
        let sorted = &mut sorted[..used.len()];
        sorted.sort_unstable_by(f64::total_cmp);
        let scale_sq = (1.5 * 1.5 * sorted[used.len() / 2]).max(0.3 * 0.3);
        for ((w, r), n) in weights.iter_mut().zip(&squares).zip(used) {
            *w = n.weight * (1.0 + r / scale_sq).powi(-2);
        }
    }
    let slope = |of: usize, along: usize| fit[(1 + along, of)] as f32;
    let warp = [
        [1.0 + slope(0, 0), slope(0, 1)],
        [slope(1, 0), 1.0 + slope(1, 1)],
    ];
    Some(Fit {
        displacement: [fit[(0, 0)], fit[(0, 1)]],
        warp,
    })
}
