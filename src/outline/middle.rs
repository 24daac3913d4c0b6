//! The outline of a tree in one picture on which nothing was drawn: what stands in its middle
//! (Rother et al. 2004, "GrabCut").

use super::region;
use crate::model::{Outline, Rgb, Size};
use opencv::core::{Mat, Rect, Scalar, Size as CvSize};
use opencv::imgproc::{
    GC_BGD, GC_INIT_WITH_MASK, GC_PR_FGD, INTER_AREA, INTER_NEAREST, grab_cut, resize,
};
use opencv::prelude::*;

/// Width to which the picture is reduced, px, and rounds of the cut.
const REDUCED_WIDTH: u32 = 480;
const ROUNDS: i32 = 5;
/// Margins to the sides that hold no tree, as shares of the picture's width: two are tried, and what
/// they give is compared. The margin above and below is a share of the height.
const MARGINS: [f64; 2] = [0.2, 0.15];
const MARGIN_ABOVE: f64 = 0.04;
/// Gaps up to this are closed, px of the reduced picture.
const CLOSE_PX: u32 = 2;

/// What stands in the middle of a picture.
#[derive(Clone, Debug)]
pub struct InMiddle {
    /// As each of the margins gives it, the wider one first; one at least.
    pub outlines: Vec<Outline>,
    /// How much of what two margins give they have in common (intersection over union), 0 to 1.
    pub agreement: f64,
}

/// Finds what stands in the middle of a picture; `None` where nothing differs from what is about it.
///
/// # Errors
/// OpenCV fails.
pub fn in_middle(picture: &Rgb) -> opencv::Result<Option<InMiddle>> {
    let whole = picture.size;
    let width = REDUCED_WIDTH.min(whole.width);
    let height = (whole.height * width).div_ceil(whole.width).max(1);
    let size = Size::new(width, height);
    let bytes =
        Mat::new_rows_cols_with_data(whole.height as i32, 3 * whole.width as i32, &picture.pixels)?;
    let colours = bytes.reshape(3, whole.height as i32)?;
    let mut reduced = Mat::default();
    let reduced_size = CvSize::new(width as i32, height as i32);
    resize(&colours, &mut reduced, reduced_size, 0.0, 0.0, INTER_AREA)?;
    let masks = [
        within(&reduced, size, MARGINS[0])?,
        within(&reduced, size, MARGINS[1])?,
    ];
    let [mut both, mut either] = [0_usize; 2];
    for (first, second) in masks[0].iter().zip(&masks[1]) {
        both += usize::from(*first != 0 && *second != 0);
        either += usize::from(*first != 0 || *second != 0);
    }
    let mut outlines = Vec::with_capacity(masks.len());
    for mask in &masks {
        if let Some(found) = region::close_to_one(size, mask, CLOSE_PX)? {
            outlines.extend(enlarged(&found, whole)?);
        }
    }
    Ok((!outlines.is_empty()).then(|| InMiddle {
        outlines,
        agreement: both as f64 / either.max(1) as f64,
    }))
}

/// The outline in a picture of this size; `None` where nothing is inside.
fn enlarged(outline: &Outline, size: Size) -> opencv::Result<Option<Outline>> {
    let (rows, cols) = (outline.size.height as i32, outline.size.width as i32);
    let small = Mat::new_rows_cols_with_data(rows, cols, &outline.mask)?;
    let mut large = Mat::default();
    let whole = CvSize::new(size.width as i32, size.height as i32);
    resize(&small, &mut large, whole, 0.0, 0.0, INTER_NEAREST)?;
    region::close_to_one(size, large.data_bytes()?, 0)
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

    fn picture(has_tree: bool) -> Rgb {
        let size = Size::new(300, 200);
        let mut pixels = Vec::new();
        for i in 0..size.area() {
            let (u, v) = ((i % 300) as f64, (i / 300) as f64);
            let is_crown = (u - 150.0).hypot(v - 80.0) < 50.0;
            let is_trunk = (u - 150.0).abs() < 6.0 && (80.0..180.0).contains(&v);
            let noise = (seed_of_part(2, i as u64) % 20) as u8;
            let colour: [u8; 3] = match (has_tree && is_crown, has_tree && is_trunk) {
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
        let found = in_middle(&picture(true)).expect("opencv").expect("a tree");
        assert!(found.agreement > 0.95, "{}", found.agreement);
        let outline = &found.outlines[0];
        let area = outline.mask.iter().filter(|m| **m != 0).count();
        assert!((8000..9800).contains(&area), "{area}");
        assert!(outline.contains(150.0, 175.0) && !outline.contains(120.0, 160.0));
        let none = in_middle(&picture(false)).expect("opencv");
        assert!(none.is_none_or(|found| found.agreement < 0.9));
    }
}
