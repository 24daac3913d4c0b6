//! How much the two terms of the posterior (Li 2011 eq. 2) weigh against each other.
//!
//! How sharply each term speaks depends on the tree: how many nodes share the filling, how deep it
//! forks. With one choice for all, one of the two gives way on some trees. So some choices are
//! tried, and each result is scored against what either term alone achieves.

use super::angles::Angles;
use super::envelope::Envelope;
use super::push::{Terms, envelope_distance, push};
use crate::config;
use crate::model::Skeleton;

/// The choices that are tried, the usually best one first: those that are best on some of the
/// clips and made-up trees. The paper's is a weight of 1, a gain floor of 0, and no spreading.
const TRIED: [Terms; 10] = [
    both(1.4, 0.02, false),
    both(1.4, 0.02, true),
    both(1.0, 0.05, true),
    both(2.0, 0.02, true),
    both(1.0, 0.05, false),
    both(2.0, 0.02, false),
    both(0.7, 0.05, true),
    both(2.8, 0.02, true),
    both(1.0, 0.02, false),
    both(4.0, 0.02, true),
];
/// With a score from which on the search ends.
const ENOUGH: f64 = 0.96;

const fn both(weight: f64, gain_floor: f64, spread_first: bool) -> Terms {
    Terms::Both {
        weight,
        gain_floor,
        spread_first,
    }
}

/// Pushes by both terms, weighed so that neither gives up more than it must: of the trees that are
/// tried the one whose worse figure is best, held against what the paper's single traversal
/// achieves with either term alone. Gives the weights.
pub fn tune_term_weights(
    skeleton: &mut Skeleton,
    trunk: &[bool],
    envelope: &Envelope,
    settings: &config::Shape,
) -> Terms {
    let baseline = Baseline::of(skeleton, trunk, envelope, settings);
    let [first, others @ ..] = TRIED;
    let mut best = Tried::push(skeleton, trunk, envelope, settings, first, &baseline);
    for terms in others {
        if best.worse >= ENOUGH {
            break;
        }
        let tried = Tried::push(skeleton, trunk, envelope, settings, terms, &baseline);
        if tried.worse > best.worse {
            best = tried;
        }
    }
    *skeleton = best.pushed;
    best.terms
}

/// A tree pushed by one choice of the weights, and its worse figure.
struct Tried {
    terms: Terms,
    pushed: Skeleton,
    worse: f64,
}

impl Tried {
    fn push(
        skeleton: &Skeleton,
        trunk: &[bool],
        envelope: &Envelope,
        settings: &config::Shape,
        terms: Terms,
        baseline: &Baseline,
    ) -> Self {
        let mut pushed = skeleton.clone();
        push(&mut pushed, trunk, envelope, settings, terms);
        Self {
            terms,
            worse: baseline.score(&pushed).worse(),
            pushed,
        }
    }
}

/// The first `count` of the choices, the usually best one first.
pub(super) fn best_choices(count: usize) -> impl Iterator<Item = Terms> {
    TRIED.into_iter().take(count)
}

/// What a tree achieves, as shares of what either term alone does in a single traversal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Score {
    /// By how much it brings the envelope nearer than copies in their planes.
    pub filling: f64,
    /// How likely its angles are.
    pub plausibility: f64,
}

impl Score {
    pub fn worse(&self) -> f64 {
        self.filling.min(self.plausibility)
    }

    /// Both as shares of what `other` achieves.
    pub fn as_share_of(&self, other: &Score) -> Score {
        Score {
            filling: share_of(self.filling, other.filling),
            plausibility: share_of(self.plausibility, other.plausibility),
        }
    }
}

/// `part` as a share of `whole`; 1 where the whole is nothing.
fn share_of(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 1.0 }
}

/// What either term alone achieves on one flat skeleton.
pub(super) struct Baseline<'a> {
    angles: Angles,
    envelope: &'a Envelope,
    attractors: usize,
    /// D of eq. 5 for the copies in their planes, and by how much eq. 6 alone brings it down, px.
    rest_px: f64,
    nearer_px: f64,
    /// Likelihood that eq. 4 alone achieves.
    likely: f64,
}

impl<'a> Baseline<'a> {
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
        let filled = by_one_term(rest, trunk, envelope, settings, Terms::Global);
        let likeliest = by_one_term(rest, trunk, envelope, settings, Terms::Local);
        Self {
            nearer_px: rest_px - envelope_distance(&filled, envelope, attractors),
            likely: angles.likelihood(&likeliest),
            angles,
            envelope,
            attractors,
            rest_px,
        }
    }

    pub fn score(&self, tree: &Skeleton) -> Score {
        let nearer_px = self.rest_px - envelope_distance(tree, self.envelope, self.attractors);
        Score {
            filling: share_of(nearer_px, self.nearer_px),
            plausibility: share_of(self.angles.likelihood(tree), self.likely),
        }
    }
}

/// The tree as one term alone pushes it, once from root to leaf (Li 2011 fig. 3 a and b).
pub(super) fn by_one_term(
    skeleton: &Skeleton,
    trunk: &[bool],
    envelope: &Envelope,
    settings: &config::Shape,
    terms: Terms,
) -> Skeleton {
    let mut pushed = skeleton.clone();
    let once = config::Shape {
        passes: 1,
        ..settings.clone()
    };
    push(&mut pushed, trunk, envelope, &once, terms);
    pushed
}
