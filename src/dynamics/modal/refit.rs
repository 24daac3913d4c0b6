//! Frequencies and dampings of many branches at once, every point with the modes that it has:
//! variable projection with Kaufman's Jacobian, as for one branch (fit.rs).

use super::super::columns::{Qr, dot};
use super::super::decay::Mode;
use super::tree::{Tree, VALUES, unusual, unusual_slope};
use nalgebra::{DMatrix, DVector};

/// How far a step may go: logarithms of frequency and damping.
const STEP: [f64; 2] = [0.05, 0.5];
const DAMPING: [f64; 2] = [0.003, 0.3];
/// Tries of a shorter step, and a gain that is worth another step.
const TRIES: usize = 5;
const WORTH: f64 = 0.5;

/// Normal equations of the modes of some branches: logarithms of frequency and damping of each in
/// turn.
pub(super) struct Normal {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Normal {
    /// Standard deviations of the logarithms, as far as the curvature tells them.
    pub fn deviations(self) -> Option<Vec<f64>> {
        let inverse = self.hessian.cholesky()?.inverse();
        Some(
            inverse
                .diagonal()
                .iter()
                .map(|v| v.max(0.0).sqrt())
                .collect(),
        )
    }
}

impl Tree<'_> {
    /// Fits the modes of `free` to the points of the branches `within`; the other modes stay.
    pub fn refit(&mut self, free: &[usize], within: &[usize], rounds: usize) {
        let free: Vec<usize> = free
            .iter()
            .copied()
            .filter(|&b| self.branches[b].mode.is_some())
            .collect();
        let groups: Vec<(usize, Vec<usize>)> = within
            .iter()
            .map(|&b| (b, self.own(b)))
            .filter(|(_, points)| !points.is_empty())
            .collect();
        if free.is_empty() || groups.is_empty() {
            return;
        }
        let weights = self.weights(&groups);
        let mut cost = self.squares(&free, &groups, &weights);
        let mut damped = 1e-3;
        for _ in 0..rounds {
            let normal = self.normal(&free, &groups, &weights);
            let before: Vec<Option<Mode>> = free.iter().map(|&b| self.branches[b].mode).collect();
            let mut gained = None;
            for _ in 0..TRIES {
                let Some(step) = normal.step(damped) else {
                    break;
                };
                for (k, &b) in free.iter().enumerate() {
                    let moved = |m: Mode| {
                        let x = m.parameters();
                        let to = |i: usize, limits: [f64; 2]| {
                            let step = step[2 * k + i].clamp(-STEP[i], STEP[i]);
                            (x[i] + step).clamp(limits[0].ln(), limits[1].ln())
                        };
                        Mode::of_parameters(&[to(0, self.decay.frequencies_hz), to(1, DAMPING)])
                    };
                    self.branches[b].mode = before[k].map(moved);
                }
                let there = self.squares(&free, &groups, &weights);
                if there < cost {
                    gained = Some(cost - there);
                    cost = there;
                    damped = (damped / 5.0).max(1e-6);
                    break;
                }
                damped *= 8.0;
            }
            if gained.is_none() {
                free.iter()
                    .zip(before)
                    .for_each(|(&b, mode)| self.branches[b].mode = mode);
            }
            if gained.is_none_or(|g| g < WORTH) {
                break;
            }
        }
    }

    /// The normal equations of all modes where they are.
    pub fn all_normal(&self) -> (Vec<usize>, Normal) {
        let all: Vec<usize> = (0..self.branches.len()).collect();
        let free: Vec<usize> = all
            .iter()
            .copied()
            .filter(|&b| self.branches[b].mode.is_some())
            .collect();
        let groups: Vec<(usize, Vec<usize>)> = all.iter().map(|&b| (b, self.own(b))).collect();
        let weights = self.weights(&groups);
        let normal = self.normal(&free, &groups, &weights);
        (free, normal)
    }

    /// By group and point: what one square counts.
    fn weights(&self, groups: &[(usize, Vec<usize>)]) -> Vec<Vec<f64>> {
        let of = |(b, points): &(usize, Vec<usize>)| {
            let design = self.design(*b);
            points
                .iter()
                .map(|&p| VALUES / self.left(&design, p))
                .collect()
        };
        groups.iter().map(of).collect()
    }

    fn squares(&self, free: &[usize], groups: &[(usize, Vec<usize>)], weights: &[Vec<f64>]) -> f64 {
        let of = |((b, points), weights): (&(usize, Vec<usize>), &Vec<f64>)| {
            let design = self.design(*b);
            points
                .iter()
                .zip(weights)
                .map(|(&p, w)| w * self.left(&design, p))
                .sum::<f64>()
        };
        let left: f64 = groups.iter().zip(weights).map(of).sum();
        left + free
            .iter()
            .filter_map(|&b| self.branches[b].mode)
            .map(|m| unusual(&m))
            .sum::<f64>()
    }

    fn normal(
        &self,
        free: &[usize],
        groups: &[(usize, Vec<usize>)],
        weights: &[Vec<f64>],
    ) -> Normal {
        let n = 2 * free.len();
        let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for ((branch, points), weights) in groups.iter().zip(weights) {
            let of = self.modes_of(*branch);
            if !of.iter().any(|b| free.contains(b)) {
                continue;
            }
            let slopes = self.slopes(&of, free, points, weights);
            for (x, a) in slopes.iter().enumerate() {
                gradient[a.parameter] += dot(&a.slope, &a.rests);
                for b in &slopes[..=x] {
                    let shares: f64 = a.factors.iter().zip(&b.factors).map(|(a, b)| a * b).sum();
                    let product = dot(&a.slope, &b.slope) * shares;
                    hessian[(a.parameter, b.parameter)] += product;
                    if !std::ptr::eq(a, b) {
                        hessian[(b.parameter, a.parameter)] += product;
                    }
                }
            }
        }
        for (k, &b) in free.iter().enumerate() {
            let Some(mode) = self.branches[b].mode else {
                continue;
            };
            let [slope, curvature] = unusual_slope(&mode);
            gradient[2 * k + 1] -= slope;
            hessian[(2 * k + 1, 2 * k + 1)] += curvature;
        }
        Normal { hessian, gradient }
    }

    /// How the columns of the modes of the branches `of` that are `free` change with their
    /// parameters, and what that does to some points.
    fn slopes(
        &self,
        of: &[usize],
        free: &[usize],
        points: &[usize],
        weights: &[f64],
    ) -> Vec<Slope> {
        let mut columns = vec![vec![1.0; self.decay.times_s.len()]];
        let mut raw: Vec<(usize, usize, Vec<f64>)> = Vec::new();
        for b in of {
            let Some(mode) = self.branches[*b].mode else {
                continue;
            };
            let at = free.iter().position(|f| f == b);
            for (column, slopes) in mode.columns_and_slopes(&self.decay.times_s, self.decay.start) {
                let [by_frequency, by_damping] = slopes.by_mode;
                raw.extend(at.map(|k| (2 * k, columns.len(), by_frequency)));
                raw.extend(at.map(|k| (2 * k + 1, columns.len(), by_damping)));
                columns.push(column);
            }
        }
        let qr = Qr::new(columns);
        let signals: Vec<(Vec<f64>, Vec<f64>, f64)> = points
            .iter()
            .zip(weights)
            .flat_map(|(&p, w)| {
                self.decay.points[p]
                    .values
                    .iter()
                    .map(move |y| (y, w.sqrt()))
            })
            .map(|(y, w)| {
                let (rest, factors) = qr.solve(y);
                (rest, factors, w)
            })
            .collect();
        let slope = |(parameter, column, slope): (usize, usize, Vec<f64>)| {
            let factors: Vec<f64> = signals.iter().map(|(_, f, w)| f[column] * w).collect();
            let mut rests = vec![0.0; slope.len()];
            for ((rest, _, w), factor) in signals.iter().zip(&factors) {
                rests
                    .iter_mut()
                    .zip(rest)
                    .for_each(|(sum, r)| *sum += factor * w * r);
            }
            Slope {
                parameter,
                slope: qr.solve(&slope).0,
                factors,
                rests,
            }
        };
        raw.into_iter().map(slope).collect()
    }
}

/// How one column changes with a parameter.
struct Slope {
    parameter: usize,
    /// Beyond what the columns themselves can do.
    slope: Vec<f64>,
    /// Of the column in every signal, times the root of its weight.
    factors: Vec<f64>,
    /// What is left of the signals, summed with the column's factors and weights.
    rests: Vec<f64>,
}

impl Normal {
    fn step(&self, damped: f64) -> Option<DVector<f64>> {
        let mut hessian = self.hessian.clone();
        for k in 0..hessian.nrows() {
            hessian[(k, k)] += damped * hessian[(k, k)] + 1e-9;
        }
        Some(hessian.cholesky()?.solve(&self.gradient))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tree::{Branch, Decay, Point};
    use super::*;
    use crate::dynamics::Start;

    /// A trunk and a branch on it, 0.70 and 0.76 Hz: less than a bin of these 10 s apart. Fitted
    /// one after the other the first takes part of the second.
    #[test]
    fn modes_that_lie_close_together_are_fitted_together() {
        let times_s: Vec<f64> = (0..150).map(|k| f64::from(k) / 15.0).collect();
        let modes = [(0.70, 0.03), (0.76, 0.05)].map(|(frequency_hz, damping)| Mode {
            frequency_hz,
            damping,
        });
        for start in [Start::Rest, Start::Moving] {
            let columns = modes.map(|m| m.columns(&times_s, start));
            let point = |arm: f64, own: f64| {
                let u: Vec<f64> = (0..times_s.len())
                    .map(|t| arm * columns[0][0][t] + own * columns[1][0][t])
                    .collect();
                let v = u.iter().map(|x| 0.2 * x).collect();
                Point::new([u, v], [arm, own], 0.03)
            };
            let arms = [
                (3.0, 0.0),
                (4.0, 0.0),
                (5.0, 0.0),
                (6.0, 2.0),
                (6.5, 3.0),
                (7.0, 4.0),
            ];
            let points = arms.map(|(arm, own)| point(arm, own));
            let decay = Decay::new(times_s.clone(), start, [0.3, 5.0], points.into());
            let branch = |parent: Option<usize>, mode: Option<Mode>| Branch {
                parent,
                mode,
                end_px: [0.0; 2],
            };
            let off = |m: Mode, share: f64| {
                Some(Mode {
                    frequency_hz: share * m.frequency_hz,
                    damping: 0.04,
                })
            };
            let branches = vec![
                branch(None, None),
                branch(Some(0), off(modes[0], 0.97)),
                branch(Some(1), off(modes[1], 1.03)),
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
