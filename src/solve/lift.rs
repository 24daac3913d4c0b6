//! From the hierarchy to the tree in space, with its radii.

use crate::config::Config;
use crate::model::{Foot, MotionHierarchy, NodeDepth, Outline, Skeleton};
use crate::{shape, skeleton};
use nalgebra::Point2;

/// Share of the outline's width at the foot that is trunk, where none can be measured above it.
const TRUNK_SHARE: f64 = 0.5;

/// Hierarchy to tree in space, with its thickness; the foot of its trunk is at `foot_px`. `depths` has
/// where a depth camera has seen each of the flat nodes, and may be empty.
pub fn lift_to_3d(
    hierarchy: &MotionHierarchy,
    foot_px: Point2<f64>,
    outline: &Outline,
    depths: &[Option<NodeDepth>],
    config: &Config,
) -> Skeleton {
    let (flat, tracks) = flat(hierarchy, foot_px, config);
    let mut skeleton = shape::build_seen(&flat, &tracks, outline, &config.shape, depths);
    assign_radii(&mut skeleton, outline, config);
    skeleton
}

/// The skeleton in the picture, and the number of points on every node.
pub(super) fn flat(
    hierarchy: &MotionHierarchy,
    foot_px: Point2<f64>,
    config: &Config,
) -> (Vec<skeleton::Node2d>, Vec<u32>) {
    let flat = skeleton::build(hierarchy, foot_px, &config.skeleton);
    let mut n_tracks = Vec::with_capacity(flat.len());
    for node in &flat {
        // The foot carries all.
        let cluster = node.cluster.map_or(0, |c| c.0 as usize);
        let cluster = hierarchy.clusters.get(cluster);
        n_tracks.push(cluster.map_or(0, |c| c.members.len() as u32));
    }
    (flat, n_tracks)
}

/// Radii, from the trunk's as it was given or as the outline shows it.
pub fn assign_radii(skeleton: &mut Skeleton, outline: &Outline, config: &Config) {
    let wood = &config.wood;
    let top_px = skeleton.nodes.get(1).map_or(skeleton.foot_px, |top| {
        skeleton.image_from_model(&top.position)
    });
    let measured = shape::trunk_radius_px(outline, skeleton.foot_px, top_px);
    let trunk_px = if wood.trunk_width_px > 0.0 {
        0.5 * wood.trunk_width_px
    } else if let Some(measured_px) = measured {
        measured_px
    } else {
        TRUNK_SHARE * Foot::of(outline, None).half_width_px
    };
    let trunk_px = trunk_px.max(2.0 * shape::TIP_RADIUS_PX);
    let room = shape::room(
        skeleton,
        Some(outline),
        shape::Silhouette::Filmed(config.shape.envelope),
    );
    shape::thicken(skeleton, trunk_px, &room, wood, wood.seed.into());
}
