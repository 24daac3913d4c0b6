//! How much the two terms of the posterior weigh against each other.

use super::{Angles, Envelope, Terms, envelope_distance, push};
use crate::config;
use crate::model::Skeleton;

/// What is tried: the power of eq. 6, what counts as no gain, and whether the tree is spread first
/// (see [`Terms::Both`]). The paper's are 1, 0 and no; but how sharply each term speaks hangs on
/// the tree (how many nodes share the filling, how deep it forks), so that with one choice for all,
/// one of the two gives way on some trees.
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

/// Pushes by both terms, weighed so that neither gives up more than it must: held against what the
/// paper's single traversal achieves with either term alone, the worse of the two is the best of
/// all that is tried.
pub fn fuse(
    skeleton: &mut Skeleton,
    trunk: &[bool],
    envelope: &Envelope,
    settings: &config::Shape,
) {
    let judge = Judge::of(skeleton, trunk, envelope, settings);
    let mut best: Option<(f64, Skeleton)> = None;
    for terms in weights() {
        let mut pushed = skeleton.clone();
        push(&mut pushed, trunk, envelope, settings, terms);
        let kept = judge.of_both(&pushed).worse();
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

/// The ways to weigh the terms, best tried in this order.
pub(super) fn weights() -> impl Iterator<Item = Terms> {
    TRIED
        .into_iter()
        .map(|(weight, no_gain, spread_first)| Terms::Both {
            weight,
            no_gain,
            spread_first,
        })
}

/// What a tree achieves of what either term alone does in a single traversal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Achieved {
    /// By how much it brings the envelope nearer than copies in their planes.
    pub filling: f64,
    /// How likely its angles are.
    pub plausibility: f64,
}

impl Achieved {
    pub fn worse(&self) -> f64 {
        self.filling.min(self.plausibility)
    }

    /// Both as shares of what `other` achieves.
    pub fn as_share_of(&self, other: &Achieved) -> Achieved {
        let share = |a: f64, b: f64| if b > 0.0 { a / b } else { 1.0 };
        Achieved {
            filling: share(self.filling, other.filling),
            plausibility: share(self.plausibility, other.plausibility),
        }
    }
}

/// Holds trees of one flat skeleton against what either term alone achieves.
pub(super) struct Judge<'a> {
    angles: Angles,
    envelope: &'a Envelope,
    attractors: usize,
    /// D of eq. 5 for the copies in their planes, and by how much eq. 6 alone brings it down, px.
    rest_px: f64,
    nearer_px: f64,
    /// Likelihood that eq. 4 alone achieves.
    likely: f64,
}

impl<'a> Judge<'a> {
    /// `rest` are the copies in their planes.
    pub fn of(
        rest: &Skeleton,
        trunk: &[bool],
        envelope: &'a Envelope,
        settings: &config::Shape,
    ) -> Self {
        let attractors = settings.attractors as usize;
        let angles = Angles::of(rest, settings);
        let rest_px = envelope_distance(rest, envelope, attractors);
        let alone = |terms: Terms| one_sided(rest, trunk, envelope, settings, terms);
        let nearer_px = rest_px - envelope_distance(&alone(Terms::Global), envelope, attractors);
        let likely = angles.likelihood(&alone(Terms::Local));
        Self {
            angles,
            envelope,
            attractors,
            rest_px,
            nearer_px,
            likely,
        }
    }

    pub fn of_both(&self, pushed: &Skeleton) -> Achieved {
        let nearer_px = self.rest_px - envelope_distance(pushed, self.envelope, self.attractors);
        let likely = self.angles.likelihood(pushed);
        Achieved {
            filling: if self.nearer_px > 0.0 {
                nearer_px / self.nearer_px
            } else {
                1.0
            },
            plausibility: if self.likely > 0.0 {
                likely / self.likely
            } else {
                1.0
            },
        }
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
    push(
        &mut pushed,
        trunk,
        envelope,
        &config::Shape {
            passes: 1,
            ..settings.clone()
        },
        terms,
    );
    pushed
}
