//! What a tree's own branches say of the twigs that were too thin to be followed: self-similarity.
//!
//! Li 2011 sect. 3 after Shlyakhter et al. 2001, Tan et al. 2007 and Chen et al. 2008: a twig
//! is a small, turned copy of a part of the tree itself.

use super::branches::{continuations, direction};
use crate::bounds::Bounds;
use crate::model::Skeleton;
use crate::random::Generator;
use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand::seq::IndexedRandom;
use std::f64::consts::FRAC_PI_2;

/// Angles between a branch and what leaves it that are believed, rad; others are noise of the
/// skeleton.
const ANGLES: Bounds = Bounds::new(0.35, 1.15);
/// Reaches of side branches against that of what they leave that are believed.
const RATIOS: Bounds = Bounds::new(0.25, 0.6);
/// Both where the skeleton shows none.
const ANGLE_RAD: f64 = 0.75;
const RATIO: f64 = 0.45;
/// Branches of a part that is copied.
const PART_BRANCHES: std::ops::RangeInclusive<usize> = 2..=7;

/// A branch of a [`Part`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// The piece that it grows from the end of, earlier in the list.
    pub parent: Option<usize>,
    pub to: Vector3<f64>,
}

/// A branch with what it carries; it leaves the origin along +y and reaches 1 along its longest
/// way.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub pieces: Vec<Piece>,
}

/// The tree's way of branching.
#[derive(Clone, Debug)]
pub(super) struct BranchingStatistics {
    /// Branching angles of side branches, rad.
    pub angles: Vec<f64>,
    /// Their reaches as shares of the reach of what they leave.
    pub ratios: Vec<f64>,
    /// How much the last branches point up: mean sine of their slope, 0 to 1.
    pub lift: f64,
    pub parts: Vec<Part>,
    /// Longest way from each node to a tip above it, px.
    pub reach_px: Vec<f64>,
}

/// What is known of the branches of a skeleton, by node.
struct Measured<'a> {
    skeleton: &'a Skeleton,
    /// px.
    lengths: Vec<f64>,
    reach_px: Vec<f64>,
    children: Vec<Vec<usize>>,
}

impl<'a> Measured<'a> {
    fn of(skeleton: &'a Skeleton) -> Self {
        let nodes = &skeleton.nodes;
        let lengths: Vec<f64> = (0..nodes.len()).map(|i| length(skeleton, i)).collect();
        let mut reach_px = vec![0.0_f64; nodes.len()];
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
        for i in (0..nodes.len()).rev() {
            if let Some(p) = nodes[i].parent.map(|p| p.index()).filter(|&p| p < i) {
                reach_px[p] = reach_px[p].max(lengths[i] + reach_px[i]);
                children[p].push(i);
            }
        }
        Self {
            skeleton,
            lengths,
            reach_px,
            children,
        }
    }

    /// From the base of branch `i` to the farthest tip above it, px.
    fn whole_reach_px(&self, i: usize) -> f64 {
        self.lengths[i] + self.reach_px[i]
    }
}

impl BranchingStatistics {
    pub fn of(skeleton: &Skeleton) -> Self {
        let measured = Measured::of(skeleton);
        let goes_on = continuations(skeleton);
        // What a tree without enough forks is taken to be like.
        let (mut angles, mut ratios) = (vec![ANGLE_RAD], vec![RATIO]);
        let (mut parts, mut slopes) = (Vec::new(), Vec::new());
        for (i, node) in skeleton.nodes.iter().enumerate() {
            if node.copy_of.is_some() || node.level <= 1 {
                continue;
            }
            let Some(p) = node.parent.map(|p| p.index()) else {
                continue;
            };
            let (Some(own), Some(before)) = (direction(skeleton, i), direction(skeleton, p)) else {
                continue;
            };
            if goes_on[p].is_none_or(|on| on.index() != i) {
                let ratio = measured.whole_reach_px(i) / measured.reach_px[p];
                angles.push(ANGLES.clamp(own.angle(&before)));
                ratios.push(RATIOS.clamp(ratio));
            }
            if measured.children[i].is_empty() {
                slopes.push(own.y);
            }
            parts.extend(part(&measured, i));
        }
        if parts.is_empty() {
            parts.push(fork());
        }
        let lift = slopes.iter().sum::<f64>() / slopes.len().max(1) as f64;
        Self {
            angles,
            ratios,
            lift: lift.clamp(0.0, 1.0),
            parts,
            reach_px: measured.reach_px,
        }
    }

    pub fn angle(&self, random: &mut Generator) -> f64 {
        self.angles.choose(random).copied().unwrap_or(ANGLE_RAD)
    }

    pub fn ratio(&self, random: &mut Generator) -> f64 {
        self.ratios.choose(random).copied().unwrap_or(RATIO) * random.random_range(0.75..1.25)
    }
}

fn length(skeleton: &Skeleton, i: usize) -> f64 {
    let node = &skeleton.nodes[i];
    match node.parent {
        Some(p) if direction(skeleton, i).is_some() => {
            (node.position - skeleton.nodes[p.index()].position).norm()
        }
        _ => 0.0,
    }
}

/// Branch `base` with all above it, if it is a part worth copying: some branches, none of which
/// turns back.
fn part(measured: &Measured, base: usize) -> Option<Part> {
    let skeleton = measured.skeleton;
    let nodes = &skeleton.nodes;
    let along = direction(skeleton, base)?;
    let upright = UnitQuaternion::rotation_between(&along, &Vector3::y())?;
    let origin = nodes[nodes[base].parent?.index()].position;
    let all = some_branches(&measured.children, base)?;
    let mut pieces = Vec::with_capacity(all.len());
    for &i in &all {
        let parent = nodes[i].parent.map(|p| p.index()).filter(|_| i != base);
        let own = direction(skeleton, i)?;
        let before = parent.and_then(|p| direction(skeleton, p));
        if before.is_some_and(|b| b.angle(&own) > 0.8 * FRAC_PI_2) {
            return None;
        }
        pieces.push(Piece {
            parent: parent.and_then(|p| all.binary_search(&p).ok()),
            to: upright * (nodes[i].position - origin) / measured.whole_reach_px(base),
        });
    }
    Some(Part { pieces })
}

/// Branch `base` and all above it in rising order, if they are as many as [`PART_BRANCHES`] says.
fn some_branches(children: &[Vec<usize>], base: usize) -> Option<Vec<usize>> {
    let mut all = vec![base];
    let mut next = 0;
    while let Some(&from) = all.get(next) {
        all.extend(&children[from]);
        if all.len() > *PART_BRANCHES.end() {
            return None;
        }
        next += 1;
    }
    all.sort_unstable();
    PART_BRANCHES.contains(&all.len()).then_some(all)
}

/// A twig with two more, for trees that have no part to copy.
fn fork() -> Part {
    let ends = [
        (None, 0.0, 0.55),
        (Some(0), 0.2, 0.95),
        (Some(0), -0.15, 0.8),
    ];
    let pieces = ends.map(|(parent, x, y)| Piece {
        parent,
        to: Vector3::new(x, y, 0.0),
    });
    Part {
        pieces: pieces.into(),
    }
}
