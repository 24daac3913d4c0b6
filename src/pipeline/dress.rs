//! From the skeleton to all that is drawn of a tree: wood, and leaves where the film shows them.

use super::{bark, leaves};
use crate::config::Config;
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
    /// A leaf of the user's own, and a drawn density of the leaves, which goes before the picture's.
    pub leaf: Option<&'a Template>,
    pub density: Option<&'a Luma>,
}

/// How far each group of leaves swings in every pose, see [`flutter`](crate::motion::flutter).
pub fn flutter(dressed: &Dressed, poses: &[Pose], skeleton: &Skeleton, config: &Config) -> Vec<Vec<[f32; 2]>> {
    let groups: Vec<NodeId> = dressed.foliage.groups.iter().map(|g| g.node).collect();
    motion::flutter(poses, skeleton, &groups, &config.leaves)
}

/// Dresses a skeleton.
pub fn dress(skeleton: &Skeleton, seen: Seen, config: &Config) -> Dressed {
    let seed = config.wood.seed.into();
    let room = room(skeleton.foot_px, seen.outline);
    let limbs = limbs(skeleton, &room, &config.wood, seed);
    let wood = wood_levels(&limbs, config.wood.triangles as usize);
    let bark = bark::colour(&seen, skeleton);
    let foliage = leaves::foliage(&limbs, skeleton, &seen, &config.leaves, seed);
    Dressed { limbs, wood, foliage, bark_rgb: bark.unwrap_or(bark::PLAIN) }
}

/// Where twigs may grow (from and to, model axes, px): within the outline turned about its axis, and not out of the outline
/// itself as seen from the front; everywhere where there is no outline.
pub(super) fn room(foot_px: [f64; 2], outline: Option<&Outline>) -> impl Fn(&Point3<f64>, &Point3<f64>) -> bool {
    let envelope = outline.map(|outline| Envelope::of_revolution(outline, foot_px));
    move |from: &Point3<f64>, to: &Point3<f64>| match (&envelope, outline) {
        (Some(envelope), Some(outline)) => {
            let middle = nalgebra::center(from, to);
            let seen = |p: &Point3<f64>| outline.contains(foot_px[0] + p.x, foot_px[1] - p.y);
            // A branch that is outside itself, as a copy may be, is no barer for it.
            envelope.contains(to) && envelope.contains(&middle) && (!seen(from) || (seen(to) && seen(&middle)))
        }
        _ => true,
    }
}
