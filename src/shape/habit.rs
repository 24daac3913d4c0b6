//! What a tree's own branches say of the twigs that were too thin to be followed: self-similarity.
//!
//! Li et al. section 3 after Shlyakhter et al. 2001, Tan et al. 2007 and Chen et al. 2008: a twig
//! is a small, turned copy of a part of the tree itself.

use super::limb::{continuations, way};
use crate::model::Skeleton;
use crate::random::Generator;
use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand::seq::IndexedRandom;
use std::f64::consts::FRAC_PI_2;

/// Angles between a branch and what leaves it that are believed, rad; others are noise of the
/// skeleton.
const ANGLES: [f64; 2] = [0.35, 1.15];
/// Reaches of side branches against that of what they leave that are believed.
const RATIOS: [f64; 2] = [0.25, 0.6];
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
pub(super) struct Habit {
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

impl Habit {
    pub fn of(skeleton: &Skeleton) -> Self {
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
        let goes_on = continuations(skeleton);
        // What a tree without enough forks is taken to be like.
        let (mut angles, mut ratios, mut parts) = (vec![0.75], vec![0.45], vec![]);
        let mut slopes = Vec::new();
        for (i, node) in nodes
            .iter()
            .enumerate()
            .filter(|(_, n)| n.copy_of.is_none() && n.level > 1)
        {
            let Some(p) = node.parent.map(|p| p.index()) else {
                continue;
            };
            let (Some(own), Some(before)) = (way(skeleton, i), way(skeleton, p)) else {
                continue;
            };
            if goes_on[p].is_none_or(|on| on.index() != i) {
                angles.push(own.angle(&before).clamp(ANGLES[0], ANGLES[1]));
                ratios.push(((lengths[i] + reach_px[i]) / reach_px[p]).clamp(RATIOS[0], RATIOS[1]));
            }
            if children[i].is_empty() {
                slopes.push(own.y);
            }
            parts.extend(part(skeleton, &children, i, lengths[i] + reach_px[i]));
        }
        let lift = (slopes.iter().sum::<f64>() / slopes.len().max(1) as f64).clamp(0.0, 1.0);
        if parts.is_empty() {
            parts.push(fork());
        }
        Self {
            angles,
            ratios,
            lift,
            parts,
            reach_px,
        }
    }

    pub fn angle(&self, random: &mut Generator) -> f64 {
        self.angles.choose(random).copied().unwrap_or(0.75)
    }

    pub fn ratio(&self, random: &mut Generator) -> f64 {
        self.ratios.choose(random).copied().unwrap_or(0.45) * random.random_range(0.75..1.25)
    }
}

fn length(skeleton: &Skeleton, i: usize) -> f64 {
    let parent = skeleton.nodes[i]
        .parent
        .filter(|_| way(skeleton, i).is_some());
    parent.map_or(0.0, |p| {
        (skeleton.nodes[i].position - skeleton.nodes[p.index()].position).norm()
    })
}

/// Branch `base` with all above it, if it is a part worth copying: some branches, none of which
/// turns back.
fn part(skeleton: &Skeleton, children: &[Vec<usize>], base: usize, reach_px: f64) -> Option<Part> {
    let nodes = &skeleton.nodes;
    let along = way(skeleton, base)?;
    let upright = UnitQuaternion::rotation_between(&along, &Vector3::y())?;
    let origin = nodes[nodes[base].parent?.index()].position;
    let mut all = vec![base];
    for next in 0..=*PART_BRANCHES.end() {
        let Some(&from) = all.get(next) else { break };
        all.extend(&children[from]);
        if all.len() > *PART_BRANCHES.end() {
            return None;
        }
    }
    all.sort_unstable();
    let mut pieces = Vec::with_capacity(all.len());
    for &i in &all {
        let parent = nodes[i].parent.map(|p| p.index()).filter(|_| i != base);
        let own = way(skeleton, i)?;
        let before = parent.and_then(|p| way(skeleton, p));
        if before.is_some_and(|b| b.angle(&own) > 0.8 * FRAC_PI_2) {
            return None;
        }
        let place = parent.and_then(|p| all.binary_search(&p).ok());
        pieces.push(Piece {
            parent: place,
            to: upright * (nodes[i].position - origin) / reach_px,
        });
    }
    PART_BRANCHES
        .contains(&pieces.len())
        .then_some(Part { pieces })
}

/// A twig with two more, for trees that have no part to copy.
fn fork() -> Part {
    let piece = |parent, x: f64, y: f64| Piece {
        parent,
        to: Vector3::new(x, y, 0.0),
    };
    Part {
        pieces: vec![
            piece(None, 0.0, 0.55),
            piece(Some(0), 0.2, 0.95),
            piece(Some(0), -0.15, 0.8),
        ],
    }
}
