//! What the points around a point say of where it should be: a robust local affine fit of displacements.

use nalgebra::{Matrix3, Matrix3x2, Vector3};

/// Number of neighbours that vouch for a point.
pub const NEIGHBOURS: usize = 12;
/// Fewer neighbours than this say nothing.
const AT_LEAST: usize = 4;

/// For every point the indices of its nearest others, at most [`NEIGHBOURS`], nearest first.
pub fn nearest(points: &[[f32; 2]]) -> Vec<Vec<u32>> {
    let distance_sq = |a: &[f32; 2], b: &[f32; 2]| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
    let mut order: Vec<u32> = Vec::new();
    points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            order.clear();
            order.extend((0..points.len() as u32).filter(|&j| j as usize != i));
            let by_distance = |a: &u32, b: &u32| {
                distance_sq(p, &points[*a as usize]).total_cmp(&distance_sq(p, &points[*b as usize]))
            };
            if order.len() > NEIGHBOURS {
                order.select_nth_unstable_by(NEIGHBOURS - 1, by_distance);
                order.truncate(NEIGHBOURS);
            }
            order.sort_unstable_by(by_distance);
            order.clone()
        })
        .collect()
}

/// Displacement (px) of a point by an affine fit to its neighbours, each given as its offset from the point at birth
/// and its displacement since. Disagreeing neighbours lose their weight (iteratively reweighted least squares with
/// Cauchy-squared weights); the slope is held towards zero, so that few or collinear neighbours still give an answer.
pub fn predicted_displacement(neighbours: &[([f64; 2], [f64; 2])]) -> Option<[f64; 2]> {
    if neighbours.len() < AT_LEAST {
        return None;
    }
    let mut weights = [1.0; NEIGHBOURS];
    let used = &neighbours[..neighbours.len().min(NEIGHBOURS)];
    let mut fit = Matrix3x2::zeros();
    for _ in 0..4 {
        let mut normal = Matrix3::from_diagonal(&Vector3::new(1e-3, 30.0, 30.0));
        let mut right = Matrix3x2::zeros();
        for ((offset, displacement), &w) in used.iter().zip(&weights) {
            let row = Vector3::new(1.0, offset[0], offset[1]);
            normal += w * row * row.transpose();
            right += w * row * nalgebra::RowVector2::new(displacement[0], displacement[1]);
        }
        fit = normal.cholesky()?.solve(&right);
        let residual = |(offset, displacement): &([f64; 2], [f64; 2])| {
            let at = |c: usize| fit[(0, c)] + fit[(1, c)] * offset[0] + fit[(2, c)] * offset[1];
            (displacement[0] - at(0)).hypot(displacement[1] - at(1))
        };
        let mut residuals: [f64; NEIGHBOURS] = [0.0; NEIGHBOURS];
        for (r, n) in residuals.iter_mut().zip(used) {
            *r = residual(n);
        }
        let mut sorted = residuals;
        let sorted = &mut sorted[..used.len()];
        sorted.sort_unstable_by(f64::total_cmp);
        let scale = (1.5 * sorted[used.len() / 2]).max(0.3);
        for (w, r) in weights.iter_mut().zip(&residuals) {
            *w = (1.0 + (r / scale).powi(2)).powi(-2);
        }
    }
    Some([fit[(0, 0)], fit[(0, 1)]])
}
