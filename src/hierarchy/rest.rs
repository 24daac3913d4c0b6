//! Where points rest, and who is near whom.

use crate::signal::median;
use crate::track::TrackTable;

/// Median position of a track: where the tree rests, whatever pose it was first seen in.
pub fn rest_position_px(table: &TrackTable, row: usize) -> [f64; 2] {
    let values = |c: usize| table.positions[row].iter().flatten().map(|p| p[c]).collect();
    [0, 1].map(|c| median(values(c), f32::total_cmp).map_or(0.0, f64::from))
}

/// Mean of the rest positions of `members`, px.
pub fn centroid(rest_px: &[[f64; 2]], members: &[usize]) -> [f64; 2] {
    let n = members.len().max(1) as f64;
    let sum = members.iter().fold([0.0; 2], |s, &i| [s[0] + rest_px[i][0], s[1] + rest_px[i][1]]);
    [sum[0] / n, sum[1] / n]
}

/// Twice the root mean square distance of `members` from their centroid, px: about 1.4 times the radius of an evenly
/// filled disc.
pub fn extent_px(rest_px: &[[f64; 2]], members: &[usize]) -> f64 {
    let centre = centroid(rest_px, members);
    let variance = members.iter().map(|&i| distance_sq(rest_px[i], centre)).sum::<f64>() / members.len().max(1) as f64;
    2.0 * variance.sqrt()
}

pub fn distance_sq(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}
