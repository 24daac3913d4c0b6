//! Parts of a mask whose pixels are joined, specks and holes, and what is wide enough for a limb.

use crate::model::Size;
use opencv::core::{CV_32S, Mat, Point, Size as CvSize};
use opencv::imgproc::{
    MORPH_ELLIPSE, MORPH_OPEN, connected_components, get_structuring_element, morphology_ex_def,
};
use opencv::prelude::*;

/// Least width of a limb that can be distinguished from leaves, px at 640 px picture width.
const LIMB_PX: f64 = 4.0;

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
    pub of_pixel: Vec<usize>,
    pub count: usize,
}

impl Parts {
    /// Number of what is not in the mask.
    pub const OUTSIDE: usize = 0;

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
