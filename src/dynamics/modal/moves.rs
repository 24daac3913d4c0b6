//! How a tree becomes a better one: modes change places, branches come apart, points change
//! branches, as long as it is worth it.

use super::super::decay::Mode;
use super::super::members::mean_px;
use super::search::{MIN_CLEAR_GAIN, MIN_POINTS, Tried};
use super::tree::{Branch, COST_PER_MODE, Tree};
use crate::cancel::CancelToken;
use crate::signal::vectors::add_scaled;
use nalgebra::Point2;

/// What a change must be worth.
const MIN_GAIN: f64 = 10.0;
/// Rounds of all changes, of fits after one, and of fits of everything.
const MAX_ROUNDS: usize = 3;
const MAX_STEPS_AFTER_CHANGE: usize = 5;
const MAX_STEPS_OF_ALL: usize = 6;
/// Branches that may come off one in a round.
const MAX_NEW_BRANCHES: usize = 4;
/// Points that a tip must have to be tried as two, and how far apart those are put: share of the
/// frequency either way.
const MIN_POINTS_FOR_TWO: usize = 8;
const LN_FREQUENCIES_APART: [f64; 2] = [0.03, 0.08];
/// Rounds in which points choose between the two, and modes are fitted, in turn.
const ROUNDS_OF_TWO: usize = 3;

impl<'a> Tree<'a> {
    /// The best tree that the changes lead to; `None` if `cancel` ends it before.
    pub fn grown(mut self, cancel: &CancelToken) -> Option<Self> {
        let tried = Tried::new(self.decay);
        self.fit_all();
        for _ in 0..MAX_ROUNDS {
            let mut changed = false;
            for branch in 1..self.branches.len() {
                if cancel.is_cancelled() {
                    return None;
                }
                changed |= self.rearrange(branch, &tried);
            }
            let mut largest: Vec<usize> = (1..self.branches.len()).collect();
            largest.sort_by_key(|&b| std::cmp::Reverse(self.own(b).len()));
            for branch in largest {
                if cancel.is_cancelled() {
                    return None;
                }
                changed |= self.shoot(branch, &tried);
            }
            for branch in 1..self.branches.len() {
                changed |= self.part(branch);
            }
            if cancel.is_cancelled() {
                return None;
            }
            let all: Vec<usize> = (1..self.branches.len()).collect();
            changed |= self.choose(&all, &(0..self.branch_of.len()).collect::<Vec<_>>());
            self.fit_all();
            for b in 1..self.branches.len() {
                if self.all(b).len() < MIN_POINTS - 1 {
                    self.branches[b].mode = None;
                }
            }
            if !changed {
                break;
            }
        }
        Some(self)
    }

    fn fit_all(&mut self) {
        let all: Vec<usize> = (0..self.branches.len()).collect();
        self.refit(&all, &all, MAX_STEPS_OF_ALL);
    }

    /// Takes `other` if what is within `root` costs less there.
    fn take(&mut self, mut other: Tree<'a>, root: usize) -> bool {
        let there = other.within(root);
        other.refit(&there, &there, MAX_STEPS_AFTER_CHANGE);
        let better = other.cost(&there) < self.cost(&self.within(root)) - MIN_GAIN;
        if better {
            *self = other;
        }
        better
    }

    /// The mode of a branch is tried on what carries it, in exchange; left out; and looked for
    /// anew.
    fn rearrange(&mut self, branch: usize, tried: &Tried) -> bool {
        if self.all(branch).len() < MIN_POINTS {
            self.branches[branch].mode = None;
            return false;
        }
        let mut changed = false;
        if let (Some(mode), Some(parent)) = (
            self.branches[branch].mode,
            self.branches[branch].parent.filter(|&p| p > 0),
        ) {
            let mut other = self.with_mode(branch, self.branches[parent].mode);
            other.branches[parent].mode = Some(mode);
            changed |= self.take(other, parent);
        }
        if self.branches[branch].mode.is_some() {
            changed |= self.take(self.with_mode(branch, None), branch);
        }
        let without = self.with_mode(branch, None);
        if let Some(mode) = without.common_mode(branch, tried) {
            changed |= self.take(without.with_mode(branch, Some(mode)), branch);
        }
        changed
    }

    /// The same tree with another mode of one branch.
    fn with_mode(&self, branch: usize, mode: Option<Mode>) -> Self {
        let mut other = self.clone();
        other.branches[branch].mode = mode;
        other
    }

    /// New branches on `branch`, of those of its own points that have a mode in common.
    fn shoot(&mut self, branch: usize, tried: &Tried) -> bool {
        let mut changed = false;
        for _ in 0..MAX_NEW_BRANCHES {
            let points = self.own(branch);
            if points.len() < MIN_POINTS {
                break;
            }
            let Some(found) = self
                .mode_of_some(branch, points, tried)
                .filter(|f| f.worth >= COST_PER_MODE)
            else {
                break;
            };
            let mut other = self.clone();
            let new = other.add_on_end(branch, found.mode, &found.points);
            other.refit(&[new], &[new], MAX_STEPS_AFTER_CHANGE);
            let within = other.within(branch);
            other.choose(&within, &other.all(branch));
            if other.all(new).len() < MIN_POINTS - 1 || !self.take(other, branch) {
                break;
            }
            changed = true;
        }
        changed
    }

    /// Two branches whose frequencies lie close together are first found as one between them: a tip
    /// is tried as two, of which every point may choose.
    fn part(&mut self, branch: usize) -> bool {
        let (points, within) = (self.own(branch), self.within(branch));
        let (Some(mode), Some(parent)) = (self.branches[branch].mode, self.branches[branch].parent)
        else {
            return false;
        };
        if points.len() < MIN_POINTS_FOR_TWO || within.len() > 1 {
            return false;
        }
        for apart in LN_FREQUENCIES_APART {
            let mut other = self.clone();
            let [slower, faster] = [-apart, apart].map(|apart: f64| Mode {
                frequency_hz: mode.frequency_hz * apart.exp(),
                ..mode
            });
            other.branches[branch].mode = Some(slower);
            let new = other.branches.len();
            other.branches.push(Branch {
                parent: Some(parent),
                mode: Some(faster),
                base_px: other.branches[branch].base_px,
                end_px: other.branches[parent].end_px,
            });
            let both = [branch, new];
            let mut large_enough = true;
            for _ in 0..ROUNDS_OF_TWO {
                let [here, there] = both.map(|b| other.costs(b, &points));
                for (k, &p) in points.iter().enumerate() {
                    other.branch_of[p] = if here[k] <= there[k] { branch } else { new };
                }
                large_enough = both.iter().all(|&b| other.own(b).len() >= MIN_POINTS);
                if !large_enough {
                    break;
                }
                other.refit(&both, &both, MAX_STEPS_AFTER_CHANGE);
            }
            if large_enough && other.cost(&both) < self.cost(&[branch]) - MIN_GAIN {
                *self = other;
                return true;
            }
        }
        false
    }

    /// Every one of `points` may go to that of `branches` where it costs clearly least; tells
    /// whether one did.
    fn choose(&mut self, branches: &[usize], points: &[usize]) -> bool {
        let mut costs: Vec<Vec<f64>> = Vec::with_capacity(branches.len());
        for &b in branches {
            let mut of_branch = self.costs(b, points);
            add_scaled(&mut of_branch, 1.0, &self.far(b, points));
            costs.push(of_branch);
        }
        let mut moved = false;
        for (k, &p) in points.iter().enumerate() {
            let Some(now) = branches.iter().position(|&b| b == self.branch_of[p]) else {
                continue;
            };
            let best = (0..branches.len()).min_by(|&a, &b| costs[a][k].total_cmp(&costs[b][k]));
            if let Some(best) = best.filter(|&b| costs[b][k] < costs[now][k] - MIN_CLEAR_GAIN) {
                self.branch_of[p] = branches[best];
                moved = true;
            }
        }
        moved
    }

    /// Adds a branch that begins where `parent` ends, with some points that were on that.
    fn add_on_end(&mut self, parent: usize, mode: Mode, points: &[usize]) -> usize {
        let new = self.branches.len();
        let at_px: Vec<Point2<f64>> = points.iter().map(|&p| self.decay.points[p].at_px).collect();
        self.branches.push(Branch {
            parent: Some(parent),
            mode: Some(mode),
            base_px: self.branches[parent].end_px,
            end_px: mean_px(&at_px),
        });
        points.iter().for_each(|&p| self.branch_of[p] = new);
        new
    }
}
