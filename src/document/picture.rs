//! `frame.jpg`: the picture of a document; written and read.

use super::note::PictureNote;
use crate::files::WriteError;
use crate::model::{Picture, Rgb, Size};
use image::codecs::jpeg::JpegEncoder;
use std::path::Path;
use std::sync::Arc;

/// Name of the picture in the folder of a capture.
pub const PICTURE_FILE: &str = "frame.jpg";
/// Grain is gone, twigs are not.
const QUALITY: u8 = 90;

/// The bytes of a JPEG file; the same on every machine.
///
/// # Errors
/// The picture has no area, or is larger than the 65535 pixels a side of the format.
pub fn jpeg(picture: &Rgb) -> Result<Vec<u8>, WriteError> {
    let mut bytes = Vec::new();
    let (width, height) = (picture.size.width, picture.size.height);
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(
            &picture.pixels,
            width,
            height,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|e| WriteError::no_form(PICTURE_FILE, format!("it cannot be a JPEG: {e}")))?;
    Ok(bytes)
}

/// The bytes of the picture that `note` speaks of, from the document in `dir`.
///
/// # Errors
/// It cannot be read, for the user to read.
pub(super) fn bytes(dir: &Path, note: &PictureNote) -> Result<Vec<u8>, String> {
    // A name and no way: the file lies in the folder.
    let name = Path::new(&note.file).file_name().ok_or("it has no name")?;
    std::fs::read(dir.join(name)).map_err(|e| e.to_string())
}

/// The picture of these bytes, which must be of the film's size.
///
/// # Errors
/// It is no picture or one of another size, for the user to read.
pub(super) fn decoded(bytes: &[u8], note: &PictureNote, size: Size) -> Result<Picture, String> {
    let rgb = image::load_from_memory(bytes)
        .map_err(|e| e.to_string())?
        .into_rgb8();
    let found = Size::new(rgb.width(), rgb.height());
    if found != size {
        return Err(format!("it is {found}, and the film is {size}"));
    }
    Ok(Picture {
        rgb: Arc::new(Rgb {
            size,
            pixels: rgb.into_raw(),
        }),
        frame: note.frame,
        time_s: note.time_s,
    })
}
