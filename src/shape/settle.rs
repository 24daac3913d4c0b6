//! A refined tree starts from the tree before it and moves no farther than it must.
//!
//! At a refinement the branches are found anew and pushed anew; that tree is as good as the film
//! allows, but its branches stand elsewhere than the viewer has seen them. So the places of the old
//! tree are carried over to the branches that both have, and the tree is pushed on from there, held
//! by a prior on those places. It has to be nearly as good as the one that was pushed anew:
//!
//! 1. A tree that is good enough where it stood stays there.
//! 2. Else it is pushed on with tight priors first, then with wider ones, until one of the results
//!    is good enough and hardly turns back (no hooks). Of those the one nearest to the old places
//!    is taken.
//! 3. If there is none, hooks are allowed; if that does not help, a tree nearly as good as the best
//!    one that was found is good enough.
//! 4. Last, branches that have changed sides or would be seen to jump go back, as far as the tree
//!    stays good.
//!
//! All of that is tried with the old places in the picture as well; where they make branches turn
//! back and the tree is not good enough for it, once more with the new places.

use super::angles::turning_back;
use super::keep::{Twin, carry_over_positions};
use super::prototype::Prototype;
use super::push::{PositionPrior, push_on, squared_way};
use super::sides::{back_to_sides, turned_as_before};
use super::term_weights::{Baseline, Score, best_choices};
use crate::config;
use crate::model::Skeleton;
use nalgebra::Point3;
use std::f64::consts::PI;

/// Deviations of the prior that are tried, tight ones first, as shares of the tree's width.
const SIGMAS: [f64; 4] = [0.025, 0.05, 0.1, 0.2];
/// How many ways to weigh the terms are tried with each.
const WEIGHTS: usize = 2;
/// Least score, as a share of that of the tree that was pushed anew.
const OF_ANEW: f64 = 0.95;
/// Least score where none reaches that, as a share of the best one found.
const OF_BEST: f64 = 0.9;
/// A tree that turns back by no more than this in the mean has as good as no hooks, radians.
const NEXT_TO_STRAIGHT_RAD: f64 = 5.0 * PI / 180.0;
/// How much branches may be made to turn back by their old places in the picture: at first, and
/// where the score needs less of it, radians.
const TURNED_BACK_AT_FIRST_RAD: f64 = PI / 2.0;
const TURNED_BACK_WITH_NEED_RAD: f64 = PI / 6.0;
/// What is left of either figure, as a share, when branches are brought back to their sides.
const OF_SETTLED: f64 = 0.95;

/// Where each node of the old tree stood in the new one; `None` for nodes that nothing holds.
type Held = [Option<Point3<f64>>];

/// `anew`, a tree in the axes of `old`, as the old one goes on in it, and where its nodes are held.
/// `twins` says which nodes both have, `prototype` and `settings` are what `anew` was pushed from.
pub fn go_on(
    anew: &Skeleton,
    old: &Skeleton,
    twins: &[Option<Twin>],
    prototype: &Prototype,
    settings: &config::Shape,
) -> (Skeleton, Vec<Option<Point3<f64>>>) {
    let optimiser = Optimiser::new(anew, prototype, settings);
    let first = optimiser.warm_start(old, twins, TURNED_BACK_AT_FIRST_RAD);
    if first.score >= OF_ANEW {
        return (first.tree, first.held);
    }
    let second = optimiser.warm_start(old, twins, TURNED_BACK_WITH_NEED_RAD);
    if second.score > first.score {
        (second.tree, second.held)
    } else {
        (first.tree, first.held)
    }
}

/// A tree that goes on from the old one.
struct Settled {
    tree: Skeleton,
    held: Vec<Option<Point3<f64>>>,
    /// The worse of its figures, as a share of those of the tree that was pushed anew.
    score: f64,
}

/// A tree that was tried.
struct Candidate {
    tree: Skeleton,
    /// The worse of its figures, as a share of those of the tree that was pushed anew.
    score: f64,
    /// Sum of the [`squared_way`]s from where its nodes stood, px².
    off_px2: f64,
}

/// The best candidate, and the score that was asked of it.
struct Choice {
    tree: Skeleton,
    least: f64,
}

/// What a tree must keep when branches are brought back to their sides.
struct Limits {
    least: Score,
    most_turning_rad: f64,
}

/// Pushes a tree on from old places; all scores are shares of what `anew` achieves.
struct Optimiser<'a> {
    anew: &'a Skeleton,
    prototype: &'a Prototype,
    settings: &'a config::Shape,
    baseline: Baseline<'a>,
    score_anew: Score,
    /// A tree that turns back by no more than this in the mean has hardly more hooks than `anew`.
    straight_rad: f64,
}

impl<'a> Optimiser<'a> {
    fn new(anew: &'a Skeleton, prototype: &'a Prototype, settings: &'a config::Shape) -> Self {
        let Prototype {
            skeleton: rest,
            envelope,
            trunk,
        } = prototype;
        let baseline = Baseline::of(rest, trunk, envelope, settings);
        let score_anew = baseline.score(anew);
        let straight_rad =
            (turning_back(anew) + NEXT_TO_STRAIGHT_RAD) / OF_ANEW - NEXT_TO_STRAIGHT_RAD;
        Self {
            anew,
            prototype,
            settings,
            baseline,
            score_anew,
            straight_rad,
        }
    }

    fn score(&self, tree: &Skeleton) -> Score {
        self.baseline.score(tree).as_share_of(&self.score_anew)
    }

    /// The tree from the places of `old`, at which branches may turn back by `turned_back_rad` more
    /// than at the new ones in the picture.
    fn warm_start(&self, old: &Skeleton, twins: &[Option<Twin>], turned_back_rad: f64) -> Settled {
        let mut kept = self.anew.clone();
        let envelope = &self.prototype.envelope;
        let held = carry_over_positions(&mut kept, old, twins, envelope, turned_back_rad);
        let tree = self.settle(kept, &held);
        let score = self.score(&tree).worse();
        Settled { tree, held, score }
    }

    /// `kept`, whose nodes stand where they are `held`, pushed on as far as it must be; as it is
    /// where it is good enough already.
    fn settle(&self, kept: Skeleton, held: &Held) -> Skeleton {
        let good = self.score(&kept).worse() >= OF_ANEW;
        if good && turning_back(&kept) <= self.straight_rad {
            return kept;
        }
        let Some(Choice { mut tree, least }) = self.nearest_good_tree(&kept, held) else {
            return kept;
        };
        let limits = self.limits(&tree, least);
        let Prototype {
            envelope, trunk, ..
        } = self.prototype;
        back_to_sides(&mut tree, held, trunk, envelope, |tried| {
            self.is_within(tried, &limits)
        });
        tree
    }

    /// Pushes on with tight priors first, and gives of the first trees that are good enough the one
    /// nearest to the old places. Without any, first the limit on hooks is dropped, then a score of
    /// [`OF_BEST`] of the best one will do.
    fn nearest_good_tree(&self, kept: &Skeleton, held: &Held) -> Option<Choice> {
        // Both starts: the kept tree, and `anew` with every main branch on the side where it stood.
        let turned = turned_as_before(kept, held, self.anew, &self.prototype.trunk);
        let mut tried = vec![
            self.candidate(kept.clone(), held),
            self.candidate(turned.clone(), held),
        ];
        for sigma in SIGMAS {
            let before = tried.len();
            let prior = PositionPrior {
                stood: held,
                sigma_px: sigma * self.prototype.envelope.width(),
            };
            for start in [kept, &turned] {
                self.push_on_from(start, prior, &mut tried);
            }
            if let Some(choice) = nearest(&tried[before..], OF_ANEW, self.straight_rad) {
                return Some(choice);
            }
        }
        let best = tried.iter().map(|c| c.score).fold(0.0, f64::max);
        nearest(&tried, OF_ANEW, f64::INFINITY)
            .or_else(|| nearest(&tried, OF_BEST * best, f64::INFINITY))
    }

    /// Adds to `tried` what `start` becomes by each way to weigh the terms.
    fn push_on_from(&self, start: &Skeleton, prior: PositionPrior, tried: &mut Vec<Candidate>) {
        let Prototype {
            envelope, trunk, ..
        } = self.prototype;
        for terms in best_choices(WEIGHTS) {
            let mut pushed = start.clone();
            push_on(&mut pushed, trunk, envelope, self.settings, terms, prior);
            tried.push(self.candidate(pushed, prior.stood));
        }
    }

    fn candidate(&self, tree: Skeleton, held: &Held) -> Candidate {
        let mut off_px2 = 0.0;
        for (node, stood) in tree.nodes.iter().zip(held) {
            if let Some(stood) = stood {
                off_px2 += squared_way(node.position - stood);
            }
        }
        Candidate {
            score: self.score(&tree).worse(),
            off_px2,
            tree,
        }
    }

    /// What `tree`, of which a score of `least` was asked, must keep.
    fn limits(&self, tree: &Skeleton, least: f64) -> Limits {
        let had = self.score(tree);
        Limits {
            least: Score {
                filling: had.filling.min(least.max(OF_SETTLED * had.filling)),
                plausibility: had
                    .plausibility
                    .min(least.max(OF_SETTLED * had.plausibility)),
            },
            most_turning_rad: self.straight_rad.max(turning_back(tree)),
        }
    }

    fn is_within(&self, tree: &Skeleton, limits: &Limits) -> bool {
        let score = self.score(tree);
        turning_back(tree) <= limits.most_turning_rad
            && score.filling >= limits.least.filling
            && score.plausibility >= limits.least.plausibility
    }
}

/// Of the candidates with a score of `least` that turn back by no more than `straight_rad` the one
/// that is nearest to where it stood.
fn nearest(tried: &[Candidate], least: f64, straight_rad: f64) -> Option<Choice> {
    let good = tried
        .iter()
        .filter(|c| c.score >= least && turning_back(&c.tree) <= straight_rad);
    let nearest = good.min_by(|a, b| a.off_px2.total_cmp(&b.off_px2))?;
    Some(Choice {
        tree: nearest.tree.clone(),
        least,
    })
}
