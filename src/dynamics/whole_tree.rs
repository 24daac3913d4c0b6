//! The modes of the whole tree: those that branches have for their own, and those of branches that
//! the tree lacks.

use super::branch_tree::BranchTree;
use super::film::Film;
use super::members::{mean_px, share_among};
use super::point_modes::{PointMode, PointModes};
use crate::model::{NodeId, Sway, Swaying, TreeMode};
use nalgebra::Point2;

/// A mode with this share of its points in one that is known, and its frequency, is that one.
const SHARE_IN_KNOWN: f64 = 0.6;

/// A mode that turns some points about a place.
struct Swing<'a> {
    sway: Sway,
    /// As indices of the film's tracks, in order.
    tracks: &'a [usize],
    pivot_px: Point2<f64>,
    collinearity: Option<f64>,
    node: Option<NodeId>,
}

/// All modes that are known, the slowest first: the answers of `sways` with the points of their
/// branches (`members`), and those of `found` that are none of these.
pub(super) fn modes_of_tree(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    sways: &[Swaying],
    found: Option<&PointModes>,
) -> Vec<TreeMode> {
    let found: &[PointMode] = found.map_or(&[], |found| &found.modes);
    let mut swings: Vec<Swing> = Vec::new();
    for (b, sway) in sways.iter().enumerate() {
        let Ok(sway) = sway else { continue };
        let same = found.iter().find(|mode| mode.sway == *sway);
        swings.push(Swing {
            sway: *sway,
            tracks: &members[b],
            pivot_px: tree.branches[b].base_px,
            collinearity: same.map(|mode| mode.collinearity),
            node: Some(tree.branches[b].node),
        });
    }
    for mode in found {
        let is_of_no_branch = mode.is_sure && mode.branch.is_none();
        if is_of_no_branch && !swings.iter().any(|known| is_known(mode, known)) {
            swings.push(Swing {
                sway: mode.sway,
                tracks: &mode.tracks,
                pivot_px: mode.pivot_px,
                collinearity: Some(mode.collinearity),
                node: None,
            });
        }
    }
    let mut out: Vec<TreeMode> = swings.iter().map(|s| s.mode(tree, film)).collect();
    out.sort_by(|a, b| {
        let [a, b] = [a, b].map(|mode| mode.sway.frequency_hz.value);
        a.total_cmp(&b)
    });
    out
}

fn is_known(mode: &PointMode, known: &Swing) -> bool {
    let ratio = known.sway.frequency_hz.value / mode.mode.frequency_hz;
    share_among(&mode.tracks, known.tracks) >= SHARE_IN_KNOWN && ratio.ln().abs() < mode.same_within
}

impl Swing<'_> {
    fn mode(&self, tree: &BranchTree, film: &Film) -> TreeMode {
        let angle = self.sway.amplitude_deg.to_radians();
        let angle = if angle.is_finite() { angle } else { 0.0 };
        let mut by_branch = vec![0.0; tree.len()];
        for &k in self.tracks {
            let track = &film.tracks[k];
            let arm = mean_px(&track.at_px) - self.pivot_px;
            by_branch[track.node.index()] += angle * angle * arm.norm_squared();
        }
        TreeMode {
            sway: self.sway,
            collinearity: self.collinearity,
            node: self.node,
            points: self.tracks.len(),
            motion_px2: tree.values_by_node(&by_branch, 0.0),
        }
    }
}
