//! Convex hull of points in the plane.

use nalgebra::Point2;

/// Corners of the convex hull, counter-clockwise, by Andrew's monotone chain; fewer than three
/// where all points lie on a line. Coordinates must be numbers.
pub fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull = half(sorted.iter());
    hull.pop();
    hull.extend(half(sorted.iter().rev()));
    hull.pop();
    hull
}

/// One side of the hull of sorted points, both ends included.
fn half<'a>(points: impl Iterator<Item = &'a Point2<f64>>) -> Vec<Point2<f64>> {
    let mut side: Vec<Point2<f64>> = Vec::new();
    for &p in points {
        while let [.., a, b] = side[..] {
            if (b - a).perp(&(p - a)) > 0.0 {
                break;
            }
            side.pop();
        }
        side.push(p);
    }
    side
}
