//! Coloured markers on the branches.

use super::command_error::CommandError;
use super::common::parse_within;
use crate::config::{Config, MarkerCorrection, MarkerWindow, Markers};
use crate::files::{LARGEST_NOTE, read_bounded, without_byte_order_mark};
use crate::markers::check_places;
use crate::model::Size;
use anyhow::anyhow;
use clap::Args;
use serde::Deserialize;
use std::path::Path;

/// Smallest and largest plausible side of a tag, m.
const LEAST_TAG_M: f64 = 0.005;
const MAX_TAG_M: f64 = 5.0;

/// Marker options of `capture` and `replay`.
#[derive(Clone, Debug, Default, Args)]
pub struct MarkerArgs {
    /// Coloured markers on the branches, which are followed by their hue: a JSON file with a window
    /// around each of them in the first frame, or `auto` to find blobs of one hue there (setting
    /// markers.hue_deg, red by default). See docs/markers.md.
    #[arg(long, value_name = "FILE|auto", value_parser = MarkerSpec::parse)]
    markers: Option<MarkerSpec>,
    /// A printed square tag beside the trunk (AprilTag 36h11) gives the scale: side of its black square,
    /// m, e.g. 0.165.
    #[arg(long, value_name = "METRES", value_parser = side, conflicts_with_all = ["metres_per_px", "scale"])]
    tag: Option<f64>,
}

/// Parses the side of a tag, m.
fn side(text: &str) -> Result<f64, String> {
    parse_within(
        text.trim().trim_end_matches('m'),
        LEAST_TAG_M..=MAX_TAG_M,
        "give the side of the black square in metres, 0.005 to 5, like 0.165",
    )
}

impl MarkerArgs {
    /// Applies the options of the command line.
    pub fn set(&self, config: &mut Config) {
        if let Some(size_m) = self.tag {
            config.tag.size_m = size_m;
        }
        match &self.markers {
            None => {}
            Some(MarkerSpec::Auto) => config.markers.find = true,
            Some(MarkerSpec::Given(file)) => {
                config.markers.windows = file.markers.clone();
                config.markers.corrections = file.corrections.clone();
            }
        }
    }

    /// Checks that the windows were drawn in a picture of this size.
    ///
    /// # Errors
    /// They were drawn in one of another size.
    pub fn check_size(&self, size: Size) -> Result<(), CommandError> {
        match &self.markers {
            Some(MarkerSpec::Given(file)) => file.check_size(size),
            _ => Ok(()),
        }
    }
}

/// Checks that the markers of these settings, from `--markers` or from a file of settings, lie in pictures of
/// this size.
///
/// # Errors
/// One does not.
pub fn check_in_picture(markers: &Markers, size: Size) -> Result<(), CommandError> {
    check_places(&markers.windows, &markers.corrections, size)
        .map_err(|e| CommandError::BadUsage(anyhow!("--markers: {e}")))
}

/// Where the markers come from.
#[derive(Clone, Debug)]
enum MarkerSpec {
    Auto,
    Given(MarkerFile),
}

impl MarkerSpec {
    fn parse(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        MarkerFile::read(text).map(Self::Given)
    }
}

/// A file of markers.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with width, height and markers"
)]
pub struct MarkerFile {
    /// Of the picture that the windows were drawn in, px.
    width: u32,
    height: u32,
    /// The markers, their windows and parents.
    pub markers: Vec<MarkerWindow>,
    #[serde(default)]
    corrections: Vec<MarkerCorrection>,
}

impl MarkerFile {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// It cannot be read, is of another form, or names no marker.
    pub fn read(path: &str) -> Result<Self, String> {
        let bytes = read_bounded(Path::new(path), LARGEST_NOTE)
            .map_err(|e| format!("{e}; give a file of markers"))?;
        Self::of_json(&bytes)
    }

    fn of_json(bytes: &[u8]) -> Result<Self, String> {
        let text = String::from_utf8_lossy(bytes);
        let file: Self = serde_json::from_str(without_byte_order_mark(&text))
            .map_err(|e| format!("{e}; it must hold width, height and markers"))?;
        if file.markers.is_empty() {
            return Err("it holds no markers".into());
        }
        Ok(file)
    }

    /// Size of the picture that the windows were drawn in.
    pub fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }

    /// Checks that the windows were drawn in a picture of this size.
    ///
    /// # Errors
    /// They were drawn in one of another size.
    fn check_size(&self, size: Size) -> Result<(), CommandError> {
        let own = self.size();
        if own == size {
            return Ok(());
        }
        Err(CommandError::BadUsage(anyhow!(
            "--markers is for a picture of {own}, this one is {size}; draw the windows on the first frame of this film"
        )))
    }

    /// Whether it gives places of markers in later frames.
    pub fn has_corrections(&self) -> bool {
        !self.corrections.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_names_markers_with_windows_and_parents() {
        let text = r#"{"width": 640, "height": 360,
            "markers": [{"name": "A", "window_px": [1, 2, 16, 16]},
                        {"name": "B", "window_px": [9, 2, 16, 16], "parent": "A"}],
            "corrections": [{"marker": "B", "frame": 12, "at_px": [20.5, 9]}]}"#;
        // As some editors of Windows write it.
        let text = format!("\u{feff}{text}");
        let file = MarkerFile::of_json(text.as_bytes()).expect("markers");
        let args = MarkerArgs {
            markers: Some(MarkerSpec::Given(file)),
            tag: None,
        };
        let mut config = Config::default();
        args.set(&mut config);
        assert_eq!(config.markers.windows[1].parent.as_deref(), Some("A"));
        assert_eq!(config.markers.corrections[0].at_px, [20.5, 9.0]);
        assert!(config.check().is_ok());
        assert!(args.check_size(Size::new(640, 360)).is_ok());
        assert!(args.check_size(Size::new(320, 180)).is_err());
    }

    #[test]
    fn a_file_of_another_form_is_refused() {
        let cases = [
            ("{", "it must hold width"),
            (
                r#"{"width": 6, "height": 3, "markers": []}"#,
                "holds no markers",
            ),
            (
                r#"{"width": 6, "height": 3, "markers": [{"name": "A", "window": [1, 2, 3, 4]}]}"#,
                "unknown field `window`",
            ),
        ];
        for (text, expected) in cases {
            let why = MarkerFile::of_json(text.as_bytes())
                .err()
                .unwrap_or_default();
            assert!(why.contains(expected), "{text}: {why}");
        }
    }
}
