//! The trunk: one, neither copied nor pushed (Li 2011 sect. 3 and fig. 9).

use crate::config::Leader;
use crate::model::Skeleton;
use crate::signal::distance_to_segment;
use crate::skeleton::Node2d;
use nalgebra::Point2;

/// A node belongs to a drawn leader if it lies within this share of the tree's height from it.
const REACH: f64 = 0.06;
/// A leader that is looked for goes on as long as it turns by less than this, radians.
const STRAIGHT: f64 = std::f64::consts::FRAC_PI_4;

/// Which nodes of the flat skeleton are trunk: the foot, the trunk's top, and with a leader the
/// chain that goes on from there along it; where none leads on, the chain of those that carry more than half
/// of the tree's points, as a stem does that only smaller branches leave. `carried` is how many points each node
/// carries, `leader_px` the line that was drawn, from the foot up, px; it counts only with
/// [`Leader::Drawn`].
pub fn trunk(
    flat: &[Node2d],
    carried: &[u32],
    leader: Leader,
    leader_px: &[Point2<f64>],
) -> Vec<bool> {
    let mut trunk: Vec<bool> = flat.iter().map(|n| n.level < 2).collect();
    let Some(foot) = flat.first().map(|n| n.position_px) else {
        return trunk;
    };
    let top_v = flat
        .iter()
        .map(|n| n.position_px.y)
        .filter(|v| v.is_finite())
        .fold(foot.y, f64::min);
    let reach = REACH * (foot.y - top_v);
    let all = u64::from(carried.first().copied().unwrap_or_default());
    let mut at = flat.iter().position(|n| n.level == 1);
    while let Some(from) = at {
        let children =
            (0..flat.len()).filter(|&i| flat[i].parent == Some(from) && flat[i].level >= 2);
        let stem = children
            .clone()
            .find(|&i| carried.get(i).is_some_and(|own| 2 * u64::from(*own) > all));
        let led = match leader {
            Leader::None => None,
            Leader::Drawn => nearest(
                children.map(|i| (i, distance_to_line(flat[i].position_px, leader_px))),
                reach,
            ),
            Leader::Auto => {
                let here = flat[from].position_px;
                let before = flat[from].parent.map_or(foot, |p| flat[p].position_px);
                nearest(
                    children.map(|i| (i, turn(before, here, flat[i].position_px))),
                    STRAIGHT,
                )
            }
        };
        at = led.or(stem);
        if let Some(i) = at {
            trunk[i] = true;
        }
    }
    trunk
}

/// Which nodes of a skeleton are trunk: those of levels 0 and 1, and where there are copies what
/// has none.
pub fn is_trunk(skeleton: &Skeleton) -> Vec<bool> {
    let mut copied = vec![false; skeleton.nodes.len()];
    for original in skeleton.nodes.iter().filter_map(|n| n.copy_of) {
        copied[original.index()] = true;
    }
    let any = copied.contains(&true);
    let mut trunk = Vec::with_capacity(skeleton.nodes.len());
    for (node, copied) in skeleton.nodes.iter().zip(copied) {
        trunk.push(node.level < 2 || any && node.copy_of.is_none() && !copied);
    }
    trunk
}

/// Whether `trunk` holds for node `i`; copies, which come after the measured nodes, are no trunk.
pub(super) fn in_trunk(trunk: &[bool], i: usize) -> bool {
    trunk.get(i).is_some_and(|t| *t)
}

/// The item with the smallest value below `limit`; the first of equals.
fn nearest(items: impl Iterator<Item = (usize, f64)>, limit: f64) -> Option<usize> {
    items
        .filter(|(_, d)| *d < limit)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

/// Distance of `p` from a line of several pieces, px.
fn distance_to_line(p: Point2<f64>, line: &[Point2<f64>]) -> f64 {
    line.windows(2)
        .map(|ends| distance_to_segment(p, ends[0], ends[1]))
        .fold(f64::INFINITY, f64::min)
}

/// By how much the way a-b-c turns at b, radians.
fn turn(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> f64 {
    let (u, v) = (b - a, c - b);
    u.perp(&v).atan2(u.dot(&v)).abs()
}
