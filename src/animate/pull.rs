//! Pull and release: a rope tied to the tree.

use super::animator::{Animator, Pull};
use crate::model::{NodeId, Skeleton};
use nalgebra::Vector3;

/// Steps of the search for the force; each halves what is left.
const HALVINGS: usize = 48;
/// A rope that pulls so hard and moves the tree no farther never will.
const DOUBLINGS: i32 = 60;

/// Share of the tree's height above which a rope is tied.
const TIED_ABOVE: f64 = 0.45;

/// Where one would tie the rope: the thickest branch of its own motion that ends well above the
/// ground, of equally thick ones the highest.
pub fn place_to_pull(skeleton: &Skeleton) -> NodeId {
    let nodes = &skeleton.nodes;
    let height = nodes.iter().map(|n| n.position.y).fold(0.0, f64::max);
    let thickest = nodes
        .iter()
        .enumerate()
        .skip(1)
        .filter(|(_, n)| n.position.y >= TIED_ABOVE * height && n.copy_of.is_none())
        .filter(|(i, _)| skeleton.mover(NodeId(*i as u32)).index() == *i)
        .max_by(|(_, a), (_, b)| {
            a.radius
                .total_cmp(&b.radius)
                .then(a.position.y.total_cmp(&b.position.y))
        })
        .map_or(0, |(i, _)| i);
    NodeId(thickest as u32)
}

impl Animator {
    /// Ties a rope to a node and pulls, level, towards `direction_deg` (as the wind's) until the
    /// line from the foot to the node leans by `lean_deg`; the tree then hangs still in it. Gives
    /// the lean that was reached, which is less where the branches' bounds do not let it come so
    /// far.
    pub fn pull_aside(&mut self, node: NodeId, direction_deg: f64, lean_deg: f64) -> f64 {
        let (sin, cos) = direction_deg.to_radians().sin_cos();
        let towards = Vector3::new(cos, 0.0, -sin);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..DOUBLINGS {
            if self.lean_under(node, towards * high) >= lean_deg {
                break;
            }
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.lean_under(node, towards * middle) < lean_deg {
                low = middle
            } else {
                high = middle
            }
        }
        self.lean_under(node, towards * high)
    }

    /// How far the line from the foot to the node leans when the tree hangs still in this force,
    /// degrees.
    fn lean_under(&mut self, node: NodeId, force: Vector3<f64>) -> f64 {
        self.pull(Some(Pull { node, force }));
        self.settle();
        self.lean_deg(node)
    }
}
