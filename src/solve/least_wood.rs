//! Where limbs run that nobody sees: their forks stand so that the tree needs least wood.

use crate::model::{Node, NodeId};
use nalgebra::{Point3, Vector3};

/// A limb is as thick as all that it bears together, its radius to this power (da Vinci's rule has
/// 2, Murray's 3; trees measured lie between).
const PIPES: f64 = 2.5;
/// Rounds of Weiszfeld's method, and the move, px, below which they end.
const MOST_ROUNDS: usize = 300;
const SETTLED_PX: f64 = 0.02;

/// A node whose place is not seen.
pub(super) struct Free {
    pub node: usize,
    /// Points of the limb that ends in the node itself, not of what it bears: they hold the node
    /// where it is, as a limb of so many would.
    pub own: u32,
}

/// Moves the nodes in `free` so that the limbs between them and their neighbours have the least
/// volume: the sum of lengths, each times the area of its limb (Murray 1926: the geometry of
/// branching). The area follows from the number of points that a limb bears. Distances below
/// `least` count as squares, so that no two nodes fall together.
///
/// For a fork alone that is the weighted Fermat point, and all forks in turn are moved there step by
/// step (Weiszfeld 1937).
pub(super) fn settle(nodes: &mut [Node], free: &[Free], least: f64) {
    let areas = areas(nodes);
    let mut held = Vec::with_capacity(free.len());
    for Free { node, own } in free {
        held.push(Joined {
            at: nodes[*node].position,
            area: area(f64::from(*own)),
        });
    }
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        if let Some(bears) = borne_by(nodes, node) {
            children[bears].push(i);
        }
    }
    for _ in 0..MOST_ROUNDS {
        let mut farthest: f64 = 0.0;
        for (&Free { node: fork, .. }, &held) in free.iter().zip(&held) {
            let Some(parent) = nodes[fork].parent else {
                continue;
            };
            let below = Joined {
                at: nodes[parent.index()].position,
                area: areas[fork],
            };
            let above = children[fork].iter().map(|&child| Joined {
                at: nodes[child].position,
                area: areas[child],
            });
            let to = between(
                nodes[fork].position,
                [below, held].into_iter().chain(above),
                least,
            );
            farthest = farthest.max((to - nodes[fork].position).norm());
            nodes[fork].position = to;
        }
        if farthest < SETTLED_PX {
            break;
        }
    }
}

/// The end of a limb at whose other end a fork is.
#[derive(Clone, Copy, Debug)]
struct Joined {
    at: Point3<f64>,
    area: f64,
}

/// A step of Weiszfeld's method: the mean of the ends, each with its limb's area over its length.
fn between(fork: Point3<f64>, ends: impl Iterator<Item = Joined>, least: f64) -> Point3<f64> {
    let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
    for end in ends {
        let weight = end.area / (end.at - fork).norm().max(least);
        sum += weight * end.at.coords;
        weights += weight;
    }
    Point3::from(sum / weights)
}

/// Area of the limb that ends in each node, that of one which bears a single point being 1. A copy
/// bears what its original does.
fn areas(nodes: &[Node]) -> Vec<f64> {
    let mut above = vec![0.0; nodes.len()];
    let mut areas = vec![0.0; nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        let original = node.copy_of.map_or(node, |of| &nodes[of.index()]);
        let borne = f64::from(original.n_tracks).max(above[i]).max(1.0);
        areas[i] = area(borne);
        if let Some(bears) = borne_by(nodes, node) {
            above[bears] += borne;
        }
    }
    areas
}

/// The parent of a node, if both are copies or neither is: what was filmed does not turn to the
/// copies that hang on it.
fn borne_by(nodes: &[Node], node: &Node) -> Option<usize> {
    let parent = node.parent.map(NodeId::index)?;
    (nodes[parent].copy_of.is_some() == node.copy_of.is_some()).then_some(parent)
}

/// Area of a limb that bears so many points.
fn area(points: f64) -> f64 {
    points.powf(2.0 / PIPES)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(parent: Option<u32>, at: [f64; 3], n_tracks: u32) -> Node {
        Node {
            parent: parent.map(NodeId),
            position: at.into(),
            n_tracks,
            ..Node::made_up(0, None, [0.0; 3])
        }
    }

    /// Two equal limbs part where their angle to each other has the cosine that Murray gives.
    #[test]
    fn equal_limbs_part_at_murray_s_angle() {
        let mut nodes = vec![
            node(None, [0.0, 0.0, 0.0], 16),
            node(Some(0), [20.0, 30.0, 0.0], 16),
            node(Some(1), [-50.0, 100.0, 0.0], 8),
            node(Some(1), [50.0, 100.0, 0.0], 8),
        ];
        settle(&mut nodes, &[Free { node: 1, own: 0 }], 0.1);
        let fork = nodes[1].position;
        assert!(fork.x.abs() < 0.1 && fork.y > 10.0, "{fork}");
        let [left, right] = [2, 3].map(|i: usize| (nodes[i].position - fork).normalize());
        let half = 0.5 * 2.0_f64.powf(2.0 / PIPES);
        let cosine = 2.0 * half * half - 1.0;
        assert!((left.dot(&right) - cosine).abs() < 0.01, "{fork}");
        assert_eq!(nodes[2].position, Point3::new(-50.0, 100.0, 0.0));
    }

    /// Where limbs part so wide that the fork would fall on what it leaves, it stays beside it.
    #[test]
    fn forks_do_not_fall_together() {
        let mut nodes = vec![
            node(None, [0.0, 0.0, 0.0], 16),
            node(Some(0), [0.0, 60.0, 0.0], 16),
            node(Some(1), [-90.0, 10.0, 0.0], 8),
            node(Some(1), [90.0, 10.0, 0.0], 8),
        ];
        settle(&mut nodes, &[Free { node: 1, own: 0 }], 4.0);
        let height = nodes[1].position.y;
        assert!((0.1..4.0).contains(&height), "{height}");
    }
}
