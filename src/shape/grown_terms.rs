//! How the two terms of the posterior (Li 2011 eq. 2) weigh for trees that are grown like another.

use super::angles::Angles;
use super::prototype::{Prototype, Tuned};
use super::push::{Terms, envelope_distance, push};
use crate::config;
use crate::model::{Outline, Skeleton};
use crate::skeleton::Node2d;

/// Shares of the weight that eq. 6 has for the example.
const SHARES: [f64; 5] = [1.0, 0.5, 0.2, 0.1, 0.05];

/// The terms for trees like `example`, of which `samples` are some that were grown in its outline,
/// flat. A new tree fills its outline evenly from the start, so that less weight on filling does
/// for it. Of some shares of the example's weight the one is taken at which the worse of filling
/// (D of eq. 5) and plausibility (eq. 4), held against the example's, is best in the geometric mean
/// over the samples: neither gives up more than it must.
pub fn grown_terms(
    example: &Tuned,
    samples: &[Vec<Node2d>],
    outline: &Outline,
    settings: &config::Shape,
) -> Terms {
    let Terms::Both {
        weight,
        gain_floor,
        spread_first,
    } = example.terms
    else {
        return example.terms;
    };
    let mut rest = Vec::with_capacity(samples.len());
    for flat in samples {
        rest.push(Prototype::of(flat, &vec![0; flat.len()], outline, settings));
    }
    let mut best = (f64::NEG_INFINITY, example.terms);
    for share in SHARES {
        let terms = Terms::Both {
            weight: share * weight,
            gain_floor,
            spread_first,
        };
        let scores = rest
            .iter()
            .map(|tree| ln_against(example, tree, terms, settings));
        let sum = scores.fold(LnFigures::default(), LnFigures::plus);
        if sum.worse() > best.0 {
            best = (sum.worse(), terms);
        }
    }
    best.1
}

/// Logarithms of filling and plausibility as shares of the example's.
#[derive(Clone, Copy, Debug, Default)]
struct LnFigures {
    filling: f64,
    plausibility: f64,
}

impl LnFigures {
    fn plus(self, other: Self) -> Self {
        Self {
            filling: self.filling + other.filling,
            plausibility: self.plausibility + other.plausibility,
        }
    }

    fn worse(self) -> f64 {
        self.filling.min(self.plausibility)
    }
}

/// The figures of a tree that is pushed by `terms` from its planes.
fn ln_against(
    example: &Tuned,
    rest: &Prototype,
    terms: Terms,
    settings: &config::Shape,
) -> LnFigures {
    let mut pushed = rest.skeleton.clone();
    push(&mut pushed, &rest.trunk, &rest.envelope, settings, terms);
    let attractors = settings.attractors as usize;
    let distance_px = |tree: &Skeleton| envelope_distance(tree, &example.envelope, attractors);
    let likelihood = |tree: &Skeleton| Angles::of(tree, settings).likelihood(tree);
    LnFigures {
        filling: (distance_px(&example.skeleton) / distance_px(&pushed)).ln(),
        plausibility: (likelihood(&pushed) / likelihood(&example.skeleton)).ln(),
    }
}
