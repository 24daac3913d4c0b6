//! How much of the way from the foot two points are likely to share: the affinity of the default method.

use super::rest::{distance_sq, extent_px};
use crate::config::Hierarchy;
use nalgebra::DMatrix;

/// Likeness of all pairs: likeness of motion, raised to a power, plus the share of the way from the foot that straight
/// ways to both would have in common, less how far apart they are.
///
/// - `rho` to its power says who rides on the same branch. Points on a trunk that sways are all alike to some degree;
///   the power keeps that from adding up over many pairs.
/// - Which of several branches that move each in its own way leaves the trunk first cannot be seen in their motion: the
///   trunk below is the same for all. There the second term counts: of ways from the foot to a and b of the lengths
///   |a| and |b|, (|a| + |b| - |a - b|) / 2 is in common if they part as late as they can (the Gromov product).
/// - The third, in squares of the extent of all points, keeps apart what merely swings alike at far ends.
pub fn likeness(rho: &DMatrix<f32>, rest_px: &[[f64; 2]], foot_px: [f64; 2], settings: &Hierarchy) -> DMatrix<f32> {
    let n = rest_px.len();
    let extent_sq = extent_px(rest_px, &(0..n).collect::<Vec<usize>>()).max(1.0).powi(2);
    let from_foot: Vec<f64> = rest_px.iter().map(|&p| distance_sq(p, foot_px).sqrt()).collect();
    let longest = from_foot.iter().copied().fold(1.0, f64::max);
    let mut w = DMatrix::zeros(n, n);
    for b in 0..n {
        for a in 0..b {
            let apart_sq = distance_sq(rest_px[a], rest_px[b]);
            let alike = f64::from(rho[(a, b)].max(0.0).powf(settings.motion_power as f32));
            let shared = (from_foot[a] + from_foot[b] - apart_sq.sqrt()) / 2.0 / longest;
            let value =
                (alike + settings.path_weight * shared - settings.distance_weight * apart_sq / extent_sq) as f32;
            w[(a, b)] = value;
            w[(b, a)] = value;
        }
    }
    w
}
