//! Ridges: what is darker or brighter than both its sides.

use super::leaves::histogram;
use super::part::Part;
use crate::model::Size;
use crate::signal::statistics::otsu;
use opencv::core::{Mat, Point, Rect, Size as CvSize};
use opencv::imgproc::{
    MORPH_BLACKHAT, MORPH_ELLIPSE, MORPH_TOPHAT, cvt_color_def, get_structuring_element,
    morphology_ex_def,
};
use opencv::prelude::*;

/// Largest width of a ridge, px at 640 px picture width.
const RIDGE_PX: f64 = 25.0;
/// Wood is darker than what stands behind it, unless its ridges are so many times as high the other
/// way.
const BRIGHT: f64 = 1.5;
/// Share of the threshold between ridges and the rest (Otsu) from which on a pixel may be a ridge.
const RIDGE: f64 = 0.5;

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
