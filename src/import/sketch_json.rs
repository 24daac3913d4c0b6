//! A sketch in JSON: `{"width": W, "height": H, "strokes": [{"polyline_px": [[u, v], ...],
//! "trunk": true, "width_px": 9, "name": "left limb"}, ...], "polygon_px": [[u, v], ...]}`. All but
//! the size may be left out; `polygon_px` is the outline of the crown. An outline's file is one, too
//! (`frame` beside `polygon_px`), and so is that of one stroke (`polyline_px` in place of `strokes`).

use super::error::ImportError;
use super::sketch::{Sketch, Stroke, picture_size};
use nalgebra::Point2;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with width, height and lines"
)]
struct SketchFile {
    width: u32,
    height: u32,
    /// Of the film that an outline was drawn on; it says nothing of the strokes.
    #[serde(rename = "frame")]
    _frame: Option<u64>,
    #[serde(default)]
    strokes: Vec<StrokeEntry>,
    polyline_px: Option<Vec<[f64; 2]>>,
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
        let what = "a line is {\"width\": W, \"height\": H, \"polyline_px\": [[u, v], ...]}, a crown has \
                    polygon_px instead, a drawing strokes";
        ImportError::bad_format(format!("its JSON holds no stroke ({e}); {what}"))
    })?;
    let mut strokes = Vec::with_capacity(file.strokes.len());
    let single = file.polyline_px.map(|polyline_px| StrokeEntry {
        polyline_px,
        trunk: false,
        width_px: None,
        name: None,
    });
    for (number, entry) in (1..).zip(single.into_iter().chain(file.strokes)) {
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
    use crate::import::{read_sketch, read_strokes};

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
    fn a_crown_is_read_from_every_file_that_may_hold_one() {
        let corners = [[10.0, 20.0], [90.0, 20.0], [50.0, 80.0]].map(nalgebra::Point2::from);
        for text in [
            r#"{"frame": 0, "width": 640, "height": 360, "polygon_px": [[10, 20], [90, 20], [50, 80]]}"#,
            r#"{"width": 640, "height": 360, "strokes": [{"polyline_px": [[50, 99], [50, 80]]}],
                "polygon_px": [[10, 20], [90, 20], [50, 80]]}"#,
            r#"<svg width="640" height="360"><polygon id="crown" points="10.5,20.5 90.5,20.5 50.5,80.5"/></svg>"#,
            r#"<svg width="640" height="360"><path d="M50.5 99.5 V80.5"/>
                <polygon id="crown" points="10.5,20.5 90.5,20.5 50.5,80.5"/></svg>"#,
            r#"<svg width="640" height="360"><polygon points="10.5,20.5 90.5,20.5 50.5,80.5"/></svg>"#,
        ] {
            let sketch = read_strokes(text.as_bytes()).expect(text);
            let crown_px = sketch.only_crown_px().expect(text);
            assert_eq!(crown_px[..3], corners, "{text}");
        }
        for text in [
            r#"{"width": 640, "height": 360}"#,
            r#"<svg width="640" height="360"/>"#,
            r#"<svg width="640" height="360"><path d="M1 2 L3 4"/><path d="M5 6 L7 8"/></svg>"#,
        ] {
            let crown = read_strokes(text.as_bytes()).expect(text).only_crown_px();
            assert!(
                crown.is_err_and(|e| e.to_string().contains("no crown")),
                "{text}"
            );
        }
    }

    #[test]
    fn the_line_of_the_trunk_comes_first() {
        let text = r#"{"width": 640, "height": 480, "strokes": [
            {"polyline_px": [[320, 300], [200, 240]]},
            {"polyline_px": [[320, 450], [320, 200]], "trunk": true}]}"#;
        let lines_px = read_strokes(text.as_bytes()).expect("sound").lines_px();
        assert_eq!((lines_px[0][0].y, lines_px[1][0].y), (450.0, 300.0));
        let one = r#"{"width": 640, "height": 480, "polyline_px": [[320, 450], [320, 200]]}"#;
        assert_eq!(
            read_strokes(one.as_bytes()).expect("sound").lines_px(),
            lines_px[..1]
        );
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
            (of("[]").replace("640", "64000"), "64 to 12288"),
        ] {
            let error = read_sketch(text.as_bytes()).expect_err(&text).to_string();
            assert!(
                error.contains(expected) && !error.contains('\n'),
                "{text}: {error}"
            );
        }
    }
}
