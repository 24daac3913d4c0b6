//! PNG files of a document: written and read.

use crate::files::WriteError;
use crate::model::{Luma, Rgb, Size};
use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// The bytes of a PNG file in colour; the same on every machine.
///
/// # Errors
/// The picture has no area, or other than three bytes a pixel.
pub fn png(picture: &Rgb) -> Result<Vec<u8>, WriteError> {
    encoded(&picture.pixels, picture.size, 3, ExtendedColorType::Rgb8)
}

/// The same in grey.
///
/// # Errors
/// The picture has no area, or other than one byte a pixel.
pub fn grey_png(picture: &Luma) -> Result<Vec<u8>, WriteError> {
    encoded(&picture.pixels, picture.size, 1, ExtendedColorType::L8)
}

/// The same in grey of 16 bits a pixel, row by row.
///
/// # Errors
/// The picture has no area, or other than one number a pixel.
pub(super) fn grey16_png(size: Size, pixels: &[u16]) -> Result<Vec<u8>, WriteError> {
    // The encoder takes them as the machine has them, and writes the high byte first.
    let bytes: Vec<u8> = pixels.iter().flat_map(|x| x.to_ne_bytes()).collect();
    encoded(&bytes, size, 2, ExtendedColorType::L16)
}

fn encoded(
    pixels: &[u8],
    size: Size,
    bytes_per_pixel: usize,
    colour: ExtendedColorType,
) -> Result<Vec<u8>, WriteError> {
    let mut bytes = Vec::new();
    if pixels.len() != bytes_per_pixel * size.area() || pixels.is_empty() {
        let what = format!("{} bytes are no picture", pixels.len());
        return Err(WriteError::no_form("a PNG file", what));
    }
    PngEncoder::new(&mut bytes)
        .write_image(pixels, size.width, size.height, colour)
        .map_err(|e| WriteError::no_form("a PNG file", format!("it cannot be one: {e}")))?;
    Ok(bytes)
}

/// The picture in the file `name` in `dir`, if it is no larger than `most`: a small file may unfold
/// to more than the memory holds.
///
/// # Errors
/// It is missing, or no picture of its kind, for the user to read.
pub(super) fn read(dir: &Path, name: &str, most: Size) -> Result<DynamicImage, String> {
    let bytes = std::fs::read(dir.join(name)).map_err(|e| format!("{name}: {e}"))?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), image::ImageFormat::Png);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(most.width), Some(most.height));
    reader.limits(limits);
    reader.decode().map_err(|e| format!("{name}: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: Size = Size {
        width: 4,
        height: 4,
    };

    #[test]
    fn what_was_written_is_read_and_damage_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let picture = Rgb {
            size: Size::new(2, 1),
            pixels: vec![1, 2, 3, 200, 100, 50],
        };
        let bytes = png(&picture).expect("a file");
        let file = dir.path().join("a.png");
        let read = |most| read(dir.path(), "a.png", most);
        assert!(read(MOST).is_err_and(|why| why.starts_with("a.png: ")));
        std::fs::write(&file, &bytes).expect("written");
        let found = read(MOST).expect("a picture").into_rgb8();
        assert_eq!(found.into_raw(), picture.pixels);
        assert!(read(Size::new(1, 1)).is_err(), "too large");
        for damaged in [&bytes[..20], b"no picture", &[]] {
            std::fs::write(&file, damaged).expect("written");
            assert!(read(MOST).is_err());
        }
    }

    #[test]
    fn grey_is_written_as_grey_and_what_is_no_picture_is_refused() {
        let dir = tempfile::tempdir().expect("a folder");
        let grey = Luma {
            size: Size::new(2, 2),
            pixels: vec![0, 127, 128, 255],
        };
        let bytes = grey_png(&grey).expect("a file");
        std::fs::write(dir.path().join("a.png"), bytes).expect("written");
        let found = read(dir.path(), "a.png", MOST).expect("a picture");
        assert_eq!(found, DynamicImage::ImageLuma8(found.to_luma8()));
        assert_eq!(found.into_luma8().into_raw(), grey.pixels);
        let short = Luma {
            pixels: vec![1, 2],
            ..grey
        };
        assert!(grey_png(&short).is_err());
    }
}
