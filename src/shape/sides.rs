//! The sides on which the branches of a tree that goes on stood: towards the viewer or away, of the
//! plane of each.

use super::envelope::Envelope;
use super::push::{out_of_planes, plane_normal, subtrees};
use crate::model::Skeleton;
use nalgebra::Point3;

/// A node so near to its plane stands on neither side, as a share of the tree's width.
const ON_PLANE: f64 = 0.02;
/// A copy that moves by more than this in the picture is seen to jump, as a share of the tree's
/// width.
const SEEN: f64 = 0.05;
/// Shares of the way back that are tried.
const BACK: [f64; 4] = [1.0, 0.75, 0.5, 0.25];

/// `kept` with the pushes of `anew`, those of each branch of the trunk in each plane mirrored if
/// that brings them nearer to what they were: a mirror image in its plane is as likely by eq. 4.
pub(super) fn turned_as_before(
    kept: &Skeleton,
    held: &[Option<Point3<f64>>],
    anew: &Skeleton,
    trunk: &[bool],
) -> Skeleton {
    let is_trunk = |i: usize| trunk.get(i).is_some_and(|t| *t);
    let (was, is) = (out_of_planes(kept, trunk), out_of_planes(anew, trunk));
    // The branch of the trunk, or of a copy's plane, that each node is on.
    let mut of_trunk: Vec<usize> = (0..kept.nodes.len()).collect();
    let mut alike = vec![0.0; kept.nodes.len()];
    for i in 0..kept.nodes.len() {
        if let Some(p) = kept.nodes[i]
            .parent
            .map(|p| p.index())
            .filter(|&p| !is_trunk(p))
        {
            of_trunk[i] = of_trunk[p];
        }
        if held.get(i).is_some_and(Option::is_some) {
            alike[of_trunk[i]] += was[i] * is[i];
        }
    }
    let mut turned = kept.clone();
    for (i, node) in turned
        .nodes
        .iter_mut()
        .enumerate()
        .filter(|(i, _)| !is_trunk(*i))
    {
        let side = if alike[of_trunk[i]] < 0.0 { -1.0 } else { 1.0 };
        node.position += plane_normal(node.plane_angle) * (side * is[i] - was[i]);
    }
    turned
}

/// Brings nodes that have changed sides back, from the root up, where the tree is still
/// `good_enough` then: each with all that hangs on it, or alone.
pub(super) fn back_to_sides(
    tree: &mut Skeleton,
    held: &[Option<Point3<f64>>],
    trunk: &[bool],
    envelope: &Envelope,
    good_enough: impl Fn(&Skeleton) -> bool,
) {
    let (near_px, seen_px) = (ON_PLANE * envelope.width(), SEEN * envelope.width());
    let subtrees = subtrees(tree);
    let mut order: Vec<usize> = (0..tree.nodes.len())
        .filter(|&i| !trunk.get(i).is_some_and(|t| *t))
        .collect();
    order.sort_by_key(|&i| (tree.nodes[i].level, i));
    for i in order {
        let Some(stood) = held.get(i).copied().flatten() else {
            continue;
        };
        let normal = plane_normal(tree.nodes[i].plane_angle);
        let way_px = (stood - tree.nodes[i].position).dot(&normal);
        let is_px = out_of_planes(tree, trunk)[i];
        let changed = is_px * (is_px + way_px) < 0.0 && way_px.abs() >= near_px;
        // The planes of copies are seen at an angle, and what is pushed along their normals moves
        // in the picture.
        let jumps = (way_px * normal.x).abs() > seen_px;
        if !changed && !jumps {
            continue;
        }
        let ways = BACK
            .iter()
            .filter(|&&share| !changed || (is_px + share * way_px) * is_px <= 0.0);
        let tries = ways.flat_map(|&share| [(share, &subtrees[i][..]), (share, &subtrees[i][..1])]);
        let back = tries.map(|(share, moved)| {
            let mut tried = tree.clone();
            moved
                .iter()
                .for_each(|&k| tried.nodes[k].position += normal * (share * way_px));
            (tried, moved)
        });
        let inside = |tried: &Skeleton, moved: &[usize]| {
            moved
                .iter()
                .all(|&k| envelope.contains(&tried.nodes[k].position))
        };
        let found = back
            .filter(|(tried, moved)| inside(tried, moved))
            .find(|(tried, _)| good_enough(tried));
        if let Some((tried, _)) = found {
            *tree = tried;
        }
    }
}
