//! Limbs: what is drawn of a tree as wood, as middle lines with a thickness.

use crate::model::{NodeId, Skeleton};
use nalgebra::Point3;

/// Which joints move a point, and their shares: joint `i` is node `i` of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Riding {
    /// Unused entries are 0.
    pub joints: [u16; 4],
    /// Add up to 1; unused entries are 0.
    pub weights: [f32; 4],
}

impl Riding {
    /// Between the branch of `parent` and that of `node`, with share `own` (0 to 1) of the latter.
    pub fn between(parent: NodeId, node: NodeId, own: f32) -> Self {
        // A joint that has no share must be 0, or validators warn.
        let (joints, weights) = if own <= 0.0 {
            ([parent.0 as u16, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])
        } else if own >= 1.0 {
            ([node.0 as u16, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])
        } else {
            ([node.0 as u16, parent.0 as u16, 0, 0], [own, 1.0 - own, 0.0, 0.0])
        };
        Self { joints, weights }
    }
}

/// A point of a limb's middle line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Model axes at rest, px.
    pub at: Point3<f64>,
    /// px; 0 only at a tip.
    pub radius: f64,
    pub riding: Riding,
}

/// One branch or twig at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// The branch that it is, or that carries it.
    pub node: NodeId,
    /// The limb that it grows from, earlier in the list; `None` for what stands on the ground.
    pub parent: Option<usize>,
    /// Added by self-similarity; not a branch of the skeleton.
    pub twig: bool,
    /// From its base to its tip, at least two.
    pub stations: Vec<Station>,
}

/// The branches of the skeleton as straight limbs, those without length left out.
pub fn limbs(skeleton: &Skeleton) -> Vec<Limb> {
    let mut limb_of: Vec<Option<usize>> = vec![None; skeleton.nodes.len()];
    let mut out: Vec<Limb> = Vec::new();
    for (i, node) in skeleton.nodes.iter().enumerate() {
        let Some(parent) = node.parent.filter(|p| p.index() < i) else { continue };
        let from = &skeleton.nodes[parent.index()];
        limb_of[i] = limb_of[parent.index()];
        let length = (node.position - from.position).norm();
        if !(length > 1e-6 && length.is_finite()) {
            continue;
        }
        let own = NodeId(i as u32);
        let station = |t: f64| Station {
            at: from.position + (node.position - from.position) * t,
            radius: node.radius,
            riding: Riding::between(parent, own, (2.0 * t).min(1.0) as f32),
        };
        let limb = Limb { node: own, parent: limb_of[i], twig: false, stations: [0.0, 0.5, 1.0].map(station).to_vec() };
        limb_of[i] = Some(out.len());
        out.push(limb);
    }
    out
}
