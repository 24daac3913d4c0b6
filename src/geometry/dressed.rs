//! A tree as it is drawn.

use super::foliage::Foliage;
use super::mesh::Mesh;
use crate::shape::Limb;

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
