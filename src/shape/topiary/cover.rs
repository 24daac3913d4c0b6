//! How much of a shape the tree covers, seen from the front.

use crate::model::{Outline, Skeleton};
use nalgebra::Point2;
use std::ops::Range;

/// A branch covers what is nearer to it than this share of the shape's larger side: about as far as
/// the leaves on it reach.
const REACH: f64 = 0.025;
/// The shape is looked at in cells of several pixels where its picture has a longer side than this,
/// px: the barest place is looked for anew after every branch.
const LONGEST_SIDE: u32 = 640;

/// Share of the pixels of `shape` that are within a fortieth of the shape's larger side of a branch
/// or of the trunk, in the front projection: 0 to 1.
pub fn coverage(skeleton: &Skeleton, shape: &Outline) -> f64 {
    let mut cover = Cover::of(shape);
    for node in &skeleton.nodes {
        if let Some(parent) = node.parent.and_then(|p| skeleton.nodes.get(p.index())) {
            cover.add([parent, node].map(|n| skeleton.image_from_model(&n.position)));
        }
    }
    cover.share()
}

/// Which cells of a shape are covered.
pub struct Cover {
    /// Side of a cell, px.
    cell: usize,
    width: usize,
    height: usize,
    /// 1 where the shape is and nothing covers it yet.
    bare: Vec<u8>,
    bare_count: usize,
    all: usize,
    /// In cells, as all lengths below.
    reach: f64,
}

impl Cover {
    pub fn of(shape: &Outline) -> Self {
        let larger = shape.bounds_px().map_or(0, |[left, top, right, bottom]| {
            (right - left).max(bottom - top) + 1
        });
        let size = shape.size;
        let cell = size.width.max(size.height).div_ceil(LONGEST_SIDE).max(1) as usize;
        let (width, height) = (size.width as usize / cell, size.height as usize / cell);
        // The pixel in the middle of a cell speaks for it.
        let mut bare: Vec<u8> = Vec::with_capacity(width * height);
        for row in 0..height {
            let first = (row * cell + cell / 2) * size.width as usize + cell / 2;
            for column in 0..width {
                bare.push(u8::from(shape.mask[first + column * cell] != 0));
            }
        }
        let all = bare.iter().filter(|b| **b != 0).count();
        let reach = (REACH * f64::from(larger) / cell as f64).max(1.0);
        Self {
            cell,
            width,
            height,
            bare,
            bare_count: all,
            all,
            reach,
        }
    }

    /// Covered share, 0 to 1.
    pub fn share(&self) -> f64 {
        1.0 - self.bare_count as f64 / self.all.max(1) as f64
    }

    /// Marks what a branch covers; its ends in px.
    pub fn add(&mut self, branch: [Point2<f64>; 2]) {
        for k in self.near(branch, self.reach) {
            self.bare_count -= usize::from(self.bare[k]);
            self.bare[k] = 0;
        }
    }

    /// Bare cells that a branch would cover; its ends in px.
    pub fn gain(&self, branch: [Point2<f64>; 2]) -> usize {
        let near = self.near(branch, self.reach);
        near.into_iter().map(|k| usize::from(self.bare[k])).sum()
    }

    /// Notes the bare cells near `at`, px, where nothing can be done.
    pub fn give_up(&self, at: Point2<f64>, given_up: &mut Vec<usize>) {
        let near = self.near([at, at], 0.5 * self.reach);
        given_up.extend(near.into_iter().filter(|&k| self.bare[k] != 0));
    }

    /// Cells within `reach` cells of a line, its ends in px.
    fn near(&self, ends_px: [Point2<f64>; 2], reach: f64) -> Vec<usize> {
        let mut near = Vec::new();
        let [a, b] = ends_px.map(|end| end.map(|x| (x - self.middle()) / self.cell as f64));
        if !a.iter().chain(b.iter()).all(|x| x.is_finite()) {
            return near;
        }
        let along = b - a;
        let length_sq = along.norm_squared().max(1e-12);
        for v in cells_about(a.y, b.y, reach, self.height) {
            for u in cells_about(a.x, b.x, reach, self.width) {
                let to = Point2::new(u as f64, v as f64) - a;
                let t = (along.dot(&to) / length_sq).clamp(0.0, 1.0);
                if (to - along * t).norm_squared() <= reach * reach {
                    near.push(v * self.width + u);
                }
            }
        }
        near
    }

    /// Of the pixel of a cell that speaks for it, from the cell's first, px.
    fn middle(&self) -> f64 {
        (self.cell / 2) as f64
    }

    /// The bare cell that is farthest from what is covered or outside (city blocks), those in
    /// `given_up` left out: its middle, px. `None` if no cell is bare.
    pub fn barest(&self, given_up: &[usize]) -> Option<Point2<f64>> {
        let (w, h) = (self.width, self.height);
        let mut far: Vec<u32> = self
            .bare
            .iter()
            .map(|b| if *b != 0 { u32::MAX } else { 0 })
            .collect();
        for &k in given_up {
            far[k] = 0;
        }
        for k in 0..far.len() {
            let before = if is_edge(k, w, h) {
                0
            } else {
                far[k - 1].min(far[k - w])
            };
            far[k] = far[k].min(before.saturating_add(1));
        }
        for k in (0..far.len()).rev() {
            let after = if is_edge(k, w, h) {
                0
            } else {
                far[k + 1].min(far[k + w])
            };
            far[k] = far[k].min(after.saturating_add(1));
        }
        let (k, _) = far
            .iter()
            .enumerate()
            .filter(|(_, d)| **d > 0)
            .max_by(|a, b| a.1.cmp(b.1).then(b.0.cmp(&a.0)))?;
        Some(Point2::new(k % w, k / w).map(|x| (x * self.cell) as f64 + self.middle()))
    }
}

/// Cells of a row or column of `count` within `reach` of the stretch between `a` and `b`.
fn cells_about(a: f64, b: f64, reach: f64, count: usize) -> Range<usize> {
    let (low, high) = (a.min(b) - reach, a.max(b) + reach);
    let end = (high.floor() + 1.0).clamp(0.0, count as f64);
    low.ceil().max(0.0) as usize..end as usize
}

/// Whether cell `k` of `w` by `h` is on the border.
fn is_edge(k: usize, w: usize, h: usize) -> bool {
    let (u, v) = (k % w, k / w);
    u == 0 || v == 0 || u + 1 == w || v + 1 == h
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    /// A disc, four fifths as high as the picture, in a picture of `side` px.
    fn disc(side: u32) -> Outline {
        let middle = f64::from(side) / 2.0;
        let mut mask = Vec::new();
        for v in 0..side {
            for u in 0..side {
                let off = (f64::from(u) - middle).hypot(f64::from(v) - middle);
                mask.push(u8::from(off <= 0.8 * middle) * 255);
            }
        }
        Outline {
            size: Size::new(side, side),
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        }
    }

    /// Number of cells, the barest place as shares of the side, and the share that a branch across
    /// the middle covers.
    fn covered(side: u32) -> (usize, Point2<f64>, f64) {
        let mut cover = Cover::of(&disc(side));
        let px = f64::from(side);
        let barest = cover.barest(&[]).unwrap().map(|x| x / px);
        cover.add([Point2::new(0.3, 0.5) * px, Point2::new(0.7, 0.5) * px]);
        (cover.bare.len(), barest, cover.share())
    }

    /// A film in 4K has nine times the pixels of one in HD, and every branch that is added looks at
    /// all.
    #[test]
    fn a_large_picture_is_looked_at_coarsely_and_gives_the_same() {
        let (cells, barest, share) = covered(600);
        let (cells_large, barest_large, share_large) = covered(4200);
        assert_eq!((cells, cells_large), (600 * 600, 600 * 600));
        assert!(
            (share / share_large - 1.0).abs() < 0.1 && share > 0.03,
            "{share} and {share_large}"
        );
        assert!(
            (barest - barest_large).iter().all(|c| c.abs() < 0.01),
            "{barest:?} and {barest_large:?}"
        );
        assert!(barest.iter().all(|c| (c - 0.5).abs() < 0.01), "{barest:?}");
    }
}
