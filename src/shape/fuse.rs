//! How much the two terms of the posterior weigh against each other.

use super::{Angles, Envelope, Terms, envelope_distance, push};
use crate::config;
use crate::model::Skeleton;

/// Powers of eq. 6 that are tried. The paper's is 1; but how sharply each term speaks hangs on the tree (how many nodes
/// share the filling, how deep it forks), so that with one power for all, one of the two gives way on some trees.
const WEIGHTS: [f64; 6] = [1.0, 0.7, 1.4, 0.5, 2.0, 2.8];

/// Pushes by both terms, weighed so that neither gives up more than it must: held against what the paper's single traversal
/// achieves with either term alone, the worse of the two is the best that any of the weights gives.
pub fn fuse(skeleton: &mut Skeleton, trunk: &[bool], envelope: &Envelope, settings: &config::Shape) {
    let angles = Angles::of(skeleton, settings);
    let distance = |s: &Skeleton| envelope_distance(s, envelope, settings.attractors as usize);
    let alone = |terms: Terms| one_sided(skeleton, trunk, envelope, settings, terms);
    let rest = distance(skeleton);
    let nearer = rest - distance(&alone(Terms::Global));
    let likely = angles.likelihood(&alone(Terms::Local));
    let tried = WEIGHTS.into_iter().map(|weight| {
        let mut pushed = skeleton.clone();
        push(&mut pushed, trunk, envelope, settings, Terms::Both(weight));
        let filling = if nearer > 0.0 { (rest - distance(&pushed)) / nearer } else { 1.0 };
        let plausibility = if likely > 0.0 { angles.likelihood(&pushed) / likely } else { 1.0 };
        (filling.min(plausibility), pushed)
    });
    // The first of equals: the paper's.
    let best = tried.reduce(|best, other| if other.0 > best.0 { other } else { best });
    if let Some((_, pushed)) = best {
        *skeleton = pushed;
    }
}

/// The tree as one term alone pushes it, once from root to leaf (Li et al. figure 3 a and b).
pub(super) fn one_sided(
    skeleton: &Skeleton,
    trunk: &[bool],
    envelope: &Envelope,
    settings: &config::Shape,
    terms: Terms,
) -> Skeleton {
    let mut pushed = skeleton.clone();
    push(&mut pushed, trunk, envelope, &config::Shape { passes: 1, ..settings.clone() }, terms);
    pushed
}
