//! What wood stands before the leaves, seen from the front.

use super::canvas::Grid;
use super::carry::Carried;
use crate::model::{Pose, Skeleton};
use crate::shape::Limb;
use nalgebra::Point2;
use std::ops::Range;

/// Wider wood than this is no tree's, cells.
const WIDEST: f64 = 200.0;

/// Depth of the foremost wood in every cell (model axes in that pose, px); minus infinity where
/// there is none. A limb is drawn as balls along it, half a cell apart.
pub(super) fn front(
    limbs: &[Limb],
    skeleton: &Skeleton,
    pose: Option<&Pose>,
    grid: &Grid,
) -> Vec<f32> {
    let mut depth = vec![f32::NEG_INFINITY; grid.area()];
    let cell_px = 1.0 / grid.length(1.0).max(1e-9);
    for limb in limbs {
        let mut before: Option<Ball> = None;
        for sample in &limb.samples {
            let posed = Carried::by(&sample.skin, skeleton, pose).posed(&sample.at);
            let ball = Ball {
                cell: grid.cell_of(&posed),
                z: posed.z,
                radius_px: sample.radius.max(0.0),
            };
            if let Some(before) = before {
                draw_between(&mut depth, grid, &before, &ball, cell_px);
            }
            before = Some(ball);
        }
    }
    depth
}

/// A ball of wood as it is seen.
#[derive(Clone, Copy)]
struct Ball {
    cell: Point2<f64>,
    /// Of its middle, px.
    z: f64,
    radius_px: f64,
}

impl Ball {
    fn is_sound(&self) -> bool {
        [self.cell.x, self.cell.y, self.z, self.radius_px]
            .iter()
            .all(|x| x.is_finite())
    }

    /// Share `t` of the way from `self` to `other`.
    fn towards(&self, other: &Self, t: f64) -> Self {
        Self {
            cell: self.cell + (other.cell - self.cell) * t,
            z: self.z + (other.z - self.z) * t,
            radius_px: self.radius_px + (other.radius_px - self.radius_px) * t,
        }
    }

    fn draw(&self, depth: &mut [f32], grid: &Grid, cell_px: f64) {
        let radius = (self.radius_px / cell_px).clamp(0.5, WIDEST);
        let across = cells_within(self.cell.x, radius, grid.size.width);
        let down = cells_within(self.cell.y, radius, grid.size.height);
        for v in down {
            for u in across.clone() {
                let off_sq = (Point2::new(u as f64, v as f64) - self.cell).norm_squared();
                let height_sq = 1.0 - off_sq / (radius * radius);
                if height_sq >= 0.0 {
                    let cell = &mut depth[v * grid.size.width as usize + u];
                    *cell = cell.max((self.z + height_sq.sqrt() * self.radius_px) as f32);
                }
            }
        }
    }
}

/// Balls from `a` to `b`, half a cell apart.
fn draw_between(depth: &mut [f32], grid: &Grid, a: &Ball, b: &Ball, cell_px: f64) {
    let way = b.cell - a.cell;
    let way = way.x.hypot(way.y);
    // A limb as long as the picture is wide is drawn; one that a torn file makes longer is not.
    let longest = f64::from(grid.size.width.max(grid.size.height));
    if !a.is_sound() || !b.is_sound() || way > longest {
        return;
    }
    let steps = (2.0 * way).ceil().max(1.0) as usize;
    for k in 0..=steps {
        let t = k as f64 / steps as f64;
        a.towards(b, t).draw(depth, grid, cell_px);
    }
}

/// Those of `count` cells in a row that lie within `radius` of `at`; none may.
fn cells_within(at: f64, radius: f64, count: u32) -> Range<usize> {
    let low = (at - radius).ceil().max(0.0);
    let high = (at + radius).floor().min(f64::from(count) - 1.0);
    if low <= high {
        low as usize..high as usize + 1
    } else {
        0..0
    }
}
