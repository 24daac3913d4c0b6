//! The code of a tag: which quadrilaterals are tags, and which corner is which.

use super::codes::{BIT_CELLS, CODES};
use super::homography::Homography;
use super::quads::{Quad, brightness, find_quads};
use crate::model::Luma;
use nalgebra::Point2;

/// Cells along a side of the black square.
const CELLS: f64 = 8.0;
/// Cells of a code that may be read wrongly: any two codes differ in eleven.
const MAX_WRONG: u32 = 2;
/// White paper around the square and its black border differ by so many grey levels at least.
const LEAST_CONTRAST: f64 = 20.0;
/// So many quadrilaterals of a picture are looked at.
const MAX_QUADS: usize = 200;

/// A tag in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tag {
    /// Its number in the family 36h11.
    pub id: u16,
    /// The corners of its black square, px: its upper left one first, then clockwise.
    pub corners_px: [Point2<f64>; 4],
    /// Standard deviation of a corner along each axis, px.
    pub corner_sd_px: f64,
}

/// All tags of a picture, the largest first.
pub fn find_tags(luma: &Luma) -> Vec<Tag> {
    let quads = find_quads(luma);
    quads
        .iter()
        .take(MAX_QUADS)
        .filter_map(|quad| decoded(luma, quad))
        .collect()
}

/// The tag that a quadrilateral is; `None` where it has no code.
fn decoded(luma: &Luma, quad: &Quad) -> Option<Tag> {
    for turn in 0..4 {
        let mut corners_px = quad.corners_px;
        corners_px.rotate_left(turn);
        let Some(bits) = bits(luma, &Homography::of_square(&corners_px)?) else {
            continue;
        };
        if let Some(id) = id_of(bits) {
            return Some(Tag {
                id,
                corners_px,
                corner_sd_px: quad.corner_sd_px,
            });
        }
    }
    None
}

/// The code in the cells; `None` where there is no white paper around black.
fn bits(luma: &Luma, homography: &Homography) -> Option<u64> {
    let (mut white, mut black) = (0.0, 0.0);
    let mut sides = 0.0;
    for k in 0..CELLS as usize {
        let along = k as f64;
        for (outer, inner) in [(-1.0, 0.0), (CELLS, CELLS - 1.0)] {
            white += cell(luma, homography, along, outer)? + cell(luma, homography, outer, along)?;
            black += cell(luma, homography, along, inner)? + cell(luma, homography, inner, along)?;
            sides += 2.0;
        }
    }
    let (white, black) = (white / sides, black / sides);
    if white - black < LEAST_CONTRAST {
        return None;
    }
    let mut bits = 0;
    for [column, row] in BIT_CELLS {
        let here = cell(luma, homography, f64::from(column), f64::from(row))?;
        bits = bits << 1 | u64::from(here > 0.5 * (white + black));
    }
    Some(bits)
}

/// Brightness of the cell in a column and row of the square, grey levels: the mean of five places in it.
fn cell(luma: &Luma, homography: &Homography, column: f64, row: f64) -> Option<f64> {
    let mut sum = 0.0;
    for [across, down] in [
        [0.5, 0.5],
        [0.35, 0.35],
        [0.65, 0.35],
        [0.35, 0.65],
        [0.65, 0.65],
    ] {
        let at = Point2::new((column + across) / CELLS - 0.5, (row + down) / CELLS - 0.5);
        sum += brightness(luma, homography.apply(at))?;
    }
    Some(sum / 5.0)
}

/// The number of the code that these bits are, but for a few.
fn id_of(bits: u64) -> Option<u16> {
    let wrong = |code: &u64| (code ^ bits).count_ones();
    let nearest = CODES.iter().zip(0..).min_by_key(|(code, _)| wrong(code))?;
    (wrong(nearest.0) <= MAX_WRONG).then_some(nearest.1)
}
