//! Outlines drawn as a black-and-white picture: white is tree.

use super::{OutlineError, region};
use crate::model::{Outline, Size};
use std::path::Path;

/// Share of grey pixels above which a picture is no mask: soft edges have some, scribbles and photographs many.
const MOST_GREY: f64 = 0.05;

/// Reads a mask image (PNG, JPEG, BMP).
///
/// # Errors
/// It cannot be read, is not of `size`, is not black and white, or has nothing white.
pub fn outline(path: &Path, size: Size) -> Result<Outline, OutlineError> {
    let name = path.display().to_string();
    let bad = |what: String| OutlineError::BadFile { name: name.clone(), what };
    let picture =
        image::open(path).map_err(|e| bad(format!("it is neither a JSON polygon nor a picture ({e})")))?.into_luma8();
    let found = Size::new(picture.width(), picture.height());
    if found != size {
        return Err(OutlineError::WrongSize { name, found, wanted: size });
    }
    let grey = picture.as_raw().iter().filter(|&&p| (64..192).contains(&p)).count();
    if grey as f64 > MOST_GREY * size.area() as f64 {
        return Err(bad("it is not black and white, as a mask is (white = tree)".into()));
    }
    let mask: Vec<u8> = picture.as_raw().iter().map(|&p| if p >= 128 { 255 } else { 0 }).collect();
    let one = region::close_to_one(size, &mask, 0).map_err(|e| bad(e.to_string()))?;
    one.ok_or_else(|| bad("nothing in it is white, and white is tree".into()))
}
