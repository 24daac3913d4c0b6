//! Outlines drawn as polygons, in a file or on the screen.

use super::{OutlineError, region};
use crate::model::{Outline, Size};
use serde::Deserialize;

/// The outline file of the contract: `{"frame": 0, "width": W, "height": H, "polygon_px": [[u, v],
/// ...]}`.
#[derive(Debug, Deserialize)]
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
    serde_json::from_str(text).map_err(|e| OutlineError::BadFile {
        name: name.into(),
        what: e.to_string(),
    })
}

/// The region inside a polygon (px, in a picture of `size`).
///
/// # Errors
/// Fewer than three different corners, a corner outside the picture, edges that cross, or no area.
pub fn outline(polygon_px: &[[f64; 2]], size: Size) -> Result<Outline, OutlineError> {
    let bad = |what: String| Err(OutlineError::BadPolygon { what });
    let mut corners: Vec<[f64; 2]> = Vec::with_capacity(polygon_px.len());
    for &p in polygon_px {
        if !(p[0].is_finite() && p[1].is_finite() && size.contains(p[0], p[1])) {
            return bad(format!(
                "corner ({}, {}) lies outside the {size} picture",
                p[0], p[1]
            ));
        }
        if corners.last() != Some(&p) {
            corners.push(p);
        }
    }
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop(); // closed by repeating the first corner
    }
    if corners.len() < 3 {
        return bad(format!(
            "it has {} different corners, at least 3 are needed",
            corners.len()
        ));
    }
    if let Some((a, b)) = crossing(&corners) {
        return bad(format!(
            "it crosses itself: edge {} cuts edge {}",
            a + 1,
            b + 1
        ));
    }
    if area(&corners) < 16.0 {
        return bad("it encloses less than 16 pixels".into());
    }
    region::fill(size, &corners).map_err(|e| OutlineError::BadPolygon {
        what: e.to_string(),
    })
}

/// The first two edges (numbered from their first corner) that cross each other.
pub fn crossing(corners: &[[f64; 2]]) -> Option<(usize, usize)> {
    let n = corners.len();
    let edge = |i: usize| (corners[i], corners[(i + 1) % n]);
    (0..n).find_map(|i| {
        let others = (i + 1..n).filter(|&j| j != i + 1 && (j + 1) % n != i);
        others
            .into_iter()
            .find(|&j| edges_cross(edge(i), edge(j)))
            .map(|j| (i, j))
    })
}

type Edge = ([f64; 2], [f64; 2]);

fn edges_cross((a, b): Edge, (c, d): Edge) -> bool {
    // Edges that only touch are no harm: the pixels inside are the same whichever way one goes
    // round.
    let side = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

fn area(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners
        .iter()
        .zip(next)
        .map(|(a, b)| a[0] * b[1] - b[0] * a[1])
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
            let message = outline(polygon, size).unwrap_err().to_string();
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
            ],
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
