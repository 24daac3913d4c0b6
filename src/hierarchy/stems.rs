//! Points that sit on the stem from which others branch off: they are no branch of their own.

use super::binary::Binary;
use nalgebra::DMatrix;

/// A half of which so much of the whole way is on the way to the other half is its stem.
const ON_THE_WAY: f32 = 0.9;

/// For every part of `tree` whether it is the stem of the part beside it. `common` holds the common
/// ways of all pairs, and on the diagonal the whole way of each point from the foot, see
/// [`super::common_way`].
///
/// Linkage sets the points along a limb apart from all that is on its upper end, as their ways end
/// before the others part. Taken for a branch they would stick out of their own limb.
pub fn stems(tree: &Binary, common: &DMatrix<f32>) -> Vec<bool> {
    let mut stems = vec![false; tree.parts.len()];
    for [a, b] in tree.parts.iter().filter_map(|p| p.halves) {
        let (on_b, on_a) = (
            share(tree.points(a), tree.points(b), common),
            share(tree.points(b), tree.points(a), common),
        );
        stems[a] = on_b >= ON_THE_WAY && on_b >= on_a;
        stems[b] = on_a >= ON_THE_WAY && !stems[a];
    }
    stems
}

/// How much of the ways to `points` is, in the mean, on the ways to the `others`.
fn share(points: &[usize], others: &[usize], common: &DMatrix<f32>) -> f32 {
    let of = |i: usize| {
        let sum: f32 = others.iter().map(|&j| common[(j, i)]).sum();
        sum / (others.len() as f32 * common[(i, i)]).max(f32::MIN_POSITIVE)
    };
    points.iter().map(|&i| of(i)).sum::<f32>() / points.len().max(1) as f32
}
