//! The sides on which the branches of a tree that goes on stood: towards the viewer or away, of the
//! plane of each.

use super::envelope::Envelope;
use super::push::{out_of_planes, plane_normal, subtrees};
use super::trunk::in_trunk;
use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};

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
    let (was, is) = (out_of_planes(kept, trunk), out_of_planes(anew, trunk));
    // The branch of the trunk, or of a copy's plane, that each node is on.
    let mut of_trunk: Vec<usize> = (0..kept.nodes.len()).collect();
    let mut alike = vec![0.0; kept.nodes.len()];
    for (i, node) in kept.nodes.iter().enumerate() {
        let parent = node.parent.map(|p| p.index());
        if let Some(p) = parent.filter(|&p| !in_trunk(trunk, p)) {
            of_trunk[i] = of_trunk[p];
        }
        if held.get(i).is_some_and(Option::is_some) {
            alike[of_trunk[i]] += was[i] * is[i];
        }
    }
    let mut turned = kept.clone();
    for (i, node) in turned.nodes.iter_mut().enumerate() {
        if in_trunk(trunk, i) {
            continue;
        }
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
    let subtrees = subtrees(tree);
    let mut order: Vec<usize> = (0..tree.nodes.len())
        .filter(|&i| !in_trunk(trunk, i))
        .collect();
    order.sort_by_key(|&i| (tree.nodes[i].level, i));
    for i in order {
        let Some(stood) = held.get(i).copied().flatten() else {
            continue;
        };
        let normal = plane_normal(tree.nodes[i].plane_angle);
        let is_px = out_of_planes(tree, trunk)[i];
        let back = WayBack::new(&tree.nodes[i].position, &stood, normal, is_px, envelope);
        if !back.changed_sides && !back.jumps {
            continue;
        }
        if let Some(better) = gone_back(tree, &back, &subtrees[i], envelope, &good_enough) {
            *tree = better;
        }
    }
}

/// From where a node is to where it stood, along the normal of its plane.
struct WayBack {
    normal: Vector3<f64>,
    /// How far the node is out of its plane, and the way back, px.
    is_px: f64,
    way_px: f64,
    changed_sides: bool,
    /// Whether it is seen to jump: the planes of copies are seen at an angle, and what is pushed
    /// along their normals moves in the picture.
    jumps: bool,
}

impl WayBack {
    fn new(
        at: &Point3<f64>,
        stood: &Point3<f64>,
        normal: Vector3<f64>,
        is_px: f64,
        envelope: &Envelope,
    ) -> Self {
        let (near_px, seen_px) = (ON_PLANE * envelope.width(), SEEN * envelope.width());
        let way_px = (stood - at).dot(&normal);
        Self {
            normal,
            is_px,
            way_px,
            changed_sides: is_px * (is_px + way_px) < 0.0 && way_px.abs() >= near_px,
            jumps: (way_px * normal.x).abs() > seen_px,
        }
    }

    /// Whether `share` of the way back leaves the node on the side where it stood.
    fn is_far_enough(&self, share: f64) -> bool {
        !self.changed_sides || (self.is_px + share * self.way_px) * self.is_px <= 0.0
    }
}

/// The tree with as much of the way back as it allows, taken by all of `subtree` or else by its
/// first node alone; `None` where it allows none.
fn gone_back(
    tree: &Skeleton,
    back: &WayBack,
    subtree: &[usize],
    envelope: &Envelope,
    good_enough: &impl Fn(&Skeleton) -> bool,
) -> Option<Skeleton> {
    for share in BACK {
        if !back.is_far_enough(share) {
            continue;
        }
        for moved in [subtree, &subtree[..1]] {
            let mut tried = tree.clone();
            for &k in moved {
                tried.nodes[k].position += back.normal * (share * back.way_px);
            }
            let inside = moved
                .iter()
                .all(|&k| envelope.contains(&tried.nodes[k].position));
            if inside && good_enough(&tried) {
                return Some(tried);
            }
        }
    }
    None
}
