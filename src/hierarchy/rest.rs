//! Rest positions of points.

use crate::model::TrackTable;
use crate::signal::median;
use nalgebra::{Point2, Vector2};

/// Median position of a track: where the tree rests, whatever pose it was first seen in.
pub fn rest_position_px(table: &TrackTable, row: usize) -> Point2<f64> {
    Point2::from([0, 1].map(|c| {
        let values = table.positions[row].iter().flatten().map(|p| p[c]);
        median(values.collect(), f32::total_cmp).map_or(0.0, f64::from)
    }))
}

/// Mean of the rest positions of `members`, px.
pub fn centroid(rest_px: &[Point2<f64>], members: &[usize]) -> Point2<f64> {
    let n = members.len().max(1) as f64;
    let sum: Vector2<f64> = members.iter().map(|&i| rest_px[i].coords).sum();
    Point2::from(sum / n)
}

/// Twice the root mean square distance of `members` from their centroid, px: about 1.4 times the
/// radius of an evenly filled disc.
pub fn extent_px(rest_px: &[Point2<f64>], members: &[usize]) -> f64 {
    let centre = centroid(rest_px, members);
    let variance = members
        .iter()
        .map(|&i| (rest_px[i] - centre).norm_squared())
        .sum::<f64>()
        / members.len().max(1) as f64;
    2.0 * variance.sqrt()
}

/// A trunk bears no points if none is nearer to the foot than this share of the distance of the
/// farthest.
const BARE_TRUNK: f64 = 0.2;
/// Share of the points, the lowest ones, below which a crown is taken to begin.
const LOWEST: f64 = 0.05;

/// Where a trunk that bears no points enters the crown, px: on the line from the foot to the middle
/// of all points, as high as the lowest of them. `None` where there are points on the trunk, which
/// say better where it goes.
pub fn crown_begins(rest_px: &[Point2<f64>], foot_px: Point2<f64>) -> Option<Point2<f64>> {
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
    for p in rest_px {
        let distance_px = (p - foot_px).norm();
        nearest = nearest.min(distance_px);
        farthest = farthest.max(distance_px);
    }
    if nearest.is_infinite() || nearest <= BARE_TRUNK * farthest {
        return None;
    }
    let all: Vec<usize> = (0..rest_px.len()).collect();
    let middle = centroid(rest_px, &all);
    let mut heights: Vec<f64> = rest_px.iter().map(|p| foot_px.y - p.y).collect();
    heights.sort_unstable_by(f64::total_cmp);
    let lowest = heights
        .get((LOWEST * heights.len() as f64) as usize)
        .copied()
        .unwrap_or(0.0);
    let share = (lowest / (foot_px.y - middle.y).max(1.0)).clamp(0.0, 1.0);
    Some(foot_px + share * (middle - foot_px))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two limbs that part at `fork`.
    fn crown(fork: Point2<f64>) -> Vec<Point2<f64>> {
        let mut points = Vec::new();
        for side in [-1.0, 1.0] {
            for k in (1..=10).map(f64::from) {
                points.push(fork + Vector2::new(side * 5.0 * k, -6.0 * k));
            }
        }
        points
    }

    const FOOT: Point2<f64> = Point2::new(100.0, 200.0);
    const FORK: Point2<f64> = Point2::new(100.0, 100.0);

    #[test]
    fn a_bare_trunk_is_as_high_as_the_lowest_of_the_crown() {
        let top = crown_begins(&crown(FORK), FOOT).expect("a bare trunk");
        assert!(
            (top.x - 100.0).abs() < 1e-9 && (90.0..=100.0).contains(&top.y),
            "{top:?}"
        );
        // One track that has gone astray must not pull the crown down to the ground.
        let mut astray: Vec<Point2<f64>> = crown(FORK).into_iter().chain(crown(FORK)).collect();
        astray.push(Point2::new(160.0, 195.0));
        let top = crown_begins(&astray, FOOT).expect("a bare trunk");
        assert!((85.0..=110.0).contains(&top.y), "{top:?}");
    }

    #[test]
    fn points_on_the_trunk_say_better_where_it_goes() {
        let mut points = crown(FORK);
        points.push(Point2::new(101.0, 185.0));
        assert_eq!(crown_begins(&points, FOOT), None);
        assert_eq!(crown_begins(&[], FOOT), None);
    }

    #[test]
    fn a_crown_below_the_foot_puts_the_top_on_the_foot() {
        // A tree that hangs from a cliff: nothing is above the foot, and the trunk must not leave
        // the picture.
        let hanging = crown(Point2::new(100.0, 330.0));
        let top = crown_begins(&hanging, FOOT).expect("no points near the foot");
        assert!(top.iter().all(|c| c.is_finite()) && top == FOOT, "{top:?}");
    }
}
