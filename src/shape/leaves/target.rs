//! The density that the leaves are to have: the frame's, or a drawn one.

use super::canvas::{Canvas, Grid, luma};
use super::colours::{Shares, shares};
use super::density::{SCALE, smoothed};
use super::{LeafView, PLAIN};
use crate::model::Skeleton;

/// Share of leaf from which on a cell's colour is that of leaves.
const PURE: f32 = 0.6;

/// What is wanted in every cell, and what is known of it.
pub(super) struct Target {
    pub grid: Grid,
    /// How much of the cell is to be covered, 0 to 1.
    pub wanted: Vec<f32>,
    /// The same, smoothed over a twentieth of the tree's height.
    pub density: Vec<f32>,
    /// Deviation of that, cells.
    pub sigma: f64,
    /// Colours with how much they are of leaves alone; empty without a picture.
    colours: Vec<([u8; 3], f32)>,
    mean: [u8; 3],
    /// Half of the leaves are darker (Li et al. B.1).
    middle_luma: f64,
}

impl Target {
    /// `None` where nothing says where leaves are to be.
    pub fn new(skeleton: &Skeleton, view: &LeafView, height: f64) -> Option<Self> {
        let grid = Grid::of(skeleton);
        let canvas = view.picture.zip(view.outline).and_then(|(p, o)| Canvas::new(grid, p, o));
        let seen: Option<Shares> = canvas.as_ref().map(shares);
        let drawn = view.density.and_then(|d| grid.reduced(&d.pixels, d.size, 1));
        let wanted: Vec<f32> = match (&drawn, &seen) {
            (Some(drawn), _) => drawn.iter().map(|&d| f32::from(d) / 255.0).collect(),
            (None, Some(seen)) => seen.leaf.clone(),
            (None, None) => return None,
        };
        let sigma = grid.length(SCALE * height);
        let density = smoothed(&wanted, grid.size.width as usize, sigma);
        let colours: Vec<([u8; 3], f32)> = match (&canvas, seen) {
            (Some(canvas), Some(seen)) => {
                let pure = pure(&seen.leaf, grid.size.width as usize);
                canvas.colours.iter().copied().zip(pure).collect()
            }
            _ => Vec::new(),
        };
        let mut lumas: Vec<f64> = colours.iter().filter(|c| c.1 > 0.5).map(|c| luma(c.0)).collect();
        lumas.sort_unstable_by(f64::total_cmp);
        let middle_luma = lumas.get(lumas.len() / 2).copied().unwrap_or(0.0);
        let mean = mean(colours.iter()).unwrap_or(PLAIN);
        Some(Self { grid, wanted, density, sigma, colours, mean, middle_luma })
    }

    /// Nothing wanted and nothing known.
    pub fn blank(grid: Grid) -> Self {
        let none = vec![0.0; grid.area()];
        Self {
            grid,
            density: none.clone(),
            wanted: none,
            sigma: 1.0,
            colours: Vec::new(),
            mean: PLAIN,
            middle_luma: 0.0,
        }
    }

    /// Colour of the leaves around a cell (sRGB); that of all where there are none.
    pub fn colour(&self, cell: [f64; 2], radius: f64) -> [u8; 3] {
        if self.colours.is_empty() {
            return self.mean;
        }
        let (w, h) = (self.grid.size.width as i64, self.grid.size.height as i64);
        let (u, v, radius) = (cell[0].round() as i64, cell[1].round() as i64, radius.round().clamp(0.0, 20.0) as i64);
        let found = [radius, 2 * radius + 2].into_iter().find_map(|r| {
            let rows = (v - r).max(0)..=(v + r).min(h - 1);
            let around = rows.flat_map(|y| ((u - r).max(0)..=(u + r).min(w - 1)).map(move |x| (y * w + x) as usize));
            mean(around.map(|i| &self.colours[i]))
        });
        found.unwrap_or(self.mean)
    }

    /// Whether a leaf seen there is of the brighter half.
    pub fn is_bright(&self, cell: [f64; 2]) -> bool {
        luma(self.colour(cell, 1.0)) > self.middle_luma
    }
}

/// How much of each cell and of the four beside it is leaf, 0 where that is less than [`PURE`]: at a leaf's edge the camera
/// mixes the sky in, and many cells that are hardly leaf would add up to a blue one.
fn pure(leaf: &[f32], width: usize) -> Vec<f32> {
    let at = |i: Option<usize>| i.and_then(|i| leaf.get(i)).copied().unwrap_or(0.0);
    let least = |i: usize| {
        let beside = [i.checked_sub(1), Some(i + 1), i.checked_sub(width), Some(i + width)];
        let least = beside.into_iter().map(at).fold(leaf[i], f32::min);
        if least < PURE { 0.0 } else { least }
    };
    (0..leaf.len()).map(least).collect()
}

/// Mean colour by weight; `None` where there is hardly any.
fn mean<'a>(colours: impl Iterator<Item = &'a ([u8; 3], f32)>) -> Option<[u8; 3]> {
    let (mut sum, mut weight) = ([0.0f64; 3], 0.0);
    for (colour, w) in colours {
        weight += f64::from(*w);
        colour.iter().zip(&mut sum).for_each(|(&c, s)| *s += f64::from(*w) * f64::from(c));
    }
    (weight > 0.5).then(|| sum.map(|s| (s / weight).round() as u8))
}
