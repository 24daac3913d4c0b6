//! The data of an SVG path as lines of points.

use crate::model::FARTHEST_PX;
use kurbo::{Affine, BezPath, PathEl, Point};
use nalgebra::Point2;
use svgtypes::{SimplePathSegment, SimplifyingPathParser};

/// How far the straight pieces may be off a curve, px.
const FLAT_PX: f64 = 0.25;

/// The parts of a path, each from one place to move to up to the next, with its curves as straight
/// pieces. Centres of pixels are at whole numbers. A part that is closed ends where it begins; one
/// of a single place is none.
///
/// # Errors
/// The data cannot be read, or reaches too far; the text says why.
pub(super) fn flattened(path: &str, to_page: Affine) -> Result<Vec<Vec<Point2<f64>>>, String> {
    let mut curves = BezPath::new();
    for segment in SimplifyingPathParser::from(path) {
        let segment = segment.map_err(|e| format!("its path cannot be read ({e})"))?;
        let element = to_page * element_of(segment);
        if !is_near(element) {
            return Err("it reaches too far, or to no number".into());
        }
        curves.push(element);
    }
    let mut parts: Vec<Vec<Point2<f64>>> = Vec::new();
    kurbo::flatten(curves, FLAT_PX, |element| match element {
        PathEl::MoveTo(at) => parts.push(vec![pixel(at)]),
        PathEl::LineTo(at) => {
            if let Some(part) = parts.last_mut() {
                part.push(pixel(at));
            }
        }
        PathEl::ClosePath => {
            if let Some(part) = parts.last_mut() {
                part.extend(part.first().copied());
            }
        }
        // Flattened paths have no curves.
        PathEl::QuadTo(..) | PathEl::CurveTo(..) => {}
    });
    for part in &mut parts {
        part.dedup();
    }
    parts.retain(|part| part.len() > 1);
    Ok(parts)
}

fn element_of(segment: SimplePathSegment) -> PathEl {
    match segment {
        SimplePathSegment::MoveTo { x, y } => PathEl::MoveTo(Point::new(x, y)),
        SimplePathSegment::LineTo { x, y } => PathEl::LineTo(Point::new(x, y)),
        SimplePathSegment::CurveTo {
            x1,
            y1,
            x2,
            y2,
            x,
            y,
        } => PathEl::CurveTo(Point::new(x1, y1), Point::new(x2, y2), Point::new(x, y)),
        SimplePathSegment::Quadratic { x1, y1, x, y } => {
            PathEl::QuadTo(Point::new(x1, y1), Point::new(x, y))
        }
        SimplePathSegment::ClosePath => PathEl::ClosePath,
    }
}

/// Curves that reach farther would be flattened to any number of pieces.
fn is_near(element: PathEl) -> bool {
    let points = match element {
        PathEl::MoveTo(a) | PathEl::LineTo(a) => vec![a],
        PathEl::QuadTo(a, b) => vec![a, b],
        PathEl::CurveTo(a, b, c) => vec![a, b, c],
        PathEl::ClosePath => Vec::new(),
    };
    points
        .iter()
        .all(|p| p.x.abs() <= FARTHEST_PX && p.y.abs() <= FARTHEST_PX)
}

/// SVG counts from the corner of the first pixel, pictures from its centre.
fn pixel(at: Point) -> Point2<f64> {
    Point2::new(at.x - 0.5, at.y - 0.5)
}
