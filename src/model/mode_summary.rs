//! What files and views say of a mode of the whole tree.

use super::{BotanicalBranches, LimbEnergy, NodeName, Skeleton, Sway, SwayColumns, TreeMode};
use serde::{Serialize, Serializer};

/// A mode of the whole tree by the names of the tree's parts.
///
/// As JSON it has the columns of `modes.csv`, with `energy` as a list; what is not known is `null`.
#[derive(Clone, Debug, PartialEq)]
pub struct ModeSummary {
    /// Its number, from 1, the slowest first.
    pub mode: usize,
    /// Frequency, damping and amplitude, and what made the tree sway.
    pub sway: Sway,
    /// How much of its motion is one swing of its points, 0 to 1; `None` where that was not looked
    /// at.
    pub collinearity: Option<f64>,
    /// Points that swing in it.
    pub points: usize,
    /// The measured node whose own mode it is; `None` for a branch that the tree lacks.
    pub node: Option<NodeName>,
    /// Whether that is the trunk.
    pub is_trunks: bool,
    /// The botanical branch that this node is on.
    pub branch: Option<String>,
    /// Shares of its kinetic energy in trunk and limbs, the largest first.
    pub energy: Vec<LimbEnergy>,
}

impl ModeSummary {
    /// Of all modes of a tree, in their order.
    pub fn all(modes: &[TreeMode], skeleton: &Skeleton) -> Vec<Self> {
        let branches = skeleton.botanical_branches();
        let mut all = Vec::with_capacity(modes.len());
        for (k, mode) in modes.iter().enumerate() {
            all.push(Self::of(k + 1, mode, skeleton, &branches));
        }
        all
    }

    fn of(
        number: usize,
        mode: &TreeMode,
        skeleton: &Skeleton,
        branches: &BotanicalBranches,
    ) -> Self {
        Self {
            mode: number,
            sway: mode.sway,
            collinearity: mode.collinearity,
            points: mode.points,
            node: mode.node.and_then(|node| skeleton.name_of(node)),
            is_trunks: mode.is_trunks,
            branch: mode.node.map(|node| branches.name(node)),
            energy: mode.energy_by_limb(branches),
        }
    }

    /// The tree has no longer the branch whose own mode it is.
    pub fn forget_branch(&mut self) {
        (self.node, self.branch) = (None, None);
    }

    /// `limb_1 0.71; trunk 0.29`, of at most so many with the largest shares; `…` stands for others.
    pub fn energy_words(&self, most: usize) -> String {
        let mut words = Vec::with_capacity(self.energy.len());
        for LimbEnergy { limb, share } in self.energy.iter().take(most) {
            words.push(format!("{limb} {share:.2}"));
        }
        if self.energy.len() > most {
            words.push("…".into());
        }
        words.join("; ")
    }
}

impl Serialize for ModeSummary {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Row::of(self).serialize(to)
    }
}

/// The columns of `modes.csv`.
#[derive(Serialize)]
struct Row<'a> {
    mode: usize,
    #[serde(flatten)]
    sway: SwayColumns,
    excitation: &'static str,
    #[serde(serialize_with = "super::rounded::to_4")]
    amplitude_deg: f64,
    #[serde(serialize_with = "super::rounded::to_3")]
    collinearity: f64,
    n_points: usize,
    node_id: Option<u32>,
    branch: Option<&'a str>,
    energy: &'a [LimbEnergy],
}

impl<'a> Row<'a> {
    fn of(mode: &'a ModeSummary) -> Self {
        Self {
            mode: mode.mode,
            sway: SwayColumns::of(Some(&mode.sway)),
            excitation: mode.sway.excitation.word(),
            amplitude_deg: mode.sway.amplitude_deg,
            collinearity: mode.collinearity.unwrap_or(f64::NAN),
            n_points: mode.points,
            node_id: mode.node.map(|node| node.0),
            branch: mode.branch.as_deref(),
            energy: &mode.energy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Interval, NodeId};
    use serde_json::json;

    fn mode() -> TreeMode {
        TreeMode {
            sway: Sway {
                frequency_hz: Interval {
                    value: 0.7,
                    lo: 0.6999999,
                    hi: 0.71,
                },
                damping_ratio: None,
                excitation: Excitation::Wind,
                amplitude_deg: f64::NAN,
            },
            collinearity: Some(0.97),
            node: Some(NodeId(2)),
            is_trunks: false,
            points: 9,
            motion_px2: vec![0.0, 24.9, 75.0, 0.1],
        }
    }

    #[test]
    fn a_mode_is_named_by_the_parts_of_its_tree() {
        let lacked = TreeMode {
            node: None,
            motion_px2: Vec::new(),
            ..mode()
        };
        let all = ModeSummary::all(&[mode(), lacked], &Skeleton::forked());
        assert_eq!((all[0].mode, all[1].mode), (1, 2));
        assert_eq!(all[0].node, Some(NodeName(12)));
        assert_eq!(all[0].branch.as_deref(), Some("limb_1"));
        // What goes on with the trunk counts to it.
        assert_eq!(all[0].energy_words(2), "limb_1 0.75; trunk 0.25");
        assert_eq!(all[0].energy_words(1), "limb_1 0.75; …");
        assert_eq!((&all[1].node, &all[1].branch), (&None, &None));
        assert!(all[1].energy.is_empty());
    }

    #[test]
    fn as_json_it_has_the_columns_of_the_table() {
        let all = ModeSummary::all(&[mode()], &Skeleton::forked());
        let json = serde_json::to_value(&all).expect("json");
        assert_eq!(
            json,
            json!([{
                "mode": 1, "frequency_hz": 0.7, "frequency_lo_hz": 0.7, "frequency_hi_hz": 0.71,
                "damping_ratio": null, "damping_lo": null, "damping_hi": null,
                "excitation": "wind", "amplitude_deg": null, "collinearity": 0.97, "n_points": 9,
                "node_id": 12, "branch": "limb_1",
                "energy": [{"limb": "limb_1", "share": 0.75}, {"limb": "trunk", "share": 0.25}]
            }])
        );
    }
}
