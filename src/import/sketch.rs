//! A sketch of a tree: strokes in a picture.

use super::error::ImportError;
use super::{sketch_json, svg};
use crate::files::without_byte_order_mark;
use crate::model::Size;
use nalgebra::Point2;

/// Strokes that are read, and points of all of them: more than anybody draws by hand.
pub(super) const MOST_STROKES: usize = 2_000;
pub(super) const MOST_POINTS: usize = 200_000;
/// Sides of a picture, px.
const SIDES_PX: std::ops::RangeInclusive<f64> = 64.0..=12_288.0;

/// A line whose ends are farther apart than this share of its length is not drawn round anything: of
/// half a circle it is 0.64.
const MOST_GAP_SHARE: f64 = 0.6;
/// And one whose ends are nearer to each other than this share is closed, as hands close lines.
const CLOSED_GAP_SHARE: f64 = 0.05;

/// A line along a branch, from its base to its tip or the other way.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    /// What messages call it.
    pub name: String,
    /// Two places at least, (u, v), px.
    pub points_px: Vec<Point2<f64>>,
    pub is_trunk: bool,
    /// How wide it is drawn, px, where the file says so.
    pub width_px: Option<f64>,
}

/// The strokes of a tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    /// Of the picture that it is drawn in.
    pub size: Size,
    pub strokes: Vec<Stroke>,
    /// Corners of the outline of the crown, px; none where it was not drawn.
    pub crown_px: Vec<Point2<f64>>,
}

/// Reads a sketch: an SVG drawing, or JSON.
///
/// # Errors
/// It is neither, or holds no strokes; a stroke, a transform or the size cannot be read, or there
/// are more strokes than anybody draws.
pub fn read_sketch(bytes: &[u8]) -> Result<Sketch, ImportError> {
    let sketch = read_strokes(bytes)?;
    match sketch.strokes.is_empty() {
        true => Err(ImportError::NoStrokes),
        false => Ok(sketch),
    }
}

/// Reads what was drawn on a picture: a sketch, which may have a crown and no strokes.
///
/// # Errors
/// As of [`read_sketch`].
pub fn read_strokes(bytes: &[u8]) -> Result<Sketch, ImportError> {
    parsed(bytes)?.checked()
}

/// A sketch as it is in the file.
///
/// # Errors
/// It is neither SVG nor JSON, or cannot be read.
fn parsed(bytes: &[u8]) -> Result<Sketch, ImportError> {
    let text = std::str::from_utf8(bytes).map_err(|_| ImportError::bad_format("it is no text"))?;
    let text = without_byte_order_mark(text).trim_start();
    match text.chars().next() {
        Some('{' | '[') => sketch_json::parse(text),
        Some('<') => svg::parse(text),
        Some(_) => Err(ImportError::bad_format("it is neither SVG nor JSON")),
        None => Err(ImportError::bad_format("it is empty")),
    }
}

/// The size of a picture with these sides, px.
///
/// # Errors
/// A side is too small or too large, or no number.
pub(super) fn picture_size(width: f64, height: f64) -> Result<Size, ImportError> {
    let sides = [width.ceil(), height.ceil()];
    if sides.iter().all(|side| SIDES_PX.contains(side)) {
        return Ok(Size::new(sides[0] as u32, sides[1] as u32));
    }
    Err(ImportError::BadSize { width, height })
}

impl Sketch {
    /// Corners of the crown: of the line that is marked so, or of the only stroke, px.
    ///
    /// # Errors
    /// No line is marked, and there is not one stroke alone, or that is no closed line.
    pub fn only_crown_px(self) -> Result<Vec<Point2<f64>>, ImportError> {
        if !self.crown_px.is_empty() {
            return Ok(self.crown_px);
        }
        let mut strokes = self.strokes.into_iter();
        match (strokes.next(), strokes.next()) {
            (Some(only), None) if only.gap_share() > MOST_GAP_SHARE => Err(ImportError::OpenCrown),
            (Some(only), None) => Ok(only.points_px),
            _ => Err(ImportError::NoCrown),
        }
    }

    /// The lines of the strokes, the trunk's first where it is marked, px.
    pub fn lines_px(&self) -> Vec<Vec<Point2<f64>>> {
        let mut strokes: Vec<&Stroke> = self.strokes.iter().collect();
        strokes.sort_by_key(|stroke| !stroke.is_trunk);
        strokes.into_iter().map(|s| s.points_px.clone()).collect()
    }

    /// The same without points that are the same as the one before.
    fn checked(mut self) -> Result<Self, ImportError> {
        let points = self.strokes.iter().map(|s| s.points_px.len()).sum();
        refuse_more("strokes", self.strokes.len(), MOST_STROKES)?;
        refuse_more("points", points, MOST_POINTS)?;
        for stroke in &mut self.strokes {
            stroke.points_px.dedup();
            stroke.check(self.size)?;
        }
        let mut trunks = self.strokes.iter().filter(|s| s.is_trunk);
        if let (Some(first), Some(second)) = (trunks.next(), trunks.next()) {
            return Err(ImportError::TwoTrunks {
                first: first.name.clone(),
                second: second.name.clone(),
            });
        }
        Ok(self)
    }
}

/// # Errors
/// There are more than `most`.
pub(super) fn refuse_more(
    what: &'static str,
    found: usize,
    most: usize,
) -> Result<(), ImportError> {
    if found <= most {
        return Ok(());
    }
    Err(ImportError::TooMany { found, what, most })
}

impl Stroke {
    /// Whether it ends where it begins, as no branch does.
    pub fn is_closed(&self) -> bool {
        self.gap_share() < CLOSED_GAP_SHARE
    }

    /// How far its ends are apart, by its length.
    fn gap_share(&self) -> f64 {
        let [first, .., last] = self.points_px[..] else {
            return 0.0;
        };
        let pieces = self.points_px.windows(2);
        let length_px: f64 = pieces.map(|ends| (ends[1] - ends[0]).norm()).sum();
        (last - first).norm() / length_px
    }

    fn check(&self, size: Size) -> Result<(), ImportError> {
        for at in &self.points_px {
            if !at.iter().all(|x| x.is_finite()) {
                return Err(self.bad("it holds what is no number"));
            }
            if !size.contains(*at) {
                let why = format!(
                    "({:.0}, {:.0}) lies outside the picture of {size} px",
                    at.x, at.y
                );
                return Err(self.bad(why));
            }
        }
        if self.points_px.len() < 2 {
            return Err(self.bad("it has fewer than two different points"));
        }
        if self.width_px.is_some_and(|w| !(w.is_finite() && w > 0.0)) {
            return Err(self.bad("its width is not above 0"));
        }
        Ok(())
    }

    fn bad(&self, why: impl Into<String>) -> ImportError {
        ImportError::BadStroke {
            what: self.name.clone(),
            why: why.into(),
        }
    }
}
