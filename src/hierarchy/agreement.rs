//! Points that contradict those around them are left out of the tree.

use super::signals::Signals;
use crate::signal::median;
use nalgebra::Point2;

/// Points around a point with which its motion is compared.
const NEIGHBOURS: usize = 8;

/// Indices of the points that move as those around them do: in the median their correlation with
/// the [`NEIGHBOURS`] nearest is at least `agreement`. The others slid along a branch, hang on the
/// background or on two layers at once; where they were put would be chance.
pub fn in_agreement(velocities: &Signals, rest_px: &[Point2<f64>], agreement: f64) -> Vec<usize> {
    let mut kept = Vec::new();
    for point in 0..rest_px.len() {
        let near = nearest(rest_px, point);
        let correlations = near.iter().map(|&j| velocities.correlation(point, j));
        let middle = median(correlations.collect(), f32::total_cmp);
        if middle.is_some_and(|rho| f64::from(rho) >= agreement) {
            kept.push(point);
        }
    }
    kept
}

/// The [`NEIGHBOURS`] points nearest to `point`, in any order; all others where there are fewer.
fn nearest(rest_px: &[Point2<f64>], point: usize) -> Vec<usize> {
    let mut others: Vec<usize> = (0..rest_px.len()).filter(|&j| j != point).collect();
    if others.len() > NEIGHBOURS {
        others.select_nth_unstable_by(NEIGHBOURS - 1, |&a, &b| {
            (rest_px[point] - rest_px[a])
                .norm_squared()
                .total_cmp(&(rest_px[point] - rest_px[b]).norm_squared())
                .then(a.cmp(&b))
        });
        others.truncate(NEIGHBOURS);
    }
    others
}
