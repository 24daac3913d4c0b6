//! How far the attractors on the envelope are from the tree: the sum of eq. 5, fast.

use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};

/// Nearest-node distances from the attractors, in single precision and coordinate by coordinate,
/// which the compiler turns into vector instructions: nearly all of the push's time goes into this.
pub(super) struct Search {
    ax: Vec<f32>,
    ay: Vec<f32>,
    az: Vec<f32>,
    nodes: Vec<[f32; 3]>,
}

impl Search {
    pub fn new(skeleton: &Skeleton, attractors: &[Point3<f64>]) -> Self {
        Self {
            ax: attractors.iter().map(|a| a.x as f32).collect(),
            ay: attractors.iter().map(|a| a.y as f32).collect(),
            az: attractors.iter().map(|a| a.z as f32).collect(),
            nodes: skeleton.nodes.iter().map(|n| single(&n.position)).collect(),
        }
    }

    pub fn moved(&mut self, skeleton: &Skeleton, subtree: &[usize]) {
        for &k in subtree {
            self.nodes[k] = single(&skeleton.nodes[k].position);
        }
    }

    fn lower(&self, nearest_sq: &mut [f32], p: [f32; 3]) {
        for (((d, x), y), z) in nearest_sq
            .iter_mut()
            .zip(&self.ax)
            .zip(&self.ay)
            .zip(&self.az)
        {
            let (dx, dy, dz) = (x - p[0], y - p[1], z - p[2]);
            *d = d.min(dx * dx + dy * dy + dz * dz);
        }
    }

    /// Squared distance of each attractor to the nearest node that is not in `subtree`.
    pub fn distances_without(&self, subtree: &[usize]) -> Vec<f32> {
        let mut inside = vec![false; self.nodes.len()];
        for &k in subtree {
            inside[k] = true;
        }
        let mut nearest_sq = vec![f32::INFINITY; self.ax.len()];
        for (p, _) in self
            .nodes
            .iter()
            .zip(&inside)
            .filter(|(_, inside)| !**inside)
        {
            self.lower(&mut nearest_sq, *p);
        }
        nearest_sq
    }

    /// D of eq. 5 with `subtree` moved by `offset`.
    pub fn total_distance(&self, without: &[f32], subtree: &[usize], offset: Vector3<f64>) -> f64 {
        let mut nearest_sq = without.to_vec();
        let o = [offset.x as f32, offset.y as f32, offset.z as f32];
        for &k in subtree {
            let p = self.nodes[k];
            self.lower(&mut nearest_sq, [p[0] + o[0], p[1] + o[1], p[2] + o[2]]);
        }
        nearest_sq.iter().map(|d| f64::from(d.sqrt())).sum()
    }
}

fn single(p: &Point3<f64>) -> [f32; 3] {
    [p.x as f32, p.y as f32, p.z as f32]
}
