//! Convex hull of points in the plane.

use crate::bounds::Bounds;
use nalgebra::Point2;

/// Corners of the convex hull, counter-clockwise, by Andrew's monotone chain; fewer than three
/// where all points lie on a line. Coordinates must be numbers.
pub(super) fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
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

/// Where the horizontal line at `y` enters and leaves a convex polygon; beyond its ends, as at its
/// nearest corner.
pub(super) fn crossed(hull: &[Point2<f64>], y: f64) -> Bounds {
    let mut crossings_x = Vec::with_capacity(2);
    for (a, b) in hull.iter().zip(hull.iter().cycle().skip(1)) {
        if !(a.y.min(b.y)..=a.y.max(b.y)).contains(&y) {
            continue;
        }
        // Of a level side both corners; the second is the first of the next side.
        let t = if a.y == b.y {
            0.0
        } else {
            (y - a.y) / (b.y - a.y)
        };
        crossings_x.push(a.x + t * (b.x - a.x));
    }
    if let Some(ends) = Bounds::of(crossings_x) {
        return ends;
    }
    let corner = hull
        .iter()
        .min_by(|a, b| (a.y - y).abs().total_cmp(&(b.y - y).abs()));
    corner.map_or(Bounds::default(), |c| Bounds::new(c.x, c.x))
}
