//! Which points are of which tree, where several stand in a cloud.
//!
//! Stems are looked for at breast height above the ground, as inventories do: what hangs together
//! there and is upright. From each the way along wood leads down to where it stands. Every point is
//! then of the tree whose foot it has the shortest way to (RayCloudTools, Lowe & Stepanas 2021).

use super::from_above;
use super::graph::{Graph, groups_within};
use nalgebra::{Point3, Vector3};

/// Height above the ground at which a stem is looked for, m, and at most this share of the height
/// of a low cloud.
const BREAST_HEIGHT_M: f32 = 1.3;
const BREAST_SHARE: f32 = 0.2;
/// From there up and down by this share, and so many cells at least.
const SLICE_SHARE: f32 = 0.15;
const SLICE_CELLS: f32 = 3.0;
/// A stem reaches through this share of the slice, and leans by no more than 45 degrees.
const THROUGH_SHARE: f32 = 0.7;
const STEEPEST_LEAN: f32 = 1.0;
/// It stands on what is lower than this share of the breast height, and its way to there is no
/// longer than so many times the height: twigs that hang down have their way by the trunk.
const FOOT_SHARE: f32 = 0.25;
const LONGEST_WAY: f32 = 1.6;
/// Stems nearer to each other than this share of the cloud's height, and than so many metres, are
/// of one stool.
const STOOL_SHARE: f32 = 0.12;
const STOOL_M: f32 = 1.0;
/// A tree reaches to this share of the height of the highest at least, and has this share of the
/// points of the largest; what does not is undergrowth.
const HIGH_SHARE: f32 = 0.3;
const LEAST_POINTS_SHARE: f64 = 0.03;

/// Of no tree.
pub(super) const OF_NO_TREE: u32 = u32::MAX;

/// The trees of a cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Stand {
    pub trees: usize,
    /// Of each point the number of its tree, that with most points first, or [`OF_NO_TREE`].
    pub of_point: Vec<u32>,
}

/// What stands on the ground and reaches through breast height.
struct Stem {
    /// The points that it stands on.
    foot: Vec<u32>,
    middle: Point3<f32>,
}

/// The trees of points that are `above` the ground, as `height` high as all, with `cell` between
/// them. A single tree and its undergrowth are one: then all points are of it.
pub(super) fn find(above: &[Point3<f32>], graph: &Graph, height: f32, cell: f32) -> Stand {
    let stems = stems(above, graph, height, cell);
    let middles: Vec<Point3<f32>> = stems.iter().map(|s| s.middle).collect();
    let stool_of = groups_within(&middles, STOOL_M.min(STOOL_SHARE * height));
    let mut seed_of = vec![OF_NO_TREE; above.len()];
    for (stem, stool) in stems.iter().zip(&stool_of) {
        for point in &stem.foot {
            seed_of[*point as usize] = *stool;
        }
    }
    let seeds: Vec<u32> = (0..above.len() as u32)
        .filter(|p| seed_of[*p as usize] != OF_NO_TREE)
        .collect();
    let nearest = graph.shortest_ways(&seeds).spread(seed_of);
    let ranked = ranked(above, &nearest, height);
    let trees = ranked.iter().filter(|rank| **rank != OF_NO_TREE).count();
    if trees < 2 {
        return Stand {
            trees,
            of_point: vec![0; above.len()],
        };
    }
    let of_point = nearest
        .iter()
        .map(|stool| ranked.get(*stool as usize).copied().unwrap_or(OF_NO_TREE))
        .collect();
    Stand { trees, of_point }
}

/// What is upright at breast height and stands on the ground.
fn stems(above: &[Point3<f32>], graph: &Graph, height: f32, cell: f32) -> Vec<Stem> {
    let breast = BREAST_HEIGHT_M.min(BREAST_SHARE * height);
    let half = (SLICE_SHARE * breast).max(SLICE_CELLS * cell);
    let bottom = from_above::bottom(above);
    let [low, high, ground] =
        [breast - half, breast + half, FOOT_SHARE * breast].map(|z| bottom + z);
    let on_ground: Vec<u32> = (0..above.len() as u32)
        .filter(|p| above[*p as usize].z <= ground)
        .collect();
    let down = graph.shortest_ways(&on_ground);
    let mut stems = Vec::new();
    for members in from_above::pieces(above, cell, |at| (low..=high).contains(&at.z)) {
        if !is_upright(above, &members, high - low) {
            continue;
        }
        let longest = LONGEST_WAY * (high - ground);
        let mut foot: Vec<u32> = members
            .iter()
            .filter(|p| down.length[**p as usize] <= longest)
            .map(|p| down.first(*p))
            .collect();
        foot.sort_unstable();
        foot.dedup();
        if foot.is_empty() {
            continue;
        }
        let mut sum = Vector3::zeros();
        foot.iter().for_each(|p| sum += above[*p as usize].coords);
        let middle = Point3::from(sum / foot.len() as f32);
        stems.push(Stem { foot, middle });
    }
    stems
}

/// Whether points reach through a slice so high, and lean by little.
fn is_upright(above: &[Point3<f32>], members: &[u32], slice: f32) -> bool {
    let heights = members.iter().map(|p| above[*p as usize].z);
    let low = heights.clone().fold(f32::INFINITY, f32::min);
    let high = heights.fold(f32::NEG_INFINITY, f32::max);
    if high - low < THROUGH_SHARE * slice {
        return false;
    }
    let between = 0.5 * (low + high);
    let [mut below, mut over] = [(Vector3::zeros(), 0_u32); 2];
    for point in members {
        let at = above[*point as usize];
        let half = if at.z < between {
            &mut below
        } else {
            &mut over
        };
        *half = (half.0 + at.coords, half.1 + 1);
    }
    let [below, over] = [below, over].map(|(sum, count)| sum / count.max(1) as f32);
    let way: Vector3<f32> = over - below;
    way.xy().norm() <= STEEPEST_LEAN * way.z
}

/// The rank of each stool by its points; what is no tree has none.
fn ranked(above: &[Point3<f32>], of_point: &[u32], height: f32) -> Vec<u32> {
    let count = of_point
        .iter()
        .filter(|s| **s != OF_NO_TREE)
        .max()
        .map_or(0, |s| *s as usize + 1);
    let mut points = vec![0_usize; count];
    let mut top = vec![f32::NEG_INFINITY; count];
    for (at, stool) in above.iter().zip(of_point) {
        if let Some(own) = points.get_mut(*stool as usize) {
            *own += 1;
            top[*stool as usize] = top[*stool as usize].max(at.z);
        }
    }
    let most = points.iter().max().map_or(0.0, |n| *n as f64);
    let least_top = from_above::bottom(above) + HIGH_SHARE * height;
    let mut order: Vec<usize> = (0..count)
        .filter(|s| top[*s] >= least_top && points[*s] as f64 >= LEAST_POINTS_SHARE * most)
        .collect();
    order.sort_by_key(|s| (std::cmp::Reverse(points[*s]), *s));
    let mut ranked = vec![OF_NO_TREE; count];
    for (rank, stool) in (0..).zip(order) {
        ranked[stool] = rank;
    }
    ranked
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: f32 = 0.02;

    /// Points of an upright pole, and of a bough that leaves it and hangs down nearly to the ground.
    fn tree(x: f32, height: f32) -> Vec<Point3<f32>> {
        let mut points = Vec::new();
        for k in 0..(height / CELL) as u32 {
            let z = CELL * k as f32;
            points.extend([-1.0, 1.0].map(|side| Point3::new(x + side * CELL, 0.0, z)));
        }
        for k in 0..120 {
            let way = CELL * k as f32;
            points.push(Point3::new(
                x,
                0.02 + way.min(1.0),
                2.0 - (way - 1.0).max(0.0),
            ));
        }
        points
    }

    fn found(points: &[Point3<f32>], height: f32) -> Stand {
        let graph = Graph::new(points, 3.0 * CELL).bridged(points, 3.0 * CELL, 0.1 * height);
        find(points, &graph, height, CELL)
    }

    #[test]
    fn each_pole_is_a_tree_and_its_bough_is_not() {
        let mut points = tree(0.0, 4.0);
        let first = points.len();
        assert_eq!(found(&points, 4.0).trees, 1);
        points.extend(tree(3.0, 6.0));
        let both = points.len();
        // Undergrowth.
        points.extend(tree(6.0, 1.2).into_iter().take(100));
        let stand = found(&points, 6.0);
        assert_eq!(stand.trees, 2);
        assert!(stand.of_point[..first].iter().all(|t| *t == 1));
        assert!(stand.of_point[first..both].iter().all(|t| *t == 0));
        assert!(stand.of_point[both..].iter().all(|t| *t == OF_NO_TREE));
        // Where no ground was scanned heights are those of the survey.
        points.iter_mut().for_each(|p| p.z -= 300.0);
        assert_eq!(found(&points, 6.0), stand);
    }

    #[test]
    fn stems_of_one_stool_are_one_tree() {
        let mut points = tree(0.0, 4.0);
        points.extend(tree(0.4, 5.0));
        let stand = found(&points, 5.0);
        assert_eq!(stand.trees, 1);
        assert!(stand.of_point.iter().all(|t| *t == 0));
        assert_eq!(found(&[], 5.0), Stand::default());
    }
}
