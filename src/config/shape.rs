//! Settings of the skeleton in space.

use serde::{Deserialize, Serialize};

/// 3D skeleton (Li 2011 sect. 3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shape {
    /// Planes about the trunk, the measured one included, 1 to 8.
    pub planes: u32,
    /// The space that branches are pushed to fill.
    pub envelope: EnvelopeKind,
    /// Points on the envelope that pull branches out.
    pub attractors: u32,
    /// Largest push, as a share of the tree's width.
    pub push_range: f64,
    /// Number of pushes tried for each node.
    pub push_options: u32,
    /// How often the tree is gone through from root to leaf; 1 is the paper's.
    pub passes: u32,
    /// Width of the distribution of branching angles, as a multiple of the paper's.
    pub angle_tolerance: f64,
    /// What of the crown counts as trunk.
    pub leader: Leader,
    /// The line that was drawn for `leader = "drawn"`, from the foot up, px of the picture.
    pub leader_px: Vec<[f64; 2]>,
}

/// What the branches are pushed to fill.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EnvelopeKind {
    /// The outline, turned about its axis (Li 2011 sect. 3).
    Revolution,
    /// The convex hull of the flat skeleton, turned about its axis (Zeng 2015 sect. 5.5).
    Hull,
}

/// The trunk beyond its top: conifers have one up to the tip (Li 2011 fig. 9).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Leader {
    None,
    /// The straightest chain of branches that goes on from the trunk.
    Auto,
    /// The branches along `leader_px`.
    Drawn,
}

impl Default for Shape {
    fn default() -> Self {
        Self {
            planes: 3,
            envelope: EnvelopeKind::Revolution,
            attractors: 256,
            push_range: 0.2,
            push_options: 41,
            passes: 3,
            angle_tolerance: 1.0,
            leader: Leader::None,
            leader_px: Vec::new(),
        }
    }
}
