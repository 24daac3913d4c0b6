//! A tree that goes on at a refinement is pushed on from where it stood, and no farther than it
//! must.

use super::angles::turning_back;
use super::fuse::{Achieved, Judge, weights};
use super::keep::{Twin, stand_as_before};
use super::push::squared_way;
use super::sides::{back_to_sides, turned_as_before};
use super::{Prototype, Tether, push_on};
use crate::config;
use crate::model::Skeleton;
use nalgebra::Point3;
use std::f64::consts::PI;

/// Deviations of the prior that are tried, tight ones first, as shares of the tree's width.
const SIGMAS: [f64; 4] = [0.025, 0.05, 0.1, 0.2];
/// How many ways to weigh the terms are tried with each.
const WEIGHTS: usize = 2;
/// What a tree that goes on must achieve, as a share of what the same branches do that were pushed
/// anew.
const OF_ANEW: f64 = 0.95;
/// Where the places in the picture that are kept do not allow for that, a share of the best that
/// was found: the last of it would cost most.
const OF_BEST: f64 = 0.9;
/// A tree that turns back by no more than this in the mean has as good as no hooks, radians.
const NEXT_TO_STRAIGHT_RAD: f64 = 5.0 * PI / 180.0;
/// How much branches may be made to turn back by their old places in the picture: without need, and
/// where the figures need it.
const TURNED_BACK_RAD: [f64; 2] = [PI / 2.0, PI / 6.0];
/// What is left of either figure, as a share, when branches are brought back to their sides.
const OF_SETTLED: f64 = 0.95;

/// `anew`, a tree in the axes of `old`, as the old one goes on in it, and where its nodes are held.
/// If branches have to turn back a little in the picture for the tree to be as good as it must,
/// these go to their new places, too.
pub fn go_on(
    anew: &Skeleton,
    old: &Skeleton,
    twins: &[Option<Twin>],
    prototype: &Prototype,
    settings: &config::Shape,
) -> (Skeleton, Vec<Option<Point3<f64>>>) {
    let by = |turned_back_rad: f64| {
        let mut tree = anew.clone();
        let held = stand_as_before(&mut tree, old, twins, &prototype.envelope, turned_back_rad);
        let achieved = settle(&mut tree, &held, anew, prototype, settings);
        (achieved, (tree, held))
    };
    let (steady, first) = by(TURNED_BACK_RAD[0]);
    if steady >= OF_ANEW {
        return first;
    }
    let (freer, second) = by(TURNED_BACK_RAD[1]);
    if freer > steady { second } else { first }
}

/// Pushes `kept`, the tree as [`stand_as_before`] has put it, on by the posterior of eq. 2 with a
/// prior on where its nodes stood (`held`). The prior is as tight as leaves the tree all but as
/// full and as likely as
/// `anew`, the same branches pushed without regard to the old tree, with hardly more hooks; a tree
/// that is so already stays as it is.
///
/// With each prior two trees are pushed on: the kept one, and `anew` with every main branch turned
/// to the side on which it stood. Of those that will do the one is taken that is nearest to where
/// the tree stood; if none will, hooks are let be, and then what is little worse than the best will
/// do. Last, what has changed sides, or would be seen to jump, goes back as far as the figures
/// allow. Gives the worse of the figures, as a share of those of `anew`.
fn settle(
    kept: &mut Skeleton,
    held: &[Option<Point3<f64>>],
    anew: &Skeleton,
    prototype: &Prototype,
    settings: &config::Shape,
) -> f64 {
    let Prototype {
        skeleton: rest,
        envelope,
        trunk,
    } = prototype;
    let judge = Judge::of(rest, trunk, envelope, settings);
    let best = judge.of_both(anew);
    let of_anew = |tree: &Skeleton| judge.of_both(tree).as_share_of(&best);
    let straight_rad = (turning_back(anew) + NEXT_TO_STRAIGHT_RAD) / OF_ANEW - NEXT_TO_STRAIGHT_RAD;
    if of_anew(kept).worse() >= OF_ANEW && turning_back(kept) <= straight_rad {
        return of_anew(kept).worse();
    }
    let turned = turned_as_before(kept, held, anew, trunk);
    let mut tried = vec![
        Tried::of(kept.clone(), of_anew, held),
        Tried::of(turned.clone(), of_anew, held),
    ];
    let mut least = OF_ANEW;
    let mut chosen = None;
    for sigma in SIGMAS {
        let tether = Tether {
            stood: held,
            sigma_px: sigma * envelope.width(),
        };
        let of_this = tried.len();
        for from in [&*kept, &turned] {
            for terms in weights().take(WEIGHTS) {
                let mut pushed = from.clone();
                push_on(&mut pushed, trunk, envelope, settings, terms, tether);
                tried.push(Tried::of(pushed, of_anew, held));
            }
        }
        chosen = nearest(&tried[of_this..], least, straight_rad);
        if chosen.is_some() {
            break;
        }
    }
    if chosen.is_none() {
        chosen = nearest(&tried, least, f64::INFINITY);
    }
    if chosen.is_none() {
        least = OF_BEST * tried.iter().map(|t| t.worse).fold(0.0, f64::max);
        chosen = nearest(&tried, least, f64::INFINITY);
    }
    let Some(settled) = chosen else {
        return of_anew(kept).worse();
    };
    *kept = settled.clone();
    let had = of_anew(kept);
    let least = Achieved {
        filling: had.filling.min(least.max(OF_SETTLED * had.filling)),
        plausibility: had
            .plausibility
            .min(least.max(OF_SETTLED * had.plausibility)),
    };
    let straight_rad = straight_rad.max(turning_back(kept));
    let good_enough = |tree: &Skeleton| {
        let achieved = of_anew(tree);
        turning_back(tree) <= straight_rad
            && achieved.filling >= least.filling
            && achieved.plausibility >= least.plausibility
    };
    back_to_sides(kept, held, trunk, envelope, good_enough);
    of_anew(kept).worse()
}

/// A tree that was pushed on.
struct Tried {
    tree: Skeleton,
    /// The worse of its figures, as a share of what the tree that was pushed anew achieves.
    worse: f64,
    /// Sum of the [`squared_way`]s from where its nodes stood, px².
    off_px2: f64,
}

impl Tried {
    fn of(
        tree: Skeleton,
        of_anew: impl Fn(&Skeleton) -> Achieved,
        held: &[Option<Point3<f64>>],
    ) -> Self {
        let ways = tree
            .nodes
            .iter()
            .zip(held)
            .filter_map(|(n, stood)| Some(squared_way(n.position - (*stood)?)));
        Self {
            worse: of_anew(&tree).worse(),
            off_px2: ways.sum(),
            tree,
        }
    }
}

/// Of those that are good enough and turn back by no more than `straight_rad` the one that is
/// nearest to where it stood.
fn nearest(tried: &[Tried], least: f64, straight_rad: f64) -> Option<&Skeleton> {
    let good = tried
        .iter()
        .filter(|t| t.worse >= least && turning_back(&t.tree) <= straight_rad);
    good.min_by(|a, b| a.off_px2.total_cmp(&b.off_px2))
        .map(|t| &t.tree)
}
