//! From the skeleton to all that is drawn of a tree: wood, and leaves where the film shows them.

use super::bark;
use super::leaves::InLeaf;
use super::seen::Seen;
use crate::config::Config;
use crate::geometry::{Dressed, wood_levels};
use crate::model::{LeafSwing, NodeId, Pose, Skeleton};
use crate::motion;
use crate::shape::{Silhouette, limbs, room};

/// How far each group of leaves swings in every pose, see [`flutter`](crate::motion::flutter).
pub fn flutter(
    dressed: &Dressed,
    poses: &[Pose],
    skeleton: &Skeleton,
    config: &Config,
) -> Vec<Vec<LeafSwing>> {
    let groups: Vec<NodeId> = dressed.foliage.groups.iter().map(|g| g.node).collect();
    motion::flutter(poses, skeleton, &groups, &config.leaves)
}

/// Dresses a skeleton.
pub fn dress(skeleton: &Skeleton, seen: Seen, config: &Config) -> Dressed {
    let seed = config.wood.seed.into();
    let room = match seen.cut_to {
        Some(shape) => room(skeleton, Some(shape), Silhouette::Drawn),
        None => room(
            skeleton,
            seen.outline_at_rest.or(seen.outline),
            Silhouette::Filmed(config.shape.envelope),
        ),
    };
    let in_leaf = InLeaf::of(skeleton, &seen, &config.leaves);
    let mut limbs = limbs(skeleton, &room, &config.wood, seed);
    if let Some(in_leaf) = &in_leaf {
        limbs = in_leaf.wood(limbs, skeleton, &seen);
    }
    let wood = wood_levels(&limbs, config.wood.triangles as usize);
    let foliage = in_leaf
        .map(|l| l.foliage(&limbs, skeleton, &seen, &config.leaves, seed))
        .unwrap_or_default();
    Dressed {
        limbs,
        wood,
        foliage,
        bark: bark::of(&seen, skeleton),
    }
}
