//! How well a tree fills its envelope and how likely its angles are, beside the one-sided variants
//! of Li et al. figure 3 and the mirrored ellipsoid of figure 4 a.

use super::fuse::one_sided;
use super::{Angles, Prototype, Terms, diener, envelope_distance};
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
        let pushed = |terms: Terms| one_sided(&rest, &trunk, &envelope, settings, terms);
        let (global, local) = (pushed(Terms::Global), pushed(Terms::Local));
        let diener = diener(flat, tracks, &trunk, outline);
        let all = |of: &dyn Fn(&Skeleton) -> f64| Variants {
            rest: of(&rest),
            global_only: of(&global),
            local_only: of(&local),
            fused: of(fused),
            diener: of(&diener),
        };
        Self {
            attractors: settings.attractors,
            expected_angle_deg: angles.expected.to_degrees(),
            distance_px: all(&|s| envelope_distance(s, &envelope, settings.attractors as usize)),
            angle_likelihood: all(&|s| angles.likelihood(s)),
            side_symmetry: all(&side_symmetry),
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

/// Share of the nodes whose mirror image in the side view (z to -z, at the same height) lies within
/// a hundredth of the tree's height of a node; nodes nearer than that to the middle, which are
/// their own images, are left out. 1 is a mirror image through and through; 0 where no node is off
/// the middle.
pub fn side_symmetry(skeleton: &Skeleton) -> f64 {
    let places: Vec<[f64; 2]> = skeleton
        .nodes
        .iter()
        .map(|n| [n.position.z, n.position.y])
        .collect();
    let heights = || places.iter().map(|p| p[1]);
    let height =
        heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min);
    let near = MIRRORED * height;
    let off: Vec<&[f64; 2]> = places.iter().filter(|p| p[0].abs() > near).collect();
    let has_image = |p: &&&[f64; 2]| {
        places
            .iter()
            .any(|q| (q[0] + p[0]).hypot(q[1] - p[1]) <= near)
    };
    off.iter().filter(has_image).count() as f64 / off.len().max(1) as f64
}
