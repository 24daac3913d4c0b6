//! Points that contradict those around them are left out of the tree.

use super::rest::distance_sq;
use super::signals::Signals;

/// Points around a point that are asked whether it moves as they do.
const NEIGHBOURS: usize = 8;

/// Indices of the points that move as those around them do: in the median their correlation with
/// the [`NEIGHBOURS`] nearest is at least `agreement`. The others slid along a branch, hang on the
/// background or on two layers at once; where they were put would be chance.
pub fn in_agreement(velocities: &Signals, rest_px: &[[f64; 2]], agreement: f64) -> Vec<usize> {
    let n = rest_px.len();
    let agrees = |i: &usize| {
        let mut others: Vec<usize> = (0..n).filter(|j| j != i).collect();
        let nearer = |a: &usize, b: &usize| {
            distance_sq(rest_px[*i], rest_px[*a])
                .total_cmp(&distance_sq(rest_px[*i], rest_px[*b]))
                .then(a.cmp(b))
        };
        if others.len() > NEIGHBOURS {
            others.select_nth_unstable_by(NEIGHBOURS - 1, nearer);
            others.truncate(NEIGHBOURS);
        }
        let mut near: Vec<f32> = others
            .iter()
            .map(|&j| velocities.correlation(*i, j))
            .collect();
        near.sort_unstable_by(f32::total_cmp);
        near.get(near.len() / 2)
            .is_some_and(|&median| f64::from(median) >= agreement)
    };
    (0..n).filter(agrees).collect()
}
