//! Lines of many points.

use super::distance_to_segment;
use nalgebra::Point2;

/// Which points of a line it takes to follow it within `tolerance`, in rising order: its ends, those
/// that are `fixed`, and as few others as the method of Douglas and Peucker (1973) finds. Empty for
/// a line without points; what is fixed beyond the end does not count.
pub fn corners(line: &[Point2<f64>], fixed: &[usize], tolerance: f64) -> Vec<usize> {
    let Some(last) = line.len().checked_sub(1) else {
        return Vec::new();
    };
    let mut kept: Vec<usize> = fixed.iter().copied().filter(|k| *k <= last).collect();
    kept.extend([0, last]);
    kept.sort_unstable();
    kept.dedup();
    // Not by recursion: a line may have any number of points.
    let mut waiting: Vec<[usize; 2]> = kept.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    while let Some([from, to]) = waiting.pop() {
        let mut farthest: Option<usize> = None;
        let mut most = tolerance;
        for k in from + 1..to {
            let off = distance_to_segment(line[k], line[from], line[to]);
            if off > most {
                (farthest, most) = (Some(k), off);
            }
        }
        if let Some(k) = farthest {
            kept.push(k);
            waiting.extend([[from, k], [k, to]]);
        }
    }
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[[f64; 2]]) -> Vec<Point2<f64>> {
        points.iter().copied().map(Point2::from).collect()
    }

    #[test]
    fn what_lies_along_the_line_is_left_out() {
        let bent = line(&[
            [0.0, 0.0],
            [5.0, 0.1],
            [10.0, 0.0],
            [10.0, 5.0],
            [10.0, 9.0],
        ]);
        assert_eq!(corners(&bent, &[], 0.5), [0, 2, 4]);
        assert_eq!(corners(&bent, &[3, 77], 0.5), [0, 2, 3, 4]);
        assert_eq!(corners(&bent, &[], 0.01), [0, 1, 2, 4]);
    }

    #[test]
    fn short_lines_stay_as_they_are() {
        assert_eq!(corners(&[], &[0], 1.0), [0; 0]);
        assert_eq!(corners(&line(&[[1.0, 2.0]]), &[], 1.0), [0]);
        let both = line(&[[1.0, 2.0], [1.0, 2.0]]);
        assert_eq!(corners(&both, &[], 1.0), [0, 1]);
    }
}
