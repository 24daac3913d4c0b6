//! With which modes of the tree a branch moves, and how much.

use super::{BotanicalBranches, NodeId, Swaying, TreeMode, Unidentified};
use serde::Serialize;
use std::fmt;

/// A mode with a smaller share of a branch's motion is not named.
const LEAST_SHARE: f64 = 0.05;
/// The most modes that are named in a sentence.
const MOST_IN_WORDS: usize = 3;
/// A mode with a larger share of what is named has no share in a sentence: it is all of it.
const WHOLE_SHARE: f64 = 0.995;

/// How much of a branch's motion is in one mode of the tree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Participation {
    /// Number of the mode, from 1, as in `modes.csv`.
    pub mode: usize,
    /// Frequency of the mode, Hz.
    #[serde(serialize_with = "super::rounded::to_5")]
    pub frequency_hz: f64,
    /// The botanical branch whose own mode it is; `None` for one that the tree lacks.
    pub branch: Option<String>,
    /// Share of the squares of the swing of the branch's points over all modes, 0 to 1.
    #[serde(serialize_with = "super::rounded::to_3")]
    pub share: f64,
}

/// The modes in which the points on `node` swing, the largest share first. Modes with hardly any of
/// the motion are left out, so that there are at most twenty; none where no mode moves the node.
pub fn participation(
    modes: &[TreeMode],
    branches: &BotanicalBranches,
    node: NodeId,
) -> Vec<Participation> {
    let all: f64 = modes.iter().map(|mode| mode.motion_px2(node)).sum();
    let mut out = Vec::new();
    for (k, mode) in modes.iter().enumerate() {
        let share = mode.motion_px2(node) / all;
        // Without motion it is no number.
        if share >= LEAST_SHARE {
            out.push(Participation {
                mode: k + 1,
                frequency_hz: mode.sway.frequency_hz.value,
                branch: mode.node.map(|of| branches.name(of)),
                share,
            });
        }
    }
    out.sort_by(|a, b| b.share.total_cmp(&a.share));
    out
}

/// The same for a branch without a frequency of its own; none for one that has one.
pub fn moves_with(
    swaying: &Swaying,
    modes: &[TreeMode],
    branches: &BotanicalBranches,
    node: NodeId,
) -> Vec<Participation> {
    match swaying {
        Ok(_) => Vec::new(),
        Err(_) => participation(modes, branches, node),
    }
}

/// Why a branch has no frequency of its own, and with which modes it moves: `no mode of its own:
/// moves with limb_2 (0.70 Hz)`. The reason alone where it moves with none.
pub fn reason(why: Unidentified, moves_with: &[Participation]) -> String {
    let modes = in_words(moves_with);
    match why {
        _ if modes.is_empty() => why.to_string(),
        Unidentified::AncestorsSway => format!("no mode of its own: moves with {modes}"),
        _ => format!("{why}; moves with {modes}"),
    }
}

/// `trunk (0.41 Hz) by 63 %, limb_2 (0.70 Hz) by 35 %`; nothing for no mode.
fn in_words(moves_with: &[Participation]) -> String {
    let mut words = Vec::new();
    for one in moves_with.iter().take(MOST_IN_WORDS) {
        words.push(if one.share >= WHOLE_SHARE {
            one.to_string()
        } else {
            format!("{one} by {:.0} %", 100.0 * one.share)
        });
    }
    words.join(", ")
}

/// The mode: `limb_2 (0.70 Hz)`, or `a mode of 0.70 Hz` where the tree lacks its branch.
impl fmt::Display for Participation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.branch {
            Some(branch) => write!(f, "{branch} ({:.2} Hz)", self.frequency_hz),
            None => write!(f, "a mode of {:.2} Hz", self.frequency_hz),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Excitation, Interval, Skeleton, Sway};

    fn mode(frequency_hz: f64, node: Option<u32>, motion_px2: &[f64]) -> TreeMode {
        TreeMode {
            sway: Sway {
                frequency_hz: Interval {
                    value: frequency_hz,
                    lo: frequency_hz,
                    hi: frequency_hz,
                },
                damping_ratio: None,
                excitation: Excitation::Wind,
                amplitude_deg: 1.0,
            },
            collinearity: None,
            node: node.map(NodeId),
            is_trunks: false,
            points: 4,
            motion_px2: motion_px2.to_vec(),
        }
    }

    fn modes() -> [TreeMode; 4] {
        [
            mode(0.41, Some(1), &[0.0, 1.0, 2.0, 10.0]),
            mode(0.7, Some(2), &[0.0, 0.0, 5.0, 0.0]),
            mode(1.2, None, &[0.0, 0.0, 0.9, 0.0]),
            // Too little to be named.
            mode(2.0, None, &[0.0, 0.0, 0.1]),
        ]
    }

    fn of(node: u32) -> Vec<Participation> {
        participation(
            &modes(),
            &Skeleton::forked().botanical_branches(),
            NodeId(node),
        )
    }

    fn shares(node: u32) -> Vec<(usize, f64)> {
        of(node).iter().map(|p| (p.mode, p.share)).collect()
    }

    #[test]
    fn the_shares_of_a_branch_are_over_all_modes_the_largest_first() {
        assert_eq!(shares(2), [(2, 0.625), (1, 0.25), (3, 0.1125)]);
        assert_eq!(shares(1), [(1, 1.0)]);
        let names: Vec<Option<String>> = of(2).into_iter().map(|p| p.branch).collect();
        let named = |name: &str| Some(name.to_owned());
        assert_eq!(names, [named("limb_1"), named("trunk"), None]);
    }

    #[test]
    fn what_no_mode_moves_takes_part_in_none() {
        for node in [0, 4, u32::MAX] {
            assert!(of(node).is_empty(), "{node}");
        }
        assert!(participation(&[], &Skeleton::forked().botanical_branches(), NodeId(1)).is_empty());
        let wild = [mode(1.0, None, &[f64::NAN, f64::INFINITY])];
        for node in [0, 1] {
            assert!(
                participation(
                    &wild,
                    &Skeleton::forked().botanical_branches(),
                    NodeId(node)
                )
                .is_empty()
            );
        }
    }

    #[test]
    fn the_reason_names_the_modes() {
        use Unidentified::{AncestorsSway, NoOscillation, TooShort};
        let cases = [
            (
                AncestorsSway,
                1,
                "no mode of its own: moves with trunk (0.41 Hz)",
            ),
            (
                AncestorsSway,
                2,
                "no mode of its own: moves with limb_1 (0.70 Hz) by 62 %, trunk (0.41 Hz) by 25 %, \
                 a mode of 1.20 Hz by 11 %",
            ),
            (
                NoOscillation,
                1,
                "no oscillation of its own; moves with trunk (0.41 Hz)",
            ),
            (
                AncestorsSway,
                0,
                "moves only with the branch that carries it",
            ),
            (TooShort, 0, "the film is too short"),
        ];
        for (why, node, words) in cases {
            assert_eq!(reason(why, &of(node)), words);
        }
    }
}
