//! The outline of a tree in one picture on which nothing was drawn: what stands in its middle
//! (Rother et al. 2004, "GrabCut").

use super::region;
use crate::model::{Outline, Rgb, Size};
use opencv::core::{Mat, Rect, Scalar};
use opencv::imgproc::{GC_BGD, GC_INIT_WITH_MASK, GC_PR_FGD, grab_cut};
use opencv::prelude::*;

/// Rounds of the cut.
const ROUNDS: i32 = 5;
/// Margins to the sides that hold no tree, as shares of the picture's width. The margin above and below is a
/// share of the height.
const WIDE_MARGIN: f64 = 0.2;
const NARROW_MARGIN: f64 = 0.15;
const MARGIN_ABOVE: f64 = 0.04;
/// Gaps up to this are closed, px.
const CLOSE_PX: u32 = 2;

/// How wide the margins are that hold no tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Margin {
    Wide,
    Narrow,
}

impl Margin {
    fn share(self) -> f64 {
        match self {
            Self::Wide => WIDE_MARGIN,
            Self::Narrow => NARROW_MARGIN,
        }
    }
}

/// What stands in the middle of a picture (a reduced one: large ones take long); `None` where nothing differs
/// from what is about it.
///
/// # Errors
/// OpenCV fails.
pub fn in_middle(picture: &Rgb, margin: Margin) -> opencv::Result<Option<Outline>> {
    let size = picture.size;
    let (rows, cols) = (size.height as i32, size.width as i32);
    let bytes = Mat::new_rows_cols_with_data(rows, 3 * cols, &picture.pixels)?;
    let colours = bytes.reshape(3, rows)?.try_clone()?;
    let mask = within(&colours, size, margin.share())?;
    region::close_to_one(size, &mask, CLOSE_PX)
}

/// What differs from what is beyond the margins, 255 or 0, row by row.
fn within(picture: &Mat, size: Size, margin: f64) -> opencv::Result<Vec<u8>> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let mut labels = Mat::new_rows_cols_with_default(
        rows,
        cols,
        u8::opencv_type(),
        Scalar::all(f64::from(GC_BGD)),
    )?;
    let left = (margin * f64::from(cols)) as i32;
    let top = (MARGIN_ABOVE * f64::from(rows)) as i32;
    let middle = Rect::new(left, top, cols - 2 * left, rows - 2 * top);
    labels
        .roi_mut(middle)?
        .set_scalar(Scalar::all(f64::from(GC_PR_FGD)))?;
    opencv::core::set_rng_seed(0)?;
    let (mut behind, mut before) = (Mat::default(), Mat::default());
    grab_cut(
        picture,
        &mut labels,
        Rect::default(),
        &mut behind,
        &mut before,
        ROUNDS,
        GC_INIT_WITH_MASK,
    )?;
    // Foreground has odd labels, sure or probable.
    let inside = labels.data_bytes()?.iter().map(|label| 255 * (label & 1));
    Ok(inside.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::seed_of_part;

    fn picture() -> Rgb {
        let size = Size::new(300, 200);
        let mut pixels = Vec::new();
        for i in 0..size.area() {
            let (u, v) = ((i % 300) as f64, (i / 300) as f64);
            let is_crown = (u - 150.0).hypot(v - 80.0) < 50.0;
            let is_trunk = (u - 150.0).abs() < 6.0 && (80.0..180.0).contains(&v);
            let noise = (seed_of_part(2, i as u64) % 20) as u8;
            let colour: [u8; 3] = match (is_crown, is_trunk) {
                (true, _) => [40, 110, 40],
                (_, true) => [70, 50, 40],
                _ => [150, 180, 220],
            };
            pixels.extend(colour.map(|c| c + noise));
        }
        Rgb { size, pixels }
    }

    #[test]
    fn a_tree_before_the_sky_is_found() {
        for margin in [Margin::Wide, Margin::Narrow] {
            let found = in_middle(&picture(), margin).expect("opencv");
            let outline = found.expect("a tree");
            let area = outline.mask.iter().filter(|m| **m != 0).count();
            assert!((8000..9800).contains(&area), "{area}");
            assert!(outline.contains(150.0, 175.0) && !outline.contains(120.0, 160.0));
        }
    }
}
