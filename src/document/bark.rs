//! `bark.png`: the bark of the filmed trunk as a tile; written and read.

use crate::files::WriteError;
use crate::model::{Rgb, Size};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Name of the tile in the folder of a capture.
pub const BARK_FILE: &str = "bark.png";
/// No tile is larger, px a side: a small file may unfold to more than the memory holds.
const LARGEST_PX: u32 = 4096;

/// The bytes of a PNG file; the same on every machine.
///
/// # Errors
/// The picture has no area, or other than three bytes a pixel.
pub fn png(picture: &Rgb) -> Result<Vec<u8>, WriteError> {
    let Size { width, height } = picture.size;
    let mut bytes = Vec::new();
    if picture.pixels.len() != 3 * picture.size.area() || picture.pixels.is_empty() {
        let what = format!("{} bytes are no picture", picture.pixels.len());
        return Err(WriteError::no_form(BARK_FILE, what));
    }
    PngEncoder::new(&mut bytes)
        .write_image(&picture.pixels, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| WriteError::no_form(BARK_FILE, format!("it cannot be a PNG: {e}")))?;
    Ok(bytes)
}

/// The tile in `dir`.
///
/// # Errors
/// It is missing, or no picture of its kind, for the user to read.
pub(super) fn read(dir: &Path) -> Result<Rgb, String> {
    let bytes = std::fs::read(dir.join(BARK_FILE)).map_err(|e| e.to_string())?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), image::ImageFormat::Png);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(LARGEST_PX), Some(LARGEST_PX));
    reader.limits(limits);
    let rgb = reader.decode().map_err(|e| e.to_string())?.into_rgb8();
    Ok(Rgb {
        size: Size::new(rgb.width(), rgb.height()),
        pixels: rgb.into_raw(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_damage_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let tile = Rgb {
            size: Size::new(2, 1),
            pixels: vec![1, 2, 3, 200, 100, 50],
        };
        let bytes = png(&tile).expect("a file");
        let file = dir.path().join(BARK_FILE);
        assert!(read(dir.path()).is_err(), "missing");
        std::fs::write(&file, &bytes).expect("written");
        assert_eq!(read(dir.path()), Ok(tile.clone()));
        for damaged in [&bytes[..20], b"no picture", &[]] {
            std::fs::write(&file, damaged).expect("written");
            assert!(read(dir.path()).is_err());
        }
        let short = Rgb {
            pixels: vec![1, 2],
            ..tile
        };
        assert!(png(&short).is_err());
    }
}
