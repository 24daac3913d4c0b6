//! Which pixels are tree: a polygon, a mask image, scribbles, or found by itself, in a film by its
//! motion, in one picture in its middle.

mod auto;
mod density;
mod error;
mod feet;
mod laplacian;
mod matting;
mod middle;
mod polygon;
mod reduced;
mod region;
mod scribbles;
mod solve;
mod steady;
mod stem;
mod still;
mod trunk;

pub use auto::{AutoOutline, Found, whole};
pub use density::{DensityError, density};
pub use error::OutlineError;
pub use matting::{alpha, outline as from_scribbles};
pub use middle::{Margin, in_middle};
pub use polygon::{PolygonFile, crossing, outline as from_polygon};
pub use reduced::Reduced;
pub use scribbles::{Given, Mark, Scribbles};
pub use stem::stem;

use crate::model::{Outline, Size};
use nalgebra::Point2;
use std::path::{Path, PathBuf};

/// Where the outline comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OutlineSpec {
    /// Where motion energy concentrates.
    Auto,
    /// A polygon in a JSON file, a mask image, or scribbles.
    File(PathBuf),
}

impl std::str::FromStr for OutlineSpec {
    type Err = std::convert::Infallible;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        Ok(if s == "auto" {
            OutlineSpec::Auto
        } else {
            OutlineSpec::File(s.into())
        })
    }
}

/// Reads an outline for pictures of `size` from a JSON polygon, a mask image or scribbles.
///
/// # Errors
/// The file cannot be read, is none of these, is for another size, the polygon encloses nothing
/// usable, or the scribbles lack one of their colours.
pub fn load(path: &Path, size: Size) -> Result<Given, OutlineError> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|source| OutlineError::Unreadable {
        name: name.clone(),
        source,
    })?;
    if bytes.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        return scribbles::read(path, size);
    }
    parse(&String::from_utf8_lossy(&bytes), name, size).map(Given::Region)
}

/// Reads the text of an outline file for pictures of `size`; `name` is for messages.
///
/// # Errors
/// As for [`load`].
pub fn parse(text: &str, name: String, size: Size) -> Result<Outline, OutlineError> {
    let file = polygon::parse(text, &name)?;
    let found = Size::new(file.width, file.height);
    if found != size {
        return Err(OutlineError::WrongSize {
            name,
            found,
            wanted: size,
        });
    }
    let polygon_px: Vec<Point2<f64>> = file.polygon_px.into_iter().map(Point2::from).collect();
    polygon::outline(&polygon_px, size).map_err(|e| match e {
        OutlineError::BadPolygon { what } => OutlineError::BadFile { name, what },
        other => other,
    })
}

/// The largest piece of a region, its holes filled, with its border as a polygon.
///
/// # Errors
/// The region is empty.
pub fn in_one_piece(region: &Outline) -> Result<Outline, OutlineError> {
    closed(region.size, &region.mask, 0)
}

/// The largest piece of a mask (255 or 0, row by row, of a picture of this `size`) whose gaps of up
/// to `close_px` are closed, its holes filled, with its border as a polygon.
///
/// # Errors
/// The mask is empty.
pub fn closed(size: Size, mask: &[u8], close_px: u32) -> Result<Outline, OutlineError> {
    let found = region::close_to_one(size, mask, close_px);
    found
        .map_err(OutlineError::bad_polygon)?
        .ok_or_else(|| OutlineError::bad_polygon("it is empty"))
}

/// The region that polygons (px, in a picture of `size`) cover together, in one piece.
///
/// # Errors
/// One of them is no outline, or there are none.
pub fn covered(polygons_px: &[Vec<Point2<f64>>], size: Size) -> Result<Outline, OutlineError> {
    let mut mask = vec![0; size.area()];
    for polygon_px in polygons_px {
        let part = polygon::outline(polygon_px, size)?;
        for (pixel, own) in mask.iter_mut().zip(part.mask) {
            *pixel |= own;
        }
    }
    in_one_piece(&Outline {
        size,
        mask,
        polygon_px: Vec::new(),
        matte: None,
        other_foot_px: None,
    })
}
