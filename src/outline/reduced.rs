//! A picture and outlines in it in a smaller size, in which a tree on which nothing was drawn is looked for.

use super::region;
use crate::model::{Outline, Rgb, Size};
use nalgebra::Point2;
use opencv::core::{Mat, Size as CvSize};
use opencv::imgproc::{INTER_AREA, INTER_NEAREST, resize};
use opencv::prelude::*;

/// Width to which pictures are reduced, px.
const REDUCED_WIDTH: u32 = 480;

/// A picture that was reduced.
#[derive(Clone, Debug)]
pub struct Reduced {
    pub picture: Rgb,
    /// Of the picture that it was made of.
    pub whole: Size,
}

impl Reduced {
    /// In the size in which a tree is looked for.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn of(picture: &Rgb) -> opencv::Result<Self> {
        Self::to_width(picture, REDUCED_WIDTH)
    }

    /// A picture that is no wider than this (px) stays as large as it is.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn to_width(picture: &Rgb, width: u32) -> opencv::Result<Self> {
        let whole = picture.size;
        let width = width.min(whole.width);
        let height = (whole.height * width).div_ceil(whole.width).max(1);
        let size = Size::new(width, height);
        let (rows, cols) = (whole.height as i32, whole.width as i32);
        let bytes = Mat::new_rows_cols_with_data(rows, 3 * cols, &picture.pixels)?;
        let colours = bytes.reshape(3, rows)?;
        let mut reduced = Mat::default();
        let reduced_size = CvSize::new(width as i32, height as i32);
        resize(&colours, &mut reduced, reduced_size, 0.0, 0.0, INTER_AREA)?;
        let bytes = reduced.reshape(1, 0)?;
        Ok(Self {
            picture: Rgb {
                size,
                pixels: bytes.data_bytes()?.to_vec(),
            },
            whole,
        })
    }

    /// A place of the reduced picture, px of the whole one.
    pub fn to_whole(&self, at_px: Point2<f64>) -> Point2<f64> {
        let scale = f64::from(self.whole.width) / f64::from(self.picture.size.width);
        at_px.map(|px| (px + 0.5) * scale - 0.5)
    }

    /// A place of the whole picture, px of the reduced one.
    pub fn to_reduced(&self, at_px: Point2<f64>) -> Point2<f64> {
        let scale = f64::from(self.picture.size.width) / f64::from(self.whole.width);
        at_px.map(|px| (px + 0.5) * scale - 0.5)
    }

    /// An outline of the reduced picture in the whole one; `None` where nothing is inside.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn outline_in_whole(&self, outline: &Outline) -> opencv::Result<Option<Outline>> {
        resized(outline, self.whole)
    }

    /// An outline of the whole picture in the reduced one; `None` where nothing is inside.
    ///
    /// # Errors
    /// OpenCV fails.
    pub fn outline_in_reduced(&self, outline: &Outline) -> opencv::Result<Option<Outline>> {
        resized(outline, self.picture.size)
    }
}

fn resized(outline: &Outline, size: Size) -> opencv::Result<Option<Outline>> {
    let (rows, cols) = (outline.size.height as i32, outline.size.width as i32);
    let own = Mat::new_rows_cols_with_data(rows, cols, &outline.mask)?;
    let mut other = Mat::default();
    let wanted = CvSize::new(size.width as i32, size.height as i32);
    resize(&own, &mut other, wanted, 0.0, 0.0, INTER_NEAREST)?;
    region::close_to_one(size, other.data_bytes()?, 0)
}
