//! How much of the way from the foot two points are likely to share: the affinity of the default
//! method.

use super::common_way::{Ways, ways};
use super::signals::Signals;
use crate::config::Hierarchy;
use crate::signal::median;
use nalgebra::DMatrix;

/// Likeness of all pairs, and the ways from the foot: likeness of motion, raised to a power, plus
/// the part of the way from the foot that both have in common.
///
/// - The correlation to its power says who rides on the same branch. Points on a trunk that sways
///   are all alike to some
///   degree; the power keeps that from adding up over many pairs.
/// - Which of several branches that move each in its own way leaves the trunk first cannot be seen
///   in their likeness:
/// the trunk below is the same for all. There the common way counts, as a share of the median whole
/// way.
pub fn likeness(
    displacements: &Signals,
    rest_px: &[[f64; 2]],
    foot_px: [f64; 2],
    settings: &Hierarchy,
) -> (DMatrix<f32>, Ways) {
    let (rho, differences) = displacements.compared();
    let ways = ways(&differences, rest_px, foot_px);
    let whole: Vec<f32> = ways.common.diagonal().iter().copied().collect();
    let Some(unit) = median(whole, f32::total_cmp) else {
        return (rho, ways);
    };
    let unit = unit.max(f32::MIN_POSITIVE);
    let (power, weight) = (
        settings.motion_power as f32,
        settings.path_weight as f32 / unit,
    );
    (
        rho.zip_map(&ways.common, |r, way| r.max(0.0).powf(power) + weight * way),
        ways,
    )
}
