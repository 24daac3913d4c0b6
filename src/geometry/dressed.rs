//! A tree as it is drawn.

use super::foliage::Foliage;
use super::mesh::Mesh;
use crate::model::Rgb;
use crate::shape::Limb;
use std::sync::Arc;

/// Everything that is drawn of a tree at rest.
#[derive(Clone, Debug, Default)]
pub struct Dressed {
    pub limbs: Vec<Limb>,
    /// The wood in falling levels of detail, at least one; all on the joints of the same skeleton.
    pub wood: Vec<Mesh>,
    pub foliage: Foliage,
    pub bark: Bark,
}

/// How the wood looks.
#[derive(Clone, Debug, Default)]
pub struct Bark {
    /// Mean colour as in a picture (sRGB).
    pub rgb: [u8; 3],
    /// The filmed bark, see [`Wood::bark`](crate::model::Wood); `None` where the film
    /// shows no trunk.
    pub tile: Option<Arc<Rgb>>,
    pub source: BarkSource,
}

/// Where the colour of the bark comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BarkSource {
    /// The pixels of the filmed trunk.
    Trunk,
    /// A guess: where the trunk should be in the picture, as no wood was seen.
    Picture,
    /// Nothing was seen.
    #[default]
    Nowhere,
}

impl BarkSource {
    /// One word for files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Trunk => "trunk",
            Self::Picture => "guess",
            Self::Nowhere => "none",
        }
    }
}

impl Dressed {
    /// From the foot to the highest place of wood and leaves, px; 0 where nothing is drawn.
    pub fn height_px(&self) -> f64 {
        let leaves = self.foliage.groups.iter().map(|g| &g.mesh);
        let drawn = self.wood.iter().take(1).chain(leaves);
        let heights = drawn
            .flat_map(|mesh| &mesh.positions)
            .map(|p| f64::from(p[1]));
        heights.filter(|y| y.is_finite()).fold(0.0, f64::max)
    }
}
