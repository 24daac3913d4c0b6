//! A tree that was drawn, or modelled elsewhere, stood up in space.

use super::reshape::reshape;
use crate::config::Config;
use crate::model::{Outline, Skeleton};
use crate::shape::{self, Silhouette};

/// The tree in space whose nodes, with their bends, are `flat` in the plane z = 0: copied to planes
/// and pushed as a captured one is, within `region`. Where its radii are not known they follow from
/// the pipe model.
pub fn stand_drawn(
    flat: &Skeleton,
    has_radii: bool,
    region: &Outline,
    config: &Config,
) -> Skeleton {
    let mut skeleton = reshape(flat, region, config);
    if !has_radii {
        thickened(&mut skeleton, region, config);
        return skeleton;
    }
    for i in 0..skeleton.nodes.len() {
        let original = skeleton.nodes[i].copy_of.map_or(i, |of| of.index());
        if let Some(drawn) = flat.nodes.get(original) {
            skeleton.nodes[i].radius = drawn.radius;
        }
    }
    skeleton
}

/// Gives a tree within `region` the radii of the pipe model.
pub fn thickened(skeleton: &mut Skeleton, region: &Outline, config: &Config) {
    let silhouette = Silhouette::Filmed(config.shape.envelope);
    let room = shape::room(skeleton, Some(region), silhouette);
    let trunk_px = trunk_radius_px(skeleton, config);
    let seed = config.wood.seed.into();
    shape::thicken(skeleton, trunk_px, &room, &config.wood, seed);
}

/// The radius of the trunk that carries all tips of the tree, px: as thick in section as all last
/// twigs together (Leonardo's rule).
fn trunk_radius_px(skeleton: &Skeleton, config: &Config) -> f64 {
    if config.wood.trunk_width_px > 0.0 {
        return 0.5 * config.wood.trunk_width_px;
    }
    let tips = skeleton.children().iter().filter(|c| c.is_empty()).count();
    let tip_px = shape::TIP_RADIUS_PX * f64::from(skeleton.image_size.width) / 640.0;
    tip_px * (tips as f64).sqrt()
}
