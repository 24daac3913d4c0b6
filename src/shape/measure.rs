//! How well a tree fills its envelope and how likely its angles are, beside the one-sided variants
//! of Li 2011 fig. 3 and the mirrored ellipsoid of fig. 4 a.

use super::angles::Angles;
use super::diener::diener;
use super::prototype::Prototype;
use super::push::{Terms, envelope_distance};
use super::term_weights::by_one_term;
use crate::config;
use crate::model::{Outline, Skeleton};
use crate::skeleton::Node2d;
use serde::{Deserialize, Serialize};

/// Two nodes count as mirror images within this share of the tree's height.
const MIRRORED: f64 = 0.01;

/// The same figure for every way to push.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Variants {
    /// Copies in their planes, not pushed.
    pub rest: f64,
    /// Pushed once from root to leaf by eq. 6 alone, and by eq. 4 alone.
    pub global_only: f64,
    pub local_only: f64,
    /// Pushed by both, as the model is.
    pub fused: f64,
    /// Mirrored on an ellipsoid.
    pub diener: f64,
}

/// What the push has achieved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PushFigures {
    pub attractors: u32,
    /// mu of eq. 4, degrees.
    pub expected_angle_deg: f64,
    /// D of eq. 5, px: the sum over the attractors of the distance to the nearest node.
    pub distance_px: Variants,
    /// Geometric mean of eq. 4 over all branches above the trunk, 0 to 1.
    pub angle_likelihood: Variants,
    /// Share of the nodes off the middle of the side view whose mirror image is a node, 0 to 1.
    pub side_symmetry: Variants,
}

impl PushFigures {
    /// Measures `fused`, the tree as it stands, beside all other variants that can be built of the
    /// same.
    pub fn of(
        fused: &Skeleton,
        flat: &[Node2d],
        tracks: &[u32],
        outline: &Outline,
        settings: &config::Shape,
    ) -> Self {
        let Prototype {
            skeleton: rest,
            envelope,
            trunk,
        } = Prototype::of(flat, tracks, outline, settings);
        let angles = Angles::of(&rest, settings);
        let trees = Trees {
            rest: &rest,
            global_only: &by_one_term(&rest, &trunk, &envelope, settings, Terms::Global),
            local_only: &by_one_term(&rest, &trunk, &envelope, settings, Terms::Local),
            fused,
            diener: &diener(flat, tracks, &trunk, outline),
        };
        let attractors = settings.attractors as usize;
        Self {
            attractors: settings.attractors,
            expected_angle_deg: angles.expected.to_degrees(),
            distance_px: trees.measured(|tree| envelope_distance(tree, &envelope, attractors)),
            angle_likelihood: trees.measured(|tree| angles.likelihood(tree)),
            side_symmetry: trees.measured(side_symmetry),
        }
    }

    /// By how much the fused push brings the envelope nearer, as a share of what the global term
    /// alone achieves.
    pub fn filling(&self) -> f64 {
        let d = &self.distance_px;
        (d.rest - d.fused) / (d.rest - d.global_only)
    }

    /// How likely the angles of the fused push are, as a share of those of the local term alone.
    pub fn plausibility(&self) -> f64 {
        self.angle_likelihood.fused / self.angle_likelihood.local_only
    }
}

/// The tree by every way to push.
struct Trees<'a> {
    rest: &'a Skeleton,
    global_only: &'a Skeleton,
    local_only: &'a Skeleton,
    fused: &'a Skeleton,
    diener: &'a Skeleton,
}

impl Trees<'_> {
    fn measured(&self, figure: impl Fn(&Skeleton) -> f64) -> Variants {
        Variants {
            rest: figure(self.rest),
            global_only: figure(self.global_only),
            local_only: figure(self.local_only),
            fused: figure(self.fused),
            diener: figure(self.diener),
        }
    }
}

/// Share of the nodes whose mirror image in the side view (z to -z, at the same height) lies within
/// a hundredth of the tree's height of a node; nodes nearer than that to the middle, which are
/// their own images, are left out. 1 is a mirror image through and through; 0 where no node is off
/// the middle.
pub fn side_symmetry(skeleton: &Skeleton) -> f64 {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for node in &skeleton.nodes {
        low = low.min(node.position.y);
        high = high.max(node.position.y);
    }
    let near = MIRRORED * (high - low);
    let (mut off, mut mirrored) = (0usize, 0usize);
    for node in &skeleton.nodes {
        let p = node.position;
        if p.z.abs() <= near {
            continue;
        }
        off += 1;
        let has_image = skeleton
            .nodes
            .iter()
            .any(|n| (n.position.z + p.z).hypot(n.position.y - p.y) <= near);
        mirrored += usize::from(has_image);
    }
    mirrored as f64 / off.max(1) as f64
}
