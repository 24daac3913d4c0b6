//! What is known of the depth beside a film: what the user says goes before what the film says.

use super::error::SourceError;
use crate::config;
use crate::depth;
use crate::model::{DepthFormat, DepthImage, Pinhole, Size};
use std::path::Path;

/// By how much the proportions of depth image and picture may differ.
const SAME_VIEW: f64 = 0.01;

/// What a film says of its depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SaidOfDepth {
    pub pinhole: Option<Pinhole>,
    pub unit_m: Option<f64>,
}

impl SaidOfDepth {
    /// The format of the depth in the film `path`.
    ///
    /// # Errors
    /// Camera or unit is known to nobody.
    pub fn format(
        &self,
        path: &Path,
        settings: &config::Depth,
    ) -> Result<DepthFormat, SourceError> {
        let Some(pinhole) = depth::pinhole(settings).or(self.pinhole) else {
            return Err(SourceError::bad_format(
                path,
                "nothing says what camera its depth belongs to; give --depth-camera FILE, or --no-depth \
                 for the colours alone",
            ));
        };
        let given = Some(settings.unit_m).filter(|unit_m| *unit_m > 0.0);
        let Some(unit_m) = given.or(self.unit_m) else {
            return Err(SourceError::bad_format(
                path,
                "nothing says how long a count of its depth is; give --depth-unit METRES (mostly \
                 0.001), or --no-depth for the colours alone",
            ));
        };
        Ok(DepthFormat { pinhole, unit_m })
    }
}

/// Checks that a depth image shows what the picture shows.
///
/// # Errors
/// It has other proportions: why it cannot be used.
pub(super) fn check_view(depth: &DepthImage, picture: Size) -> Result<(), String> {
    let across = f64::from(depth.size.width) / f64::from(picture.width);
    let down = f64::from(depth.size.height) / f64::from(picture.height);
    if (across / down - 1.0).abs() <= SAME_VIEW {
        return Ok(());
    }
    Err(format!(
        "the depth image is {}, the picture {picture}; it must be registered with the picture",
        depth.size
    ))
}
