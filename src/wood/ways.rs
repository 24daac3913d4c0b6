//! The mask of wood as a graph of pixels, and the cheapest ways in it from the foot (Dijkstra 1959).

use super::mask::WoodMask;
use crate::model::Size;
use nalgebra::Point2;
use opencv::core::Mat;
use opencv::imgproc::{
    DIST_L2, DIST_MASK_5, MORPH_ELLIPSE, distance_transform_def, get_structuring_element,
};
use opencv::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// How much dearer a step along the edge of a branch is than one along its middle.
const OFF_MIDDLE: f32 = 6.0;
/// A pixel is as far off the middle as it is nearer to the edge than the best within so many
/// pixels.
const MIDDLE_WITHIN_PX: i32 = 21;
/// A step over a gap costs so much. No gap is wider than twice the reach unless what is in it moves
/// with the tree.
const GAP: f32 = 12.0;
const REACH_PX: f32 = 8.0;
/// The trunk's foot may lie in the shade or in grass: within this share of the picture's height the
/// way to it leads over anything.
const FOOT_SHARE: f64 = 0.3;

/// The mask as a graph of pixels.
pub(super) struct Grid<'a> {
    pub wood: &'a WoodMask,
    /// Distance from the edge of the wood, px; 0 outside.
    pub inside: Vec<f32>,
    /// Whether a way may lead there: wood, what is near to it, and what moves with the tree.
    passable: Vec<bool>,
    /// Of a step in the pixel.
    cost: Vec<f32>,
}

impl<'a> Grid<'a> {
    pub fn of(wood: &'a WoodMask) -> opencv::Result<Self> {
        let inside = distances(&wood.mask, wood.size)?;
        let inverse: Vec<u8> = wood.mask.iter().map(|m| 255 - m).collect();
        let outside = distances(&inverse, wood.size)?;
        let near = outside.iter().map(|outside| *outside <= REACH_PX);
        let passable = near.zip(&wood.moves).map(|(near, moves)| near || *moves);
        let middle = dilated(&inside, wood.size)?;
        let mut cost = Vec::with_capacity(inside.len());
        for (inside, middle) in inside.iter().zip(&middle) {
            cost.push(if *inside > 0.0 {
                1.0 + OFF_MIDDLE * (1.0 - inside / middle).powi(2)
            } else {
                GAP
            });
        }
        Ok(Self {
            wood,
            inside,
            passable: passable.collect(),
            cost,
        })
    }

    pub fn width(&self) -> usize {
        self.wood.size.width as usize
    }

    pub fn height(&self) -> usize {
        self.wood.size.height as usize
    }

    /// The pixel nearest to a place.
    pub fn nearest(&self, at: Point2<f64>) -> usize {
        let u = at.x.round().clamp(0.0, (self.width() - 1) as f64) as usize;
        let v = at.y.round().clamp(0.0, (self.height() - 1) as f64) as usize;
        v * self.width() + u
    }

    pub fn place(&self, pixel: usize) -> Point2<f64> {
        self.wood.place(pixel)
    }

    /// The pixels about `pixel`, and the length of the step to each.
    fn neighbours(&self, pixel: usize) -> impl Iterator<Item = Neighbour> {
        const AROUND: [(isize, isize); 8] = [
            (-1, -1),
            (0, -1),
            (1, -1),
            (-1, 0),
            (1, 0),
            (-1, 1),
            (0, 1),
            (1, 1),
        ];
        let (u, v) = (
            (pixel % self.width()) as isize,
            (pixel / self.width()) as isize,
        );
        let (width, height) = (self.width() as isize, self.height() as isize);
        AROUND.into_iter().filter_map(move |(du, dv)| {
            let (u, v) = (u + du, v + dv);
            let is_in = (0..width).contains(&u) && (0..height).contains(&v);
            is_in.then_some(Neighbour {
                pixel: (v * width + u) as usize,
                step: if du != 0 && dv != 0 {
                    std::f32::consts::SQRT_2
                } else {
                    1.0
                },
            })
        })
    }
}

struct Neighbour {
    pixel: usize,
    step: f32,
}

/// Distance of every pixel of a mask from its edge, px; 0 outside.
pub fn distances(mask: &[u8], size: Size) -> opencv::Result<Vec<f32>> {
    let mat = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, mask)?;
    let mut out = Mat::default();
    distance_transform_def(&mat, &mut out, DIST_L2, DIST_MASK_5)?;
    Ok(out.data_typed::<f32>()?.to_vec())
}

/// The greatest value about every pixel.
fn dilated(values: &[f32], size: Size) -> opencv::Result<Vec<f32>> {
    let mat = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, values)?;
    let side = opencv::core::Size::new(MIDDLE_WITHIN_PX, MIDDLE_WITHIN_PX);
    let middle = opencv::core::Point::new(-1, -1);
    let disc = get_structuring_element(MORPH_ELLIPSE, side, middle)?;
    let mut out = Mat::default();
    opencv::imgproc::dilate_def(&mat, &mut out, &disc)?;
    Ok(out.data_typed::<f32>()?.to_vec())
}

/// The cheapest ways from the foot.
pub(super) struct Ways {
    /// Of the way to each pixel; infinite where none leads.
    pub cost: Vec<f32>,
    /// The pixel before each on its way; itself at the foot.
    pub from: Vec<usize>,
}

/// A pixel that has been reached; the cheapest comes first out of a heap.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reached {
    cost: f32,
    pixel: usize,
}

impl Eq for Reached {}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        let order = other.cost.total_cmp(&self.cost);
        order.then_with(|| other.pixel.cmp(&self.pixel))
    }
}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ways {
    /// Dijkstra's algorithm.
    pub fn from(grid: &Grid, foot: usize) -> Self {
        let mut ways = Self {
            cost: vec![f32::INFINITY; grid.cost.len()],
            from: (0..grid.cost.len()).collect(),
        };
        let about_foot_px = FOOT_SHARE * grid.height() as f64;
        let foot_at = grid.place(foot);
        let mut heap = BinaryHeap::from([Reached {
            cost: 0.0,
            pixel: foot,
        }]);
        ways.cost[foot] = 0.0;
        while let Some(Reached { cost, pixel }) = heap.pop() {
            if cost > ways.cost[pixel] {
                continue;
            }
            for Neighbour { pixel: next, step } in grid.neighbours(pixel) {
                if !grid.passable[next] && (grid.place(next) - foot_at).norm() > about_foot_px {
                    continue;
                }
                let cost = cost + 0.5 * step * (grid.cost[pixel] + grid.cost[next]);
                if cost < ways.cost[next] {
                    (ways.cost[next], ways.from[next]) = (cost, pixel);
                    heap.push(Reached { cost, pixel: next });
                }
            }
        }
        ways
    }
}
