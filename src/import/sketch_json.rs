//! A sketch in JSON: `{"width": W, "height": H, "strokes": [{"polyline_px": [[u, v], ...],
//! "trunk": true, "width_px": 9, "name": "left limb"}, ...], "polygon_px": [[u, v], ...]}`. All but
//! the size and the lines may be left out; `polygon_px` is the outline of the crown.

use super::error::ImportError;
use super::sketch::{Sketch, Stroke, picture_size};
use nalgebra::Point2;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SketchFile {
    width: u32,
    height: u32,
    strokes: Vec<StrokeEntry>,
    #[serde(default)]
    polygon_px: Vec<[f64; 2]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StrokeEntry {
    polyline_px: Vec<[f64; 2]>,
    #[serde(default)]
    trunk: bool,
    width_px: Option<f64>,
    name: Option<String>,
}

/// # Errors
/// It is of another form, or its picture of no usable size.
pub(super) fn parse(text: &str) -> Result<Sketch, ImportError> {
    let file: SketchFile = serde_json::from_str(text).map_err(|e| {
        ImportError::bad_format(format!("{e}; it must hold width, height and strokes"))
    })?;
    let mut strokes = Vec::with_capacity(file.strokes.len());
    for (number, entry) in (1..).zip(file.strokes) {
        strokes.push(Stroke {
            name: entry.name.unwrap_or_else(|| format!("stroke {number}")),
            points_px: entry.polyline_px.into_iter().map(Point2::from).collect(),
            is_trunk: entry.trunk,
            width_px: entry.width_px,
        });
    }
    Ok(Sketch {
        size: picture_size(file.width.into(), file.height.into())?,
        strokes,
        crown_px: file.polygon_px.into_iter().map(Point2::from).collect(),
    })
}

#[cfg(test)]
mod tests {
    use crate::import::read_sketch;

    #[test]
    fn strokes_are_read_with_all_that_is_said_of_them() {
        let text = r#"{"width": 640, "height": 480, "polygon_px": [[1, 1], [9, 1], [5, 9]], "strokes": [
            {"polyline_px": [[320, 450], [320, 450], [320, 200]], "trunk": true, "width_px": 9},
            {"polyline_px": [[320, 300], [200, 240]], "name": "limb"}]}"#;
        let sketch = read_sketch(text.as_bytes()).expect("sound");
        assert_eq!(sketch.crown_px.len(), 3);
        let [trunk, limb] = &sketch.strokes[..] else {
            panic!("{sketch:?}");
        };
        assert!(trunk.is_trunk && !limb.is_trunk);
        assert_eq!((trunk.points_px.len(), trunk.width_px), (2, Some(9.0)));
        assert_eq!(limb.name, "limb");
    }

    #[test]
    fn what_cannot_be_read_is_said_in_one_line() {
        let of =
            |strokes: &str| format!(r#"{{"width": 640, "height": 480, "strokes": {strokes}}}"#);
        for (text, expected) in [
            ("{".to_owned(), "strokes"),
            (r#"{"width": 640, "height": 480}"#.into(), "strokes"),
            (of("[]"), "no strokes"),
            (
                of(r#"[{"polyline_px": [[1, 2]]}]"#),
                "stroke 1: it has fewer",
            ),
            (
                of(r#"[{"polyline_px": [[1, 2], [1, 2]]}]"#),
                "fewer than two",
            ),
            (of(r#"[{"polyline_px": [[1, 2], [1e999, 2]]}]"#), "damaged"),
            (of(r#"[{"polyline_px": [[1, 2], [NaN, 2]]}]"#), "damaged"),
            (of(r#"[{"polyline_px": [[1, 2], [700, 2]]}]"#), "outside"),
            (
                of(r#"[{"polyline_px": [[1, 2], [3, 4]], "width_px": 0}]"#),
                "width",
            ),
            (
                of(r#"[{"polyline_px": [[1, 2], [3, 4]], "colour": 1}]"#),
                "colour",
            ),
            (of("[]").replace("640", "64000"), "64 to 8192"),
        ] {
            let error = read_sketch(text.as_bytes()).expect_err(&text).to_string();
            assert!(
                error.contains(expected) && !error.contains('\n'),
                "{text}: {error}"
            );
        }
    }
}
