//! A new flat tree stood up in space.

use crate::config::Config;
use crate::model::{NodeKind, Outline, Skeleton};
use crate::shape::{self, Silhouette, Terms};
use crate::skeleton::Node2d;

/// The tree of `flat` in space: copied to planes and pushed as a captured one is, by the `terms` of
/// its example, within `region`, in which it was grown, on a trunk of this radius, px.
pub fn stand_grown(
    flat: &[Node2d],
    region: &Outline,
    terms: Terms,
    trunk_radius_px: f64,
    config: &Config,
) -> Skeleton {
    let tracks = vec![0; flat.len()];
    let mut skeleton = shape::build_like(flat, &tracks, region, &config.shape, terms);
    for node in &mut skeleton.nodes {
        node.kind = NodeKind::Grown;
    }
    let silhouette = Silhouette::Filmed(config.shape.envelope);
    let room = shape::room(&skeleton, Some(region), silhouette);
    let seed = config.wood.seed.into();
    shape::thicken(&mut skeleton, trunk_radius_px, &room, &config.wood, seed);
    skeleton
}
