//! Which pixels of the picture at rest are wood: a graph cut (Tan et al. 2008 sect. 2.1) whose data
//! terms are what the motion says of a pixel, its colour, held against mixtures of colours, and
//! whether it is on a ridge.

use super::cut::{PAIRS, SURE, is_diagonal, least_cut, links_within, neighbour};
use super::evidence::Evidence;
use super::mixture::{Mixtures, Seed};
use super::{Stroke, blurred, colour_mat};
use crate::cancel::CancelToken;
use crate::model::{Foot, Rgb, Size, bounds_px};
use crate::signal::statistics::otsu;
use nalgebra::{Matrix3, Point2, Vector3};
use opencv::core::{CV_8U, CV_32S, Mat, Point, Rect, Scalar, Size as CvSize, Vec3b, Vector};
use opencv::imgproc::{
    COLOR_RGB2BGR, INTER_CUBIC, INTER_LINEAR, LINE_8, MORPH_BLACKHAT, MORPH_ELLIPSE, MORPH_OPEN,
    MORPH_TOPHAT, connected_components, cvt_color_def, get_structuring_element, morphology_ex_def,
    polylines, resize,
};
use opencv::prelude::*;

/// Pictures narrower than this are worked on at twice their size: a twig is a pixel wide.
const ENLARGED_BELOW: u32 = 960;
/// The evidence is evened out by so much, px.
const EVENED_PX: f64 = 0.7;
/// Evidence above which a pixel is taken to be tree, and below which to stand still.
const TREE: f32 = 0.15;
const STILL: f32 = -0.03;
/// Strokes are drawn no farther than this from the first pixel, px: whole numbers hold it.
const FARTHEST: f64 = 30_000.0;
/// Largest width of a ridge, px at 640 px picture width.
const RIDGE_PX: f64 = 25.0;
/// Least width of a limb that can be distinguished from leaves, px at 640 px picture width.
const LIMB_PX: f64 = 4.0;
/// Wood is darker than what stands behind it, unless its ridges are so many times as high the other
/// way.
const BRIGHT: f64 = 1.5;
/// Share of the threshold between ridges and the rest (Otsu) from which on a pixel may be a ridge.
const RIDGE: f64 = 0.5;
/// Light that is added to a pixel's before its share of green is taken: dark pixels count as grey.
const DARK: f32 = 30.0;
/// No leaf is less green than this, see [`greenness`].
const GREEN: f64 = 125.0;
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

/// The trunk is looked for by its colour over so great a share of the tree's height above the foot.
const TRUNK_HEIGHT: f64 = 0.08;
/// Bark has the colours of the low trunk within so many deviations, to which such a share of the
/// picture's contrast is added for other light.
const BARK_DEVIATIONS: f64 = 3.0;
const BARK_NOISE: f64 = 0.2;
/// Bark in the shade of the crown is darker than that of the low trunk by no more than this factor.
const SHADE: f64 = 0.5;
/// A colour is the trunk's if it is so many times as frequent there as beside it.
const TRUNK_COLOUR: f64 = 2.0;
/// Width of a stroke, px.
pub(super) const STROKE_PX: i32 = 2;
/// Fewer pixels than this show no colour of bark.
const LEAST_BARK: usize = 64;

/// A part of a picture, the ends not included, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    left: u32,
    top: u32,
    right: u32,
    bottom: u32,
}

impl Part {
    /// The smallest part that holds all of the region; `None` where it is empty.
    pub fn holding(region: &[u8], size: Size) -> Option<Self> {
        let [left, top, last_u, last_v] = bounds_px(region, size)?;
        Some(Self {
            left,
            top,
            right: last_u + 1,
            bottom: last_v + 1,
        })
    }

    /// Where the lowest part of the trunk is.
    fn above_foot(foot: Foot, tree: Part, size: Size) -> Self {
        let foot_px = foot.position_px;
        let height = TRUNK_HEIGHT * f64::from(tree.bottom - tree.top);
        let half_width = foot.half_width_px;
        Self {
            left: clamped(foot_px.x - half_width, size.width),
            top: clamped(foot_px.y - height, size.height),
            right: clamped(foot_px.x + half_width, size.width),
            bottom: clamped(foot_px.y, size.height),
        }
    }

    /// The same in a picture `scale` times as large.
    fn enlarged(self, scale: u32) -> Self {
        Self {
            left: scale * self.left,
            top: scale * self.top,
            right: scale * self.right,
            bottom: scale * self.bottom,
        }
    }

    /// The same and all that is no farther from it than `by_px`, as far as there is a picture.
    fn widened(self, by_px: u32, size: Size) -> Self {
        Self {
            left: self.left.saturating_sub(by_px),
            top: self.top.saturating_sub(by_px),
            right: (self.right + by_px).min(size.width),
            bottom: (self.bottom + by_px).min(size.height),
        }
    }

    fn as_rect(self) -> Rect {
        let [left, top, right, bottom] =
            [self.left, self.top, self.right, self.bottom].map(|px| px as i32);
        Rect::new(left, top, right - left, bottom - top)
    }

    /// Whether it is as high as `v`, and not farther off to the side than its own width.
    fn is_beside(self, u: u32, v: u32) -> bool {
        let width = self.right - self.left;
        let is_near = u + width >= self.left && u < self.right + width;
        (self.top..self.bottom).contains(&v) && is_near && !self.holds(u, v)
    }

    fn holds(self, u: u32, v: u32) -> bool {
        (self.left..self.right).contains(&u) && (self.top..self.bottom).contains(&v)
    }
}

/// A place along a side of the picture, 0 to `most` px.
fn clamped(px: f64, most: u32) -> u32 {
    px.clamp(0.0, f64::from(most)) as u32
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

/// Places of lines are given to OpenCV in parts of a pixel, so many bits of them.
const PIXEL_BITS: i32 = 4;

/// Which pixels of the mask `wood` the strokes are drawn on.
pub(super) fn drawn(strokes: &[Stroke], wood: &WoodMask) -> opencv::Result<Vec<bool>> {
    let mut lines: Vec<Stroke> = Vec::with_capacity(strokes.len());
    for stroke in strokes {
        lines.push(stroke.iter().map(|at| wood.to_mask(*at)).collect());
    }
    on_lines(&lines, wood.size, STROKE_PX * wood.scale as i32)
}

/// Which pixels of a picture of this `size` lines of this width (px) are drawn on.
pub(super) fn on_lines(lines: &[Stroke], size: Size, width_px: i32) -> opencv::Result<Vec<bool>> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let mut mask = Mat::zeros(rows, cols, CV_8U)?.to_mat()?;
    for line in lines {
        draw_line(&mut mask, line, Scalar::all(1.0), width_px)?;
    }
    Ok(mask.data_bytes()?.iter().map(|m| *m != 0).collect())
}

/// Draws a line of this width, px. Its places are not rounded to pixels: one that is drawn half a pixel
/// beside another covers nearly the same.
pub(super) fn draw_line(
    mask: &mut Mat,
    places: &[Point2<f64>],
    colour: Scalar,
    width_px: i32,
) -> opencv::Result<()> {
    let parts = f64::from(1 << PIXEL_BITS);
    let mut corners = Vector::<Point>::new();
    for at in places {
        let [u, v] = [at.x, at.y].map(|c| (parts * c.clamp(-FARTHEST, FARTHEST)).round() as i32);
        corners.push(Point::new(u, v));
    }
    polylines(mask, &corners, false, colour, width_px, LINE_8, PIXEL_BITS)
}

/// Which pixels have the colours of the low trunk, are no leaves and rather move than stand still,
/// as far as they are joined to some that surely move (hysteresis, Canny 1986); none where the
/// trunk is not seen.
fn limbs(
    rest: &Mat,
    tree: &[f32],
    leaves: &Leaves,
    is_trunk: &[bool],
    size: Size,
) -> opencv::Result<Vec<bool>> {
    let pixels = rest.data_typed::<Vec3b>()?;
    let Some(bark) = BarkColour::of(pixels, is_trunk, BARK_NOISE * contrast(pixels)) else {
        return Ok(vec![false; pixels.len()]);
    };
    let mut mask = Vec::with_capacity(pixels.len());
    for (i, pixel) in pixels.iter().enumerate() {
        let is_bark = bark.is_like(pixel) && !leaves.is_leaf[i];
        mask.push(u8::from(is_trunk[i] || is_bark && tree[i] > -STILL));
    }
    let wide: Vec<u8> = wide(&mask, size)?.into_iter().map(u8::from).collect();
    let parts = Parts::of(&wide, size, 8)?;
    let mut is_sure = vec![false; parts.count];
    for (i, part) in parts.of_pixel.iter().enumerate() {
        is_sure[*part] |= is_trunk[i] || tree[i] > TREE;
    }
    is_sure[Parts::OUTSIDE] = false;
    Ok(parts.of_pixel.iter().map(|part| is_sure[*part]).collect())
}

/// The colour of bark, as a normal distribution.
struct BarkColour {
    mean: Vector3<f64>,
    precision: Matrix3<f64>,
}

impl BarkColour {
    /// That of the pixels on the trunk; `None` where there are too few.
    fn of(pixels: &[Vec3b], is_trunk: &[bool], noise: f64) -> Option<Self> {
        let mut colours = Vec::new();
        for (pixel, _) in pixels.iter().zip(is_trunk).filter(|(_, on)| **on) {
            colours.push(colour(pixel));
        }
        if colours.len() < LEAST_BARK {
            return None;
        }
        let count = colours.len() as f64;
        let mean = colours.iter().sum::<Vector3<f64>>() / count;
        let mut covariance = noise.powi(2) * Matrix3::identity();
        for colour in &colours {
            let off = colour - mean;
            covariance += off * off.transpose() / count;
        }
        let precision = covariance.try_inverse()?;
        Some(Self { mean, precision })
    }

    /// Whether a pixel has the colour of bark, in the light or in the shade.
    fn is_like(&self, pixel: &Vec3b) -> bool {
        let colour = colour(pixel);
        let light = colour.dot(&self.mean) / self.mean.norm_squared().max(f64::MIN_POSITIVE);
        let off = colour - light.clamp(SHADE, 1.0) * self.mean;
        off.dot(&(self.precision * off)) <= BARK_DEVIATIONS.powi(2)
    }
}

/// Deviation of a picture's colours from their mean, grey levels.
fn contrast(pixels: &[Vec3b]) -> f64 {
    let mut sum = Vector3::zeros();
    let mut squares = 0.0;
    for pixel in pixels {
        sum += colour(pixel);
        squares += colour(pixel).norm_squared();
    }
    let count = pixels.len().max(1) as f64;
    let variance = squares / count - (sum / count).norm_squared();
    // Of one component.
    (variance / 3.0).max(0.0).sqrt()
}

pub(super) fn colour(pixel: &Vec3b) -> Vector3<f64> {
    Vector3::from(pixel.0.map(f64::from))
}

/// What a disc of [`LIMB_PX`] fits into (opening): in leaf, thin wood cannot be distinguished from
/// the mixed colours at the edges of leaves.
pub(super) fn wide(mask: &[u8], size: Size) -> opencv::Result<Vec<bool>> {
    let mat = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, mask)?;
    let side = limb_width(size).round() as i32 | 1;
    let middle = Point::new(-1, -1);
    let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), middle)?;
    let mut out = Mat::default();
    morphology_ex_def(&mat, &mut out, MORPH_OPEN, &disc)?;
    Ok(out.data_bytes()?.iter().map(|m| *m != 0).collect())
}

/// [`LIMB_PX`] in a picture of this size, px.
fn limb_width(size: Size) -> f64 {
    LIMB_PX * f64::from(size.width) / 640.0
}

/// Makes the holes of a mask wood that are no larger than half a limb is wide, as a knot or a light
/// on the bark is: the widths of limbs would be measured too small beside them. Wood of that size
/// that is joined to no other is none.
pub(super) fn without_specks(mask: &mut [u8], size: Size) -> opencv::Result<()> {
    let most = (0.5 * limb_width(size)).powi(2) as usize;
    let holes: Vec<u8> = mask.iter().map(|m| 255 - m).collect();
    let is_hole = Parts::of(&holes, size, 4)?.no_larger_than(most);
    for (mask, is_hole) in mask.iter_mut().zip(is_hole) {
        *mask = if is_hole { 255 } else { *mask };
    }
    let is_speck = Parts::of(mask, size, 8)?.no_larger_than(most);
    for (mask, is_speck) in mask.iter_mut().zip(is_speck) {
        *mask = if is_speck { 0 } else { *mask };
    }
    Ok(())
}

/// The parts of a mask whose pixels are joined.
pub(super) struct Parts {
    /// Number of each pixel's part, row by row.
    of_pixel: Vec<usize>,
    count: usize,
}

impl Parts {
    /// Number of what is not in the mask.
    const OUTSIDE: usize = 0;

    /// Pixels are joined to their 4 or 8 neighbours, as `connectivity` says.
    pub fn of(mask: &[u8], size: Size, connectivity: i32) -> opencv::Result<Self> {
        let mat = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, mask)?;
        let mut parts = Mat::default();
        let count = connected_components(&mat, &mut parts, connectivity, CV_32S)?;
        let of_pixel = parts.data_typed::<i32>()?.iter();
        Ok(Self {
            of_pixel: of_pixel.map(|part| *part as usize).collect(),
            count: count.max(1) as usize,
        })
    }

    /// Whether each pixel is in a part of at most so many pixels.
    pub fn no_larger_than(&self, most: usize) -> Vec<bool> {
        let mut area = vec![0_usize; self.count];
        for part in &self.of_pixel {
            area[*part] += 1;
        }
        let mut is_small: Vec<bool> = area.iter().map(|area| *area <= most).collect();
        is_small[Self::OUTSIDE] = false;
        self.of_pixel.iter().map(|part| is_small[*part]).collect()
    }
}

/// Which pixels within `bounds` are on a ridge that is narrower than [`RIDGE_PX`]. Whether wood is
/// darker or brighter than what stands behind it is estimated from the pixels that move.
pub(super) fn ridges(
    rest: &Mat,
    bounds: Part,
    moves: &[bool],
    size: Size,
) -> opencv::Result<Vec<bool>> {
    let width_px = RIDGE_PX * f64::from(size.width) / 640.0;
    let mut grey = Mat::default();
    cvt_color_def(rest, &mut grey, opencv::imgproc::COLOR_BGR2GRAY)?;
    let side = (width_px.round() as i32) | 1;
    let middle = Point::new(-1, -1);
    let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), middle)?;
    // The second of the two steps looks so far beyond the bounds at what the first made.
    let part = bounds.widened(side as u32 / 2, size).as_rect();
    let dark = Ridges::of(&grey, part, MORPH_BLACKHAT, &disc, moves, size)?;
    let bright = Ridges::of(&grey, part, MORPH_TOPHAT, &disc, moves, size)?;
    let ridges = if bright.mean > BRIGHT * dark.mean {
        bright
    } else {
        dark
    };
    Ok(ridges.high())
}

/// How high the ridges of a picture are.
struct Ridges {
    height: Vec<u8>,
    /// Mean where the tree moves.
    mean: f64,
    threshold: f64,
}

impl Ridges {
    fn of(
        grey: &Mat,
        part: Rect,
        operation: i32,
        disc: &Mat,
        moves: &[bool],
        size: Size,
    ) -> opencv::Result<Self> {
        let mut height = Mat::default();
        morphology_ex_def(&grey.roi(part)?, &mut height, operation, disc)?;
        let height = pasted(height.data_bytes()?, part, size);
        let histogram = histogram(&height, moves);
        Ok(Self {
            height,
            mean: mean(&histogram),
            threshold: f64::from(otsu(&histogram)),
        })
    }

    fn high(self) -> Vec<bool> {
        let least = RIDGE * self.threshold;
        let high = self.height.iter().map(|h| f64::from(*h) > least);
        high.collect()
    }
}

/// Values of a picture of this size, row by row, that are those of `part` in `at`, and 0 elsewhere.
fn pasted(part: &[u8], at: Rect, size: Size) -> Vec<u8> {
    let mut whole = vec![0; size.area()];
    let (left, width) = (at.x as usize, at.width as usize);
    let rows = whole.chunks_exact_mut(size.width as usize);
    for (row, part) in rows.skip(at.y as usize).zip(part.chunks_exact(width)) {
        row[left..left + width].copy_from_slice(part);
    }
    whole
}

/// Mean of the values that a histogram counts.
fn mean(histogram: &[u32; 256]) -> f64 {
    let count: f64 = histogram.iter().map(|&n| f64::from(n)).sum();
    let sum: f64 = (0..256).map(|v| v as f64 * f64::from(histogram[v])).sum();
    sum / count.max(1.0)
}

/// The pixels of `low` whose colours are found there much more often than beside it, and are not
/// those of leaves: the lowest part of a trunk hardly moves.
fn low_trunk(rest: &Mat, low: Part, leaves: &Leaves, size: Size) -> opencv::Result<Vec<bool>> {
    let pixels = rest.data_typed::<Vec3b>()?;
    let (mut within, mut beside) = (Colours::default(), Colours::default());
    for (i, pixel) in pixels.iter().enumerate() {
        let (u, v) = (i as u32 % size.width, i as u32 / size.width);
        if low.holds(u, v) {
            within.add(pixel);
        } else if low.is_beside(u, v) {
            beside.add(pixel);
        }
    }
    let mut mask = Vec::with_capacity(pixels.len());
    for (i, pixel) in pixels.iter().enumerate() {
        let (u, v) = (i as u32 % size.width, i as u32 / size.width);
        let is_trunk = within.share(pixel) > TRUNK_COLOUR * beside.share(pixel);
        mask.push(u8::from(low.holds(u, v) && is_trunk && !leaves.is_leaf[i]));
    }
    wide(&mask, size)
}

/// How often colours occur, in 16 steps of each component.
struct Colours {
    counts: Vec<u32>,
    all: u32,
}

impl Default for Colours {
    fn default() -> Self {
        Self {
            counts: vec![0; 1 << 12],
            all: 0,
        }
    }
}

impl Colours {
    fn bin(pixel: &Vec3b) -> usize {
        let [blue, green, red] = pixel.0.map(|c| usize::from(c >> 4));
        (blue << 8) | (green << 4) | red
    }

    fn add(&mut self, pixel: &Vec3b) {
        self.counts[Self::bin(pixel)] += 1;
        self.all += 1;
    }

    fn share(&self, pixel: &Vec3b) -> f64 {
        f64::from(self.counts[Self::bin(pixel)]) / f64::from(self.all.max(1))
    }
}

/// How often each value occurs where something moves.
fn histogram(values: &[u8], moves: &[bool]) -> [u32; 256] {
    let mut histogram = [0; 256];
    for (value, _) in values.iter().zip(moves).filter(|(_, moves)| **moves) {
        histogram[usize::from(*value)] += 1;
    }
    histogram
}

/// Which pixels are leaves.
struct Leaves {
    is_leaf: Vec<bool>,
    /// Their share of what moves with the tree.
    share: f64,
}

impl Leaves {
    /// The greener of two groups of pixels (Otsu), as far as it is green.
    fn of(rest: &Mat, moves: &[bool]) -> opencv::Result<Self> {
        let evened = blurred(rest, 1.0)?;
        let pixels = evened.data_typed::<Vec3b>()?;
        let green: Vec<u8> = pixels.iter().map(greenness).collect();
        let least = f64::from(otsu(&histogram(&green, moves))).max(GREEN);
        let is_leaf: Vec<bool> = green.iter().map(|g| f64::from(*g) > least).collect();
        let n_moving = moves.iter().filter(|moves| **moves).count();
        let n_leaf = is_leaf
            .iter()
            .zip(moves)
            .filter(|(l, m)| **l && **m)
            .count();
        Ok(Self {
            is_leaf,
            share: n_leaf as f64 / n_moving.max(1) as f64,
        })
    }
}

/// How much green exceeds the mean of red and blue, 100 where it does not, 200 more for all of the
/// light.
fn greenness(pixel: &Vec3b) -> u8 {
    let [blue, green, red] = pixel.0.map(f32::from);
    let share = (2.0 * green - red - blue) / (red + green + blue + DARK);
    (100.0 + 200.0 * share).clamp(0.0, 255.0) as u8
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bark_in_the_shade_is_bark_and_brighter_or_other_colours_are_not() {
        let mut trunk = Vec::new();
        for k in 0..200_u8 {
            let rough = k % 9;
            trunk.push(Vec3b::from([88 + rough, 106 + rough, 120 + rough]));
        }
        let bark = BarkColour::of(&trunk, &vec![true; trunk.len()], 10.0).expect("enough pixels");
        for (colour, expected, name) in [
            ([92, 110, 124], true, "lit"),
            ([52, 62, 70], true, "in the shade"),
            ([14, 16, 18], false, "black"),
            ([140, 165, 185], false, "brighter"),
            ([60, 110, 70], false, "grass"),
        ] {
            assert_eq!(bark.is_like(&Vec3b::from(colour)), expected, "{name}");
        }
        assert!(BarkColour::of(&trunk[..10], &[true; 10], 10.0).is_none());
    }
}
