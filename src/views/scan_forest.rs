//! A forest of the trees in one point cloud, each at its place on the ground.

use super::drawn::DrawnTree;
use super::forest_plan::ForestPlan;
use crate::cloud::{CloudTree, CloudTrees};
use crate::document::ForestOrigin;
use crate::model::{Forest, ForestTree, Ground, Size};
use nalgebra::{Point2, Point3};

/// The ground reaches beyond the feet by this share of the highest tree.
const MARGIN_SHARE: f64 = 0.6;
/// Samples of the ground's height along each side.
const GROUND_SAMPLES: u32 = 65;

/// A tree of a cloud in its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct StandingTree {
    /// Its folder.
    name: String,
    /// Against the origin of the cloud, z up, m.
    foot: Point3<f64>,
    height_m: f64,
    metres_per_px: f64,
}

impl StandingTree {
    /// The tree `drawn`, in the folder `name`.
    pub fn of(name: String, tree: &CloudTree, drawn: &DrawnTree) -> Self {
        Self {
            name,
            foot: tree.nodes.first().map_or(Point3::origin(), |n| n.position),
            height_m: tree.figures.height_m,
            metres_per_px: drawn.note.config.export.metres_per_px,
        }
    }
}

/// The forest of `trees`, seen as each is by itself: the cloud's x axis to the right, its y axis away
/// from the viewer. `name` says where the cloud is from. `None` where there are no trees.
pub fn scan_forest(
    name: &str,
    trees: &[StandingTree],
    cloud: &CloudTrees,
    seed: u64,
) -> Option<ForestPlan> {
    let metres_per_px = trees.first()?.metres_per_px;
    let highest_m = trees.iter().map(|t| t.height_m).fold(0.0, f64::max);
    let plot = Plot::around(trees, MARGIN_SHARE * highest_m);
    let heights = plot.heights(trees, cloud);
    let bottom = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let top = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let relief_m = top - bottom;
    let relief = heights.iter().map(|z| (z - bottom) / relief_m.max(1e-9));
    let ground = Ground {
        width_m: plot.width_m,
        depth_m: plot.depth_m,
        relief_m,
        samples: Size::new(GROUND_SAMPLES, GROUND_SAMPLES),
        heights: relief
            .map(|share| (share * f64::from(u16::MAX)) as u16)
            .collect(),
    };
    let mut standing = Vec::with_capacity(trees.len());
    for (template, tree) in trees.iter().enumerate() {
        let at = tree.foot - plot.middle;
        standing.push(ForestTree {
            template,
            foot: Point3::new(at.x, tree.foot.z - bottom, -at.y),
            turn_rad: 0.0,
            scale: tree.metres_per_px / metres_per_px,
            ahead: 0,
        });
    }
    Some(ForestPlan {
        forest: Forest {
            trees: standing,
            ground,
            metres_per_px,
        },
        origin: ForestOrigin {
            example: name.to_owned(),
            seed,
            templates: trees.iter().map(|t| t.name.clone()).collect(),
            spacing_m: least_distance_m(trees),
            scale: "measured",
        },
    })
}

/// The rectangle that trees stand in.
struct Plot {
    /// At height 0.
    middle: Point3<f64>,
    width_m: f64,
    depth_m: f64,
}

impl Plot {
    fn around(trees: &[StandingTree], margin_m: f64) -> Self {
        let [x, y] = [0, 1].map(|axis| {
            let along = trees.iter().map(|t| t.foot[axis]);
            let low = along.clone().fold(f64::INFINITY, f64::min);
            Point2::new(low, along.fold(f64::NEG_INFINITY, f64::max))
        });
        Self {
            middle: Point3::new(0.5 * (x.x + x.y), 0.5 * (y.x + y.y), 0.0),
            width_m: x.y - x.x + 2.0 * margin_m,
            depth_m: y.y - y.x + 2.0 * margin_m,
        }
    }

    /// Heights of the ground, row by row, the farthest first; that of the lowest foot where no ground
    /// was scanned.
    fn heights(&self, trees: &[StandingTree], cloud: &CloudTrees) -> Vec<f64> {
        let lowest = trees.iter().map(|t| t.foot.z).fold(f64::INFINITY, f64::min);
        let last = f64::from(GROUND_SAMPLES - 1);
        let mut heights = Vec::new();
        for row in 0..GROUND_SAMPLES {
            for column in 0..GROUND_SAMPLES {
                let [across, along] = [column, row].map(|n| f64::from(n) / last - 0.5);
                let x = self.middle.x + across * self.width_m;
                let y = self.middle.y - along * self.depth_m;
                heights.push(cloud.ground_height_m(x, y).unwrap_or(lowest));
            }
        }
        heights
    }
}

/// The least distance between two trees; 0 where there is one.
fn least_distance_m(trees: &[StandingTree]) -> f64 {
    let mut least = f64::INFINITY;
    for (k, a) in trees.iter().enumerate() {
        for b in &trees[k + 1..] {
            least = least.min((a.foot - b.foot).xy().norm());
        }
    }
    if least.is_finite() { least } else { 0.0 }
}
