//! Frequency and damping of every branch of a film.

use super::branch_tree::BranchTree;
use super::branches::SearchLimits;
use super::decaying_motions::DecayingMotions;
use super::film::Film;
use super::free_decay;
use super::members::{members, trunk};
use super::modal;
use super::point_modes::{PointModes, Shoot, is_open, may_have_other};
use super::release::{FoundOnset, Onset, ReleaseTime, onset};
use super::sampling;
use super::tree_modes;
use super::whole_tree::{modes_of_tree, withdraw_small};
use super::wind;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::config::{Dynamics, Excited};
use crate::model::{Excitation, NodeId, Skeleton, Swaying, TreeMode, Unidentified};
use std::borrow::Cow;

/// Fewer frames than this say nothing.
const LEAST_FRAMES: usize = 32;
/// Periods that a film must have of the lowest frequency that is looked for in it.
pub const LEAST_PERIODS: f64 = 1.5;

/// How much work an analysis may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// In a time that a screen can wait for: one branch after the other.
    Quick,
    /// All branches at once besides, which takes several times as long and answers for a few more.
    Full,
}

/// What a film says of the sway of its tree.
#[derive(Clone, Debug)]
pub struct Analysis {
    /// By measured node; copies sway as their originals, and what moves with another node has no
    /// sway of its own.
    pub sway: Vec<Swaying>,
    /// The modes that are known, the slowest first.
    pub modes: Vec<TreeMode>,
    /// What made the tree sway; `None` where there is too little film to tell.
    pub onset: Option<Onset>,
    /// When it was released, s, where that was more than once: the answers are of one of them, the
    /// onset's.
    pub releases_s: Vec<f64>,
}

/// The sway of every measured node of `skeleton` (its foot among them, which has none) in `film`.
///
/// Never fails: what the film does not carry is [`Unidentified`].
/// The branches that are left when `cancel` ends the work are [`Unidentified::NotInTime`].
pub fn analyse(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    depth: Depth,
    cancel: &CancelToken,
) -> Analysis {
    let tree = BranchTree::of(skeleton);
    let film = tree.film(film);
    let usable = match UsableFilm::of(&tree, &film, config, cancel) {
        Ok(usable) => usable,
        Err(reason) => return without_answers(&tree, &film, reason),
    };
    let mut sways = usable.one_by_one(&tree, cancel);
    let mut found = None;
    let is_worth_it = match usable.onset.excitation {
        Excitation::Wind => sways.iter().any(may_have_other),
        Excitation::Release => sways.iter().any(is_open),
    };
    if depth == Depth::Full && is_worth_it {
        found = usable.all_at_once(&tree, &sways, cancel);
        match &found {
            Some(modes) => modes.answer(&tree, &mut sways),
            None if cancel.is_cancelled() => {
                for sway in sways.iter_mut().filter(|s| is_open(s)) {
                    *sway = Err(Unidentified::NotInTime);
                }
            }
            None => {}
        }
    }
    let UsableFilm {
        film,
        members,
        trunk,
        ..
    } = &usable;
    withdraw_small(&tree, film, members, *trunk, &mut sways, found.as_ref());
    if let Some(modes) = &found {
        modes.turn_about_bases(&tree, film, &mut sways);
    }
    Analysis {
        modes: modes_of_tree(&tree, film, members, *trunk, &sways, found.as_ref()),
        sway: tree.by_node(&sways),
        onset: Some(usable.onset),
        releases_s: usable.releases_s,
    }
}

/// The branches that a film shows beyond those of `skeleton`, at most one for every point; none
/// where the film carries too little, or where `cancel` ends it before.
pub fn shoots(
    skeleton: &Skeleton,
    film: &Film,
    config: &Dynamics,
    cancel: &CancelToken,
) -> Vec<Shoot> {
    let tree = BranchTree::of(skeleton);
    let film = tree.film(film);
    let Ok(usable) = UsableFilm::of(&tree, &film, config, cancel) else {
        return Vec::new();
    };
    let sways = usable.one_by_one(&tree, cancel);
    match usable.all_at_once(&tree, &sways, cancel) {
        Some(modes) => modes.shoots(&tree, &usable.film, &sways),
        None => Vec::new(),
    }
}

/// Of a film that cannot be used, for one reason.
fn without_answers(tree: &BranchTree, film: &Film, reason: Unidentified) -> Analysis {
    let mut sway: Vec<Swaying> = Vec::with_capacity(tree.len());
    for (i, members) in members(tree, film).iter().enumerate() {
        sway.push(Err(if i == 0 || members.is_empty() {
            Unidentified::NotMeasured
        } else {
            reason
        }));
    }
    Analysis {
        sway: tree.by_node(&sway),
        modes: Vec::new(),
        onset: None,
        releases_s: Vec::new(),
    }
}

/// A film that is long enough to be looked at, and what made its tree sway.
pub(super) struct UsableFilm<'a> {
    /// Points of every branch and of all that it carries.
    pub members: Vec<Vec<usize>>,
    /// The branch on the foot that most of them are on or above.
    pub trunk: NodeId,
    pub onset: Onset,
    pub release: ReleaseTime,
    pub releases_s: Vec<f64>,
    /// The motions of all points after a release, where there are enough frames.
    pub decaying: Option<DecayingMotions>,
    pub limits: SearchLimits,
    /// The frames that are used, in means of neighbours.
    pub film: Cow<'a, Film>,
}

impl<'a> UsableFilm<'a> {
    /// The sway of one branch after the other, from the trunk up.
    fn one_by_one(&self, tree: &BranchTree, cancel: &CancelToken) -> Vec<Swaying> {
        let (film, limits) = (&self.film, &self.limits);
        let (members, trunk) = (&self.members, self.trunk);
        match self.onset.excitation {
            Excitation::Wind => wind::sways(tree, film, members, trunk, limits, cancel),
            Excitation::Release => free_decay::sways(tree, self, cancel),
        }
    }

    /// The modes of all points; `None` where there is too little to tell them, or where `cancel`
    /// ends the work before.
    fn all_at_once(
        &self,
        tree: &BranchTree,
        sways: &[Swaying],
        cancel: &CancelToken,
    ) -> Option<PointModes> {
        let (film, limits) = (&self.film, &self.limits);
        match self.onset.excitation {
            Excitation::Wind => {
                tree_modes::point_modes(tree, film, &self.members, self.trunk, limits, cancel)
            }
            Excitation::Release => {
                modal::point_modes(tree, film, self.trunk, &self.onset, limits, sways, cancel)
            }
        }
    }

    /// An error where there is too little film, or `cancel` ends the work before.
    pub fn of(
        tree: &BranchTree,
        filmed: &'a Film,
        config: &Dynamics,
        cancel: &CancelToken,
    ) -> Result<Self, Unidentified> {
        if filmed.times_s.len() < LEAST_FRAMES || filmed.span_s() <= 0.0 {
            return Err(Unidentified::TooShort);
        }
        let highest_hz = sampling::highest_hz(filmed, filmed).min(config.highest_hz);
        let frequencies_hz = Bounds::new(LEAST_PERIODS / filmed.span_s(), highest_hz);
        if frequencies_hz.is_empty() {
            return Err(Unidentified::TooShort);
        }
        let given = match config.excitation {
            Excited::Auto => None,
            Excited::Release => Some(Excitation::Release),
            Excited::Wind => Some(Excitation::Wind),
        };
        let members = members(tree, filmed);
        let trunk = trunk(tree, &members);
        let of_tree: &[usize] = members.get(trunk.index()).map_or(&[], Vec::as_slice);
        let FoundOnset {
            onset,
            release,
            releases_s,
            decaying,
            film,
        } = onset(filmed, of_tree, given, frequencies_hz, cancel);
        if cancel.is_cancelled() {
            return Err(Unidentified::NotInTime);
        }
        if onset.to - onset.from < LEAST_FRAMES {
            return Err(Unidentified::TooShort);
        }
        let highest_hz = highest_hz.min(sampling::highest_hz(filmed, &film));
        let frequencies_hz = Bounds::new(frequencies_hz.lo, highest_hz);
        Ok(Self {
            members,
            trunk,
            onset,
            release,
            releases_s,
            decaying,
            limits: SearchLimits {
                frequencies_hz,
                highest_hz: config.highest_hz,
                max_relative_ci: config.widest,
            },
            film,
        })
    }
}
