//! A picture inside a page.

use super::ExportError;
use crate::document::jpeg;
use crate::model::Rgb;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

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
