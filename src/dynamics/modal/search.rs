//! Modes that points have beyond those of the branch that they are on.

use super::super::decay::Mode;
use super::super::mode_search::mode_grid;
use super::tree::{COST_PER_POINT, Decay, EFFECTIVE_VALUES, Tree};
use crate::bounds::Bounds;
use crate::signal::extension::Candidates;
use crate::signal::statistics::quantile;
use nalgebra::DMatrix;

/// Frequencies that are tried per factor of e, and up to which, Hz.
const TRIED_PER_E: f64 = 33.0;
const HIGHEST_HZ: f64 = 4.5;
/// What a point must gain by a mode to have it clearly.
pub(super) const MIN_CLEAR_GAIN: f64 = 5.0;
/// A mode is a branch's if this share of its points, and of the points of every branch on it with
/// so many, gains so much.
const MIN_POINTS_SHARE: f64 = 0.75;
const MIN_POINTS_OF_PART: usize = 3;
const MIN_GAIN: f64 = 16.0;
/// Points that a branch must have.
pub(super) const MIN_POINTS: usize = 4;

/// The modes that are tried.
pub(super) struct Tried {
    modes: Vec<Mode>,
    columns: Candidates,
}

/// A mode that some of the points have.
pub(super) struct Found {
    pub mode: Mode,
    /// What it gains in all.
    pub worth: f64,
    pub points: Vec<usize>,
}

impl Tried {
    pub fn new(decay: &Decay) -> Self {
        let Bounds { lo, hi } = decay.frequencies_hz;
        let modes = mode_grid(Bounds::new(lo, hi.min(HIGHEST_HZ).max(lo)), TRIED_PER_E);
        let columns = modes.iter().map(|m| decay.columns(m));
        Self {
            columns: Candidates::new(columns, decay.times_s.len()),
            modes,
        }
    }
}

/// Some points with the same modes, and what others would take off them.
struct Rests {
    points: Vec<usize>,
    /// What each mode that is tried, a row for each, takes off, as a share of what is left of each
    /// point; 0 if it could not be told from what the points have.
    taken_shares: DMatrix<f64>,
}

impl Rests {
    fn new(tree: &Tree, branch: usize, points: Vec<usize>, tried: &Tried) -> Self {
        let qr = tree.design(branch).qr;
        let mut left = Vec::with_capacity(points.len());
        let mut residuals = Vec::new();
        for &p in &points {
            left.push(tree.left(&qr, p));
            for y in &tree.decay.points[p].values {
                residuals.extend(qr.solve(y).0);
            }
        }
        let frames = tree.decay.times_s.len();
        let residuals = DMatrix::from_vec(frames, 2 * points.len(), residuals);
        let taken = tried.columns.explained(&qr, &residuals);
        let taken_shares = DMatrix::from_fn(tried.modes.len(), points.len(), |mode, k| {
            (taken[(mode, 2 * k)] + taken[(mode, 2 * k + 1)]) / left[k]
        });
        Self {
            points,
            taken_shares,
        }
    }
}

/// Whether most points of some groups gain enough; `gains` are those of all groups.
fn most_gain(gains: &[Vec<f64>], groups: &[usize]) -> bool {
    let of_groups = groups.iter().flat_map(|&g| gains[g].iter().copied());
    quantile(of_groups.collect(), 1.0 - MIN_POINTS_SHARE).is_some_and(|g| g > MIN_GAIN)
}

impl Tree<'_> {
    /// The mode that nearly all points of `branch` and of what is on it have beyond theirs.
    pub fn common_mode(&self, branch: usize, tried: &Tried) -> Option<Mode> {
        let within = self.within(branch);
        let mut rests: Vec<Rests> = Vec::new();
        for &b in &within {
            let points = self.own(b);
            if !points.is_empty() {
                rests.push(Rests::new(self, b, points, tried));
            }
        }
        let mut parts: Vec<Vec<usize>> = vec![(0..rests.len()).collect()];
        for &b in &within {
            let all = self.all(b);
            if self.branches[b].parent == Some(branch) && all.len() >= MIN_POINTS_OF_PART {
                parts.push(groups_on(&rests, &all));
            }
        }
        let mut best: Option<(f64, Mode)> = None;
        for (k, mode) in tried.modes.iter().enumerate() {
            let mut gains: Vec<Vec<f64>> = Vec::with_capacity(rests.len());
            for rests in &rests {
                let shares = rests.taken_shares.row(k);
                gains.push(shares.iter().map(|s| EFFECTIVE_VALUES * s).collect());
            }
            if !parts.iter().all(|part| most_gain(&gains, part)) {
                continue;
            }
            let worth: f64 = gains.iter().flatten().map(|g| (g / MIN_GAIN).ln_1p()).sum();
            if best.is_none_or(|(most, _)| worth >= most) {
                best = Some((worth, *mode));
            }
        }
        best.map(|(_, mode)| mode)
    }

    /// The mode that some of the `points` of `branch` itself have beyond theirs.
    pub fn mode_of_some(&self, branch: usize, points: Vec<usize>, tried: &Tried) -> Option<Found> {
        let rests = Rests::new(self, branch, points, tried);
        let mut best: Option<Found> = None;
        for (k, mode) in tried.modes.iter().enumerate() {
            let mut worth = 0.0;
            let mut clear: Vec<usize> = Vec::new();
            for (share, &point) in rests.taken_shares.row(k).iter().zip(&rests.points) {
                let gain = -EFFECTIVE_VALUES * (1.0 - share).ln() - COST_PER_POINT;
                worth += gain.max(0.0);
                if gain > MIN_CLEAR_GAIN {
                    clear.push(point);
                }
            }
            if clear.len() >= MIN_POINTS && best.as_ref().is_none_or(|b| worth > b.worth) {
                best = Some(Found {
                    mode: *mode,
                    worth,
                    points: clear,
                });
            }
        }
        best
    }
}

/// Which of the groups of points are of those of `points`.
fn groups_on(rests: &[Rests], points: &[usize]) -> Vec<usize> {
    (0..rests.len())
        .filter(|&g| points.binary_search(&rests[g].points[0]).is_ok())
        .collect()
}
