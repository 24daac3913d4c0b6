//! Generalised cylinders: the skeleton's branches as one skinned mesh.
//!
//! Joint `i` is the branch that ends in node `i` and turns about the parent node. A tube leaves its parent along the
//! parent's direction and with the parent's weights, so both skins meet at the pivot, which neither moves.

use super::tube::{self, Frame};
use crate::model::Skeleton;
use nalgebra::Vector3;

/// Triangles with skinning weights; all vectors but `indices` have one entry a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Model axes at rest, px.
    pub positions: Vec<[f32; 3]>,
    /// Outward, of length 1.
    pub normals: Vec<[f32; 3]>,
    /// u runs once around the branch, v along it in units of its circumference.
    pub uvs: Vec<[f32; 2]>,
    /// Node indices of the branches that move the vertex; unused entries are 0.
    pub joints: Vec<[u16; 4]>,
    /// Their shares, which add up to 1; unused entries are 0.
    pub weights: Vec<[f32; 4]>,
    /// Three a triangle, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
}

/// How finely branches are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detail {
    /// Faces around the thickest branch, at least 3; thinner ones get fewer.
    pub sides: u32,
    /// Rings along one branch, at least 2.
    pub rings: u32,
}

impl Default for Detail {
    fn default() -> Self {
        Self { sides: 12, rings: 8 }
    }
}

impl Detail {
    /// The finest detail, at most the default, with which `branches` branches stay within `max_triangles`; the
    /// coarsest (3 sides, 2 rings) where nothing fits.
    pub fn for_budget(branches: usize, max_triangles: usize) -> Self {
        (0..=18)
            .rev()
            .map(|step| Self { sides: 3 + step / 2, rings: 2 + step / 3 })
            .find(|d| branches.saturating_mul((2 * d.sides * (d.rings + 2)) as usize) <= max_triangles)
            .unwrap_or(Self { sides: 3, rings: 2 })
    }

    /// Twigs are seen from so far that five faces look round.
    fn sides_of(self, radius: f64, thickest: f64) -> usize {
        let most = self.sides.max(3) as f64;
        let least = most.min(5.0);
        (least + (most - least) * (radius / thickest).clamp(0.0, 1.0).sqrt()).round() as usize
    }
}

/// Draws every branch of the skeleton; a branch without length or thickness, or with a position that is no number, is
/// left out. Joint numbers are node indices, at most 65535.
pub fn branches(skeleton: &Skeleton, detail: Detail) -> Mesh {
    let nodes = &skeleton.nodes;
    let drawn: Vec<bool> = (0..nodes.len()).map(|i| is_drawn(skeleton, i)).collect();
    let follow = following_radius(skeleton, &drawn);
    let thickest = nodes.iter().map(|n| n.radius).filter(|r| r.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
    let mut ends: Vec<Option<Frame>> = vec![None; nodes.len()];
    let mut lengths = vec![0.0; nodes.len()];
    let mut mesh = Mesh::default();
    for (i, node) in nodes.iter().enumerate() {
        let Some(parent) = node.parent.map(|p| p.index()).filter(|&p| p < i) else { continue };
        if !drawn[i] {
            ends[i] = ends[parent];
            lengths[i] = lengths[parent];
            continue;
        }
        let from = nodes[parent].position.coords;
        let chord = node.position.coords - from;
        lengths[i] = chord.norm();
        let start = ends[parent].unwrap_or_else(|| Frame::along(chord / lengths[i]));
        let tube = tube::Tube {
            from,
            to: node.position.coords,
            start,
            grows_from_branch: ends[parent].is_some(),
            // Far enough inside the parent to hide the seam, not so far as to come out below it.
            root_depth: (0.5 * node.radius).min(0.25 * lengths[parent]),
            radius: node.radius,
            end_radius: follow[i],
            parent_joint: parent as u16,
            joint: i as u16,
            sides: detail.sides_of(node.radius, thickest),
            rings: detail.rings.max(2) as usize,
        };
        ends[i] = Some(tube.append_to(&mut mesh));
    }
    mesh
}

/// Whether branch `i` has a length and a thickness to be seen.
fn is_drawn(skeleton: &Skeleton, i: usize) -> bool {
    let node = &skeleton.nodes[i];
    let Some(parent) = node.parent.filter(|p| p.index() < i && i <= usize::from(u16::MAX)) else { return false };
    let chord: Vector3<f64> = node.position - skeleton.nodes[parent.index()].position;
    // `chord.norm() > ..` is false for what is no number.
    chord.norm() > 1e-6 && chord.norm().is_finite() && node.radius > 1e-6 && node.radius.is_finite()
}

/// Radius with which the tree goes on beyond every node: that of its thickest drawn child, seen through children that
/// are not drawn; 0 at a tip.
fn following_radius(skeleton: &Skeleton, drawn: &[bool]) -> Vec<f64> {
    let mut follow = vec![0.0_f64; drawn.len()];
    for (i, node) in skeleton.nodes.iter().enumerate().rev() {
        if let Some(p) = node.parent.filter(|p| p.index() < i) {
            let own = if drawn[i] { node.radius } else { follow[i] };
            follow[p.index()] = follow[p.index()].max(own);
        }
    }
    for (f, node) in follow.iter_mut().zip(&skeleton.nodes) {
        if node.radius.is_finite() {
            *f = f.min(node.radius);
        }
    }
    follow
}
