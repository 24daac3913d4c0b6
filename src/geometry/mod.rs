//! What is drawn of a tree in space: its limbs as a mesh or as cylinders, and its leaves (Li 2011
//! app. B).

mod chain;
mod cylinders;
mod dressed;
mod foliage;
mod ground;
mod leaves;
mod mesh;
mod tube;
mod wood;

pub use cylinders::{Cylinder, cylinders_by_branch};
pub use dressed::{Bark, BarkSource, Dressed};
pub use foliage::{Foliage, FoliageGroup};
pub use ground::{GROUND_RGB, ground};
pub use leaves::{
    LeafColours, LeafView, Sampling, Season, Template, TemplateFault, TemplateMesh, density_match,
    foliage, foliage_by, leaf_cover, leaf_palette, season, within_leaves,
};
pub use mesh::Mesh;
pub use wood::{LEVELS, bare_wood, wood, wood_levels};
