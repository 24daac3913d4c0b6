//! Regions of pixels: rasterising polygons, closing ragged masks to one region, tracing borders (OpenCV).

use crate::model::{Outline, Size};
use opencv::core::{Mat, Point, Scalar, Size as CvSize, Vector};
use opencv::imgproc::{
    CHAIN_APPROX_SIMPLE, FILLED, LINE_8, MORPH_CLOSE, MORPH_ELLIPSE, RETR_EXTERNAL, contour_area, draw_contours,
    fill_poly, find_contours, get_structuring_element, morphology_ex,
};
use opencv::prelude::*;

/// The pixels inside a polygon (px, at least three corners), its border included.
pub fn fill(size: Size, polygon_px: &[[f64; 2]]) -> opencv::Result<Outline> {
    let corner = |p: &[f64; 2]| Point::new(p[0].round() as i32, p[1].round() as i32);
    let corners: Vector<Point> = polygon_px.iter().map(corner).collect();
    let mut mask = Mat::new_rows_cols_with_default(size.height as i32, size.width as i32, u8::opencv_type(), 0.into())?;
    let polygons: Vector<Vector<Point>> = Vector::from_iter([corners.clone()]);
    fill_poly(&mut mask, &polygons, Scalar::all(255.0), LINE_8, 0, Point::new(0, 0))?;
    Ok(Outline { size, mask: mask.data_bytes()?.to_vec(), polygon_px: corners.iter().map(|c| [c.x, c.y]).collect() })
}

/// Closes gaps of up to `close_px` in a mask (non-zero inside), keeps the largest piece and fills its holes; `None`
/// where nothing is inside.
pub fn close_to_one(size: Size, mask: &[u8], close_px: u32) -> opencv::Result<Option<Outline>> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let ragged = Mat::new_rows_cols_with_data(rows, cols, mask)?;
    let mut closed = ragged.try_clone()?;
    if close_px > 0 {
        let side = 2 * close_px as i32 + 1;
        let disc = get_structuring_element(MORPH_ELLIPSE, CvSize::new(side, side), Point::new(-1, -1))?;
        let border = opencv::imgproc::morphology_default_border_value()?;
        let constant = opencv::core::BORDER_CONSTANT;
        morphology_ex(&ragged, &mut closed, MORPH_CLOSE, &disc, Point::new(-1, -1), 1, constant, border)?;
    }
    let mut contours: Vector<Vector<Point>> = Vector::new();
    find_contours(&closed, &mut contours, RETR_EXTERNAL, CHAIN_APPROX_SIMPLE, Point::new(0, 0))?;
    let mut largest: Option<(f64, usize)> = None;
    for (i, contour) in contours.iter().enumerate() {
        let area = contour_area(&contour, false)?;
        if largest.is_none_or(|(best, _)| area > best) {
            largest = Some((area, i));
        }
    }
    let Some((_, i)) = largest else { return Ok(None) };
    let mut filled = Mat::new_rows_cols_with_default(rows, cols, u8::opencv_type(), 0.into())?;
    let all = Scalar::all(255.0);
    draw_contours(&mut filled, &contours, i as i32, all, FILLED, LINE_8, &Mat::default(), 0, Point::new(0, 0))?;
    let polygon_px = contours.get(i)?.iter().map(|c| [c.x, c.y]).collect();
    Ok(Some(Outline { size, mask: filled.data_bytes()?.to_vec(), polygon_px }))
}
