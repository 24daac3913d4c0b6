//! Where the branches end: at the place where their children part, or at their tip.

use super::cut::Node;
use super::dendrogram::Dendrogram;
use super::rest::{centroid, crown_begins};
use super::root_paths::Edge;
use nalgebra::Point2;

/// Points of a path over which its end is averaged: one alone may sit on either edge of its
/// branch.
const EVENED: usize = 3;
/// A branch is no shorter than this share of the distance from the foot to the farthest point, or
/// it could not be told from its fork.
const SHORTEST: f64 = 0.06;

/// The end of every node's branch, px.
///
/// The spanning tree of all points (`edges`, see
/// [`RootPaths`](super::root_paths::RootPaths)) runs along the branches. More than half of the
/// paths from the foot to a cluster's points run together for a while: that is the path to the
/// cluster. A branch ends where the paths to its children part; without children it goes on to its
/// tip by the path that most of its points are on. So forks and tips lie on branches that are seen,
/// not between them.
///
/// The papers put nodes at the centroids of clusters that are cut into halves side by side. Here a
/// cluster is often a low branch and all that is above it; between their centroids, or above the
/// branch, nothing parts.
pub fn ends_px(
    nodes: &[Node],
    tree: &Dendrogram,
    edges: &[Edge],
    rest_px: &[Point2<f64>],
    foot_px: Point2<f64>,
) -> Vec<Point2<f64>> {
    let farthest = rest_px
        .iter()
        .map(|p| (p - foot_px).norm_squared())
        .fold(1.0, f64::max)
        .sqrt();
    let paths: Vec<Vec<usize>> = nodes
        .iter()
        .map(|n| path_to(tree.points(n.part), edges))
        .collect();
    let mut ends: Vec<Point2<f64>> = Vec::with_capacity(nodes.len());
    for (k, node) in nodes.iter().enumerate() {
        if k == 0
            && let Some(top) = crown_begins(rest_px, foot_px)
        {
            ends.push(top);
            continue;
        }
        let begin = node.parent.map_or(foot_px, |p| ends[p]);
        let children: Vec<usize> = (0..nodes.len())
            .filter(|&c| nodes[c].parent == Some(k))
            .collect();
        let path = if children.is_empty() {
            path_to_tip(tree.points(node.part), edges)
        } else {
            common_start(&paths, &children)
        };
        let last = &path[path.len().saturating_sub(EVENED)..];
        let end = centroid(rest_px, last);
        let far_enough = !last.is_empty() && (end - begin).norm() >= SHORTEST * farthest;
        ends.push(if far_enough {
            end
        } else if children.is_empty() {
            outermost(tree.points(node.part), rest_px, |p| {
                -(p - begin).norm_squared()
            })
        } else {
            fork_by_distance(&children, nodes, tree, rest_px, begin)
        });
    }
    ends
}

/// The points on the path from the foot to `points`, in its order: those through which more than
/// half of the paths to them run.
fn path_to(points: &[usize], edges: &[Edge]) -> Vec<usize> {
    busiest_path(points, edges, points.len() / 2 + 1)
}

/// As [`path_to`], and on from there to the end: at each fork by the path to most of the points.
fn path_to_tip(points: &[usize], edges: &[Edge]) -> Vec<usize> {
    busiest_path(points, edges, 1)
}

/// From the foot at each fork by the path to most of `points`, as long as it leads to `least` of
/// them.
fn busiest_path(points: &[usize], edges: &[Edge], least: usize) -> Vec<usize> {
    let n = edges.len();
    let mut beyond = vec![0usize; n];
    points.iter().for_each(|&p| beyond[p] += 1);
    for edge in edges.iter().rev() {
        if let Some(from) = edge.from {
            beyond[from] += beyond[edge.point];
        }
    }
    let mut next: Vec<Option<usize>> = vec![None; n];
    let mut first: Option<usize> = None;
    for &Edge { point, from } in edges {
        let best = from.map_or(&mut first, |from| &mut next[from]);
        if beyond[point] >= least && best.is_none_or(|b| beyond[point] > beyond[b]) {
            *best = Some(point);
        }
    }
    std::iter::successors(first, |&p| next[p]).collect()
}

/// What the paths to all `children` begin with.
fn common_start(paths: &[Vec<usize>], children: &[usize]) -> Vec<usize> {
    let Some((&first, others)) = children.split_first() else {
        return Vec::new();
    };
    let mut length = paths[first].len();
    for &other in others {
        let same = paths[first].iter().zip(&paths[other]);
        length = length.min(same.take_while(|(a, b)| a == b).count());
    }
    paths[first][..length].to_vec()
}

/// Share of a cluster's points, those nearest to or farthest from where its branch begins, that
/// mark its end.
const SHARE: f64 = 0.15;
/// Fewer points than this mark nothing: one alone may be a bad track.
const LEAST: usize = 2;

/// Where the paths do not tell: halfway between those points of each child that are nearest to the
/// beginning of the branch.
fn fork_by_distance(
    children: &[usize],
    nodes: &[Node],
    tree: &Dendrogram,
    rest_px: &[Point2<f64>],
    begin: Point2<f64>,
) -> Point2<f64> {
    let mut begins: Vec<Point2<f64>> = Vec::with_capacity(children.len());
    for &child in children {
        let points = tree.points(nodes[child].part);
        begins.push(outermost(points, rest_px, |p| (p - begin).norm_squared()));
    }
    let all: Vec<usize> = (0..begins.len()).collect();
    centroid(&begins, &all)
}

/// Mean of the points of least `rank`.
fn outermost(
    points: &[usize],
    rest_px: &[Point2<f64>],
    rank: impl Fn(Point2<f64>) -> f64,
) -> Point2<f64> {
    let mut points = points.to_vec();
    points.sort_by(|&a, &b| rank(rest_px[a]).total_cmp(&rank(rest_px[b])));
    points.truncate(((SHARE * points.len() as f64) as usize).max(LEAST));
    centroid(rest_px, &points)
}

#[cfg(test)]
mod tests {
    use super::super::dendrogram::Part;
    use super::*;
    use nalgebra::{Vector2, distance};

    const FOOT: Point2<f64> = Point2::new(100.0, 200.0);

    /// A limb for each entry: the point from which it leaves (`None`: the foot), its points, and
    /// whether they are a branch.
    type Limb<'a> = (Option<usize>, &'a [Point2<f64>], bool);

    /// Ends of a tree whose root holds all points, and which has a child for each limb that is a
    /// branch.
    fn ends(foot_px: Point2<f64>, limbs: &[Limb]) -> Vec<Point2<f64>> {
        let (mut rest_px, mut edges, mut branches) = (Vec::new(), Vec::new(), Vec::new());
        for &(mut from, points, is_branch) in limbs {
            let first = rest_px.len();
            for p in points {
                let point = rest_px.len();
                edges.push(Edge { point, from });
                from = Some(point);
                rest_px.push(*p);
            }
            if is_branch {
                branches.push(Part::undivided(first, rest_px.len()));
            }
        }
        let n = rest_px.len();
        let mut nodes = vec![Node {
            parent: None,
            level: 0,
            part: 0,
            certainty: 1.0,
        }];
        for part in 1..=branches.len() {
            nodes.push(Node {
                parent: Some(0),
                level: 1,
                part,
                certainty: 0.0,
            });
        }
        let mut parts = vec![Part::undivided(0, n)];
        parts.append(&mut branches);
        let tree = Dendrogram {
            order: (0..n).collect(),
            parts,
        };
        ends_px(&nodes, &tree, &edges, &rest_px, foot_px)
    }

    fn line(from: Point2<f64>, step: Vector2<f64>, n: usize) -> Vec<Point2<f64>> {
        (0..n).map(|k| from + step * k as f64).collect()
    }

    /// Else the picture would show a fork in the air between two limbs.
    #[test]
    fn a_fork_lies_on_the_stem_and_tips_on_their_limbs() {
        let trunk = line(Point2::new(100.0, 190.0), Vector2::new(0.0, -10.0), 8);
        let (left, right) = (
            line(Point2::new(90.0, 110.0), Vector2::new(-10.0, -10.0), 6),
            line(Point2::new(110.0, 112.0), Vector2::new(12.0, -8.0), 6),
        );
        let ends = ends(
            FOOT,
            &[
                (None, &trunk, false),
                (Some(7), &left, true),
                (Some(7), &right, true),
            ],
        );
        assert_eq!(ends.len(), 3);
        assert!(
            ends[0].x == 100.0 && (115.0..140.0).contains(&ends[0].y),
            "fork: {:?}",
            ends[0]
        );
        let (tip, near) = (ends[1], left[4]);
        assert!(distance(&tip, &near) < 1e-9, "left tip: {tip:?}");
        assert!(
            distance(&ends[2], &right[4]) < 1e-9,
            "right tip: {:?}",
            ends[2]
        );
    }

    /// What the papers' centroids get wrong: halfway between a low branch and the crown above it
    /// nothing parts.
    #[test]
    fn a_low_branch_leaves_the_trunk_where_it_does_and_not_halfway_up_the_crown() {
        let trunk = line(Point2::new(100.0, 190.0), Vector2::new(0.0, -10.0), 4);
        let low = line(Point2::new(90.0, 158.0), Vector2::new(-10.0, -3.0), 5);
        let above = line(Point2::new(100.0, 150.0), Vector2::new(0.0, -10.0), 14);
        let ends = ends(
            FOOT,
            &[
                (None, &trunk, false),
                (Some(3), &low, true),
                (Some(3), &above, true),
            ],
        );
        assert!(
            ends[0].x == 100.0 && (158.0..182.0).contains(&ends[0].y),
            "fork: {:?}",
            ends[0]
        );
        assert!(
            ends[2].y < 40.0,
            "the crown goes on to its top: {:?}",
            ends[2]
        );
    }

    #[test]
    fn a_trunk_without_points_ends_where_the_crown_begins() {
        let (left, right) = (
            line(Point2::new(90.0, 100.0), Vector2::new(-8.0, -8.0), 6),
            line(Point2::new(110.0, 100.0), Vector2::new(8.0, -8.0), 6),
        );
        let ends = ends(FOOT, &[(None, &left, true), (None, &right, true)]);
        assert!(
            (ends[0].x - 100.0).abs() < 1.0 && (90.0..=110.0).contains(&ends[0].y),
            "top: {:?}",
            ends[0]
        );
    }

    /// A branch of no length has no direction, and could not be posed.
    #[test]
    fn no_branch_ends_where_it_begins() {
        // The path to the right branch is known from its first points alone, right at the fork.
        let trunk = line(Point2::new(100.0, 190.0), Vector2::new(0.0, -10.0), 8);
        let (left, right) = (
            line(Point2::new(90.0, 110.0), Vector2::new(-10.0, -10.0), 6),
            [[101.0, 121.0], [99.0, 119.0], [104.0, 90.0]].map(Point2::from),
        );
        let ends = ends(
            FOOT,
            &[
                (None, &trunk, false),
                (Some(7), &left, true),
                (Some(7), &right, true),
            ],
        );
        for tip in &ends[1..] {
            assert!(
                distance(tip, &ends[0]) > 10.0,
                "{tip:?} at the fork {:?}",
                ends[0]
            );
        }
    }
}
