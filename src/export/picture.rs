//! The picture of a capture as JPEG.

use super::ExportError;
use crate::model::Rgb;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;

/// Name of the picture in the folder of a capture.
pub const PICTURE_FILE: &str = "frame.jpg";
/// Grain is gone, twigs are not.
const QUALITY: u8 = 90;

/// The picture as an address that holds it, for a page that is one file.
///
/// # Errors
/// As of [`jpeg`].
pub fn data_address(picture: &Rgb) -> Result<String, ExportError> {
    Ok(format!(
        "data:image/jpeg;base64,{}",
        STANDARD.encode(jpeg(picture)?)
    ))
}

/// The bytes of a JPEG file; the same on every machine.
///
/// # Errors
/// The picture has no area, or is larger than the 65535 pixels a side of the format.
pub fn jpeg(picture: &Rgb) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Vec::new();
    let (width, height) = (picture.size.width, picture.size.height);
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(
            &picture.pixels,
            width,
            height,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|e| ExportError::unfit(format!("the picture cannot be a JPEG: {e}")))?;
    Ok(bytes)
}
