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
    /// The filmed bark as a tile that repeats without a seam, PNG: once round a limb, and as far
    /// along it as it is round. `None` where the film shows too little of the trunk.
    pub bark_png: Option<Vec<u8>>,
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
