//! From the flat skeleton to a tree in space (Li et al. section 3).

mod cylinders;
mod envelope;
mod foliage;
mod keep;
mod limb;
mod mesh;
mod planes;
mod push;
mod radius;
mod tube;

pub use cylinders::{Cylinder, cylinders};
pub use envelope::Envelope;
pub use foliage::{Foliage, FoliageGroup};
pub use keep::{Twin, stand_as_before, twins};
pub use limb::{Limb, Riding, Station, limbs};
pub use mesh::{Detail, Mesh, branches};
pub use planes::copy_to_planes;
pub use push::{Terms, envelope_distance, mean_branching_angle, push};
pub use radius::pipe_model;

use crate::config;
use crate::model::{Outline, Skeleton};
use crate::skeleton::Node2d;

/// Copies, then pushes: the 3D skeleton of `flat`, with `tracks` points on each of its nodes.
pub fn build(flat: &[Node2d], tracks: &[u32], outline: &Outline, settings: &config::Shape) -> Skeleton {
    let foot_px = flat.first().map_or([0.0, 0.0], |n| n.position_px);
    let envelope = Envelope::of_revolution(outline, foot_px);
    let mut skeleton = copy_to_planes(flat, tracks, outline, &envelope, settings.planes);
    push(&mut skeleton, &envelope, settings, Terms::Both);
    skeleton
}
