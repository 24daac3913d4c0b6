//! Lines along branches for the shipped recording.

use arborcam::solve::Model;
use nalgebra::Point2;

/// Across the fork, where a wall is seen and no wood.
pub const ACROSS: [[f64; 2]; 2] = [[313.0, 250.0], [346.0, 245.0]];
/// From a limb into the sky.
pub const ALONG_SKY: [[f64; 2]; 2] = [[300.0, 200.0], [358.0, 200.0]];
/// Places on a stroke that are looked at.
const PLACES: u32 = 19;
/// Wood farther from a place than this is beside it, px.
const BESIDE_PX: f64 = 2.0;

/// On how many of 19 places on `stroke` the tree has wood.
pub fn covered(model: &Model, stroke: [[f64; 2]; 2]) -> usize {
    let wood = &model.wood.as_ref().expect("wood").branches;
    let [from, to] = stroke.map(Point2::from);
    let is_on_wood = |at: &Point2<f64>| {
        let mut pieces = wood.nodes.iter().filter_map(|node| {
            let base = wood.nodes[node.parent?].position_px;
            Some((base, node.position_px - base))
        });
        pieces.any(|(base, way)| {
            let share = (at - base).dot(&way) / way.norm_squared();
            (base + way * share.clamp(0.0, 1.0) - at).norm() < BESIDE_PX
        })
    };
    let places = (1..=PLACES).map(|k| from + (to - from) * f64::from(k) / f64::from(PLACES + 1));
    places.filter(is_on_wood).count()
}
