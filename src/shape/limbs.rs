//! All wood of a tree: its branches, then twigs, then how thick they are.

use super::branches::branches;
use super::limb::{Grown, Limb};
use super::radius;
use super::twigs::{self, GrowthConstraint};
use crate::config;
use crate::model::Skeleton;

/// The branches of the skeleton as curved limbs, those without length left out, then twigs, each
/// after what carries it.
///
/// The ends of branches do not move; in between they leave the straight line by at most
/// [`CURL_BOUND`](super::CURL_BOUND) of their length. Twigs grow where `room` allows it. Same seed,
/// same tree. The trunk is as thick as the skeleton says; what leaves it by the pipe model, see
/// [`thicken`].
pub fn limbs(
    skeleton: &Skeleton,
    room: GrowthConstraint,
    wood: &config::Wood,
    seed: u64,
) -> Vec<Limb> {
    let trunk_px = skeleton.nodes.get(1).map_or(0.0, |top| top.radius);
    let mut grown = piped(skeleton, trunk_px, room, wood, seed);
    radius::as_seen(&mut grown, skeleton);
    grown.into_iter().map(|g| g.limb).collect()
}

/// The same as thick as the pipe model says for a trunk of this radius, px, whatever radii the nodes
/// have.
fn piped(
    skeleton: &Skeleton,
    trunk_px: f64,
    room: GrowthConstraint,
    wood: &config::Wood,
    seed: u64,
) -> Vec<Grown> {
    let mut grown = branches(skeleton, wood.curl, seed);
    twigs::add(&mut grown, skeleton, room, wood, seed);
    radius::by_pipes(&mut grown, skeleton, trunk_px);
    grown
}

/// Gives every node the radius (px) of the branch that ends there, at the middle of its length:
/// `trunk_radius_px` for the trunk, thinner with every branch and twig that leaves, never below
/// [`TIP_RADIUS_PX`](super::TIP_RADIUS_PX) unless the trunk is. Twigs count as pipes: they are
/// those that [`limbs`] adds with the same arguments.
pub fn thicken(
    skeleton: &mut Skeleton,
    trunk_radius_px: f64,
    room: GrowthConstraint,
    wood: &config::Wood,
    seed: u64,
) {
    let trunk_px = radius::sound(trunk_radius_px);
    for node in &mut skeleton.nodes {
        node.radius = trunk_px;
    }
    let grown = piped(skeleton, trunk_px, room, wood, seed);
    for limb in grown.iter().map(|g| &g.limb).filter(|l| !l.twig) {
        let Some(node) = skeleton.nodes.get_mut(limb.node.index()) else {
            continue;
        };
        if node.level > 1 {
            node.radius = limb.samples[limb.samples.len() / 2].radius;
        }
    }
    for i in 0..skeleton.nodes.len() {
        let Some(parent) = skeleton.nodes[i].parent.filter(|p| p.index() < i) else {
            continue;
        };
        let parent_px = skeleton.nodes[parent.index()].radius;
        skeleton.nodes[i].radius = skeleton.nodes[i].radius.min(parent_px);
    }
}
