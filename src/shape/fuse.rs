//! How much the two terms of the posterior weigh against each other.

use super::{Angles, Envelope, Terms, envelope_distance, push};
use crate::config;
use crate::model::Skeleton;

/// What is tried: the power of eq. 6, what counts as no gain, and whether the tree is spread first (see [`Terms::Both`]). The
/// paper's are 1, 0 and no; but how sharply each term speaks hangs on the tree (how many nodes share the filling, how deep
/// it forks), so that with one choice for all, one of the two gives way on some trees.
const TRIED: [(f64, f64, bool); 10] = [
    (1.4, 0.02, false),
    (1.4, 0.02, true),
    (1.0, 0.05, true),
    (2.0, 0.02, true),
    (1.0, 0.05, false),
    (2.0, 0.02, false),
    (0.7, 0.05, true),
    (2.8, 0.02, true),
    (1.0, 0.02, false),
    (4.0, 0.02, true),
];
/// With so little given up the search ends.
const ENOUGH: f64 = 0.96;

/// Pushes by both terms, weighed so that neither gives up more than it must: held against what the paper's single traversal
/// achieves with either term alone, the worse of the two is the best of all that is tried.
pub fn fuse(skeleton: &mut Skeleton, trunk: &[bool], envelope: &Envelope, settings: &config::Shape) {
    let angles = Angles::of(skeleton, settings);
    let distance = |s: &Skeleton| envelope_distance(s, envelope, settings.attractors as usize);
    let alone = |terms: Terms| one_sided(skeleton, trunk, envelope, settings, terms);
    let rest = distance(skeleton);
    let nearer = rest - distance(&alone(Terms::Global));
    let likely = angles.likelihood(&alone(Terms::Local));
    let mut best: Option<(f64, Skeleton)> = None;
    for (weight, no_gain, spread_first) in TRIED {
        let mut pushed = skeleton.clone();
        push(&mut pushed, trunk, envelope, settings, Terms::Both { weight, no_gain, spread_first });
        let filling = if nearer > 0.0 { (rest - distance(&pushed)) / nearer } else { 1.0 };
        let plausibility = if likely > 0.0 { angles.likelihood(&pushed) / likely } else { 1.0 };
        let kept = filling.min(plausibility);
        if best.as_ref().is_none_or(|(before, _)| kept > *before) {
            best = Some((kept, pushed));
        }
        if best.as_ref().is_some_and(|(kept, _)| *kept >= ENOUGH) {
            break;
        }
    }
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
