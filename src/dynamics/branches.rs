//! The way through a tree from the trunk up, which the analyses of a release and of wind share, and
//! what either says of one branch.
//!
//! In the picture a branch moves with everything that carries it, so that the modes of its
//! ancestors must be known when its turn comes.

use super::branch_tree::BranchTree;
use super::decay::Mode;
use super::film::Film;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::{Interval, NodeId, Swaying, Unidentified};
use nalgebra::Point2;

/// Frequencies that are nearer to each other than so many standard deviations are one.
const SAME_FREQ_SIGMAS: f64 = 2.0;
/// The interval of the trunk, which all points move with and every film should show, may be so many
/// times as wide as that of others.
const MAX_CI_OF_TRUNK: f64 = 3.0;

/// Where modes are looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct SearchLimits {
    /// Frequencies that are looked for in a film of this length and rate, Hz.
    pub frequencies_hz: Bounds,
    /// Highest frequency that a tree may have, Hz.
    pub highest_hz: f64,
    /// Half a 95 % interval of the frequency at most, as a share of it.
    pub max_relative_ci: f64,
}

impl SearchLimits {
    /// Whether what is seen at `frequency_hz` may be a faster sway: films of few frames a second
    /// show it as a slow one.
    pub fn may_be_aliased(&self, frequency_hz: f64, film: &Film) -> bool {
        1.0 / film.step_s() - frequency_hz <= self.highest_hz
    }

    /// Whether a mode of all points is sure enough to answer for the trunk, and no faster one.
    pub fn may_be_trunks(&self, mode: &BranchMode, film: &Film) -> bool {
        mode.is_within(MAX_CI_OF_TRUNK * self.max_relative_ci)
            && !self.may_be_aliased(mode.mode.frequency_hz, film)
    }
}

/// Standard deviations of the logarithms of a mode's frequency and damping.
#[derive(Clone, Copy, Debug)]
pub(super) struct LnDeviations {
    pub frequency: f64,
    pub damping: f64,
}

impl LnDeviations {
    /// In the order of [`Mode::parameters`].
    pub fn of_parameters(x: &[f64]) -> Self {
        Self {
            frequency: x[0],
            damping: x[1],
        }
    }

    /// In the order of [`Mode::parameters`].
    pub fn parameters(&self) -> [f64; 2] {
        [self.frequency, self.damping]
    }

    /// So many times as wide, and wider by `least`.
    pub fn inflated(&self, by: f64, least: &Self) -> Self {
        Self {
            frequency: (by * self.frequency).hypot(least.frequency),
            damping: (by * self.damping).hypot(least.damping),
        }
    }
}

/// A branch's own mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct BranchMode {
    pub mode: Mode,
    pub ln_sd: LnDeviations,
}

impl BranchMode {
    /// Whether half the 95 % interval of the frequency is at most this share of it.
    pub fn is_within(&self, max_relative_ci: f64) -> bool {
        Interval::Z * self.ln_sd.frequency <= max_relative_ci
    }

    /// Whether both frequencies may be one.
    pub fn agrees_with(&self, other: &Self) -> bool {
        let sd = self.ln_sd.frequency.hypot(other.ln_sd.frequency);
        other
            .mode
            .has_frequency_of(&self.mode, SAME_FREQ_SIGMAS * sd)
    }

    /// The mean of both where they agree, else itself. Both are of one film: their mean is no surer
    /// than either.
    pub fn agreed_with(&self, other: &Self) -> Self {
        if !self.agrees_with(other) {
            return *self;
        }
        let [own, others] =
            [self, other].map(|m| m.ln_sd.frequency.max(f64::MIN_POSITIVE).powi(-2));
        let share = own / (own + others);
        let between = |own: f64, other: f64| own.powf(share) * other.powf(1.0 - share);
        Self {
            mode: Mode {
                frequency_hz: between(self.mode.frequency_hz, other.mode.frequency_hz),
                damping: between(self.mode.damping, other.mode.damping),
            },
            ln_sd: LnDeviations {
                frequency: (2.0 / (own + others)).sqrt(),
                damping: between(self.ln_sd.damping, other.ln_sd.damping),
            },
        }
    }

    pub fn frequency_hz(&self) -> Interval {
        interval(self.mode.frequency_hz, self.ln_sd.frequency)
    }

    /// `None` where the film says nothing of it: half the interval is longer than the value.
    pub fn damping_ratio(&self) -> Option<Interval> {
        let known = self.ln_sd.damping > 0.0 && Interval::Z * self.ln_sd.damping <= 1.0;
        known.then(|| interval(self.mode.damping, self.ln_sd.damping))
    }
}

/// 95 % interval of a value whose logarithm has this standard deviation.
fn interval(value: f64, ln_sd: f64) -> Interval {
    Interval {
        value,
        lo: value * (-Interval::Z * ln_sd).exp(),
        hi: value * (Interval::Z * ln_sd).exp(),
    }
}

/// What was found for a branch: a mode, for the branches on it, and its sway if that can be told.
pub(super) struct Estimate {
    pub mode: BranchMode,
    pub sway: Swaying,
}

/// A branch whose turn it is.
pub(super) struct BranchInFilm<'a> {
    pub node: NodeId,
    pub parent: NodeId,
    /// Points on it and on all that it carries, as indices of the film's tracks.
    pub tracks: &'a [usize],
    /// Where it begins at rest, px.
    pub base_px: Point2<f64>,
}

impl BranchInFilm<'_> {
    pub fn is_on_foot(&self) -> bool {
        self.parent == NodeId(0)
    }
}

/// A way to tell the sway of one branch after the other; it keeps what it needs of those below.
pub(super) trait BranchEstimator {
    fn estimate(&mut self, branch: &BranchInFilm) -> Swaying;
}

/// The sway of every branch, that of the trunk first, then the nearest to the foot first; `members` are
/// the points of each and of all above it.
pub(super) fn from_the_trunk_up(
    tree: &BranchTree,
    members: &[Vec<usize>],
    trunk: NodeId,
    cancel: &CancelToken,
    estimator: &mut impl BranchEstimator,
) -> Vec<Swaying> {
    let mut out = vec![Err(Unidentified::NotMeasured); members.len()];
    let others = (1..tree.len()).filter(|i| *i != trunk.index());
    for i in std::iter::once(trunk.index()).chain(others) {
        let (Some(branch), Some(tracks)) = (tree.branches.get(i), members.get(i)) else {
            continue;
        };
        if tracks.is_empty() {
            continue;
        }
        if cancel.is_cancelled() {
            out[i] = Err(Unidentified::NotInTime);
            continue;
        }
        out[i] = estimator.estimate(&BranchInFilm {
            node: NodeId(i as u32),
            parent: branch.parent.unwrap_or_default(),
            tracks,
            base_px: branch.base_px,
        });
    }
    out
}
