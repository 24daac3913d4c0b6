//! From the flat skeleton to a tree in space (Li 2011 sect. 3).

mod angles;
mod bounds;
mod branches;
mod branching;
mod chain;
mod curl;
mod cylinders;
mod diener;
mod dressed;
mod envelope;
mod foliage;
mod hull;
mod keep;
mod leaves;
mod limb;
mod limbs;
mod measure;
mod mesh;
mod planes;
mod prototype;
mod push;
mod radius;
mod search;
mod settle;
mod sides;
mod skin;
mod term_weights;
mod topiary;
mod trunk;
mod trunk_radius;
mod tube;
mod twigs;
mod wood;

pub use angles::{Angles, expected_branching_angle};
pub use bounds::{Bounds, room};
pub use curl::CURL_BOUND;
pub use cylinders::{Cylinder, cylinders};
pub use diener::diener;
pub use dressed::Dressed;
pub use envelope::Envelope;
pub use foliage::{Foliage, FoliageGroup};
pub use keep::{Twin, on_foot, twins};
pub use leaves::{
    LeafView, Sampling, Season, Template, TemplateFault, TemplateMesh, density_match, foliage,
    foliage_by, leaf_cover, season, within_leaves,
};
pub use limb::{CenterlineSample, Limb};
pub use limbs::{limbs, thicken};
pub use measure::{PushFigures, side_symmetry};
pub use mesh::Mesh;
pub use planes::copy_to_planes;
pub use prototype::{Prototype, build};
pub use push::{PositionPrior, Terms, envelope_distance, push, push_on};
pub use radius::{PIPE_EXPONENTS, TIP_RADIUS_PX};
pub use settle::go_on;
pub use skin::SkinWeights;
pub use term_weights::tune_term_weights;
pub use topiary::{Cut, Drawn, Topiary, TopiaryError, coverage, topiary};
pub use trunk::{is_trunk, trunk};
pub use trunk_radius::trunk_radius_px;
pub use twigs::GrowthConstraint;
pub use wood::{LEVELS, bare_wood, wood, wood_levels};
