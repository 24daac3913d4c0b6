//! Points on the axis from which others branch off: they are no branch of their own.

use super::dendrogram::Dendrogram;
use nalgebra::DMatrix;

/// A part is the axis of its sibling if so great a share of the path to it is on the path to that.
const MIN_SHARED: f32 = 0.9;

/// For every part of `tree` whether it is the axis that carries its sibling. `shared` holds the
/// shared path lengths of all pairs, and on the diagonal the length of each point's own path from
/// the foot, see [`super::root_paths`].
///
/// Linkage sets the points along a limb apart from all that is on its upper end, as their paths end
/// before the others part. Taken for a branch they would stick out of their own limb.
pub fn axis_parts(tree: &Dendrogram, shared: &DMatrix<f32>) -> Vec<bool> {
    let mut is_axis = vec![false; tree.parts.len()];
    for [a, b] in tree.parts.iter().filter_map(|p| p.halves) {
        let on_b = shared_share(tree.points(a), tree.points(b), shared);
        let on_a = shared_share(tree.points(b), tree.points(a), shared);
        is_axis[a] = on_b >= MIN_SHARED && on_b >= on_a;
        is_axis[b] = on_a >= MIN_SHARED && !is_axis[a];
    }
    is_axis
}

/// Mean share of the paths to `points` that is on the paths to the `others`.
fn shared_share(points: &[usize], others: &[usize], shared: &DMatrix<f32>) -> f32 {
    let mut sum = 0.0;
    for &i in points {
        let with_others: f32 = others.iter().map(|&j| shared[(j, i)]).sum();
        sum += with_others / (others.len() as f32 * shared[(i, i)]).max(f32::MIN_POSITIVE);
    }
    sum / points.len().max(1) as f32
}
