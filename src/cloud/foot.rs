//! Where the tree stands: the lowest points of its trunk.

use super::CloudError;
use super::graph::{Graph, Ways, root};
use nalgebra::{Point3, Vector3};

/// The trunk is looked for in the lowest part of the tree, this share of its height.
const SLAB_SHARE: f32 = 0.05;
/// Its lowest points reach up to so many cells above the lowest.
const FOOT_CELLS: f32 = 2.5;
/// What reaches higher than this share of the tree's height counts for a trunk.
const HIGH_SHARE: f32 = 0.3;
/// Another trunk carries at least this share of what the largest does, and stands farther off than
/// this share of the tree's height: stems of one stool are one tree.
const OTHER_TREE: f64 = 0.25;
const STOOL_SHARE: f32 = 0.12;

/// The lowest points of a trunk.
struct Stand {
    lowest: Vec<u32>,
    middle: Point3<f32>,
}

/// The lowest points of the trunk that carries most. `points` are as high as they are above the
/// ground; `height` is that of the tree, `cell` the distance of points.
///
/// # Errors
/// Several trees stand in it.
pub(super) fn find(
    points: &[Point3<f32>],
    graph: &Graph,
    height: f32,
    cell: f32,
) -> Result<Vec<u32>, CloudError> {
    let stands = stands(points, graph, height, cell);
    let seeds: Vec<u32> = stands.iter().flat_map(|s| &s.lowest).copied().collect();
    let ways = graph.shortest_ways(&seeds);
    let bottom = points.iter().map(|p| p.z).fold(f32::INFINITY, f32::min);
    let carried = carried(&stands, &ways, points, bottom + HIGH_SHARE * height);
    let Some(main) = (0..stands.len()).max_by_key(|s| (carried[*s], std::cmp::Reverse(*s))) else {
        return Err(CloudError::NoTree);
    };
    let least = (OTHER_TREE * carried[main] as f64).max(1.0);
    let is_tree: Vec<usize> = (0..stands.len())
        .filter(|s| carried[*s] as f64 >= least)
        .collect();
    let trees = groups(&stands, &is_tree, STOOL_SHARE * height);
    if trees > 1 {
        return Err(CloudError::SeveralTrees { trees });
    }
    let own = &stands[main];
    let of_stool = stands
        .iter()
        .filter(|s| (s.middle - own.middle).norm() <= STOOL_SHARE * height);
    let stool: Vec<&Stand> = of_stool.collect();
    if is_tree.len() == 1 {
        return Ok(own.lowest.clone());
    }
    Ok(stool
        .iter()
        .flat_map(|s| s.lowest.iter().copied())
        .collect())
}

/// What hangs together in the lowest part of the tree.
fn stands(points: &[Point3<f32>], graph: &Graph, height: f32, cell: f32) -> Vec<Stand> {
    let bottom = points.iter().map(|p| p.z).fold(f32::INFINITY, f32::min);
    let slab = bottom + SLAB_SHARE * height;
    let is_low = |p: u32| points[p as usize].z <= slab;
    let pieces = graph.pieces_where(|a, b| is_low(a) && is_low(b));
    let count = pieces.iter().max().map_or(0, |p| *p as usize + 1);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (point, piece) in (0..).zip(&pieces) {
        if is_low(point) {
            members[*piece as usize].push(point);
        }
    }
    let mut stands = Vec::new();
    for own in members.iter().filter(|m| !m.is_empty()) {
        stands.push(Stand::of(own, points, cell));
    }
    stands
}

impl Stand {
    /// Of what hangs together. What lies beside the trunk, as grass does, is seen in its upper half
    /// to be beside it.
    fn of(members: &[u32], points: &[Point3<f32>], cell: f32) -> Self {
        let heights = members.iter().map(|p| points[*p as usize].z);
        let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), z| {
            (l.min(z), h.max(z))
        });
        let is_upper = |p: &&u32| points[**p as usize].z >= 0.5 * (low + high);
        let upper: Vec<Point3<f32>> = members
            .iter()
            .filter(is_upper)
            .map(|p| points[*p as usize])
            .collect();
        let mut sum = Vector3::zeros();
        upper.iter().for_each(|p| sum += p.coords);
        let middle = Point3::from(sum / upper.len() as f32);
        let reach = upper
            .iter()
            .map(|p| (p - middle).xy().norm())
            .fold(cell, f32::max)
            + high
            - low;
        let near: Vec<u32> = members
            .iter()
            .copied()
            .filter(|p| (points[*p as usize] - middle).xy().norm() <= reach)
            .collect();
        let lowest = near
            .iter()
            .map(|p| points[*p as usize].z)
            .fold(f32::INFINITY, f32::min);
        let is_lowest = |p: &u32| points[*p as usize].z <= lowest + FOOT_CELLS * cell;
        Self {
            lowest: near.iter().copied().filter(is_lowest).collect(),
            middle,
        }
    }
}

/// How many of the points above a height are nearest to each stand.
fn carried(stands: &[Stand], ways: &Ways, points: &[Point3<f32>], above: f32) -> Vec<usize> {
    let mut stand_of = vec![usize::MAX; points.len()];
    for (s, stand) in stands.iter().enumerate() {
        stand.lowest.iter().for_each(|p| stand_of[*p as usize] = s);
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by(|a, b| ways.length[*a as usize].total_cmp(&ways.length[*b as usize]));
    let mut carried = vec![0; stands.len()];
    for point in order {
        let p = point as usize;
        if stand_of[p] == usize::MAX {
            stand_of[p] = stand_of[ways.before[p] as usize];
        }
        if stand_of[p] != usize::MAX && points[p].z > above {
            carried[stand_of[p]] += 1;
        }
    }
    carried
}

/// Number of groups of stands that are farther than `apart` from each other.
fn groups(stands: &[Stand], which: &[usize], apart: f32) -> usize {
    let mut joined: Vec<u32> = (0..which.len() as u32).collect();
    for a in 0..which.len() {
        for b in 0..a {
            if (stands[which[a]].middle - stands[which[b]].middle).norm() <= apart {
                let [low, high] = [root(&joined, a as u32), root(&joined, b as u32)];
                joined[low.max(high) as usize] = low.min(high);
            }
        }
    }
    (0..).zip(&joined).filter(|(i, of)| i == *of).count()
}
