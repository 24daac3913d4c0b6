//! Modes of a whole tree.

use super::{BotanicalBranches, NodeId, Sway};
use serde::Serialize;
use std::collections::BTreeMap;

/// A limb with less of a mode's energy is not named.
const LEAST_ENERGY: f64 = 0.005;

/// A mode of the whole tree: one frequency and damping, and the points that swing in it.
#[derive(Clone, Debug, PartialEq)]
pub struct TreeMode {
    /// Its frequency, damping and size: as of the branch that swings in it.
    pub sway: Sway,
    /// How much of its motion is one swing of its points, 0 to 1; `None` where that was not looked
    /// at.
    pub collinearity: Option<f64>,
    /// The measured node whose own mode it is; `None` for a branch that the tree lacks.
    pub node: Option<NodeId>,
    /// Whether that is the branch that the analysis takes for the trunk: the one on the foot with most
    /// points on it and above. A table of modes does not say it.
    pub is_trunks: bool,
    /// Points that swing in it.
    pub points: usize,
    /// By measured node: squares of the swing of all points on that node, px².
    pub motion_px2: Vec<f64>,
}

/// Share of a mode's kinetic energy in a limb with all that it carries, or in the trunk alone.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimbEnergy {
    /// `trunk`, `limb_1`, ...
    pub limb: String,
    /// 0 to 1.
    #[serde(serialize_with = "super::rounded::to_3")]
    pub share: f64,
}

impl TreeMode {
    /// Squares of the swing of the points on a node, px².
    pub fn motion_px2(&self, node: NodeId) -> f64 {
        self.motion_px2.get(node.index()).copied().unwrap_or(0.0)
    }

    /// Shares of its kinetic energy in trunk and limbs, all points of like mass, the largest first;
    /// without those that are hardly any.
    pub fn energy_by_limb(&self, branches: &BotanicalBranches) -> Vec<LimbEnergy> {
        let all: f64 = self.motion_px2.iter().sum();
        let mut by_limb: BTreeMap<usize, f64> = BTreeMap::new();
        for (node, px2) in (0..).map(NodeId).zip(&self.motion_px2) {
            // Without motion it is no number, and no share is large enough.
            *by_limb.entry(branches.limb(node)).or_default() += px2 / all;
        }
        let mut shares: Vec<LimbEnergy> = Vec::with_capacity(by_limb.len());
        for (limb, share) in by_limb {
            let tip = branches.all.get(limb).and_then(|b| b.nodes.last());
            if let Some(tip) = tip.filter(|_| share >= LEAST_ENERGY) {
                let limb = branches.name(*tip);
                shares.push(LimbEnergy { limb, share });
            }
        }
        shares.sort_by(|a, b| b.share.total_cmp(&a.share));
        shares
    }
}
