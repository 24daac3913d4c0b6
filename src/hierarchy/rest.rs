//! Rest positions of points, and distances between them.

use crate::model::TrackTable;
use crate::signal::median;

/// Median position of a track: where the tree rests, whatever pose it was first seen in.
pub fn rest_position_px(table: &TrackTable, row: usize) -> [f64; 2] {
    [0, 1].map(|c| {
        let values = table.positions[row].iter().flatten().map(|p| p[c]);
        median(values.collect(), f32::total_cmp).map_or(0.0, f64::from)
    })
}

/// Mean of the rest positions of `members`, px.
pub fn centroid(rest_px: &[[f64; 2]], members: &[usize]) -> [f64; 2] {
    let n = members.len().max(1) as f64;
    let sum = members.iter().fold([0.0; 2], |s, &i| {
        [s[0] + rest_px[i][0], s[1] + rest_px[i][1]]
    });
    [sum[0] / n, sum[1] / n]
}

/// Twice the root mean square distance of `members` from their centroid, px: about 1.4 times the
/// radius of an evenly filled disc.
pub fn extent_px(rest_px: &[[f64; 2]], members: &[usize]) -> f64 {
    let centre = centroid(rest_px, members);
    let variance = members
        .iter()
        .map(|&i| distance_sq(rest_px[i], centre))
        .sum::<f64>()
        / members.len().max(1) as f64;
    2.0 * variance.sqrt()
}

/// Squared distance, px^2.
pub fn distance_sq(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

/// A trunk bears no points if none is nearer to the foot than this share of the distance of the
/// farthest.
const BARE_TRUNK: f64 = 0.2;
/// Share of the points, the lowest ones, below which a crown is taken to begin.
const LOWEST: f64 = 0.05;

/// Where a trunk that bears no points enters the crown, px: on the line from the foot to the middle
/// of all points, as high as the lowest of them. `None` where there are points on the trunk, which
/// say better where it goes.
pub fn crown_begins(rest_px: &[[f64; 2]], foot_px: [f64; 2]) -> Option<[f64; 2]> {
    let (mut nearest, mut farthest) = (f64::INFINITY, 0.0_f64);
    for p in rest_px {
        let distance_px = distance_sq(*p, foot_px).sqrt();
        nearest = nearest.min(distance_px);
        farthest = farthest.max(distance_px);
    }
    if nearest.is_infinite() || nearest <= BARE_TRUNK * farthest {
        return None;
    }
    let all: Vec<usize> = (0..rest_px.len()).collect();
    let middle = centroid(rest_px, &all);
    let mut heights: Vec<f64> = rest_px.iter().map(|p| foot_px[1] - p[1]).collect();
    heights.sort_unstable_by(f64::total_cmp);
    let lowest = heights
        .get((LOWEST * heights.len() as f64) as usize)
        .copied()
        .unwrap_or(0.0);
    let share = (lowest / (foot_px[1] - middle[1]).max(1.0)).clamp(0.0, 1.0);
    Some([0, 1].map(|c| foot_px[c] + share * (middle[c] - foot_px[c])))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two limbs that part at `fork`.
    fn crown(fork: [f64; 2]) -> Vec<[f64; 2]> {
        let mut points = Vec::new();
        for side in [-1.0, 1.0] {
            for k in (1..=10).map(f64::from) {
                points.push([fork[0] + side * 5.0 * k, fork[1] - 6.0 * k]);
            }
        }
        points
    }

    #[test]
    fn a_bare_trunk_is_as_high_as_the_lowest_of_the_crown() {
        let top = crown_begins(&crown([100.0, 100.0]), [100.0, 200.0]).expect("a bare trunk");
        assert!(
            (top[0] - 100.0).abs() < 1e-9 && (90.0..=100.0).contains(&top[1]),
            "{top:?}"
        );
        // One track that has gone astray must not pull the crown down to the ground.
        let mut astray: Vec<[f64; 2]> = crown([100.0, 100.0])
            .into_iter()
            .chain(crown([100.0, 100.0]))
            .collect();
        astray.push([160.0, 195.0]);
        let top = crown_begins(&astray, [100.0, 200.0]).expect("a bare trunk");
        assert!((85.0..=110.0).contains(&top[1]), "{top:?}");
    }

    #[test]
    fn points_on_the_trunk_say_better_where_it_goes() {
        let mut points = crown([100.0, 100.0]);
        points.push([101.0, 185.0]);
        assert_eq!(crown_begins(&points, [100.0, 200.0]), None);
        assert_eq!(crown_begins(&[], [100.0, 200.0]), None);
    }

    #[test]
    fn a_crown_below_the_foot_puts_the_top_on_the_foot() {
        // A tree that hangs from a cliff: nothing is above the foot, and the trunk must not leave
        // the picture.
        let hanging = crown([100.0, 330.0]);
        let top = crown_begins(&hanging, [100.0, 200.0]).expect("no points near the foot");
        assert!(
            top.iter().all(|c| c.is_finite()) && top == [100.0, 200.0],
            "{top:?}"
        );
    }
}
