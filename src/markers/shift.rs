//! Windows that move to the middle of what is likely: mean shift, and CamShift (Bradski 1998).

use super::area::PixelArea;
use super::hue::Likelihood;
use crate::config::MarkerMethod;
use opencv::core::{Mat, Rect, TermCriteria, TermCriteria_Type};
use opencv::video::{cam_shift, mean_shift};

/// A window is moved until it moves by less than a pixel, or so often.
const MAX_ROUNDS: i32 = 20;
const LEAST_MOVE_PX: f64 = 1.0;
/// A window that follows its marker's size has sides of so many of its first ones.
const LEAST_SIDE: f64 = 0.5;
const MAX_SIDE: f64 = 2.0;

/// Where `window` stands still on `likely`; `None` where it lies beside that. With CamShift it has
/// another size then, within half and twice that of `first`.
///
/// # Errors
/// OpenCV fails.
pub fn shifted(
    likely: &Likelihood,
    window: &PixelArea,
    first: &PixelArea,
    method: MarkerMethod,
) -> opencv::Result<Option<PixelArea>> {
    let area = likely.area;
    let local = window.relative_to(&area);
    let size = crate::model::Size::new(area.width as u32, area.height as u32);
    if local.within(size).is_none() {
        return Ok(None);
    }
    let pixels = Mat::new_rows_cols_with_data(area.height, area.width, &likely.pixels)?;
    let mut rect = Rect::new(local.u, local.v, local.width, local.height);
    let kind = TermCriteria_Type::COUNT as i32 + TermCriteria_Type::EPS as i32;
    let until = TermCriteria::new(kind, MAX_ROUNDS, LEAST_MOVE_PX)?;
    mean_shift(&pixels, &mut rect, until)?;
    if method == MarkerMethod::CamShift {
        cam_shift(&pixels, &mut rect, until)?;
        let wanted =
            [(rect.width, first.width), (rect.height, first.height)].map(|(now, first)| {
                f64::from(now).clamp(LEAST_SIDE * f64::from(first), MAX_SIDE * f64::from(first))
                    as i32
            });
        rect = Rect::new(
            rect.x + (rect.width - wanted[0]) / 2,
            rect.y + (rect.height - wanted[1]) / 2,
            wanted[0],
            wanted[1],
        );
    } else {
        // At the edge of the picture OpenCV cuts it.
        rect = Rect::new(
            rect.x + (rect.width - window.width) / 2,
            rect.y + (rect.height - window.height) / 2,
            window.width,
            window.height,
        );
    }
    Ok(Some(PixelArea {
        u: rect.x + area.u,
        v: rect.y + area.v,
        width: rect.width,
        height: rect.height,
    }))
}
