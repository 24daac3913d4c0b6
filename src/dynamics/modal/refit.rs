//! Frequencies and dampings of many branches at once, every point with the modes that it has:
//! variable projection, as for one branch (fit.rs).

use super::super::decay::{LN_DAMPING_WEIGHT, Mode, Slopes, USUAL_DAMPING, damping_penalty};
use super::tree::{Design, EFFECTIVE_VALUES, Tree};
use crate::bounds::Bounds;
use crate::signal::gram::{GramCholesky, gram};
use crate::signal::least_squares::{
    LeastSquares, NormalEquations, ParameterLimits, Stopping, levenberg_marquardt,
};
use crate::signal::variable_projection::{Basis, Explained, SignalBlock, Slope};
use crate::signal::vectors::{dot, slices};
use std::collections::BTreeSet;

/// How far a step may go.
const MAX_LN_FREQUENCY_STEP: f64 = 0.05;
const MAX_LN_DAMPING_STEP: f64 = 0.5;
const DAMPING: Bounds = Bounds::new(0.003, 0.3);
/// A gain that is worth another step.
const MIN_GAIN: f64 = 0.5;

/// Points that have the same modes.
struct PointGroup {
    /// The branches whose modes they are.
    of: Vec<usize>,
    /// Right and down of each point in turn.
    signals: SignalBlock,
    /// Of every signal: what one square counts.
    weights: Vec<f64>,
    /// What noise counts, in all of them.
    noise: f64,
}

/// A fit of the modes of the branches `free`; the other modes stay.
struct ModesFit<'a, 'd> {
    tree: &'a Tree<'d>,
    free: &'a [usize],
    groups: &'a [PointGroup],
}

impl<'d> ModesFit<'_, 'd> {
    fn tree_at(&self, x: &[f64]) -> Tree<'d> {
        let mut tree = self.tree.clone();
        tree.set_modes(self.free, x);
        tree
    }
}

impl LeastSquares for ModesFit<'_, '_> {
    fn cost(&self, x: &[f64]) -> f64 {
        let tree = self.tree_at(x);
        let ones = vec![1.0; tree.decay.times_s.len()];
        let mut of_branches = vec![Vec::new(); tree.branches.len()];
        for b in branches_of(self.groups) {
            of_branches[b] = tree.branches[b]
                .mode
                .map_or(Vec::new(), |m| tree.decay.columns(&m));
        }
        let mut cost = 0.0;
        for group in self.groups {
            let mut columns: Vec<&[f64]> = vec![&ones];
            for &b in &group.of {
                columns.extend(slices(&of_branches[b]));
            }
            let factored = GramCholesky::new(&gram(&columns), columns.len());
            let left = Explained::new(&group.signals, &columns, &factored).left;
            cost += dot(&left, &group.weights) + group.noise;
        }
        for mode in x.chunks_exact(2) {
            cost += damping_penalty(mode[1]);
        }
        cost
    }

    fn normal_equations(&self, x: &[f64]) -> NormalEquations {
        self.tree_at(x).normal_equations(self.free, self.groups)
    }
}

/// The branches whose modes some groups have, each once.
fn branches_of(groups: &[PointGroup]) -> BTreeSet<usize> {
    groups.iter().flat_map(|g| g.of.iter().copied()).collect()
}

impl Tree<'_> {
    /// Fits the modes of `free` to the points of the branches `within`; the other modes stay.
    pub fn refit(&mut self, free: &[usize], within: &[usize], max_steps: usize) {
        let free = self.with_modes(free);
        let groups = self.groups(within);
        if free.is_empty() || groups.is_empty() {
            return;
        }
        let mut limits = Vec::with_capacity(2 * free.len());
        for _ in &free {
            limits.push(ParameterLimits {
                bounds: self.decay.frequencies_hz.map(f64::ln),
                max_step: MAX_LN_FREQUENCY_STEP,
            });
            limits.push(ParameterLimits {
                bounds: DAMPING.map(f64::ln),
                max_step: MAX_LN_DAMPING_STEP,
            });
        }
        let stopping = Stopping {
            max_steps,
            min_gain: MIN_GAIN,
            min_relative_gain: 0.0,
        };
        let start = self.parameters(&free);
        let problem = ModesFit {
            tree: self,
            free: &free,
            groups: &groups,
        };
        let x = levenberg_marquardt(&problem, start, &limits, &stopping);
        self.set_modes(&free, &x);
    }

    /// The branches that have modes, and the normal equations of these where they are.
    pub fn all_normal_equations(&self) -> (Vec<usize>, NormalEquations) {
        let all: Vec<usize> = (0..self.branches.len()).collect();
        let free = self.with_modes(&all);
        let normal = self.normal_equations(&free, &self.groups(&all));
        (free, normal)
    }

    fn with_modes(&self, branches: &[usize]) -> Vec<usize> {
        let all = branches.iter().copied();
        all.filter(|&b| self.branches[b].mode.is_some()).collect()
    }

    /// Logarithms of frequency and damping of the modes of some branches in turn.
    fn parameters(&self, branches: &[usize]) -> Vec<f64> {
        let modes = branches.iter().filter_map(|&b| self.branches[b].mode);
        modes.flat_map(|m| m.parameters()).collect()
    }

    fn set_modes(&mut self, branches: &[usize], x: &[f64]) {
        for (&b, x) in branches.iter().zip(x.chunks_exact(2)) {
            self.branches[b].mode = Some(Mode::of_parameters(x));
        }
    }

    /// The points of some branches, where there are any.
    fn groups(&self, branches: &[usize]) -> Vec<PointGroup> {
        let mut out = Vec::with_capacity(branches.len());
        for &branch in branches {
            let points = self.own(branch);
            if points.is_empty() {
                continue;
            }
            let Design { of, qr } = self.design(branch);
            let (mut signals, mut weights, mut noise) = (Vec::new(), Vec::new(), 0.0);
            for p in points {
                let weight = EFFECTIVE_VALUES / self.left(&qr, p);
                let point = &self.decay.points[p];
                noise += weight * point.floor;
                for values in &point.values {
                    signals.push(values.as_slice());
                    weights.push(weight);
                }
            }
            out.push(PointGroup {
                of,
                signals: SignalBlock::new(&signals),
                weights,
                noise,
            });
        }
        out
    }

    fn normal_equations(&self, free: &[usize], groups: &[PointGroup]) -> NormalEquations {
        let mut normal = NormalEquations::zeros(2 * free.len());
        let mut of_branches: Vec<Vec<(Vec<f64>, Slopes)>> = Vec::new();
        of_branches.resize_with(self.branches.len(), Vec::new);
        for b in branches_of(groups) {
            if let Some(mode) = self.branches[b].mode {
                let (times_s, start) = (&self.decay.times_s, self.decay.start);
                of_branches[b] = mode.columns_and_slopes(times_s, start);
            }
        }
        for group in groups {
            let basis = self.basis(&group.of, free, &of_branches);
            if basis.slopes.is_empty() {
                continue;
            }
            let products = gram(&basis.columns_and_slopes());
            normal.add_signals(&basis, &products, &group.signals, &group.weights);
        }
        for (k, x) in self.parameters(free).chunks_exact(2).enumerate() {
            normal.add_prior(2 * k + 1, USUAL_DAMPING.ln() - x[1], LN_DAMPING_WEIGHT);
        }
        normal
    }

    /// The columns of the modes of the branches `of`, and how those of the branches `free` change with
    /// their parameters, from those of all branches.
    fn basis(
        &self,
        of: &[usize],
        free: &[usize],
        of_branches: &[Vec<(Vec<f64>, Slopes)>],
    ) -> Basis {
        let mut basis = Basis {
            columns: vec![vec![1.0; self.decay.times_s.len()]],
            slopes: Vec::new(),
        };
        for &b in of {
            let place = free.iter().position(|f| *f == b);
            for (values, slopes) in &of_branches[b] {
                let column = basis.columns.len();
                basis.columns.push(values.clone());
                let Some(place) = place else { continue };
                for (i, values) in slopes.by_mode.iter().enumerate() {
                    basis.slopes.push(Slope {
                        parameter: 2 * place + i,
                        column,
                        values: values.clone(),
                    });
                }
            }
        }
        basis
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::{Branch, Decay, Point};
    use super::*;
    use crate::dynamics::Start;
    use nalgebra::Point2;

    /// Moved by so much of the trunk's motion and of the branch's.
    fn point((trunk, own): (f64, f64), columns: &[Vec<Vec<f64>>; 2]) -> Point {
        let both = columns[0][0].iter().zip(&columns[1][0]);
        let u: Vec<f64> = both.map(|(a, b)| trunk * a + own * b).collect();
        let v = u.iter().map(|x| 0.2 * x).collect();
        Point::new([u, v], Point2::new(trunk, own), 0.03)
    }

    fn branch(parent: Option<usize>, mode: Option<Mode>) -> Branch {
        Branch {
            parent,
            mode,
            base_px: Point2::origin(),
            end_px: Point2::origin(),
        }
    }

    fn start(mode: Mode, share: f64) -> Mode {
        Mode {
            frequency_hz: share * mode.frequency_hz,
            damping: 0.04,
        }
    }

    /// A trunk and a branch on it, 0.70 and 0.76 Hz: less than a bin of these 10 s apart. Fitted
    /// one after the other the first takes part of the second.
    #[test]
    fn modes_that_lie_close_together_are_fitted_together() {
        let times_s: Vec<f64> = (0..150).map(|k| f64::from(k) / 15.0).collect();
        let modes = [(0.70, 0.03), (0.76, 0.05)].map(|(frequency_hz, damping)| Mode {
            frequency_hz,
            damping,
        });
        for from in [Start::Rest, Start::Moving] {
            let columns = modes.map(|m| m.columns(&times_s, from));
            let arms = [
                (3.0, 0.0),
                (4.0, 0.0),
                (5.0, 0.0),
                (6.0, 2.0),
                (6.5, 3.0),
                (7.0, 4.0),
            ];
            let points = arms.map(|arms| point(arms, &columns));
            let decay = Decay::new(times_s.clone(), from, Bounds::new(0.3, 5.0), points.into());
            let branches = vec![
                branch(None, None),
                branch(Some(0), Some(start(modes[0], 0.97))),
                branch(Some(1), Some(start(modes[1], 1.03))),
            ];
            let mut tree = Tree {
                decay: &decay,
                branches,
                branch_of: vec![1, 1, 1, 2, 2, 2],
            };
            tree.refit(&[1, 2], &[1, 2], 30);
            for (branch, mode) in tree.branches[1..].iter().zip(&modes) {
                let found = branch.mode.unwrap();
                assert!(
                    (found.frequency_hz / mode.frequency_hz - 1.0).abs() < 2e-3,
                    "{found:?} for {mode:?}"
                );
                assert!(
                    (found.damping / mode.damping - 1.0).abs() < 0.05,
                    "{found:?} for {mode:?}"
                );
            }
        }
    }
}
