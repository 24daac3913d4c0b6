//! Settings of the wood that is drawn.

use serde::{Deserialize, Serialize};

/// Curl, twigs, thickness and mesh (Li 2011 sect. 3, end).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wood {
    /// How far branches leave the straight line between their ends, 0 (straight) to 1.
    pub curl: f64,
    /// Twigs are added down to this length, px at 640 px picture width; 0 adds none.
    pub twig_px: f64,
    /// Twigs that are added at most.
    pub max_twigs: u32,
    /// The trunk's width, px of the picture; 0 measures it.
    pub trunk_width_px: f64,
    /// Triangles of the wood at its finest level of detail.
    pub triangles: u32,
    /// Where chance is involved, the same number gives the same tree.
    pub seed: u32,
}

impl Default for Wood {
    fn default() -> Self {
        Self {
            curl: 0.5,
            twig_px: 9.0,
            max_twigs: 2000,
            trunk_width_px: 0.0,
            triangles: 30_000,
            seed: 1,
        }
    }
}
