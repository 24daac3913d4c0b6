//! Where the tree stands: the lowest points of its trunk.

use super::CloudError;
use super::from_above;
use super::graph::{Graph, Ways};
use nalgebra::{Point3, Vector3};

/// The trunk is looked for in the lowest part of the tree, this share of its height.
const SLAB_SHARE: f32 = 0.05;
/// Its lowest points reach up to so many cells above the lowest.
const FOOT_CELLS: f32 = 2.5;
/// What reaches higher than this share of the tree's height counts for a trunk.
const HIGH_SHARE: f32 = 0.3;
/// Another stem of a stool carries at least this share of what the largest does, and stands no
/// farther off than this share of the tree's height.
const OTHER_STEM: f64 = 0.25;
const STOOL_SHARE: f32 = 0.12;

/// The lowest points of a trunk.
struct Stand {
    lowest: Vec<u32>,
    middle: Point3<f32>,
}

/// The lowest points of the trunk that carries most, and of others on its stool that carry much.
/// `points` are as high as they are above the ground; `height` is that of the tree, `cell` the
/// distance of points.
///
/// # Errors
/// Nothing stands in it.
pub(super) fn find(
    points: &[Point3<f32>],
    graph: &Graph,
    height: f32,
    cell: f32,
) -> Result<Vec<u32>, CloudError> {
    let bottom = from_above::bottom(points);
    let stands = stands(points, bottom + SLAB_SHARE * height, cell);
    let seeds: Vec<u32> = stands.iter().flat_map(|s| &s.lowest).copied().collect();
    let ways = graph.shortest_ways(&seeds);
    let carried = carried(&stands, &ways, points, bottom + HIGH_SHARE * height);
    let Some(main) = (0..stands.len()).max_by_key(|s| (carried[*s], std::cmp::Reverse(*s))) else {
        return Err(CloudError::NoTree);
    };
    let own = &stands[main];
    let least = (OTHER_STEM * carried[main] as f64).max(1.0);
    let mut stool: Vec<usize> = (0..stands.len()).collect();
    stool.retain(|s| (stands[*s].middle - own.middle).norm() <= STOOL_SHARE * height);
    let stems = stool.iter().filter(|s| carried[**s] as f64 >= least);
    if stems.count() < 2 {
        return Ok(own.lowest.clone());
    }
    let lowest = stool.iter().flat_map(|s| &stands[*s].lowest);
    Ok(lowest.copied().collect())
}

/// What hangs together up to a height, seen from above: few points make a torn trunk.
fn stands(points: &[Point3<f32>], up_to: f32, cell: f32) -> Vec<Stand> {
    let members = from_above::pieces(points, cell, |at| at.z <= up_to);
    members
        .iter()
        .map(|own| Stand::of(own, points, cell))
        .collect()
}

impl Stand {
    /// Of what hangs together. What lies beside the trunk, as grass does, is seen in its upper half
    /// to be beside it.
    fn of(members: &[u32], points: &[Point3<f32>], cell: f32) -> Self {
        let heights = members.iter().map(|p| points[*p as usize].z);
        let (low, high) = heights.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), z| {
            (l.min(z), h.max(z))
        });
        let mut upper: Vec<Point3<f32>> = members.iter().map(|p| points[*p as usize]).collect();
        upper.retain(|at| at.z >= 0.5 * (low + high));
        let mut sum = Vector3::zeros();
        upper.iter().for_each(|p| sum += p.coords);
        let middle = Point3::from(sum / upper.len() as f32);
        let reach = upper
            .iter()
            .map(|p| (p - middle).xy().norm())
            .fold(cell, f32::max)
            + high
            - low;
        let mut near = members.to_vec();
        near.retain(|p| (points[*p as usize] - middle).xy().norm() <= reach);
        let lowest = near
            .iter()
            .map(|p| points[*p as usize].z)
            .fold(f32::INFINITY, f32::min);
        near.retain(|p| points[*p as usize].z <= lowest + FOOT_CELLS * cell);
        Self {
            lowest: near,
            middle,
        }
    }
}

/// How many of the points above a height are nearest to each stand.
fn carried(stands: &[Stand], ways: &Ways, points: &[Point3<f32>], above: f32) -> Vec<usize> {
    let mut seed_of = vec![u32::MAX; points.len()];
    for (s, stand) in (0..).zip(stands) {
        stand.lowest.iter().for_each(|p| seed_of[*p as usize] = s);
    }
    let mut carried = vec![0; stands.len()];
    for (at, stand) in points.iter().zip(ways.spread(seed_of)) {
        if stand != u32::MAX && at.z > above {
            carried[stand as usize] += 1;
        }
    }
    carried
}
