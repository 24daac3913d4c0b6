//! The density that the leaves are to have: the frame's, or a drawn one.

use super::canvas::{Canvas, Grid, luma};
use super::colours::{Shares, shares, smooth_step};
use super::density::{SCALE, smoothed};
use super::mixture::Mixture;
use super::view::{LeafColours, LeafView, PLAIN};
use crate::model::Skeleton;
use crate::random::seed_of_part;
use nalgebra::{Point2, Vector2};

/// Share of leaf from which on a cell's colour is that of leaves.
const PURE: f32 = 0.6;
/// Colour tells a cell apart with some doubt, and the sum of the doubts would be missing: what is
/// these shares leaf in a cell and those around it is not leaf, or wholly.
const NOT_LEAF: f32 = 0.3;
const WHOLLY_LEAF: f32 = 0.6;
/// Where less than this share of the leaves has colours of its own, leaf and background cannot be
/// told apart by them.
const LEAST_KEPT: f32 = 0.5;
/// Hues farther from the leaves' middle one than so many deviations belong to what is seen between
/// them.
const STRANGE: f64 = 3.5;
/// Rounds in which they are looked for at most.
const MOST_ROUNDS: usize = 5;
/// The film's light and shade are in the colours already, and a viewer's own come on top: of their
/// ratio to the mean this power is kept.
const SHADING: f64 = 0.65;

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
    /// The cells that have colours of leaves, where any leaf may have the colour of any of them;
    /// else none.
    palette: Vec<usize>,
    mean: [u8; 3],
    /// Half of the leaves are darker (Li 2011 app. B.1).
    middle_luma: f64,
    mean_luma: f64,
    /// What gives softened colours the mean of the film's back.
    brighter: f64,
}

impl Target {
    /// `None` where nothing says where leaves are to be.
    pub fn new(skeleton: &Skeleton, view: &LeafView, height: f64) -> Option<Self> {
        let grid = Grid::of(skeleton);
        let canvas = view
            .picture
            .zip(view.outline)
            .and_then(|(p, o)| Canvas::new(grid, p, o));
        let shares = canvas.as_ref().map(shares);
        let wanted = match drawn_density(view, &grid) {
            Some(drawn) => drawn,
            None => filmed_density(&shares.as_ref()?.leaf, &grid),
        };
        let sigma = grid.length(SCALE * height);
        let density = smoothed(&wanted, grid.size.width as usize, sigma);
        let colours = match (canvas, shares) {
            (Some(canvas), Some(shares)) if view.colours != LeafColours::Plain => {
                leaf_colours(&canvas, &shares)
            }
            _ => Vec::new(),
        };
        let lumas = Lumas::of(&colours);
        let palette = match view.colours {
            LeafColours::Anywhere => leafy(&colours),
            LeafColours::InPlace | LeafColours::Plain => Vec::new(),
        };
        Some(Self {
            palette,
            grid,
            wanted,
            density,
            sigma,
            mean: mean(colours.iter()).unwrap_or(PLAIN),
            colours,
            middle_luma: lumas.middle,
            mean_luma: lumas.mean,
            brighter: lumas.brighter,
        })
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
            palette: Vec::new(),
            mean: PLAIN,
            middle_luma: 0.0,
            mean_luma: 0.0,
            brighter: 1.0,
        }
    }

    /// Colour of the leaves around a cell (sRGB); that of all where there are none.
    pub fn colour(&self, cell: Point2<f64>, radius: f64) -> [u8; 3] {
        if self.colours.is_empty() {
            return self.mean;
        }
        let cell = self.seen_for(cell);
        let (w, h) = (self.grid.size.width as i64, self.grid.size.height as i64);
        let (u, v, radius) = (
            cell.x.round() as i64,
            cell.y.round() as i64,
            radius.round().clamp(0.0, 20.0) as i64,
        );
        let found = [radius, 2 * radius + 2].into_iter().find_map(|r| {
            let rows = (v - r).max(0)..=(v + r).min(h - 1);
            let around = rows.flat_map(|y| {
                ((u - r).max(0)..=(u + r).min(w - 1)).map(move |x| (y * w + x) as usize)
            });
            mean(around.map(|i| &self.colours[i]))
        });
        found.unwrap_or(self.mean)
    }

    /// The cell whose colour a leaf in another one has. Of a tree that was given another shape it is
    /// any that shows leaves: in their own places the old crown with its light and shade would be
    /// seen in the new one, and all beside it would be of one colour.
    fn seen_for(&self, cell: Point2<f64>) -> Point2<f64> {
        let count = self.palette.len() as u64;
        if count == 0 {
            return cell;
        }
        let width = self.grid.size.width as usize;
        let seen = self.palette[(self.chance_at(cell) % count) as usize];
        Point2::new((seen % width) as f64, (seen / width) as f64)
    }

    /// A number by chance, the same for all that lies in a cell.
    fn chance_at(&self, cell: Point2<f64>) -> u64 {
        let width = i64::from(self.grid.size.width);
        let place = cell.y.round() as i64 * width + cell.x.round() as i64;
        seed_of_part(0, place as u64)
    }

    /// Whether the picture shows colours of leaves.
    pub fn has_colours(&self) -> bool {
        !self.colours.is_empty()
    }

    /// The colour around a cell with its light and shade softened, channels 0 to 255.
    pub fn soft_colour(&self, cell: Point2<f64>, radius: f64) -> [f64; 3] {
        let colour = self.colour(cell, radius);
        let luma = luma(colour).max(1.0);
        let share = if self.mean_luma > 0.0 {
            self.brighter * softened(luma, self.mean_luma) / luma
        } else {
            1.0
        };
        colour.map(|c| f64::from(c) * share)
    }

    /// Whether a leaf seen there is of the brighter half; by chance where no colours are known.
    pub fn is_bright(&self, cell: Point2<f64>) -> bool {
        if self.colours.is_empty() {
            return self.chance_at(cell).is_multiple_of(2);
        }
        luma(self.colour(cell, 1.0)) > self.middle_luma
    }
}

/// The density that was drawn, 0 to 1.
fn drawn_density(view: &LeafView, grid: &Grid) -> Option<Vec<f32>> {
    let drawn = view.density?;
    let cells = grid.reduced(&drawn.pixels, drawn.size, 1)?;
    Some(cells.iter().map(|&d| f32::from(d) / 255.0).collect())
}

/// The density of what is `leaf` in the picture, without what is so with some doubt.
fn filmed_density(leaf: &[f32], grid: &Grid) -> Vec<f32> {
    smoothed(leaf, grid.size.width as usize, 1.0)
        .iter()
        .map(|&p| smooth_step(NOT_LEAF, WHOLLY_LEAF, p))
        .collect()
}

/// The colour of every cell with how much it is of leaves alone.
fn leaf_colours(canvas: &Canvas, shares: &Shares) -> Vec<([u8; 3], f32)> {
    let pure = pure(&shares.leaf, canvas.grid.size.width as usize);
    let mut colours: Vec<([u8; 3], f32)> = canvas.colours.iter().copied().zip(pure).collect();
    without_background(&mut colours, &shares.beside);
    without_strangers(&mut colours);
    colours
}

/// The cells that have colours of leaves.
fn leafy(colours: &[([u8; 3], f32)]) -> Vec<usize> {
    let cells = colours.iter().enumerate();
    cells.filter(|(_, c)| c.1 > 0.5).map(|(i, _)| i).collect()
}

/// How bright the leaves are.
struct Lumas {
    middle: f64,
    mean: f64,
    /// What gives softened colours the mean of the film's back.
    brighter: f64,
}

impl Lumas {
    fn of(colours: &[([u8; 3], f32)]) -> Self {
        let mut lumas: Vec<f64> = colours
            .iter()
            .filter(|c| c.1 > 0.5)
            .map(|c| luma(c.0))
            .collect();
        lumas.sort_unstable_by(f64::total_cmp);
        let count = lumas.len().max(1) as f64;
        let mean = lumas.iter().sum::<f64>() / count;
        let soft = lumas.iter().map(|l| softened(*l, mean)).sum::<f64>() / count;
        Self {
            middle: lumas.get(lumas.len() / 2).copied().unwrap_or(0.0),
            mean,
            brighter: if soft > 0.0 { mean / soft } else { 1.0 },
        }
    }
}

/// How much of each cell and of the four beside it is leaf, 0 where that is less than [`PURE`]: at
/// a leaf's edge the camera mixes the sky in, and many cells that are hardly leaf would add up to a
/// blue one.
fn pure(leaf: &[f32], width: usize) -> Vec<f32> {
    let mut pure = Vec::with_capacity(leaf.len());
    for (i, &own) in leaf.iter().enumerate() {
        let beside = [
            i.checked_sub(1),
            Some(i + 1),
            i.checked_sub(width),
            Some(i + width),
        ];
        let mut least = own;
        for cell in beside {
            let share = cell.and_then(|k| leaf.get(k)).copied().unwrap_or(0.0);
            least = least.min(share);
        }
        pure.push(if least < PURE { 0.0 } else { least });
    }
    pure
}

fn softened(luma: f64, mean: f64) -> f64 {
    mean * (luma / mean.max(1.0)).max(0.0).powf(SHADING)
}

/// Takes the weight of colours that are rather those of what is seen `beside` the tree: a cell that
/// is told apart by steps of 16 may still be a grey of the wall behind. Where the two have their
/// colours in common all stay.
fn without_background(colours: &mut [([u8; 3], f32)], beside: &[bool]) {
    let leaf = colours.iter().filter(|c| c.1 > 0.5).map(|c| c.0);
    let background = colours.iter().zip(beside).filter(|(_, b)| **b);
    let (Some(leaf), Some(background)) = (
        Mixture::of(leaf.collect()),
        Mixture::of(background.map(|(c, _)| c.0).collect()),
    ) else {
        return;
    };
    let mut kept: Vec<f32> = Vec::with_capacity(colours.len());
    for (colour, weight) in colours.iter() {
        let is_leaf = *weight > 0.0 && leaf.density(*colour) > background.density(*colour);
        kept.push(if is_leaf { *weight } else { 0.0 });
    }
    let before: f32 = colours.iter().map(|c| c.1).sum();
    if kept.iter().sum::<f32>() < LEAST_KEPT * before {
        return;
    }
    for (colour, kept) in colours.iter_mut().zip(kept) {
        colour.1 = kept;
    }
}

/// Takes the weight of colours whose hue is none of the leaves': what is seen between them can have
/// colours that are found nowhere outside. By median and median deviation, so that autumn may have
/// all of its hues; again without those that were found, as long as there are any: they widen the
/// deviation.
fn without_strangers(colours: &mut [([u8; 3], f32)]) {
    for k in 0..2 {
        for _ in 0..MOST_ROUNDS {
            if !take_strangers(colours, k) {
                break;
            }
        }
    }
}

/// One round of [`without_strangers`] by part `k` of the hue; whether any were found.
fn take_strangers(colours: &mut [([u8; 3], f32)], k: usize) -> bool {
    let mut hues: Vec<f64> = colours
        .iter()
        .filter(|c| c.1 > 0.5)
        .map(|c| hue(c.0)[k])
        .collect();
    let Some(middle) = median(&mut hues) else {
        return false;
    };
    for hue in &mut hues {
        *hue = (*hue - middle).abs();
    }
    // 1.4826: from the median deviation to the standard one of a normal distribution; below a
    // step of 8 bits all is noise.
    let most = STRANGE * (1.4826 * median(&mut hues).unwrap_or(0.0)).max(0.02);
    let mut found = false;
    for (colour, weight) in colours.iter_mut() {
        if *weight > 0.0 && (hue(*colour)[k] - middle).abs() > most {
            *weight = 0.0;
            found = true;
        }
    }
    found
}

/// How much redder and bluer than green a colour is, as shares of its brightness; of dark colours,
/// whose hue is noise, less.
fn hue(colour: [u8; 3]) -> Vector2<f64> {
    let [r, g, b] = colour.map(|c| f64::from(c) + 4.0);
    Vector2::new((r - g) / (r + g + b), (b - g) / (r + g + b))
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Mean colour by weight; `None` where there is hardly any.
fn mean<'a>(colours: impl Iterator<Item = &'a ([u8; 3], f32)>) -> Option<[u8; 3]> {
    let (mut sum, mut weight) = ([0.0f64; 3], 0.0);
    for (colour, w) in colours {
        weight += f64::from(*w);
        for (s, &c) in sum.iter_mut().zip(colour) {
            *s += f64::from(*w) * f64::from(c);
        }
    }
    (weight > 0.5).then(|| sum.map(|s| (s / weight).round() as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of leaf, of which a few are those of a wall that is seen between them, then the wall
    /// beside the tree.
    fn before_wall(leaf: fn(u8) -> [u8; 3], wall: [u8; 3]) -> (Vec<([u8; 3], f32)>, Vec<bool>) {
        let (mut colours, mut beside) = (Vec::new(), Vec::new());
        for k in 0..200_u8 {
            colours.push((leaf(k), 0.9));
            beside.push(false);
        }
        for k in 0..110_u8 {
            let [r, g, b] = wall;
            let is_beside = k >= 10;
            colours.push((
                [r + k % 5, g + k % 4, b + k % 3],
                if is_beside { 0.0 } else { 0.7 },
            ));
            beside.push(is_beside);
        }
        (colours, beside)
    }

    fn green(k: u8) -> [u8; 3] {
        [24 + k / 4, 40 + k / 3, 14 + k / 6]
    }

    #[test]
    fn the_grey_of_a_wall_is_no_colour_of_leaves() {
        let (mut colours, beside) = before_wall(green, [40, 50, 44]);
        without_background(&mut colours, &beside);
        let kept = |cells: &[([u8; 3], f32)]| cells.iter().filter(|c| c.1 > 0.0).count();
        assert_eq!(kept(&colours[200..]), 0);
        assert!(kept(&colours[..200]) > 180, "{}", kept(&colours[..200]));
    }

    #[test]
    fn before_what_has_their_colours_leaves_keep_them() {
        let (mut colours, beside) =
            before_wall(|k| [40 + k % 5, 50 + k % 4, 44 + k % 3], [40, 50, 44]);
        let before = colours.clone();
        without_background(&mut colours, &beside);
        let weight = |cells: &[([u8; 3], f32)]| cells.iter().map(|c| c.1).sum::<f32>();
        assert!(weight(&colours) > 0.5 * weight(&before));
    }
}
