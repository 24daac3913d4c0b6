//! The branches of the skeleton as curved limbs.

use super::curl::Curve;
use super::limb::{CenterlineSample, Grown, Limb};
use super::skin::SkinWeights;
use crate::model::{FARTHEST_PX, NodeId, NodeKind, Skeleton};
use crate::random::generator;
use nalgebra::Vector3;

/// Straight pieces of the middle line of a branch.
const PIECES: u32 = 12;
/// The same between two bends that were traced in a picture: they are near each other.
const TRACED_PIECES: u32 = 3;
/// Share of its excursions that a trunk keeps: it was filmed all along, and is as straight as it
/// looks.
const TRUNK_EXCURSIONS: f64 = 0.3;

/// The child that every branch goes on in: a thick one, by the tips above it, that is straight.
pub(super) fn continuations(skeleton: &Skeleton) -> Vec<Option<NodeId>> {
    let nodes = &skeleton.nodes;
    let mut tips = vec![0u32; nodes.len()];
    let mut best: Vec<Option<(bool, f64, NodeId)>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        tips[i] = tips[i].max(1);
        let Some(p) = node.parent.map(|p| p.index()).filter(|&p| p < i) else {
            continue;
        };
        tips[p] += tips[i];
        let Some(own) = direction(skeleton, i) else {
            continue;
        };
        let straight = direction(skeleton, p).map_or(0.0, |before| before.dot(&own));
        // A measured branch goes on in a measured one: its copies lie where nobody looked.
        let seen = node.copy_of.is_none() || nodes[p].copy_of.is_some();
        // As the pipe model makes it, and as chains of limbs are put together.
        let thick = f64::from(tips[i]).powf(0.4);
        let here = (seen, thick * (2.0 + straight), NodeId(i as u32));
        if best[p].is_none_or(|b| (here.0, here.1) >= (b.0, b.1)) {
            best[p] = Some(here);
        }
    }
    best.into_iter().map(|b| b.map(|(_, _, id)| id)).collect()
}

/// Direction of branch `i`, of length 1; `None` where it has no length, or its place is no number.
pub(super) fn direction(skeleton: &Skeleton, i: usize) -> Option<Vector3<f64>> {
    let node = skeleton.nodes.get(i)?;
    let parent = node.parent.filter(|p| p.index() < i)?;
    let from = skeleton.nodes.get(parent.index())?.position;
    let chord: Vector3<f64> = node.position - from;
    let mut coordinates = chord.iter().chain(from.iter());
    if !coordinates.all(|x| x.abs() <= FARTHEST_PX) {
        return None;
    }
    chord.try_normalize(1e-6)
}

/// The branches of the skeleton, parents first, curved by `curl` (0 to 1); those without length are
/// left out.
pub(super) fn branches(skeleton: &Skeleton, curl: f64, seed: u64) -> Vec<Grown> {
    let nodes = &skeleton.nodes;
    let goes_on = continuations(skeleton);
    let mut arrives: Vec<Vector3<f64>> = vec![Vector3::y(); nodes.len()];
    let mut limb_of: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut out: Vec<Grown> = Vec::new();
    for (i, node) in nodes.iter().enumerate().take(usize::from(u16::MAX) + 1) {
        let Some(parent) = node.parent.filter(|p| p.index() < i) else {
            continue;
        };
        let (own, grows_from) = (NodeId(i as u32), limb_of[parent.index()]);
        let before = arrives[parent.index()];
        limb_of[i] = grows_from;
        arrives[i] = before;
        let Some(along) = direction(skeleton, i) else {
            continue;
        };
        let next = goes_on[i].and_then(|k| direction(skeleton, k.index()));
        arrives[i] = arrival(along, next, curl);
        let leaves = match grows_from {
            // A trunk stands upright on the ground.
            None if along.y > 0.0 => Vector3::y(),
            None => along,
            Some(_) if goes_on[parent.index()] == Some(own) => before,
            Some(_) => side_departure(along, before),
        };
        let ends = [nodes[parent.index()].position, node.position];
        let mut random = generator(seed, node.name.0.into());
        let mut curve = Curve::new(ends, leaves, arrives[i], curl, &mut random);
        let is_traced = is_along_wood(skeleton, own);
        if is_traced {
            curve = curve.calmer(0.0);
        } else if grows_from.is_none() {
            curve = curve.calmer(TRUNK_EXCURSIONS);
        }
        let pieces = if is_traced { TRACED_PIECES } else { PIECES };
        limb_of[i] = Some(out.len());
        out.push(Grown {
            limb: Limb {
                node: own,
                parent: grows_from,
                twig: false,
                made_up: node.is_made_up(),
                samples: centerline(&curve, parent, own, pieces),
            },
            at: 1.0,
        });
    }
    out
}

/// Whether the piece of wood that ends in `node` was seen: it ends at a traced node, or begins at
/// one of the same branch.
fn is_along_wood(skeleton: &Skeleton, node: NodeId) -> bool {
    let own = &skeleton.nodes[node.index()];
    let begins_at_bend = own
        .parent
        .is_some_and(|p| skeleton.nodes[p.index()].moves_with == Some(node));
    own.kind == NodeKind::Traced || begins_at_bend
}

/// The direction in which a branch ends: halfway between its own and that of the branch that it
/// goes on in, so that no crease is left there.
fn arrival(along: Vector3<f64>, next: Option<Vector3<f64>>, curl: f64) -> Vector3<f64> {
    let smooth = (2.0 * curl).clamp(0.0, 1.0);
    next.and_then(|next| (along + next * smooth).try_normalize(0.1))
        .unwrap_or(along)
}

/// The direction in which a side branch begins: between that of what it grows from, `before`, and
/// its own; from a right angle on its own.
pub(super) fn side_departure(along: Vector3<f64>, before: Vector3<f64>) -> Vector3<f64> {
    (along + before * (0.5 * along.dot(&before).max(0.0)))
        .try_normalize(0.1)
        .unwrap_or(along)
}

/// The middle line of the branch from `parent` to `own`; how thick it is is not known yet.
fn centerline(curve: &Curve, parent: NodeId, own: NodeId, pieces: u32) -> Vec<CenterlineSample> {
    let mut samples = Vec::with_capacity(pieces as usize + 1);
    for k in 0..=pieces {
        let t = f64::from(k) / f64::from(pieces);
        samples.push(CenterlineSample {
            at: curve.at(t),
            radius: 0.0,
            skin: SkinWeights::between(parent, own, own_share(t)),
        });
    }
    samples
}

/// Share of the branch's own joint at share `t` of its length: none at the pivot, which neither
/// joint moves, all at its end.
///
/// A branch that has turned by a small angle a is so bent as a beam is that is held in its parent's
/// direction at its base and in its own child's at its end: off the straight line by `a (2 t^2 -
/// t^3)` of its length. Its bending angle follows the bending moment from piece to piece (Hu et al.
/// 2017, section 6, fig. 13), and it meets the next without a crease.
fn own_share(t: f64) -> f32 {
    let t = t.clamp(0.0, 1.0);
    (t * (2.0 - t)) as f32
}
