//! From the skeleton to all that is drawn of a tree: wood, and leaves where the film shows them.

use super::bark;
use super::leaves::InLeaf;
use crate::config::{Config, EnvelopeKind};
use crate::model::{Luma, NodeId, Outline, Pose, Rgb, Skeleton};
use crate::motion;
use crate::shape::{Dressed, Envelope, Template, limbs, wood_levels};
use nalgebra::Point3;

/// What the film shows of the tree apart from its motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen<'a> {
    /// A whole frame in colour, and the tree's pose in it (`None`: the rest pose).
    pub picture: Option<&'a Rgb>,
    pub pose: Option<&'a Pose>,
    pub outline: Option<&'a Outline>,
    /// The drawn shape, in the picture, that the tree was cut to. It stands in the tree's place at
    /// rest.
    pub cut_to: Option<&'a Outline>,
    /// A leaf of the user's own, and a drawn density of the leaves, which goes before the
    /// picture's.
    pub leaf: Option<&'a Template>,
    pub density: Option<&'a Luma>,
}

/// How far each group of leaves swings in every pose, see [`flutter`](crate::motion::flutter).
pub fn flutter(
    dressed: &Dressed,
    poses: &[Pose],
    skeleton: &Skeleton,
    config: &Config,
) -> Vec<Vec<[f32; 2]>> {
    let groups: Vec<NodeId> = dressed.foliage.groups.iter().map(|g| g.node).collect();
    motion::flutter(poses, skeleton, &groups, &config.leaves)
}

/// Dresses a skeleton.
pub fn dress(skeleton: &Skeleton, seen: Seen, config: &Config) -> Dressed {
    let seed = config.wood.seed.into();
    let room = match seen.cut_to {
        Some(shape) => room(skeleton, Some(shape), Bounds::Drawn),
        None => room(
            skeleton,
            seen.outline,
            Bounds::Filmed(config.shape.envelope),
        ),
    };
    let in_leaf = InLeaf::of(skeleton, &seen, &config.leaves);
    let mut limbs = limbs(skeleton, &room, &config.wood, seed);
    if let Some(in_leaf) = &in_leaf {
        limbs = in_leaf.wood(limbs, skeleton, &seen);
    }
    let wood = wood_levels(&limbs, config.wood.triangles as usize);
    let bark = bark::colour(&seen, skeleton);
    let foliage = in_leaf
        .map(|l| l.foliage(&limbs, skeleton, &seen, &config.leaves, seed))
        .unwrap_or_default();
    Dressed {
        limbs,
        wood,
        foliage,
        bark_rgb: bark.unwrap_or(bark::PLAIN),
    }
}

/// What an outline says about the space that the tree stands in.
#[derive(Clone, Copy, Debug)]
pub(super) enum Bounds {
    /// It is a drawn shape that the tree was cut to.
    Drawn,
    Filmed(EnvelopeKind),
}

/// Where twigs may grow (from and to, model axes, px): within the envelope that the branches were
/// pushed to fill or were cut to, and not out of the outline itself as seen from the front;
/// everywhere where there is no outline.
pub(super) fn room<'a>(
    skeleton: &Skeleton,
    outline: Option<&'a Outline>,
    bounds: Bounds,
) -> impl Fn(&Point3<f64>, &Point3<f64>) -> bool + use<'a> {
    let foot_px = skeleton.foot_px;
    let envelope = outline.map(|outline| match bounds {
        Bounds::Drawn => Envelope::of_drawn(outline, foot_px),
        Bounds::Filmed(kind) => Envelope::of_filmed(kind, outline, foot_px, &places(skeleton)),
    });
    move |from: &Point3<f64>, to: &Point3<f64>| match (&envelope, outline) {
        (Some(envelope), Some(outline)) => {
            let middle = nalgebra::center(from, to);
            // A branch that is outside itself, as a copy may be, is no barer for it.
            envelope.contains(to)
                && envelope.contains(&middle)
                && (!is_seen_in(outline, foot_px, from)
                    || (is_seen_in(outline, foot_px, to) && is_seen_in(outline, foot_px, &middle)))
        }
        _ => true,
    }
}

/// Whether a place, model axes, px, is seen from the front in the outline of a tree whose foot is
/// at `foot_px` in the picture.
fn is_seen_in(outline: &Outline, foot_px: [f64; 2], p: &Point3<f64>) -> bool {
    outline.contains(foot_px[0] + p.x, foot_px[1] - p.y)
}

/// Where the measured nodes are, model axes, px.
pub(super) fn places(skeleton: &Skeleton) -> Vec<Point3<f64>> {
    skeleton.nodes[..skeleton.measured()]
        .iter()
        .map(|n| n.position)
        .collect()
}
