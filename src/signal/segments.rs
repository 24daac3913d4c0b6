//! Straight lines from one point to another.

use nalgebra::Point2;

/// Whether two lines cross. Those that only touch do not.
pub fn segments_cross([a, b]: &[Point2<f64>; 2], [c, d]: &[Point2<f64>; 2]) -> bool {
    let (ab, cd) = (b - a, d - c);
    ab.perp(&(c - a)) * ab.perp(&(d - a)) < 0.0 && cd.perp(&(a - c)) * cd.perp(&(b - c)) < 0.0
}

/// Distance of `p` from the straight line between `from` and `to`.
pub fn distance_to_segment(p: Point2<f64>, from: Point2<f64>, to: Point2<f64>) -> f64 {
    let along = to - from;
    let way = p - from;
    let length_sq = along.norm_squared();
    let share = if length_sq > 0.0 {
        along.dot(&way) / length_sq
    } else {
        0.0
    };
    let off = way - along * share.clamp(0.0, 1.0);
    off.x.hypot(off.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_cross_only_where_each_has_the_others_ends_on_both_sides() {
        let line = [[0.0, 0.0], [4.0, 4.0]].map(Point2::from);
        for (other, expected, name) in [
            ([[0.0, 4.0], [4.0, 0.0]], true, "across"),
            ([[3.0, 0.0], [4.0, 1.0]], false, "beside"),
            ([[5.0, 6.0], [6.0, 5.0]], false, "beyond its end"),
            ([[2.0, 2.0], [4.0, 0.0]], false, "begins on it"),
            ([[4.0, 4.0], [8.0, 0.0]], false, "has a common end"),
            ([[1.0, 1.0], [3.0, 3.0]], false, "lies on it"),
            ([[f64::NAN, 4.0], [4.0, 0.0]], false, "no number"),
        ] {
            let other = other.map(Point2::from);
            assert_eq!(segments_cross(&line, &other), expected, "{name}");
            assert_eq!(segments_cross(&other, &line), expected, "{name}");
        }
    }
}
