//! Lines that were drawn in a picture, for `--trunk` and `--branch-stroke`.

use super::command_error::CommandError;
use crate::import::read_sketch;
use crate::model::Size;
use anyhow::anyhow;
use serde::Deserialize;

/// A line in a picture of the given size.
#[derive(Clone, Debug, Deserialize)]
#[serde(expecting = "an object with width, height and polyline_px")]
pub struct Line {
    width: u32,
    height: u32,
    /// At least two points (u, v), px.
    pub polyline_px: Vec<[f64; 2]>,
}

impl Line {
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

    /// Of the picture that it was drawn in.
    pub fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }

    /// Checks that it was drawn in a picture of this size; `option` is what it was given to.
    ///
    /// # Errors
    /// It was drawn in one of another size.
    pub fn check_size(&self, option: &str, size: Size) -> Result<(), CommandError> {
        if self.size() == size {
            return Ok(());
        }
        Err(of_another_picture(option, self.size(), size))
    }
}

/// What was given to `option` was drawn in a picture of another size than `own`.
pub fn of_another_picture(option: &str, drawn_in: Size, own: Size) -> CommandError {
    CommandError::BadUsage(anyhow!(
        "{option} is for a picture of {drawn_in}, this one is {own}; draw it on this one"
    ))
}

/// The lines of one file.
#[derive(Clone, Debug)]
pub struct Lines(pub Vec<Line>);

impl Lines {
    /// Reads the file at `path`: a line in JSON, or a drawing as for `sketch`, of which each stroke is
    /// a line.
    ///
    /// # Errors
    /// It cannot be read, is of another form, or holds no line.
    pub fn read(path: &str) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|e| format!("{e}; give a file"))?;
        let is_sketch = bytes.trim_ascii_start().starts_with(b"<") || has_strokes(&bytes);
        if !is_sketch {
            return Line::of_json(&bytes).map(|line| Self(vec![line]));
        }
        let sketch = read_sketch(&bytes).map_err(|e| e.to_string())?;
        let mut lines = Vec::with_capacity(sketch.strokes.len());
        for stroke in &sketch.strokes {
            lines.push(Line {
                width: sketch.size.width,
                height: sketch.size.height,
                polyline_px: stroke.points_px.iter().map(|p| [p.x, p.y]).collect(),
            });
        }
        Ok(Self(lines))
    }
}

/// Whether bytes are a sketch in JSON, which has a list of strokes.
fn has_strokes(bytes: &[u8]) -> bool {
    let value: Option<serde_json::Value> = serde_json::from_slice(bytes).ok();
    value.is_some_and(|value| value.get("strokes").is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Result<Vec<Vec<[f64; 2]>>, String> {
        let file = tempfile::NamedTempFile::new().expect("file");
        std::fs::write(file.path(), text).expect("write");
        let lines = Lines::read(file.path().to_str().expect("path"))?.0;
        assert!(lines.iter().all(|l| (l.width, l.height) == (640, 360)));
        Ok(lines.into_iter().map(|l| l.polyline_px).collect())
    }

    #[test]
    fn a_drawing_holds_as_many_lines_as_strokes() {
        let line = r#"{"width": 640, "height": 360, "polyline_px": [[1, 2], [3, 4]]}"#;
        let sketch = r#"{"width": 640, "height": 360, "strokes": [
            {"polyline_px": [[1, 2], [3, 4]]}, {"polyline_px": [[5, 6], [7, 8]], "trunk": true}]}"#;
        let svg = r#"<svg width="640" height="360"><path d="M1.5 2.5 L3.5 4.5"/>
            <line x1="5.5" y1="6.5" x2="7.5" y2="8.5"/></svg>"#;
        let first = vec![[1.0, 2.0], [3.0, 4.0]];
        let both = vec![first.clone(), vec![[5.0, 6.0], [7.0, 8.0]]];
        assert_eq!(lines(line), Ok(vec![first]));
        assert_eq!(lines(sketch), Ok(both.clone()));
        assert_eq!(lines(svg), Ok(both));
        assert!(lines("<svg width='640' height='360'/>").is_err_and(|e| e.contains("no strokes")));
        assert!(lines("{").is_err_and(|e| e.contains("polyline_px")));
    }
}
