//! The affinity of the papers: how near two points are, times the correlation of their velocities
//! (Zeng 2015 eq. 2.20 after Liu et al. 2005).

use super::rest::extent_px;
use nalgebra::{DMatrix, Point2};

/// Affinity of the points `members`: exp(-d^2 / 2s^2) * max(rho, 0)^power, with s a share of the
/// members' own extent.
pub fn affinity(
    rho: &DMatrix<f32>,
    rest_px: &[Point2<f64>],
    members: &[usize],
    distance_scale: f64,
    power: f64,
) -> DMatrix<f32> {
    let n = members.len();
    let s = (extent_px(rest_px, members) * distance_scale).max(1.0);
    let mut w = DMatrix::zeros(n, n);
    for a in 0..n {
        for b in a + 1..n {
            let apart_px = rest_px[members[a]] - rest_px[members[b]];
            let near = (-apart_px.norm_squared() / (2.0 * s * s)).exp();
            let alike = f64::from(rho[(members[a], members[b])].max(0.0)).powf(power);
            // A floor keeps the graph connected, so that its second eigenvector exists and means a
            // cut.
            let weight = (near * alike).max(1e-6) as f32;
            w[(a, b)] = weight;
            w[(b, a)] = weight;
        }
    }
    w
}
