//! Which pixels of the picture at rest are wood: a graph cut (Tan et al. 2008 sect. 2.1) whose data
//! terms are what the motion says of a pixel, its colour, held against mixtures of colours, and
//! whether it is on a ridge.

use super::bark_colour::{limbs, low_trunk};
use super::cut::{PAIRS, SURE, is_diagonal, least_cut, links_within, neighbour};
use super::drawing::drawn;
use super::evidence::Evidence;
use super::joined::without_specks;
use super::leaves::Leaves;
use super::mixture::{Mixtures, Seed};
use super::part::Part;
use super::ridges::ridges;
use super::{Stroke, blurred, colour_mat};
use crate::cancel::CancelToken;
use crate::model::{Foot, Rgb, Size};
use nalgebra::{Point2, Vector3};
use opencv::core::{Mat, Size as CvSize, Vec3b};
use opencv::imgproc::{COLOR_RGB2BGR, INTER_CUBIC, INTER_LINEAR, cvt_color_def, resize};
use opencv::prelude::*;

/// Pictures narrower than this are worked on at twice their size: a twig is a pixel wide.
const ENLARGED_BELOW: u32 = 960;
/// The evidence is evened out by so much, px.
const EVENED_PX: f64 = 0.7;
/// Evidence above which a pixel is taken to be tree, and below which to stand still.
pub(super) const TREE: f32 = 0.15;
pub(super) const STILL: f32 = -0.03;
/// A tree is in leaf where so great a share of what moves is leaves.
const IN_LEAF: f64 = 0.25;

/// Odds of wood where the evidence is 1, and by how much they fall where it is -1; no evidence
/// that a pixel stands still counts more than the last. By the truth of 18 made films: where the
/// tree differs much from a still background, the odds are higher yet.
const MOVING_ODDS: f32 = 8.0;
const STILL_ODDS: f32 = 50.0;
const MOST_STILL_ODDS: f32 = 8.0;
/// No colour counts more than this: mixtures are sure of what they have not seen.
pub(super) const COLOUR_ODDS: f32 = 4.0;
/// Odds of wood on a ridge, elsewhere, and where ridges are not looked for: most pixels are none.
const RIDGE_ODDS: f32 = 0.0;
const PLAIN_ODDS: f32 = -4.0;
const LEAFY_ODDS: f32 = -3.0;
/// What the colour of leaves takes from the odds.
const LEAF_ODDS: f32 = 4.0;
/// What it costs at most that neighbours differ, in the same measure.
const LINK: f32 = 5.0;

/// The wood of the picture at rest.
pub struct WoodMask {
    /// Size of the mask, and how many times larger it is than the picture.
    pub size: Size,
    pub scale: u32,
    /// Row by row, 255 is wood.
    pub mask: Vec<u8>,
    /// Row by row, the odds of wood that the cut was made by, as logarithms; negative infinity
    /// where no wood is looked for.
    pub odds: Vec<f32>,
    /// Row by row, whether it moves with the tree.
    pub moves: Vec<bool>,
    /// Row by row, whether it is as green as leaves.
    pub is_leaf: Vec<bool>,
    pub in_leaf: bool,
}

impl WoodMask {
    /// The place in the mask of one in the picture, px.
    pub fn to_mask(&self, at_px: Point2<f64>) -> Point2<f64> {
        let scale = f64::from(self.scale);
        at_px.map(|x| (x + 0.5) * scale - 0.5)
    }

    /// The place in the picture of one in the mask, px.
    pub fn to_picture(&self, at: Point2<f64>) -> Point2<f64> {
        let scale = f64::from(self.scale);
        at.map(|x| (x + 0.5) / scale - 0.5)
    }

    /// Half the width of wood in the picture whose middle is `inside` from the nearest pixel beside
    /// it, px.
    pub fn radius_px(&self, inside: f32) -> f64 {
        // The edge lies half a pixel beyond the last pixel of the wood.
        f64::from((inside - 0.5).max(0.0)) / f64::from(self.scale)
    }

    /// Place of a pixel of the mask.
    pub fn place(&self, pixel: usize) -> Point2<f64> {
        let width = self.size.width as usize;
        Point2::new((pixel % width) as f64, (pixel / width) as f64)
    }

    /// The pixel of the mask at a place; `None` outside.
    pub fn pixel(&self, at: Point2<f64>) -> Option<usize> {
        let (u, v) = (at.x.round(), at.y.round());
        let is_in = (0.0..f64::from(self.size.width)).contains(&u)
            && (0.0..f64::from(self.size.height)).contains(&v);
        is_in.then(|| v as usize * self.size.width as usize + u as usize)
    }

    /// Whether there is wood at a place of the mask.
    pub fn holds(&self, at: Point2<f64>) -> bool {
        self.pixel(at).is_some_and(|pixel| self.mask[pixel] != 0)
    }

    /// The pixels of the mask that are pixel `i` of the picture, which is of this `size`.
    pub fn pixels_of(&self, i: usize, size: Size) -> impl Iterator<Item = usize> + Clone + use<> {
        let (width, scale) = (self.size.width as usize, self.scale as usize);
        let (u, v) = (i % size.width as usize, i / size.width as usize);
        let first = scale * v * width + scale * u;
        (0..scale * scale).map(move |k| first + k / scale * width + k % scale)
    }
}

/// Finds the wood within `region` (one byte a pixel of the picture, 0 outside). Pixels as green as
/// leaves are excluded. A bare tree is separated from what stands behind it by its ridges as well.
/// What is on one of the `strokes` is wood, and shows the colour of bark.
///
/// # Errors
/// OpenCV fails.
pub fn wood_mask(
    evidence: &Evidence,
    region: &[u8],
    foot: Foot,
    strokes: &[Stroke],
    cancel: &CancelToken,
) -> opencv::Result<WoodMask> {
    let size = evidence.rest.size;
    let scale = if size.width < ENLARGED_BELOW { 2 } else { 1 };
    let large = Size::new(scale * size.width, scale * size.height);
    let mut out = WoodMask {
        size: large,
        scale,
        mask: vec![0; large.area()],
        odds: vec![f32::NEG_INFINITY; large.area()],
        moves: vec![false; large.area()],
        is_leaf: vec![false; large.area()],
        in_leaf: false,
    };
    let Some(bounds) = Part::holding(region, size) else {
        return Ok(out);
    };
    let rest = enlarged_picture(&evidence.rest, large)?;
    let tree = enlarged_evidence(&evidence.tree, size, large)?;
    let region = enlarged_region(region, size, scale);
    for (i, moves) in out.moves.iter_mut().enumerate() {
        *moves = region[i] != 0 && tree[i] > TREE;
    }
    let leaves = Leaves::of(&rest, &out.moves)?;
    out.in_leaf = leaves.share >= IN_LEAF;
    let low = Part::above_foot(foot, bounds, size).enlarged(scale);
    let mut is_trunk = low_trunk(&rest, low, &leaves, large)?;
    let is_stroke = drawn(strokes, &out)?;
    for (is_trunk, is_stroke) in is_trunk.iter_mut().zip(&is_stroke) {
        *is_trunk |= is_stroke;
    }
    let is_limb = limbs(&rest, &tree, &leaves, &is_trunk, large)?;
    let is_ridge = match out.in_leaf {
        true => vec![false; large.area()],
        false => ridges(&rest, bounds.enlarged(scale), &out.moves, large)?,
    };
    let clues = Clues {
        region: &region,
        tree: &tree,
        moves: &out.moves,
        is_leaf: &leaves.is_leaf,
        in_leaf: out.in_leaf,
        is_stroke: &is_stroke,
        is_trunk: &is_trunk,
        is_limb: &is_limb,
        is_ridge: &is_ridge,
    };
    let pixels = rest.data_typed::<Vec3b>()?;
    let seeds = clues.seeds(bounds.enlarged(scale), large);
    let Some(mixtures) = Mixtures::of(pixels, &seeds)? else {
        return Ok(out);
    };
    let odds = clues.odds(pixels, &mixtures);
    let links = links(pixels, &region, large);
    let Some(is_wood) = least_cut(large, &odds, &links, cancel) else {
        return Ok(out);
    };
    for (mask, is_wood) in out.mask.iter_mut().zip(is_wood) {
        *mask = if is_wood { 255 } else { 0 };
    }
    without_specks(&mut out.mask, large)?;
    for (i, odds) in odds.into_iter().enumerate() {
        if region[i] != 0 || is_trunk[i] {
            out.odds[i] = odds;
        }
    }
    out.is_leaf = leaves.is_leaf;
    Ok(out)
}

/// What is known of the pixels; the slices have one entry for each, row by row.
struct Clues<'a> {
    /// 0 where no wood is looked for.
    region: &'a [u8],
    /// Evidence of the tree, as in [`Evidence::tree`].
    tree: &'a [f32],
    /// Moves with the tree.
    moves: &'a [bool],
    is_leaf: &'a [bool],
    /// Whether the tree is in leaf.
    in_leaf: bool,
    /// Drawn by the user as wood.
    is_stroke: &'a [bool],
    /// On the low trunk by its colour, or on a stroke.
    is_trunk: &'a [bool],
    is_limb: &'a [bool],
    is_ridge: &'a [bool],
}

impl Clues<'_> {
    /// Which pixels within `bounds` show the colours of wood, and which those of all else.
    fn seeds(&self, bounds: Part, size: Size) -> Vec<Seed> {
        let mut seeds = Vec::with_capacity(self.region.len());
        for i in 0..self.region.len() {
            let (u, v) = (i as u32 % size.width, i as u32 / size.width);
            seeds.push(if bounds.holds(u, v) {
                self.seed(i)
            } else {
                Seed::Unknown
            });
        }
        seeds
    }

    fn seed(&self, i: usize) -> Seed {
        let moves = self.moves[i];
        if self.is_stroke[i] {
            Seed::Wood
        } else if self.region[i] == 0 || self.tree[i] < STILL {
            Seed::Other
        } else if self.is_trunk[i] || self.is_limb[i] && (moves || self.in_leaf) {
            Seed::Wood
        } else if moves && self.is_leaf[i] {
            Seed::Other
        } else if self.is_limb[i] || self.is_ridge[i] && moves {
            Seed::Wood
        } else {
            Seed::Unknown
        }
    }

    /// The odds of wood, as logarithms: those of what is known add up, as if each were known alone.
    fn odds(&self, pixels: &[Vec3b], mixtures: &Mixtures) -> Vec<f32> {
        let mut odds = Vec::with_capacity(pixels.len());
        for (i, pixel) in pixels.iter().enumerate() {
            odds.push(if self.is_trunk[i] {
                SURE
            } else if self.region[i] == 0 {
                0.0
            } else {
                let by_colour = mixtures.odds_of_wood(pixel) as f32;
                self.odds_by_motion(i)
                    + self.odds_by_shape(i)
                    + by_colour.clamp(-COLOUR_ODDS, COLOUR_ODDS)
            });
        }
        odds
    }

    fn odds_by_motion(&self, i: usize) -> f32 {
        let evidence = self.tree[i];
        if evidence > 0.0 {
            MOVING_ODDS * evidence
        } else {
            (STILL_ODDS * evidence).max(-MOST_STILL_ODDS)
        }
    }

    /// Before anything else is known.
    fn odds_by_shape(&self, i: usize) -> f32 {
        let by_ridge = match (self.in_leaf, self.is_ridge[i]) {
            (true, _) => LEAFY_ODDS,
            (false, true) => RIDGE_ODDS,
            (false, false) => PLAIN_ODDS,
        };
        by_ridge - if self.is_leaf[i] { LEAF_ODDS } else { 0.0 }
    }
}

/// What it costs that neighbours differ: little where their colours do (Boykov and Jolly 2001).
/// Nothing links what is beyond the region.
pub(super) fn links(pixels: &[Vec3b], region: &[u8], size: Size) -> Vec<[f32; PAIRS]> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for i in (0..pixels.len()).filter(|i| region[*i] != 0) {
        let neighbours = (0..PAIRS).filter_map(|pair| neighbour(i, pair, size));
        for next in neighbours.filter(|next| region[*next] != 0) {
            sum += apart_squared(&pixels[i], &pixels[next]);
            count += 1;
        }
    }
    let mean = (sum / count.max(1) as f64).max(f64::MIN_POSITIVE);
    links_within(region, size, |i, next, pair| {
        let length = if is_diagonal(pair) {
            f64::sqrt(2.0)
        } else {
            1.0
        };
        let most = f64::from(LINK) / length;
        let apart = apart_squared(&pixels[i], &pixels[next]);
        most * (-apart / (2.0 * mean)).exp()
    })
}

fn apart_squared(a: &Vec3b, b: &Vec3b) -> f64 {
    (colour(a) - colour(b)).norm_squared()
}

/// The picture at the larger size, blue first, as OpenCV has it.
pub(super) fn enlarged_picture(picture: &Rgb, large: Size) -> opencv::Result<Mat> {
    let mut bgr = Mat::default();
    cvt_color_def(&colour_mat(picture)?, &mut bgr, COLOR_RGB2BGR)?;
    let mut out = Mat::default();
    resize(&bgr, &mut out, cv_size(large), 0.0, 0.0, INTER_CUBIC)?;
    Ok(out)
}

fn cv_size(size: Size) -> CvSize {
    CvSize::new(size.width as i32, size.height as i32)
}

fn enlarged_evidence(tree: &[f32], size: Size, large: Size) -> opencv::Result<Vec<f32>> {
    let mat = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, tree)?;
    let evened = blurred(&mat, EVENED_PX)?;
    let mut out = Mat::default();
    resize(&evened, &mut out, cv_size(large), 0.0, 0.0, INTER_LINEAR)?;
    Ok(out.data_typed::<f32>()?.to_vec())
}

fn enlarged_region(region: &[u8], size: Size, scale: u32) -> Vec<u8> {
    let (width, scale) = (size.width as usize, scale as usize);
    let mut out = Vec::with_capacity(region.len() * scale * scale);
    for row in region.chunks_exact(width) {
        for _ in 0..scale {
            for pixel in row {
                out.extend(std::iter::repeat_n(*pixel, scale));
            }
        }
    }
    out
}

pub(super) fn colour(pixel: &Vec3b) -> Vector3<f64> {
    Vector3::from(pixel.0.map(f64::from))
}

#[cfg(test)]
impl WoodMask {
    /// Wood within `radius` of lines.
    pub fn made_up(size: Size, lines: &[[Point2<f64>; 2]], radius: f64) -> Self {
        let mut wood = Self {
            size,
            scale: 1,
            mask: vec![0; size.area()],
            odds: vec![f32::NEG_INFINITY; size.area()],
            moves: vec![false; size.area()],
            is_leaf: vec![false; size.area()],
            in_leaf: false,
        };
        for pixel in 0..size.area() {
            let at = wood.place(pixel);
            let mut lines = lines.iter();
            if lines.any(|[a, b]| crate::signal::distance_to_segment(at, *a, *b) <= radius) {
                wood.mask[pixel] = 255;
            }
        }
        wood
    }
}
