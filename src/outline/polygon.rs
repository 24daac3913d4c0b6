//! Outlines drawn as polygons, in a file or on the screen.

use super::error::OutlineError;
use super::region;
use crate::model::{Outline, Size};
use crate::signal::segments_cross;
use nalgebra::Point2;
use serde::Deserialize;

/// The outline file of the contract: `{"frame": 0, "width": W, "height": H, "polygon_px": [[u, v],
/// ...]}`.
#[derive(Debug, Deserialize)]
#[serde(expecting = "an object with width, height and polygon_px")]
pub struct PolygonFile {
    pub width: u32,
    pub height: u32,
    pub polygon_px: Vec<[f64; 2]>,
}

/// Reads an outline file's text; `name` is for messages.
///
/// # Errors
/// The text is no such JSON.
pub fn parse(text: &str, name: &str) -> Result<PolygonFile, OutlineError> {
    serde_json::from_str(text).map_err(|e| OutlineError::bad_file(name, e))
}

/// The region inside a polygon (px, in a picture of `size`).
///
/// # Errors
/// Fewer than three different corners, a corner outside the picture, edges that cross, or no area.
pub fn outline(polygon_px: &[Point2<f64>], size: Size) -> Result<Outline, OutlineError> {
    let corners = corners(polygon_px, size).map_err(OutlineError::bad_polygon)?;
    region::fill(size, &corners).map_err(OutlineError::bad_polygon)
}

/// The different corners of a polygon that can be an outline, or why it cannot.
fn corners(polygon_px: &[Point2<f64>], size: Size) -> Result<Vec<Point2<f64>>, String> {
    let mut corners: Vec<Point2<f64>> = Vec::with_capacity(polygon_px.len());
    for &p in polygon_px {
        let (u, v) = (p.x, p.y);
        if !(u.is_finite() && v.is_finite() && size.contains(p)) {
            return Err(format!("corner ({u}, {v}) lies outside the {size} picture"));
        }
        if corners.last() != Some(&p) {
            corners.push(p);
        }
    }
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop(); // closed by repeating the first corner
    }
    if corners.len() < 3 {
        let n = corners.len();
        return Err(format!(
            "it has {n} different corners, at least 3 are needed"
        ));
    }
    if let Some((a, b)) = crossing(&corners) {
        let (a, b) = (a + 1, b + 1);
        return Err(format!("it crosses itself: edge {a} cuts edge {b}"));
    }
    if area(&corners) < 16.0 {
        return Err("it encloses less than 16 pixels".into());
    }
    Ok(corners)
}

/// The first two edges (numbered from their first corner) that cross each other. Edges that only
/// touch are no harm: the pixels inside are the same whichever way one goes round.
pub fn crossing(corners: &[Point2<f64>]) -> Option<(usize, usize)> {
    let n = corners.len();
    for i in 0..n {
        for j in i + 2..n {
            let edge = [corners[i], corners[i + 1]];
            let other = [corners[j], corners[(j + 1) % n]];
            // The last edge and the first are neighbours.
            if (j + 1) % n != i && segments_cross(&edge, &other) {
                return Some((i, j));
            }
        }
    }
    None
}

fn area(corners: &[Point2<f64>]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners
        .iter()
        .zip(next)
        .map(|(a, b)| a.coords.perp(&b.coords))
        .sum::<f64>()
        .abs()
        / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_polygons_are_refused_and_named() {
        let size = Size::new(100, 80);
        let cases: [(&[[f64; 2]], &str); 6] = [
            (&[[1.0, 1.0], [50.0, 1.0]], "2 different corners"),
            (
                &[[1.0, 1.0], [50.0, 1.0], [1.0, 1.0]],
                "2 different corners",
            ),
            (
                &[[1.0, 1.0], [50.0, 1.0], [150.0, 40.0]],
                "(150, 40) lies outside the 100x80",
            ),
            (
                &[[1.0, 1.0], [50.0, 50.0], [50.0, 1.0], [1.0, 50.0]],
                "edge 1 cuts edge 3",
            ),
            (&[[1.0, 1.0], [3.0, 1.0], [2.0, 3.0]], "less than 16 pixels"),
            (&[[f64::NAN, 1.0], [3.0, 1.0], [2.0, 3.0]], "outside"),
        ];
        for (polygon, expected) in cases {
            let polygon: Vec<Point2<f64>> = polygon.iter().map(|p| Point2::from(*p)).collect();
            let message = outline(&polygon, size).unwrap_err().to_string();
            assert!(message.contains(expected), "{polygon:?}: {message}");
        }
    }

    #[test]
    fn pixels_inside_a_polygon_are_tree_and_others_are_not() {
        let o = outline(
            &[
                [10.0, 10.0],
                [40.0, 10.0],
                [40.0, 60.0],
                [10.0, 60.0],
                [10.0, 10.0],
            ]
            .map(Point2::from),
            Size::new(100, 80),
        );
        let o = o.unwrap();
        assert!(
            o.contains(10.0, 10.0)
                && o.contains(25.0, 59.6)
                && !o.contains(9.0, 30.0)
                && !o.contains(25.0, 61.0)
        );
        assert_eq!(o.bounds_px(), Some([10, 10, 40, 60]));
    }
}
