//! Branches that were captured as one with another, and that their modes tell apart.

use super::super::branch_tree::BranchTree;
use super::super::film::Film;
use super::super::free_decay;
use super::super::sway::UsableFilm;
use super::{ModalSolution, ModeEstimate, is_of_carrier, known_modes};
use crate::cancel::CancelToken;
use crate::config::Dynamics;
use crate::model::{Excitation, NodeId, Skeleton, Swaying};

/// A branch is on the captured one that has this share of its points, and begins with those that
/// are on no branch of that.
const MIN_SHARE_ON_CARRIER: f64 = 0.75;
const MIN_SHARE_OF_ITS_OWN: f64 = 0.6;
/// Points that one must have. Nothing but its mode tells of it, and four agree by chance more often
/// than five.
const MIN_POINTS: usize = 5;

/// A branch of its own on a captured one that is not known to fork there: some of its points have a
/// mode in common that the others have not.
#[derive(Clone, Debug, PartialEq)]
pub struct Shoot {
    /// The captured branch that carries it.
    pub on: NodeId,
    /// Its points, as indices of the film's tracks, in order.
    pub tracks: Vec<usize>,
}

/// The branches that a release shows beyond those of `skeleton`, at most one for every point; none
/// in wind, or where the film carries too little, or where `cancel` ends it before. The one that
/// is clearest by all its points takes them first.
pub fn shoots(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Vec<Shoot> {
    let tree = BranchTree::of(skeleton);
    let film = tree.film(film);
    let Ok(UsableFilm {
        members,
        onset,
        limits,
        film,
        ..
    }) = UsableFilm::of(&tree, &film, config, cancel)
    else {
        return Vec::new();
    };
    if onset.excitation != Excitation::Release {
        return Vec::new();
    }
    let sways = free_decay::sways(&tree, &film, &members, &onset, &limits, cancel);
    match ModalSolution::of(&tree, &film, &onset, &limits, &sways, cancel) {
        Some(solution) => solution.shoots(&tree, &sways),
        None => Vec::new(),
    }
}

impl ModalSolution {
    fn shoots(&self, tree: &BranchTree, sways: &[Swaying]) -> Vec<Shoot> {
        let mut estimates: Vec<&ModeEstimate> = self.estimates.iter().collect();
        estimates.sort_by(|a, b| b.gain_together().total_cmp(&a.gain_together()));
        let mut taken = vec![false; self.tracks.len()];
        let mut out = Vec::new();
        for estimate in estimates {
            let Some(on) = self.carrier_of(estimate) else {
                continue;
            };
            let branch = NodeId(on as u32);
            let points = self.own_points(estimate, on, &taken);
            let all = estimate.points.len() as f64;
            if points.len() < MIN_POINTS || (points.len() as f64) < MIN_SHARE_OF_ITS_OWN * all {
                continue;
            }
            let carriers = std::iter::once(branch).chain(tree.carriers(branch));
            if is_of_carrier(&estimate.mode, &known_modes(carriers, sways)) {
                continue;
            }
            let mut tracks = Vec::with_capacity(points.len());
            for p in points {
                taken[p] = true;
                tracks.push(self.tracks[p]);
            }
            let node = tree.branches[on].node;
            out.push(Shoot { on: node, tracks });
        }
        out
    }

    /// The smallest captured branch that has most of an estimate's points; `None` where there is
    /// none, or the estimate is that of a captured branch.
    fn carrier_of(&self, estimate: &ModeEstimate) -> Option<usize> {
        let captured = 1..self.on.len();
        if captured
            .clone()
            .any(|b| self.similarity(b, estimate).is_some())
        {
            return None;
        }
        let least = MIN_SHARE_ON_CARRIER * estimate.points.len() as f64;
        captured
            .filter(|&b| self.points_on(b, estimate) as f64 >= least)
            .min_by_key(|&b| self.on[b].len())
    }

    /// Points of an estimate that lie on captured branch `on` itself, and are not taken.
    fn own_points(&self, estimate: &ModeEstimate, on: usize, taken: &[bool]) -> Vec<usize> {
        let points = estimate.points.iter().copied();
        points
            .filter(|&p| self.branch_of[p] == on && !taken[p])
            .collect()
    }
}
