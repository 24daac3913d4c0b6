//! Branches outside of a shape are cut.

use super::drawn::TopiaryError;
use crate::model::{Node, NodeId, Skeleton};
use crate::shape::envelope::Envelope;
use nalgebra::Point3;

/// A branch of which less than this share is inside is not worth keeping.
const STUMP: f64 = 0.1;
/// The trunk may be led on to a shape that begins above it by this share of the shape's height.
const LED_ON: f64 = 0.5;
/// Steps in which the border is looked for along a branch.
const STEPS: u32 = 64;

/// What is left of a tree.
pub struct Pruned {
    pub skeleton: Skeleton,
    /// For every node that is left, which it was.
    pub kept: Vec<usize>,
    /// Branches that end at the border.
    pub shortened: usize,
}

/// Keeps of every branch what is inside of `envelope`, from its parent up; what grows beyond the
/// border is gone, and with a measured branch its copies. The trunk (levels 0 and 1) stays, with
/// its top inside.
pub fn cut(skeleton: &Skeleton, envelope: &Envelope) -> Result<Pruned, TopiaryError> {
    let mut nodes = skeleton.nodes.clone();
    // Whether a node is left, and whether anything may grow from it.
    let (mut is_left, mut goes_on) = (vec![true; nodes.len()], vec![true; nodes.len()]);
    let mut shortened = 0;
    for i in 0..nodes.len() {
        let (at, Some(parent)) = (nodes[i].position, nodes[i].parent.map(|p| p.index())) else {
            continue;
        };
        let from = nodes[parent].position;
        let original = nodes[i].copy_of.map_or(i, |o| o.index());
        let is_trunk = nodes[i].level < 2;
        is_left[i] = goes_on[parent]
            && is_left[original]
            && (is_trunk || at.coords.iter().all(|x| x.is_finite()));
        if !is_left[i] {
            goes_on[i] = false;
        } else if is_trunk {
            nodes[i].position = trunk_top(&from, &at, envelope)?;
        } else if !envelope.contains(&at) {
            let share = inside_share(&from, &at, envelope);
            (is_left[i], goes_on[i]) = (share >= STUMP, false);
            nodes[i].position = from + (at - from) * share;
            shortened += usize::from(is_left[i]);
        }
    }
    end_in_bends(&mut nodes, skeleton, &mut is_left);
    let kept: Vec<usize> = (0..nodes.len()).filter(|&i| is_left[i]).collect();
    let mut left = Vec::with_capacity(kept.len());
    for &i in &kept {
        let mut node = nodes[i].clone();
        node.parent = node.parent.map(|p| new_id(&kept, p));
        node.copy_of = node.copy_of.map(|c| new_id(&kept, c));
        node.moves_with = node.moves_with.map(|m| new_id(&kept, m));
        left.push(node);
    }
    Ok(Pruned {
        skeleton: Skeleton {
            nodes: left,
            ..skeleton.clone()
        },
        kept,
        shortened,
    })
}

/// A limb whose end is gone ends in its last bend that is left; where none is, its side wood is
/// gone, too, with all that grows from it.
fn end_in_bends(nodes: &mut [Node], skeleton: &Skeleton, is_left: &mut [bool]) {
    for branch in skeleton.moving_branches() {
        if is_left[branch.node.index()] || branch.riders.is_empty() {
            continue;
        }
        let mut bends = skeleton.ancestors(branch.node);
        let end = bends.find(|n| is_left[n.index()] || *n == branch.begin);
        let end = end.filter(|n| *n != branch.begin);
        for rider in &branch.riders {
            is_left[rider.index()] &= end.is_some();
            nodes[rider.index()].moves_with = end.filter(|end| end != rider);
        }
    }
    for (i, node) in nodes.iter().enumerate() {
        let mut holds_on = node.parent.iter().chain(&node.copy_of);
        is_left[i] &= holds_on.all(|n| is_left[n.index()]);
    }
}

/// What node `old` is among the nodes that are `kept`.
fn new_id(kept: &[usize], old: NodeId) -> NodeId {
    NodeId(kept.partition_point(|&k| k < old.index()) as u32)
}

/// Where the trunk ends: at its top if that is inside, else where it leaves the shape; a shape that
/// begins above it is led on to.
fn trunk_top(
    from: &Point3<f64>,
    at: &Point3<f64>,
    envelope: &Envelope,
) -> Result<Point3<f64>, TopiaryError> {
    if envelope.contains(at) {
        return Ok(*at);
    }
    for k in (1..=STEPS).rev() {
        let along = step(from, at, k);
        if envelope.contains(&along) {
            return Ok(along);
        }
    }
    let led_on = envelope.clamp(at);
    let near = (led_on - at).norm() <= LED_ON * envelope.height() && envelope.contains(&led_on);
    if near {
        Ok(led_on)
    } else {
        Err(TopiaryError::OffTree)
    }
}

/// Share of the way from `from` to `at` that lies inside without a break.
fn inside_share(from: &Point3<f64>, at: &Point3<f64>, envelope: &Envelope) -> f64 {
    (1..=STEPS)
        .take_while(|&k| envelope.contains(&step(from, at, k)))
        .last()
        .map_or(0.0, |k| f64::from(k) / f64::from(STEPS))
}

/// The place after step `k` of [`STEPS`] from `from` to `at`.
fn step(from: &Point3<f64>, at: &Point3<f64>, k: u32) -> Point3<f64> {
    from + (at - from) * (f64::from(k) / f64::from(STEPS))
}
