//! From the flat skeleton to a tree in space (Li et al. section 3).

mod angles;
mod bounds;
mod chain;
mod curl;
mod cylinders;
mod diener;
mod dressed;
mod envelope;
mod foliage;
mod fuse;
mod girth;
mod habit;
mod hull;
mod keep;
mod leaves;
mod limb;
mod measure;
mod mesh;
mod planes;
mod push;
mod radius;
mod search;
mod settle;
mod sides;
mod topiary;
mod trunk;
mod tube;
mod twigs;

pub use angles::{Angles, expected_branching_angle};
pub use bounds::{Bounds, room};
pub use curl::CURL_BOUND;
pub use cylinders::{Cylinder, cylinders};
pub use diener::diener;
pub use dressed::Dressed;
pub use envelope::Envelope;
pub use foliage::{Foliage, FoliageGroup};
pub use fuse::fuse;
pub use girth::trunk_radius_px;
pub use keep::{Twin, on_foot, twins};
pub use leaves::{
    LeafView, Sampling, Season, Template, TemplateFault, TemplateMesh, density_match, foliage,
    foliage_by, leaf_cover, season, within_leaves,
};
pub use limb::{Limb, Riding, Room, Station, limbs};
pub use measure::{PushFigures, side_symmetry};
pub use mesh::{LEVELS, Mesh, bare_wood, wood, wood_levels};
pub use planes::copy_to_planes;
pub use push::{Terms, Tether, envelope_distance, push, push_on};
pub use radius::{PIPE_EXPONENTS, TIP_RADIUS_PX, thicken};
pub use settle::go_on;
pub use topiary::{Cut, Drawn, Topiary, TopiaryError, coverage, topiary};
pub use trunk::{is_trunk, trunk};

use crate::config;
use crate::model::{Outline, Skeleton};
use crate::skeleton::Node2d;
use nalgebra::Point3;

/// Copies, then pushes: the 3D skeleton of `flat`, with `tracks` points on each of its nodes.
pub fn build(
    flat: &[Node2d],
    tracks: &[u32],
    outline: &Outline,
    settings: &config::Shape,
) -> Skeleton {
    let prototype = Prototype::of(flat, tracks, outline, settings);
    let mut skeleton = prototype.skeleton;
    fuse(
        &mut skeleton,
        &prototype.trunk,
        &prototype.envelope,
        settings,
    );
    skeleton
}

/// What is pushed: copies on their planes, and what bounds them.
pub struct Prototype {
    pub skeleton: Skeleton,
    pub envelope: Envelope,
    /// Which of the measured nodes are trunk.
    pub trunk: Vec<bool>,
}

impl Prototype {
    /// Copies `flat` to its planes in the envelope that the settings name.
    pub fn of(
        flat: &[Node2d],
        tracks: &[u32],
        outline: &Outline,
        settings: &config::Shape,
    ) -> Self {
        let foot_px = flat.first().map_or([0.0, 0.0], |n| n.position_px);
        let place = |n: &Node2d| {
            Point3::new(
                n.position_px[0] - foot_px[0],
                foot_px[1] - n.position_px[1],
                0.0,
            )
        };
        let places: Vec<Point3<f64>> = flat.iter().map(place).collect();
        let envelope = Envelope::of_filmed(settings.envelope, outline, foot_px, &places);
        let trunk = trunk(flat, settings.leader, &settings.leader_px);
        let skeleton = copy_to_planes(flat, tracks, &trunk, outline, &envelope, settings.planes);
        Self {
            skeleton,
            envelope,
            trunk,
        }
    }
}
