//! Where the branches end: at the place where their children part, or at their tip.

use super::arrange::Node;
use super::binary::Binary;
use super::rest::{centroid, distance_sq};

/// Share of a cluster's points, those nearest to or farthest from where its branch begins, that mark its end.
const SHARE: f64 = 0.15;
/// Fewer points than this mark nothing: one alone may be a bad track.
const LEAST: usize = 2;

/// The end of every node's branch, px.
///
/// A branch begins where its parent's ends, the first at the foot. It ends where its children begin: halfway between
/// those points of each child that are nearest to the beginning. Without children it goes out to its farthest points.
///
/// The papers put nodes at the centroids of clusters that are cut into halves side by side. Here a cluster is often a low
/// branch and all that is above it; between their centroids, or above the branch, nothing parts.
pub fn ends_px(nodes: &[Node], tree: &Binary, rest_px: &[[f64; 2]], foot_px: [f64; 2]) -> Vec<[f64; 2]> {
    let mut ends: Vec<[f64; 2]> = Vec::with_capacity(nodes.len());
    for (k, node) in nodes.iter().enumerate() {
        let begin = node.parent.map_or(foot_px, |p| ends[p]);
        let children = nodes.iter().filter(|n| n.parent == Some(k));
        let begins: Vec<[f64; 2]> =
            children.map(|c| outermost(tree.points(c.part), rest_px, |p| distance_sq(p, begin))).collect();
        ends.push(match begins.len() {
            0 => outermost(tree.points(node.part), rest_px, |p| -distance_sq(p, begin)),
            n => centroid(&begins, &(0..n).collect::<Vec<usize>>()),
        });
    }
    ends
}

/// Mean of the points of least `rank`.
fn outermost(points: &[usize], rest_px: &[[f64; 2]], rank: impl Fn([f64; 2]) -> f64) -> [f64; 2] {
    let mut points = points.to_vec();
    points.sort_by(|&a, &b| rank(rest_px[a]).total_cmp(&rank(rest_px[b])));
    points.truncate(((SHARE * points.len() as f64) as usize).max(LEAST));
    centroid(rest_px, &points)
}
