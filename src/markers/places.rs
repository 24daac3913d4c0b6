//! Whether what a user says of markers lies in the picture.

use super::area::PixelArea;
use super::error::MarkerError;
use crate::config::{MarkerCorrection, MarkerWindow};
use crate::model::Size;

/// Checks that the middles of all windows and all corrections lie in pictures of this size.
///
/// # Errors
/// The first one that does not.
pub fn check_places(
    windows: &[MarkerWindow],
    corrections: &[MarkerCorrection],
    size: Size,
) -> Result<(), MarkerError> {
    windows
        .iter()
        .try_for_each(|window| check_window(window, size))?;
    let off = corrections
        .iter()
        .find(|correction| !size.contains(correction.at_px.into()));
    match off {
        None => Ok(()),
        Some(correction) => Err(MarkerError::CorrectionOffPicture {
            name: correction.marker.clone(),
            frame: correction.frame,
            size,
        }),
    }
}

/// Checks that the middle of a window lies in pictures of this size.
///
/// # Errors
/// It does not.
pub(super) fn check_window(window: &MarkerWindow, size: Size) -> Result<(), MarkerError> {
    match size.contains(PixelArea::of_window(window).middle_px()) {
        true => Ok(()),
        false => Err(MarkerError::OffPicture {
            name: window.name.clone(),
            size,
        }),
    }
}
