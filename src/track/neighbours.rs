//! The points around a point, by which its place is predicted.

use nalgebra::{Point2, distance_squared};
use std::cmp::Ordering;

/// Number of neighbours by which the place of a point is predicted.
pub const NEIGHBOURS: usize = 12;
/// Number of neighbours that a point knows: of those that are on trial, half will go.
const REMEMBERED: usize = 2 * NEIGHBOURS;

/// For every point the indices of its nearest others among all of `known`, at most [`REMEMBERED`],
/// nearest first. The points themselves are the last of `known`.
pub fn nearest(points: &[Point2<f32>], known: &[Point2<f32>]) -> Vec<Vec<u32>> {
    let before = known.len() - points.len();
    let mut all = Vec::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        let mut others: Vec<u32> = (0..known.len() as u32)
            .filter(|&j| j as usize != before + i)
            .collect();
        if others.len() > REMEMBERED {
            others.select_nth_unstable_by(REMEMBERED - 1, |a, b| nearer(p, known, *a, *b));
            others.truncate(REMEMBERED);
        }
        others.sort_unstable_by(|a, b| nearer(p, known, *a, *b));
        all.push(others);
    }
    all
}

/// The order of `known` points by their distance from `p`.
fn nearer(p: &Point2<f32>, known: &[Point2<f32>], a: u32, b: u32) -> Ordering {
    distance_squared(p, &known[a as usize]).total_cmp(&distance_squared(p, &known[b as usize]))
}
