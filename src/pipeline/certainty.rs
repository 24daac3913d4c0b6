//! How sure it is that a tree is found on which nothing was drawn.

use crate::wood::SeenInPhotograph;

/// A tree with less than this is more likely wrong than right.
const LEAST_CHANCE: f64 = 0.5;
/// No tree is said to be surer: of 82 fresh pictures that were said to be surest 69 were right.
const MOST_CHANCE: f64 = 0.85;
/// Without colours none is said to be surer: of 43 grey pictures 12 were right.
const MOST_GREY: f64 = 0.45;
/// With this no other attempt is made.
const SURE_CHANCE: f64 = 0.8;
/// Weights of a logistic regression: once, by standard errors of the trunk up to so many, and in leaf
/// (`benches/photos_trust.py fit`, see docs/design/photo.md).
const ONCE: f64 = 1.96;
const BY_TRUNK: f64 = 0.19;
const MOST_DEVIATIONS: f64 = 15.0;
const IN_LEAF: f64 = -1.80;
const BY_LEVEL: f64 = -40.5;

/// What a tree that was found without strokes is judged by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certainty {
    /// By how many standard errors the trunk differs from what is beside it.
    pub trunk_deviations: f64,
    pub in_leaf: bool,
    /// The share of the branches' length that runs level.
    pub level_share: f64,
    /// Without colours leaves are not known, and a tree in leaf would be taken to be bare.
    pub has_colour: bool,
}

impl Certainty {
    pub fn of(seen: &SeenInPhotograph, has_colour: bool) -> Self {
        Self {
            trunk_deviations: seen.trunk_deviations.unwrap_or(0.0),
            in_leaf: seen.in_leaf,
            level_share: seen.level_share,
            has_colour,
        }
    }

    /// Whether the tree is more likely right than wrong.
    pub fn is_likely(&self) -> bool {
        self.chance() >= LEAST_CHANCE
    }

    /// Whether it is so likely right that no other is looked for.
    pub fn is_sure(&self) -> bool {
        self.chance() >= SURE_CHANCE
    }

    /// The chance that the tree is right, 0 to 1.
    pub fn chance(&self) -> f64 {
        let by_trunk = BY_TRUNK * self.trunk_deviations.clamp(0.0, MOST_DEVIATIONS);
        let in_leaf = if self.in_leaf { IN_LEAF } else { 0.0 };
        let score = ONCE + by_trunk + in_leaf + BY_LEVEL * self.level_share;
        let most = if self.has_colour {
            MOST_CHANCE
        } else {
            MOST_GREY
        };
        (1.0 / (1.0 + (-score).exp())).min(most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trunk_that_differs_more_is_surer() {
        for in_leaf in [false, true] {
            let mut last = 0.0;
            for trunk_deviations in [0.0, 5.0, 10.0, 15.0] {
                let found = Certainty {
                    trunk_deviations,
                    in_leaf,
                    level_share: 0.02,
                    has_colour: true,
                };
                let is_surer = found.chance() > last || last == MOST_CHANCE;
                assert!(is_surer, "{found:?}");
                last = found.chance();
                assert_eq!(found.is_likely(), last >= 0.5);
                let with_ledges = Certainty {
                    level_share: 0.12,
                    ..found
                };
                assert!(with_ledges.chance() < last);
                let grey = Certainty {
                    has_colour: false,
                    ..found
                };
                assert!(!grey.is_likely());
            }
            assert!((0.8..1.0).contains(&last), "{last}");
        }
    }
}
