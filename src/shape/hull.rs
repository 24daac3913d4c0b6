//! Convex hull of points in the plane.

/// Corners of the convex hull, counter-clockwise, by Andrew's monotone chain; fewer than three
/// where all points lie on a line. Coordinates must be numbers.
pub(super) fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
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
fn half<'a>(points: impl Iterator<Item = &'a [f64; 2]>) -> Vec<[f64; 2]> {
    let mut side: Vec<[f64; 2]> = Vec::new();
    for &p in points {
        while let [.., a, b] = side[..] {
            if (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0.0 {
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
pub(super) fn crossed(hull: &[[f64; 2]], y: f64) -> (f64, f64) {
    let mut ends: Option<(f64, f64)> = None;
    for (a, b) in hull.iter().zip(hull.iter().cycle().skip(1)) {
        if !(a[1].min(b[1])..=a[1].max(b[1])).contains(&y) {
            continue;
        }
        // Of a level side both corners; the second is the first of the next side.
        let t = if a[1] == b[1] {
            0.0
        } else {
            (y - a[1]) / (b[1] - a[1])
        };
        let x = a[0] + t * (b[0] - a[0]);
        ends = Some(match ends {
            Some((left, right)) => (left.min(x), right.max(x)),
            None => (x, x),
        });
    }
    if let Some(ends) = ends {
        return ends;
    }
    let corner = hull
        .iter()
        .min_by(|a, b| (a[1] - y).abs().total_cmp(&(b[1] - y).abs()));
    corner.map_or((0.0, 0.0), |c| (c[0], c[0]))
}
