//! Whether the picture shows a tree in leaf.

use super::canvas::{Canvas, Grid};
use super::colours::shares;
use super::density::{SCALE, smoothed};
use crate::model::{Outline, Rgb, Skeleton};

/// Above this share of the tree's height it is crown: below there is mostly trunk, in winter as in
/// summer.
const CROWN_SHARE: f64 = 0.35;
/// Half a tree in leaf has this density; the bare trees that were looked at have 0.23 and 0.40,
/// those in leaf 0.69 to 0.77.
const HALF: f64 = 0.55;
/// Over this difference of density the odds change by a factor of e.
const SPREAD: f64 = 0.05;

/// What the picture says about leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Season {
    /// Half of the crown's pixels have more tree around them than this, 0 to 1, at a twentieth of
    /// the tree's height.
    pub density: f64,
    /// How sure it is that the tree is in leaf, 0 to 1.
    pub in_leaf: f64,
}

/// Looks whether a tree is in leaf: around a pixel of a crown in leaf there is more tree, around
/// one of a bare crown there is mostly what stands behind. `None` where picture and outline say
/// nothing.
pub fn season(picture: &Rgb, outline: &Outline, skeleton: &Skeleton) -> Option<Season> {
    let canvas = Canvas::new(Grid::of(skeleton), picture, outline)?;
    let tree = shares(&canvas).tree;
    of_tree(&canvas, &tree)
}

pub(super) fn of_tree(canvas: &Canvas, tree: &[f32]) -> Option<Season> {
    let width = canvas.grid.size.width as usize;
    let (top, bottom) = canvas.rows();
    let height = (bottom + 1 - top) as f64;
    let limit = bottom as f64 - CROWN_SHARE * height;
    let around = smoothed(tree, width, SCALE * height);
    let mut found: Vec<f32> = Vec::new();
    for (i, share) in tree.iter().enumerate() {
        if ((i / width) as f64) < limit && *share > 0.5 {
            found.push(around[i]);
        }
    }
    found.sort_unstable_by(f32::total_cmp);
    let density = f64::from(*found.get(found.len() / 2)?);
    Some(Season {
        density,
        in_leaf: 1.0 / (1.0 + ((HALF - density) / SPREAD).exp()),
    })
}
