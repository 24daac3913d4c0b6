//! A crown stroke: the closed line that a user draws round the crown in a picture.

use super::error::ImportError;
use super::sketch::{Sketch, parsed, picture_size};
use crate::model::Size;
use nalgebra::Point2;
use serde::Deserialize;

/// A closed line in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Crown {
    /// Of the picture that it is drawn in.
    pub size: Size,
    /// Its corners, px.
    pub corners_px: Vec<Point2<f64>>,
}

/// `{"width": W, "height": H, "polygon_px": [[u, v], ...]}`; an outline's `frame` and a sketch's
/// strokes may stand beside it.
#[derive(Deserialize)]
struct CrownFile {
    width: u32,
    height: u32,
    polygon_px: Vec<[f64; 2]>,
}

/// Reads a crown stroke: JSON with `polygon_px`, or an SVG drawing with a crown (see the sketch) or
/// one stroke alone.
///
/// # Errors
/// It is neither, or holds no crown.
pub fn read_crown(bytes: &[u8]) -> Result<Crown, ImportError> {
    let text = std::str::from_utf8(bytes).map_err(|_| ImportError::bad_format("it is no text"))?;
    if text.trim_start().starts_with('{') {
        let file: CrownFile = serde_json::from_str(text).map_err(|e| {
            ImportError::bad_format(format!("{e}; it must hold width, height and polygon_px"))
        })?;
        return Ok(Crown {
            size: picture_size(file.width.into(), file.height.into())?,
            corners_px: file.polygon_px.into_iter().map(Point2::from).collect(),
        });
    }
    let Sketch {
        size,
        mut strokes,
        crown_px,
    } = parsed(bytes)?;
    if !crown_px.is_empty() {
        return Ok(Crown {
            size,
            corners_px: crown_px,
        });
    }
    match (strokes.pop(), strokes.is_empty()) {
        (Some(only), true) => Ok(Crown {
            size,
            corners_px: only.points_px,
        }),
        _ => Err(ImportError::NoCrown),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crown_is_read_from_every_file_that_may_hold_one() {
        let corners = [[10.0, 20.0], [90.0, 20.0], [50.0, 80.0]].map(Point2::from);
        for text in [
            r#"{"frame": 0, "width": 640, "height": 360, "polygon_px": [[10, 20], [90, 20], [50, 80]]}"#,
            r#"{"width": 640, "height": 360, "strokes": [{"polyline_px": [[50, 99], [50, 80]]}],
                "polygon_px": [[10, 20], [90, 20], [50, 80]]}"#,
            r#"<svg width="640" height="360"><polygon id="crown" points="10.5,20.5 90.5,20.5 50.5,80.5"/></svg>"#,
            r#"<svg width="640" height="360"><path d="M50.5 99.5 V80.5"/>
                <polygon id="crown" points="10.5,20.5 90.5,20.5 50.5,80.5"/></svg>"#,
        ] {
            let crown = read_crown(text.as_bytes()).expect(text);
            assert_eq!(crown.size, Size::new(640, 360));
            assert_eq!(crown.corners_px[..3], corners, "{text}");
        }
        for (text, expected) in [
            ("", "empty"),
            ("{", "polygon_px"),
            (r#"{"width": 640, "height": 360}"#, "polygon_px"),
            (r#"<svg width="640" height="360"/>"#, "no crown"),
            (
                r#"<svg width="640" height="360"><path d="M1 2 L3 4"/><path d="M5 6 L7 8"/></svg>"#,
                "no crown",
            ),
        ] {
            let error = read_crown(text.as_bytes()).expect_err(text).to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
