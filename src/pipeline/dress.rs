//! From the skeleton to all that is drawn of a tree: wood now, leaves where the film shows them.

use super::bark;
use crate::config::Config;
use crate::model::{Outline, Pose, Rgb, Skeleton};
use crate::shape::{Detail, Foliage, Limb, Mesh, branches, limbs};

/// Triangles of the wood at most.
const TRIANGLES: usize = 60_000;

/// What the film shows of the tree apart from its motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen<'a> {
    /// A whole frame in colour, and the tree's pose in it (`None`: the rest pose).
    pub picture: Option<&'a Rgb>,
    pub pose: Option<&'a Pose>,
    pub outline: Option<&'a Outline>,
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

/// Dresses a skeleton.
pub fn dress(skeleton: &Skeleton, seen: Seen, _config: &Config) -> Dressed {
    Dressed {
        limbs: limbs(skeleton),
        wood: vec![branches(skeleton, Detail::for_budget(skeleton.nodes.len(), TRIANGLES))],
        foliage: Foliage::default(),
        bark_rgb: bark::colour(&seen, skeleton).unwrap_or(bark::PLAIN),
    }
}
