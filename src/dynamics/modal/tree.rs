//! Points, the tree that they are on, and what it costs to say so.

use super::super::decay::{Mode, Start, damping_penalty};
use crate::bounds::Bounds;
use crate::signal::median;
use crate::signal::qr::Qr;
use crate::signal::statistics::noise_variance;
use crate::signal::vectors::dot;
use nalgebra::Point2;

/// Values that count as one, of a point: what is left of it is branches that are not told and what
/// is not linear, alike from frame to frame.
pub(super) const EFFECTIVE_VALUES: f64 = 80.0;
/// What a point must gain by each mode that it has, and a mode by being there: twice logarithms of
/// likelihood.
pub(super) const COST_PER_POINT: f64 = 8.0;
pub(super) const COST_PER_MODE: f64 = 30.0;
/// What it costs a point to be farther from the others of a branch than is usual: per square of the
/// distance, and at most; and where there are no others.
const COST_PER_DISTANCE: f64 = 4.0;
const MAX_SQUARE_DISTANCE: f64 = 9.0;
const COST_ALONE: f64 = 200.0;
/// The neighbour that distance is measured to, and how many times its median is usual.
const NEIGHBOUR: usize = 3;
const USUAL_OF_MEDIAN: f64 = 2.5;

/// One point.
pub(super) struct Point {
    /// Displacement to the right and down from the mean, px.
    pub values: [Vec<f64>; 2],
    /// Sum of their squares, px².
    squares: f64,
    /// That of noise, px².
    pub floor: f64,
    /// Mean place, px.
    pub at_px: Point2<f64>,
}

impl Point {
    pub fn new(values: [Vec<f64>; 2], at_px: Point2<f64>, least_noise_px: f64) -> Self {
        let noise = noise_variance(values.iter().map(Vec::as_slice));
        let floor = 2.0 * (2 * values[0].len()) as f64 * noise.max(least_noise_px * least_noise_px);
        let squares = values.iter().map(|v| dot(v, v)).sum();
        Self {
            values,
            squares,
            floor,
            at_px,
        }
    }
}

/// What does not change while a tree is looked for.
pub(super) struct Decay {
    /// From the release, s.
    pub times_s: Vec<f64>,
    pub start: Start,
    pub frequencies_hz: Bounds,
    pub points: Vec<Point>,
    /// Distance at which a point is as far from the others as is usual, px.
    usual_px: f64,
}

impl Decay {
    pub fn new(
        times_s: Vec<f64>,
        start: Start,
        frequencies_hz: Bounds,
        points: Vec<Point>,
    ) -> Self {
        let mut decay = Self {
            times_s,
            start,
            frequencies_hz,
            points,
            usual_px: 1.0,
        };
        let all: Vec<usize> = (0..decay.points.len()).collect();
        let distances = all
            .iter()
            .map(|&p| decay.distance_px(p, &all, NEIGHBOUR + 1));
        let middle_px = median(distances.collect(), f64::total_cmp).unwrap_or(1.0);
        decay.usual_px = USUAL_OF_MEDIAN * middle_px.max(1.0);
        decay
    }

    /// From point `p` to the `k`-th nearest of `others`, or to the farthest if there are fewer, px.
    fn distance_px(&self, p: usize, others: &[usize], k: usize) -> f64 {
        let mut nearest: Vec<f64> = Vec::with_capacity(k + 1);
        for &o in others {
            let way = self.points[p].at_px - self.points[o].at_px;
            let d = way.x.hypot(way.y);
            nearest.insert(nearest.partition_point(|n| *n <= d), d);
            nearest.truncate(k);
        }
        nearest.last().copied().unwrap_or(0.0)
    }

    pub fn columns(&self, mode: &Mode) -> Vec<Vec<f64>> {
        mode.columns(&self.times_s, self.start)
    }
}

/// A branch of the tree, or a joint of the captured one that has no mode of its own.
#[derive(Clone, Debug)]
pub(super) struct Branch {
    /// Nothing for the foot, which comes first; every branch comes after the one that carries it.
    pub parent: Option<usize>,
    pub mode: Option<Mode>,
    /// Where it begins and ends, px; most that it carries begin at its end.
    pub base_px: Point2<f64>,
    pub end_px: Point2<f64>,
}

/// Every point on one branch, with the modes of that branch and of all that carry it.
#[derive(Clone)]
pub(super) struct Tree<'a> {
    pub decay: &'a Decay,
    pub branches: Vec<Branch>,
    /// Of every point.
    pub branch_of: Vec<usize>,
}

/// The modes that the points of one branch have, as columns.
pub(super) struct Design {
    /// The branches whose modes they are, from the foot up; their columns come after one of ones.
    pub of: Vec<usize>,
    pub qr: Qr,
}

impl Tree<'_> {
    pub fn carries(&self, above: usize, mut branch: usize) -> bool {
        // Parents come first.
        while branch > above {
            let Some(parent) = self.branches[branch].parent else {
                return false;
            };
            branch = parent;
        }
        branch == above
    }

    /// `branch` and all on it.
    pub fn within(&self, branch: usize) -> Vec<usize> {
        (branch..self.branches.len())
            .filter(|&b| self.carries(branch, b))
            .collect()
    }

    /// Points of `branch` itself.
    pub fn own(&self, branch: usize) -> Vec<usize> {
        (0..self.branch_of.len())
            .filter(|&p| self.branch_of[p] == branch)
            .collect()
    }

    /// Points of `branch` and of all on it.
    pub fn all(&self, branch: usize) -> Vec<usize> {
        let within = self.within(branch);
        (0..self.branch_of.len())
            .filter(|&p| within.binary_search(&self.branch_of[p]).is_ok())
            .collect()
    }

    /// The branches with modes that carry `branch`, itself included, from the foot up.
    pub fn modes_of(&self, branch: usize) -> Vec<usize> {
        let mut out: Vec<usize> = std::iter::successors(Some(branch), |b| self.branches[*b].parent)
            .filter(|b| self.branches[*b].mode.is_some())
            .collect();
        out.reverse();
        out
    }

    pub fn design(&self, branch: usize) -> Design {
        let of = self.modes_of(branch);
        let qr = Qr::new(self.columns_of(&of));
        Design { of, qr }
    }

    /// A column of ones, then those of the modes of some branches.
    pub fn columns_of(&self, branches: &[usize]) -> Vec<Vec<f64>> {
        let mut columns = vec![vec![1.0; self.decay.times_s.len()]];
        for mode in branches.iter().filter_map(|b| self.branches[*b].mode) {
            columns.extend(self.decay.columns(&mode));
        }
        columns
    }

    /// Squares of a point that a design leaves, with those of noise, px².
    pub fn left(&self, design: &Qr, point: usize) -> f64 {
        let point = &self.decay.points[point];
        let taken: f64 = point.values.iter().map(|y| design.explained(y)).sum();
        (point.squares - taken).max(0.0) + point.floor
    }

    /// What it costs `points` to be on `branch`.
    pub fn costs(&self, branch: usize, points: &[usize]) -> Vec<f64> {
        let design = self.design(branch);
        let modes = design.of.len() as f64;
        points
            .iter()
            .map(|&p| EFFECTIVE_VALUES * self.left(&design.qr, p).ln() + COST_PER_POINT * modes)
            .collect()
    }

    /// What some branches cost with their own points and modes.
    pub fn cost(&self, branches: &[usize]) -> f64 {
        let mut cost = 0.0;
        for &b in branches {
            let points = self.own(b);
            if !points.is_empty() {
                cost += self.costs(b, &points).iter().sum::<f64>();
            }
            if let Some(mode) = self.branches[b].mode {
                cost += COST_PER_MODE + damping_penalty(mode.damping.ln());
            }
        }
        cost
    }

    /// What it costs points to be where they are in the picture if they are on `branch`.
    pub fn far(&self, branch: usize, points: &[usize]) -> Vec<f64> {
        let others = self.all(branch);
        if others.is_empty() {
            return vec![COST_ALONE; points.len()];
        }
        let mut costs = Vec::with_capacity(points.len());
        for &p in points {
            let d = self.decay.distance_px(p, &others, NEIGHBOUR) / self.decay.usual_px;
            costs.push(COST_PER_DISTANCE * (d * d).min(MAX_SQUARE_DISTANCE));
        }
        costs
    }
}
