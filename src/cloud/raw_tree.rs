//! The tree as a skeleton method finds it, before anything is known of its thickness.

use super::paths::{Joint, Path, Place};
use nalgebra::Point3;

/// Places of the wood, each on another one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RawTree {
    /// Parents first; the first is the foot.
    pub nodes: Vec<RawNode>,
    /// The node that each point belongs to, or `u32::MAX`.
    pub of_point: Vec<u32>,
}

/// A place of the wood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RawNode {
    pub parent: Option<usize>,
    /// m, z up.
    pub at: Point3<f64>,
}

impl RawTree {
    /// The points drawn together to the middle of the wood: each at the node that it belongs to, or
    /// where it is if it is of none.
    pub fn contracted(&self, points: &[Point3<f32>]) -> Vec<Point3<f32>> {
        let nodes = points.iter().zip(&self.of_point);
        let middle = nodes.map(|(at, of)| match self.nodes.get(*of as usize) {
            Some(node) => node.at.cast(),
            None => *at,
        });
        middle.collect()
    }

    /// Places between nodes, and below the first one from `foot` on, that are farther apart than `longest`, no
    /// two of them farther than that: where the tree leads over a gap. Each with the upper of its nodes.
    pub fn between(&self, foot: Point3<f64>, longest: f64) -> Vec<(u32, Point3<f32>)> {
        let mut places = Vec::new();
        for (number, node) in (0..).zip(&self.nodes) {
            let from = node.parent.map_or(foot, |parent| self.nodes[parent].at);
            let pieces = ((node.at - from).norm() / longest).ceil();
            for k in 1..pieces as usize {
                let at = from + (node.at - from) * (k as f64 / pieces);
                places.push((number, at.cast()));
            }
        }
        places
    }

    /// The tree as paths, each from where it leaves another one to its tip: at every fork the path
    /// goes on in the child that carries the greatest length of wood.
    pub fn paths(&self) -> Vec<Path> {
        let mut above = vec![0.0; self.nodes.len()];
        let mut next: Vec<Option<usize>> = vec![None; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate().rev() {
            if let Some(p) = node.parent {
                let own = above[i] + (node.at - self.nodes[p].at).norm();
                above[p] += own;
                if next[p].is_none_or(|n: usize| {
                    own > above[n] + (self.nodes[n].at - self.nodes[p].at).norm()
                }) {
                    next[p] = Some(i);
                }
            }
        }
        let mut paths: Vec<Path> = Vec::new();
        let mut joint_of: Vec<Joint> = vec![Joint::default(); self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            let joint = match node.parent {
                Some(p) if next[p] == Some(i) => Joint {
                    path: joint_of[p].path,
                    place: joint_of[p].place + 1,
                },
                on => {
                    paths.push(Path {
                        on: on.map(|p| joint_of[p]),
                        places: Vec::new(),
                    });
                    Joint {
                        path: paths.len() - 1,
                        place: 0,
                    }
                }
            };
            joint_of[i] = joint;
            paths[joint.path].places.push(Place::new(node.at));
        }
        for (point, node) in (0..).zip(&self.of_point) {
            if let Some(joint) = joint_of.get(*node as usize) {
                paths[joint.path].places[joint.place].points.push(point);
            }
        }
        paths
    }
}
