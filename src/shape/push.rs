//! The Bayesian push: branches leave their planes to fill the envelope while their angles stay likely
//! (Li et al. section 3, eq. 2-6).

use super::envelope::Envelope;
use crate::config;
use crate::model::Skeleton;
use nalgebra::{Point3, Vector3};
use std::f64::consts::PI;

/// Which terms of the posterior are used; the one-sided ones are the paper's figure 3 a and b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Terms {
    /// Local and global, eq. 2.
    Both,
    /// Only the branching angles, eq. 4.
    Local,
    /// Only the filling of the envelope, eq. 6.
    Global,
}

/// Pushes every node above the trunk, with all that hangs on it, along the normal of its plane, level by level from
/// the root. Each push is the most probable of `settings.push_options` values in [-delta, delta], with delta a share
/// of the tree's width. No node is pushed out of the envelope.
pub fn push(skeleton: &mut Skeleton, envelope: &Envelope, settings: &config::Shape, terms: Terms) {
    let attractors = envelope.attractors(settings.attractors as usize);
    let delta = settings.push_range * envelope.width();
    let mu = mean_branching_angle(skeleton);
    let deepest = skeleton.nodes.iter().map(|n| n.level).max().unwrap_or(0);
    let subtrees = subtrees(skeleton);
    let mut order: Vec<usize> = (0..skeleton.nodes.len()).filter(|&i| skeleton.nodes[i].level >= 2).collect();
    order.sort_by_key(|&i| (skeleton.nodes[i].level, i));
    let mut search = Search::new(skeleton, &attractors);
    for i in order {
        let subtree = &subtrees[i];
        let Some(parent) = skeleton.nodes[i].parent.map(|p| p.index()) else { continue };
        let grand = skeleton.nodes[parent].parent.map(|g| skeleton.nodes[g.index()].position);
        let normal = plane_normal(skeleton.nodes[i].plane_angle);
        // sigma_i = pi (d_max - d_i) / d_max; a tip would get 0 and could not move at all, so tips get half a step.
        let above = f64::from(deepest - skeleton.nodes[i].level).max(0.5);
        let sigma = PI * above / f64::from(deepest.max(1));
        let without = search.distances_without(subtree);
        let before = search.total_distance(&without, subtree, Vector3::zeros());
        let options: Vec<Candidate> = (0..settings.push_options)
            .filter_map(|l| {
                let offset = normal * option(l, settings.push_options) * delta;
                let inside = |&k: &usize| envelope.contains(&(skeleton.nodes[k].position + offset));
                if offset != Vector3::zeros() && !subtree.iter().all(inside) {
                    return None; // outside of the envelope the probability is 0
                }
                let at = skeleton.nodes[i].position + offset;
                let local = match grand {
                    Some(grand) => {
                        let alpha = angle_between(&grand, &skeleton.nodes[parent].position, &at);
                        -(alpha - mu).powi(2) / (2.0 * sigma * sigma)
                    }
                    None => 0.0,
                };
                let gain = (before - search.total_distance(&without, subtree, offset)).max(0.0);
                Some(Candidate { offset, local, gain })
            })
            .collect();
        let best = most_probable(&options, terms);
        for &k in subtree {
            skeleton.nodes[k].position += best;
        }
        search.moved(skeleton, subtree);
    }
}

/// One push that was tried: ln of eq. 4, and E of eq. 6.
struct Candidate {
    offset: Vector3<f64>,
    local: f64,
    gain: f64,
}

/// The offset with the highest posterior; of equals the smallest push, so that nothing moves for nothing.
fn most_probable(options: &[Candidate], terms: Terms) -> Vector3<f64> {
    let sum: f64 = options.iter().map(|c| c.gain).sum();
    // Eq. 6 is 0 for every option where none brings the tree nearer to the envelope: it then says nothing.
    let global_speaks = sum > 0.0 && terms != Terms::Local;
    let score = |c: &Candidate| {
        let global = if global_speaks { (c.gain / sum).ln() } else { 0.0 };
        global + if terms == Terms::Global { 0.0 } else { c.local }
    };
    let better = |a: &&Candidate, b: &&Candidate| {
        score(a).total_cmp(&score(b)).then(b.offset.norm_squared().total_cmp(&a.offset.norm_squared()))
    };
    options.iter().max_by(better).map_or(Vector3::zeros(), |c| c.offset)
}

/// Option `l` of `n` values spread evenly over [-1, 1]; an odd `n` holds 0.
fn option(l: u32, n: u32) -> f64 {
    if n < 2 { 0.0 } else { 2.0 * f64::from(l) / f64::from(n - 1) - 1.0 }
}

/// Normal of the plane that is turned by `angle` about the y axis.
fn plane_normal(angle: f64) -> Vector3<f64> {
    Vector3::new(angle.sin(), 0.0, angle.cos())
}

/// Angle between the branch a-b and the branch b-c that goes on from it; 0 goes straight on.
fn angle_between(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> f64 {
    (b - a).angle(&(c - b))
}

/// mu of eq. 4: the mean of all branching angles, of the skeleton as it lies in its planes.
pub fn mean_branching_angle(skeleton: &Skeleton) -> f64 {
    let angles: Vec<f64> = branching_angles(skeleton);
    if angles.is_empty() { PI / 4.0 } else { angles.iter().sum::<f64>() / angles.len() as f64 }
}

fn branching_angles(skeleton: &Skeleton) -> Vec<f64> {
    let nodes = &skeleton.nodes;
    let angle = |i: usize| {
        let parent = &nodes[nodes[i].parent?.index()];
        let grand = &nodes[parent.parent?.index()];
        Some(angle_between(&grand.position, &parent.position, &nodes[i].position))
    };
    (0..nodes.len()).filter(|&i| nodes[i].copy_of.is_none()).filter_map(angle).collect()
}

/// D of eq. 5: sum over the attractors of the distance to the nearest node, px.
pub fn envelope_distance(skeleton: &Skeleton, envelope: &Envelope, attractors: usize) -> f64 {
    let attractors = envelope.attractors(attractors);
    let nearest =
        |w: &Point3<f64>| skeleton.nodes.iter().map(|n| (w - n.position).norm()).fold(f64::INFINITY, f64::min);
    attractors.iter().map(nearest).sum()
}

/// Every node's own index and those of all its descendants.
fn subtrees(skeleton: &Skeleton) -> Vec<Vec<usize>> {
    let n = skeleton.nodes.len();
    let mut out: Vec<Vec<usize>> = (0..n).map(|i| vec![i]).collect();
    for i in (1..n).rev() {
        if let Some(p) = skeleton.nodes[i].parent {
            let below = out[i].clone();
            out[p.index()].extend(below);
        }
    }
    out
}

/// Nearest-node distances from the attractors, in single precision and coordinate by coordinate, which the compiler
/// turns into vector instructions: nearly all of the push's time goes into this.
struct Search {
    ax: Vec<f32>,
    ay: Vec<f32>,
    az: Vec<f32>,
    nodes: Vec<[f32; 3]>,
}

impl Search {
    fn new(skeleton: &Skeleton, attractors: &[Point3<f64>]) -> Self {
        Self {
            ax: attractors.iter().map(|a| a.x as f32).collect(),
            ay: attractors.iter().map(|a| a.y as f32).collect(),
            az: attractors.iter().map(|a| a.z as f32).collect(),
            nodes: skeleton.nodes.iter().map(|n| single(&n.position)).collect(),
        }
    }

    fn moved(&mut self, skeleton: &Skeleton, subtree: &[usize]) {
        for &k in subtree {
            self.nodes[k] = single(&skeleton.nodes[k].position);
        }
    }

    fn lower(&self, nearest_sq: &mut [f32], p: [f32; 3]) {
        for (((d, x), y), z) in nearest_sq.iter_mut().zip(&self.ax).zip(&self.ay).zip(&self.az) {
            let (dx, dy, dz) = (x - p[0], y - p[1], z - p[2]);
            *d = d.min(dx * dx + dy * dy + dz * dz);
        }
    }

    /// Squared distance of each attractor to the nearest node that is not in `subtree`.
    fn distances_without(&self, subtree: &[usize]) -> Vec<f32> {
        let mut inside = vec![false; self.nodes.len()];
        for &k in subtree {
            inside[k] = true;
        }
        let mut nearest_sq = vec![f32::INFINITY; self.ax.len()];
        for (p, _) in self.nodes.iter().zip(&inside).filter(|(_, inside)| !**inside) {
            self.lower(&mut nearest_sq, *p);
        }
        nearest_sq
    }

    /// D of eq. 5 with `subtree` moved by `offset`.
    fn total_distance(&self, without: &[f32], subtree: &[usize], offset: Vector3<f64>) -> f64 {
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
