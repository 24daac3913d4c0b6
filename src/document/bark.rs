//! `bark.png`: the bark of the filmed trunk as a tile.

use super::png;
use crate::model::{Rgb, Size};
use std::path::Path;

/// Name of the tile in the folder of a capture.
pub const BARK_FILE: &str = "bark.png";
/// No tile is larger, px a side.
const LARGEST_PX: u32 = 4096;

/// The tile in `dir`.
///
/// # Errors
/// It is missing, or no picture of its kind, for the user to read.
pub(super) fn read(dir: &Path) -> Result<Rgb, String> {
    let most = Size::new(LARGEST_PX, LARGEST_PX);
    let rgb = png::read(dir, BARK_FILE, most)?.into_rgb8();
    Ok(Rgb {
        size: Size::new(rgb.width(), rgb.height()),
        pixels: rgb.into_raw(),
    })
}
