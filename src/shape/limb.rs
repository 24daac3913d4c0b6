//! Limbs: what is drawn of a tree as wood, as middle lines with a thickness.

use super::skin::SkinWeights;
use crate::model::NodeId;
use nalgebra::{Point3, Vector3};

/// A point of a limb's middle line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CenterlineSample {
    /// Model axes at rest, px.
    pub at: Point3<f64>,
    /// px; 0 only at a tip.
    pub radius: f64,
    pub skin: SkinWeights,
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
    /// Nobody has seen it: a twig, or a branch that is [made up](crate::model::Node::is_made_up).
    pub made_up: bool,
    /// From its base to its tip, at least two; the first is on the parent's middle line.
    pub samples: Vec<CenterlineSample>,
}

impl Limb {
    /// Way along its middle line, px.
    pub fn length(&self) -> f64 {
        self.samples
            .windows(2)
            .map(|s| (s[1].at - s[0].at).norm())
            .sum()
    }

    /// Radius at share `t` (0 to 1) of its samples, px.
    pub(crate) fn radius_at(&self, t: f64) -> f64 {
        self.between(t)
            .map_or(0.0, |(a, b, s)| a.radius + (b.radius - a.radius) * s)
    }

    /// The samples about share `t` (0 to 1), and how far it is from the one to the other.
    pub(crate) fn between(&self, t: f64) -> Option<(&CenterlineSample, &CenterlineSample, f64)> {
        let place = t.clamp(0.0, 1.0) * self.samples.len().checked_sub(1)? as f64;
        let k = (place as usize).min(self.samples.len().checked_sub(2)?);
        Some((&self.samples[k], &self.samples[k + 1], place - k as f64))
    }

    /// Direction in which it begins, of length 1; up where it has none.
    pub(crate) fn departs(&self) -> Vector3<f64> {
        match &self.samples[..] {
            [first, second, ..] => (second.at - first.at)
                .try_normalize(1e-12)
                .unwrap_or_else(Vector3::y),
            _ => Vector3::y(),
        }
    }

    /// Direction in which it ends, of length 1; up where it has none.
    pub(crate) fn arrives(&self) -> Vector3<f64> {
        match &self.samples[..] {
            [.., before, last] => (last.at - before.at)
                .try_normalize(1e-12)
                .unwrap_or_else(Vector3::y),
            _ => Vector3::y(),
        }
    }
}

/// A limb whose thickness is not known yet, and where it leaves its parent (share of the parent's
/// length).
#[derive(Clone, Debug)]
pub(super) struct Grown {
    pub limb: Limb,
    pub at: f64,
}
