//! Branches identified by their modes, after a release.
//!
//! Going up the tree one branch at a time (free_decay.rs) takes the captured tree as it is, and a
//! mode that is identified wrongly misleads the branches on it. Here all points and all modes are
//! fitted at once: a point has the modes of the branch that it is on and of those that carry it,
//! and no others; modes are fitted together, points may go to another branch, branches come off
//! others, as long as what the film shows becomes likelier by more than what it costs. What comes
//! out answers for the captured branches that have mostly the same points, and had no answer; and
//! it separates branches that were captured as one with another (point_modes.rs).

mod moves;
mod points;
mod read;
mod refit;
mod search;
mod tree;

use super::branch_tree::BranchTree;
use super::branches::{BranchMode, LnDeviations, SearchLimits};
use super::film::Film;
use super::free_decay::MIN_PERIODS;
use super::point_modes::{PointMode, PointModes, mode_of};
use super::release::Onset;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::{Excitation, NodeId, Sway, Swaying};
use points::BridgedFilm;
use read::ModeEstimate;
use search::MIN_POINTS;
use tree::{Branch, Decay, Tree};

/// A mode is clear if its points gain so much by it, each (but for a quarter of them) and together;
/// if its frequency is known to this standard deviation of the logarithm, and changes by less than
/// this one where some of the points are left out; and if it is damped less than this.
const MIN_GAIN: f64 = 15.0;
const MIN_GAIN_TOGETHER: f64 = 80.0;
const MAX_LN_FREQUENCY_SD: f64 = 0.009;
const MAX_JACKKNIFE_SD: f64 = 0.0045;
const MAX_DAMPING: f64 = 0.15;
/// It is a captured branch's own if it is in so much of its points.
const MIN_SHARE_OF_BRANCH: f64 = 0.75;
/// A mode that is no farther from a carrier's than this share is the carrier's. Somewhat more than
/// one branch at a time needs (free_decay.rs): these frequencies are known less well.
const CARRIER_FREQ_TOLERANCE: f64 = 0.012;
/// Intervals are so much wider than the curvature says, and no narrower than these standard
/// deviations. Found on clips of our own (docs/design/sway.md).
const CI_INFLATION: f64 = 2.0;
const MIN_LN_SD: LnDeviations = LnDeviations {
    frequency: 0.003,
    damping: 0.1,
};

/// The modes of all points at once, from the captured tree with the answers of `sways`; `None` where
/// too little is seen, or `cancel` ends it before.
pub(super) fn point_modes(
    tree: &BranchTree,
    film: &Film,
    trunk: NodeId,
    onset: &Onset,
    limits: &SearchLimits,
    sways: &[Swaying],
    cancel: &CancelToken,
) -> Option<PointModes> {
    // All points have the trunk's sway: without it nothing is sure.
    if !sways.get(trunk.index()).is_some_and(Result::is_ok) {
        return None;
    }
    let bridged = BridgedFilm::of(film, onset.at_s);
    let span_s = bridged.span_s();
    if bridged.points.len() < MIN_POINTS || span_s <= 0.0 {
        return None;
    }
    let frequencies_hz = Bounds::new(MIN_PERIODS / span_s, limits.frequencies_hz.hi);
    if frequencies_hz.is_empty() {
        return None;
    }
    let BridgedFilm {
        times_s,
        points,
        tracks,
    } = bridged;
    let decay = Decay::new(times_s, onset.start, frequencies_hz, points);
    let nodes = tracks.iter().map(|&k| film.tracks[k].node);
    let branch_of: Vec<usize> = nodes.map(NodeId::index).collect();
    let captured = captured(tree, sways, &decay, branch_of);
    let as_tracks = |points: &[usize]| points.iter().map(|p| tracks[*p]).collect::<Vec<_>>();
    let on = (0..sways.len()).map(|b| as_tracks(&captured.all(b)));
    let on = on.collect();
    let mut modes = Vec::new();
    for estimate in captured.grown(cancel)?.estimates() {
        if estimate.is_clear()
            && estimate.mode.frequency_hz * span_s > MIN_PERIODS
            && !limits.may_be_aliased(estimate.mode.frequency_hz, film)
        {
            modes.push(PointMode {
                branch: None,
                mode: estimate.mode,
                tracks: as_tracks(&estimate.points),
                clearness: estimate.gain_together(),
                same_within: CARRIER_FREQ_TOLERANCE,
                sway: estimate.sway(),
                is_sure: estimate.branch_mode().is_within(limits.max_relative_ci),
                collinearity: estimate.collinearity,
                pivot_px: estimate.base_px,
            });
        }
    }
    Some(PointModes {
        modes,
        on,
        min_share_of_branch: MIN_SHARE_OF_BRANCH,
    })
}

impl ModeEstimate {
    fn gain_together(&self) -> f64 {
        self.gain * self.points.len() as f64
    }

    fn is_clear(&self) -> bool {
        self.gain >= MIN_GAIN
            && self.gain_together() >= MIN_GAIN_TOGETHER
            && self.ln_sd.frequency <= MAX_LN_FREQUENCY_SD
            && self.jackknife_sd <= MAX_JACKKNIFE_SD
            && self.mode.damping <= MAX_DAMPING
    }

    fn branch_mode(&self) -> BranchMode {
        BranchMode {
            mode: self.mode,
            ln_sd: self.ln_sd.inflated(CI_INFLATION, &MIN_LN_SD),
        }
    }

    fn sway(&self) -> Sway {
        let mode = self.branch_mode();
        Sway {
            frequency_hz: mode.frequency_hz(),
            damping_ratio: mode.damping_ratio(),
            excitation: Excitation::Release,
            amplitude_deg: self.amplitude_deg,
        }
    }
}

/// The tree as it was captured, with the modes that are known.
fn captured<'a>(
    tree: &BranchTree,
    sways: &[Swaying],
    decay: &'a Decay,
    branch_of: Vec<usize>,
) -> Tree<'a> {
    let mut branches = Vec::with_capacity(sways.len());
    for (branch, sway) in tree.branches.iter().zip(sways) {
        branches.push(Branch {
            parent: branch.parent.map(NodeId::index),
            mode: sway.as_ref().ok().map(mode_of),
            base_px: branch.base_px,
            end_px: branch.end_px,
        });
    }
    let mut tree = Tree {
        decay,
        branches,
        branch_of,
    };
    for b in 0..tree.branches.len() {
        if tree.all(b).len() < MIN_POINTS {
            tree.branches[b].mode = None;
        }
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::super::film::NOT_SEEN;
    use super::*;
    use crate::config::Dynamics;
    use crate::dynamics::sway::UsableFilm;
    use crate::dynamics::{Depth, FilmTrack, analyse, free_decay, shoots};
    use crate::model::{Node, Size, Skeleton};
    use crate::random::Generator;
    use nalgebra::Point2;
    use rand::RngExt;
    use rand_distr::StandardNormal;
    use std::f64::consts::TAU;

    /// A trunk of 0.6 Hz that is released after 0.5 s with 8 points on it, and a tip with
    /// `branches`: the frequency and the lever arms of the points of each. Noise of 0.1 px.
    fn filmed(branches: &[(f64, &[f64])]) -> (Skeleton, Film) {
        let times: Vec<f64> = (0..150).map(|k| f64::from(k) / 15.0).collect();
        let mut chance = crate::random::generator(9, 0);
        let mut tracks: Vec<FilmTrack> = Vec::new();
        for k in 0..8 {
            tracks.push(track(&times, 1, 6.0 + f64::from(k), None, &mut chance));
        }
        for (hz, arms) in branches {
            for arm in *arms {
                tracks.push(track(&times, 2, 15.0, Some((*hz, *arm)), &mut chance));
            }
        }
        let skeleton = Skeleton {
            nodes: (0..3).map(node).collect(),
            foot_px: [0.0; 2].into(),
            image_size: Size {
                width: 64,
                height: 64,
            },
        };
        (skeleton, Film::new(&times, tracks))
    }

    fn decay(hz: f64, t: f64) -> f64 {
        let t = t - 0.5;
        if t <= 0.0 {
            return 1.0;
        }
        let (z, w) = (0.03_f64, TAU * hz);
        let root = (1.0 - z * z).sqrt();
        (-z * w * t).exp() * ((w * root * t).cos() + z / root * (w * root * t).sin())
    }

    fn noise(chance: &mut Generator) -> f64 {
        0.1 * chance.sample::<f64, _>(StandardNormal)
    }

    /// With so much of the trunk's sway, and a frequency and size of its own.
    fn track(
        times: &[f64],
        node: u32,
        trunk: f64,
        own: Option<(f64, f64)>,
        chance: &mut Generator,
    ) -> FilmTrack {
        let mut at_px = Vec::with_capacity(times.len());
        for t in times {
            let sway = trunk * decay(0.6, *t) + own.map_or(0.0, |(hz, arm)| arm * decay(hz, *t));
            let u = 100.0 + sway + noise(chance);
            at_px.push(Point2::new(u, 100.0 + 0.3 * sway + noise(chance)));
        }
        FilmTrack {
            node: NodeId(node),
            at_px,
        }
    }

    fn node(i: u32) -> Node {
        Node {
            level: i as u8,
            ..Node::made_up(i, i.checked_sub(1), [0.0, 50.0 * f64::from(i), 0.0])
        }
    }

    /// All branches at once of a film.
    fn analysed(skeleton: &Skeleton, film: &Film) -> Vec<Swaying> {
        let config = Dynamics::default();
        analyse(skeleton, film, &config, Depth::Full, &CancelToken::new()).sway
    }

    /// Two points of eight are of another branch, which is no reason to say nothing of the six.
    #[test]
    fn a_branch_with_a_few_strangers_gets_its_answer() {
        let (skeleton, film) =
            filmed(&[(1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0]), (1.6, &[3.0, 4.0])]);
        let sway = analysed(&skeleton, &film)[2].unwrap();
        assert!(sway.frequency_hz.holds(1.10), "{sway:?}");
        assert!(
            sway.damping_ratio.is_some_and(|d| d.holds(0.03)),
            "{sway:?}"
        );
    }

    /// A branch on the foot that is listed before the trunk, and has no points, hides nothing.
    #[test]
    fn the_trunk_is_the_branch_of_most_points_whatever_its_place() {
        let (mut skeleton, mut film) = filmed(&[(1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0])]);
        for known in &mut skeleton.nodes[1..] {
            known.parent = known.parent.map(|p| NodeId(p.0 + u32::from(p.0 > 0)));
        }
        let empty = Node::made_up(1, Some(0), [40.0, 10.0, 0.0]);
        skeleton.nodes.insert(1, Node { level: 1, ..empty });
        for track in &mut film.tracks {
            track.node = NodeId(track.node.0 + 1);
        }
        let sway = analysed(&skeleton, &film);
        assert!(sway[2].unwrap().frequency_hz.holds(0.6), "{sway:?}");
        assert!(sway[3].unwrap().frequency_hz.holds(1.10), "{sway:?}");
    }

    /// The points of the branches that are found beside the trunk and the tip as a whole.
    fn groups(skeleton: &Skeleton, film: &Film) -> Vec<Vec<usize>> {
        let cancel = CancelToken::new();
        let tree = BranchTree::of(skeleton);
        let Ok(usable) = UsableFilm::of(&tree, film, &Dynamics::default(), &cancel) else {
            return Vec::new();
        };
        let sways = free_decay::sways(&tree, &usable, &cancel);
        let UsableFilm {
            trunk,
            onset,
            limits,
            film,
            ..
        } = usable;
        let Some(found) = point_modes(&tree, &film, trunk, &onset, &limits, &sways, &cancel) else {
            return Vec::new();
        };
        let own = found.modes.iter().map(|mode| mode.tracks.clone());
        let mut groups: Vec<Vec<usize>> = own
            .filter(|tracks| tracks.len() < found.on[2].len())
            .collect();
        groups.sort();
        groups
    }

    fn found(branches: &[(f64, &[f64])]) -> Vec<Vec<usize>> {
        let (skeleton, film) = filmed(branches);
        groups(&skeleton, &film)
    }

    /// Two branches of 1.10 and 1.15 Hz in one tip: each hides the frequency of the other.
    #[test]
    fn two_branches_in_one_tip_come_apart_by_their_modes() {
        let groups = found(&[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5]),
            (1.15, &[3.0, 4.0, 5.0, 3.5, 4.5, 4.0]),
        ]);
        assert_eq!(
            groups,
            [vec![8, 9, 10, 11, 12], vec![13, 14, 15, 16, 17, 18]]
        );
    }

    /// A branch that is cut in two for how far out its points are would be told twice.
    #[test]
    fn one_branch_is_not_cut_whatever_its_lever_arms() {
        assert_eq!(
            found(&[(1.12, &[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 2.5, 4.5, 6.5])]),
            Vec::<Vec<usize>>::new()
        );
        assert_eq!(
            found(&[(1.12, &[0.0; 10])]),
            Vec::<Vec<usize>>::new(),
            "noise on the trunk's sway"
        );
    }

    fn shot(branches: &[(f64, &[f64])]) -> Vec<Vec<usize>> {
        let (skeleton, film) = filmed(branches);
        let shoots = shoots(&skeleton, &film, &Dynamics::default(), &CancelToken::new());
        assert!(shoots.iter().all(|s| s.on == NodeId(2)), "{shoots:?}");
        let mut groups: Vec<Vec<usize>> = shoots.into_iter().map(|s| s.tracks).collect();
        groups.sort();
        groups
    }

    /// Each has a frequency of its own, and a tip that has both cannot have it.
    #[test]
    fn branches_that_only_their_modes_tell_are_shoots_of_their_tip() {
        let two: &[(f64, &[f64])] = &[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5]),
            (1.15, &[3.0, 4.0, 5.0, 3.5, 4.5, 4.0]),
        ];
        assert_eq!(
            shot(two),
            [vec![8, 9, 10, 11, 12], vec![13, 14, 15, 16, 17, 18]]
        );
    }

    #[test]
    fn a_tip_that_is_one_branch_has_no_shoots_and_four_points_are_none() {
        assert_eq!(
            shot(&[(1.12, &[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 2.5, 4.5, 6.5])]),
            Vec::<Vec<usize>>::new()
        );
        assert_eq!(
            shot(&[(1.12, &[0.0; 10])]),
            Vec::<Vec<usize>>::new(),
            "noise on the trunk's sway"
        );
        let small = shot(&[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0, 4.0]),
            (1.6, &[3.0, 4.0, 5.0, 4.0]),
        ]);
        assert!(small.iter().flatten().all(|k| *k < 15), "{small:?}");
    }

    /// Three points might be of three branches.
    #[test]
    fn a_few_points_make_no_branch() {
        let groups = found(&[
            (1.10, &[4.0, 5.0, 3.5, 4.5, 5.5, 5.0]),
            (1.6, &[3.0, 4.0, 5.0]),
        ]);
        assert!(
            groups.iter().all(|g| g.iter().all(|k| *k < 14)),
            "{groups:?}"
        );
    }

    /// A point that was put on its branch by hand speaks for it alone.
    #[test]
    fn one_marker_on_a_branch_is_enough() {
        let (skeleton, mut film) = filmed(&[(1.1, &[6.0])]);
        assert!(analysed(&skeleton, &film)[2].is_err());
        film.are_markers = true;
        let sway = analysed(&skeleton, &film)[2].expect("a sway");
        assert!(
            (sway.frequency_hz.value / 1.1 - 1.0).abs() < 0.01,
            "{sway:?}"
        );
        assert!(sway.frequency_hz.holds(1.1), "{sway:?}");
    }

    #[test]
    fn a_film_that_carries_nothing_shows_none() {
        let (skeleton, mut film) = filmed(&[(1.1, &[4.0; 6]), (1.4, &[4.0; 6])]);
        let short = film.part(0..20).into_owned();
        assert!(groups(&skeleton, &short).is_empty());
        film.tracks.iter_mut().for_each(|t| t.at_px.fill(NOT_SEEN));
        assert!(groups(&skeleton, &film).is_empty());
        film.tracks
            .iter_mut()
            .for_each(|t| t.at_px.fill(Point2::new(3.0, 3.0)));
        assert!(groups(&skeleton, &film).is_empty());
    }
}
