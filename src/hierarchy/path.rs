//! The affinity of the default method: correlation of motion, and shared path from the foot.

use super::root_paths::{RootPaths, root_paths};
use super::signals::Signals;
use crate::config::Hierarchy;
use crate::signal::median;
use nalgebra::{DMatrix, Point2};

/// Affinity of all pairs, and the paths from the foot: max(rho, 0)^motion_power + path_weight * s,
/// with rho the correlation of displacements and s the shared path length over the median length of
/// all paths.
///
/// - The correlation says which points are on the same branch. Points on a trunk that sways are all
///   alike to some degree; the power keeps that from adding up over many pairs.
/// - Which of several branches that move each in its own way leaves the trunk first cannot be seen
///   in their correlation: the trunk below is the same for all. There the shared path counts.
pub fn affinity(
    displacements: &Signals,
    rest_px: &[Point2<f64>],
    foot_px: Point2<f64>,
    settings: &Hierarchy,
) -> (DMatrix<f32>, RootPaths) {
    let (rho, differences) = displacements.compared();
    let paths = root_paths(&differences, rest_px, foot_px);
    let lengths: Vec<f32> = paths.shared.diagonal().iter().copied().collect();
    let Some(unit) = median(lengths, f32::total_cmp) else {
        return (rho, paths);
    };
    let power = settings.motion_power as f32;
    let weight = settings.path_weight as f32 / unit.max(f32::MIN_POSITIVE);
    let affinity = rho.zip_map(&paths.shared, |r, shared| {
        r.max(0.0).powf(power) + weight * shared
    });
    (affinity, paths)
}
