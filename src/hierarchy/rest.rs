//! Where points rest, and who is near whom.

use crate::track::TrackTable;

/// Median position of a track: where the tree rests, whatever pose it was first seen in.
pub fn rest_position_px(table: &TrackTable, row: usize) -> [f64; 2] {
    let median = |c: usize| {
        let mut values: Vec<f32> = table.positions[row].iter().flatten().map(|p| p[c]).collect();
        let middle = values.len() / 2;
        if values.is_empty() { 0.0 } else { f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1) }
    };
    [median(0), median(1)]
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
