//! From the skeleton to all that is drawn of a tree: wood now, leaves where the film shows them.

use super::leaves;
use crate::config::Config;
use crate::model::{Luma, Outline, Pose, Rgb, Skeleton};
use crate::shape::{Detail, Foliage, Limb, Mesh, Template, branches, limbs};

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

/// Everything that is drawn of a tree at rest.
#[derive(Clone, Debug, Default)]
pub struct Dressed {
    pub limbs: Vec<Limb>,
    /// The wood in falling levels of detail, at least one; all on the joints of the same skeleton.
    pub wood: Vec<Mesh>,
    pub foliage: Foliage,
    /// Colour of the bark as in a picture (sRGB).
    pub bark_rgb: [u8; 3],
}

/// Chance in the places of leaves: always the same.
const SEED: u64 = 0;

/// Dresses a skeleton.
pub fn dress(skeleton: &Skeleton, seen: Seen, config: &Config) -> Dressed {
    let wood = vec![branches(skeleton, Detail::for_budget(skeleton.nodes.len(), 60_000))];
    let limbs = limbs(skeleton);
    let foliage = leaves::foliage(&limbs, skeleton, &seen, &config.leaves, SEED);
    Dressed { limbs, wood, foliage, bark_rgb: [104, 84, 66] }
}
