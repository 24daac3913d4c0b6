//! Which pixels are tree: a polygon, a mask image, or found by itself.

mod auto;
mod mask;
mod polygon;
mod region;

pub use auto::{AutoOutline, Found, whole};
pub use polygon::{PolygonFile, crossing, outline as from_polygon};

use crate::model::{Outline, Size};
use std::path::{Path, PathBuf};

/// Why an outline was not taken.
#[derive(Debug, thiserror::Error)]
pub enum OutlineError {
    #[error(
        "cannot read outline {name}: {source}; check the name, or leave --outline out to find the tree by its motion"
    )]
    Unreadable { name: String, source: std::io::Error },
    #[error("outline {name}: {what}; draw it on a frame of this clip, or leave --outline out")]
    BadFile { name: String, what: String },
    #[error("outline {name} is for {found}, the picture is {wanted}; draw it on a frame of this clip")]
    WrongSize { name: String, found: Size, wanted: Size },
    #[error("the outline is no usable polygon: {what}")]
    BadPolygon { what: String },
}

/// Where the outline comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OutlineSpec {
    /// Where motion energy concentrates.
    Auto,
    /// A polygon in a JSON file, or a mask image.
    File(PathBuf),
}

impl std::str::FromStr for OutlineSpec {
    type Err = std::convert::Infallible;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        Ok(if s == "auto" { OutlineSpec::Auto } else { OutlineSpec::File(s.into()) })
    }
}

/// Reads an outline for pictures of `size` from a JSON polygon or a mask image.
///
/// # Errors
/// The file cannot be read, is neither of the two, is for another size, or the polygon encloses nothing usable.
pub fn load(path: &Path, size: Size) -> Result<Outline, OutlineError> {
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|source| OutlineError::Unreadable { name: name.clone(), source })?;
    if bytes.iter().find(|b| !b.is_ascii_whitespace()) != Some(&b'{') {
        return mask::outline(path, size);
    }
    parse(&String::from_utf8_lossy(&bytes), name, size)
}

/// Reads the text of an outline file for pictures of `size`; `name` is for messages.
///
/// # Errors
/// As for [`load`].
pub fn parse(text: &str, name: String, size: Size) -> Result<Outline, OutlineError> {
    let file = polygon::parse(text, &name)?;
    let found = Size::new(file.width, file.height);
    if found != size {
        return Err(OutlineError::WrongSize { name, found, wanted: size });
    }
    polygon::outline(&file.polygon_px, size).map_err(|e| match e {
        OutlineError::BadPolygon { what } => OutlineError::BadFile { name, what },
        other => other,
    })
}
