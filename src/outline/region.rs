//! Regions of pixels: rasterising polygons, closing ragged masks to one region, tracing borders
//! (OpenCV).

use crate::model::{Outline, Size};
use nalgebra::Point2;
use opencv::core::{Mat, Point, Scalar, Size as CvSize, ToInputArray, Vector};
use opencv::imgproc::{
    CHAIN_APPROX_SIMPLE, FILLED, LINE_8, MORPH_CLOSE, MORPH_DILATE, MORPH_ELLIPSE, RETR_EXTERNAL,
    connected_components, contour_area, draw_contours, fill_poly, find_contours,
    get_structuring_element, morphology_ex,
};
use opencv::prelude::*;

/// The pixels inside a polygon (px, at least three corners), its border included.
pub fn fill(size: Size, polygon_px: &[Point2<f64>]) -> opencv::Result<Outline> {
    let corners: Vector<Point> = polygon_px
        .iter()
        .map(|p| Point::new(p.x.round() as i32, p.y.round() as i32))
        .collect();
    let mut mask = Mat::new_rows_cols_with_default(
        size.height as i32,
        size.width as i32,
        u8::opencv_type(),
        0.into(),
    )?;
    let polygons: Vector<Vector<Point>> = Vector::from_iter([corners.clone()]);
    fill_poly(
        &mut mask,
        &polygons,
        Scalar::all(255.0),
        LINE_8,
        0,
        Point::new(0, 0),
    )?;
    Ok(Outline {
        size,
        mask: mask.data_bytes()?.to_vec(),
        polygon_px: corners.iter().map(|c| Point2::new(c.x, c.y)).collect(),
        matte: None,
        other_foot_px: None,
    })
}

/// Closes gaps of up to `close_px` in a mask (non-zero inside), keeps the largest piece and fills
/// its holes; `None` where nothing is inside.
pub fn close_to_one(size: Size, mask: &[u8], close_px: u32) -> opencv::Result<Option<Outline>> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let ragged = Mat::new_rows_cols_with_data(rows, cols, mask)?;
    let closed = morphed(&ragged, MORPH_CLOSE, close_px)?;
    let mut contours: Vector<Vector<Point>> = Vector::new();
    find_contours(
        &closed,
        &mut contours,
        RETR_EXTERNAL,
        CHAIN_APPROX_SIMPLE,
        Point::new(0, 0),
    )?;
    let mut largest: Option<(f64, usize)> = None;
    for (i, contour) in contours.iter().enumerate() {
        let area = contour_area(&contour, false)?;
        if largest.is_none_or(|(best, _)| area > best) {
            largest = Some((area, i));
        }
    }
    let Some((_, i)) = largest else {
        return Ok(None);
    };
    let mut filled = Mat::new_rows_cols_with_default(rows, cols, u8::opencv_type(), 0.into())?;
    let all = Scalar::all(255.0);
    draw_contours(
        &mut filled,
        &contours,
        i as i32,
        all,
        FILLED,
        LINE_8,
        &Mat::default(),
        0,
        Point::new(0, 0),
    )?;
    let polygon_px = contours
        .get(i)?
        .iter()
        .map(|c| Point2::new(c.x, c.y))
        .collect();
    Ok(Some(Outline {
        size,
        mask: filled.data_bytes()?.to_vec(),
        polygon_px,
        matte: None,
        other_foot_px: None,
    }))
}

/// A mask with `by_px` more on all sides.
pub fn grown(size: Size, mask: &[u8], by_px: u32) -> opencv::Result<Vec<u8>> {
    let mask = Mat::new_rows_cols_with_data(size.height as i32, size.width as i32, mask)?;
    Ok(morphed(&mask, MORPH_DILATE, by_px)?.data_bytes()?.to_vec())
}

/// Takes out of a mask the pieces that are smaller than `share` of it, gaps of up to `close_px`
/// within a piece bridged.
pub fn without_specks(
    size: Size,
    mask: &mut [u8],
    close_px: u32,
    share: f64,
) -> opencv::Result<()> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let closed = morphed(
        &Mat::new_rows_cols_with_data(rows, cols, &*mask)?,
        MORPH_CLOSE,
        close_px,
    )?;
    let mut labels = Mat::default();
    connected_components(&closed, &mut labels, 8, i32::opencv_type())?;
    let labels = labels.data_typed::<i32>()?;
    let mut areas: Vec<usize> = Vec::new();
    for &label in labels {
        let label = label.max(0) as usize;
        if areas.len() <= label {
            areas.resize(label + 1, 0);
        }
        areas[label] += 1;
    }
    let least = share * areas.iter().skip(1).sum::<usize>() as f64;
    for (m, &label) in mask.iter_mut().zip(labels) {
        if label > 0 && (areas[label as usize] as f64) < least {
            *m = 0;
        }
    }
    Ok(())
}

/// With a disc of radius `by_px`; the picture's edge neither adds nor takes anything.
fn morphed(mask: &impl ToInputArray, how: i32, by_px: u32) -> opencv::Result<Mat> {
    let (side, centre) = (2 * by_px as i32 + 1, Point::new(-1, -1));
    let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), centre)?;
    let border = opencv::imgproc::morphology_default_border_value()?;
    let mut into = Mat::default();
    morphology_ex(
        mask,
        &mut into,
        how,
        &disc,
        centre,
        1,
        opencv::core::BORDER_CONSTANT,
        border,
    )?;
    Ok(into)
}
