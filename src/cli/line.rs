//! Lines that were drawn in a picture, for `--trunk` and `--branch-stroke`.

use super::command_error::CommandError;
use crate::model::Size;
use anyhow::anyhow;
use serde::Deserialize;

/// A line in a picture of the given size.
#[derive(Clone, Debug, Deserialize)]
pub struct Line {
    width: u32,
    height: u32,
    /// At least two points (u, v), px.
    pub polyline_px: Vec<[f64; 2]>,
}

impl Line {
    /// Reads the JSON file at `path`.
    ///
    /// # Errors
    /// It cannot be read, is of another form, or holds no line.
    pub fn read(path: &str) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|e| format!("{e}; give a file"))?;
        Self::of_json(&bytes)
    }

    /// The line that a JSON file of these bytes holds.
    ///
    /// # Errors
    /// It is of another form, or holds no line.
    pub fn of_json(bytes: &[u8]) -> Result<Self, String> {
        let line: Self = serde_json::from_slice(bytes)
            .map_err(|e| format!("{e}; it must hold width, height and polyline_px"))?;
        if line.polyline_px.iter().flatten().any(|x| !x.is_finite()) {
            return Err("polyline_px holds what is no number".into());
        }
        if line.polyline_px.len() < 2 {
            return Err("polyline_px needs at least two points".into());
        }
        Ok(line)
    }

    /// Checks that it was drawn in a picture of this size; `option` is what it was given to.
    ///
    /// # Errors
    /// It was drawn in one of another size.
    pub fn check_size(&self, option: &str, size: Size) -> Result<(), CommandError> {
        if Size::new(self.width, self.height) == size {
            return Ok(());
        }
        Err(CommandError::BadUsage(anyhow!(
            "{option} is for a picture of {}x{}, this one is {size}; draw it on a frame of this \
             clip",
            self.width,
            self.height
        )))
    }
}
