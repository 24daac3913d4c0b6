//! Points, the tree that they are on, and what it costs to say so.

use super::super::columns::{Qr, dot};
use super::super::decay::{Mode, Start};

/// Values that count as one, of a point: what is left of it is branches that are not told and what
/// is not linear, alike from frame to frame.
pub(super) const VALUES: f64 = 80.0;
/// What a point must gain by each mode that it has, and a mode by being there: twice logarithms of
/// likelihood.
pub(super) const PER_POINT: f64 = 8.0;
pub(super) const PER_MODE: f64 = 30.0;
/// Damping of branches: median, and standard deviation of the logarithm.
const USUAL_DAMPING: f64 = 0.05;
const DAMPING_SD: f64 = 0.8;
/// What it costs a point to be farther from the others of a branch than is usual: per square of the
/// distance, and at most; and where there are no others.
const FAR: f64 = 4.0;
const FARTHEST: f64 = 9.0;
const ALONE: f64 = 200.0;
/// The neighbour by which distance is told, and what is usual of it.
const NEIGHBOUR: usize = 3;
const USUAL: f64 = 2.5;

/// One point.
pub(super) struct Point {
    /// Displacement to the right and down from the mean, px.
    pub values: [Vec<f64>; 2],
    /// Sum of their squares, and of those of noise, px².
    squares: f64,
    floor: f64,
    /// Mean place, px.
    pub at_px: [f64; 2],
}

impl Point {
    pub fn new(values: [Vec<f64>; 2], at_px: [f64; 2], least_noise_px: f64) -> Self {
        let third = |w: &[f64]| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0];
        let thirds = || values.iter().flat_map(|v| v.windows(4).map(third));
        // The squares of 1, 3, 3, 1 make 20.
        let noise =
            thirds().map(|d| d * d).sum::<f64>() / (20.0 * (thirds().count() as f64).max(1.0));
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
    pub frequencies_hz: [f64; 2],
    pub points: Vec<Point>,
    /// Distance at which a point is as far from the others as is usual, px.
    usual_px: f64,
}

impl Decay {
    pub fn new(
        times_s: Vec<f64>,
        start: Start,
        frequencies_hz: [f64; 2],
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
        let mut near: Vec<f64> = all
            .iter()
            .map(|&p| decay.distance_px(p, &all, NEIGHBOUR + 1))
            .collect();
        near.sort_unstable_by(f64::total_cmp);
        decay.usual_px = USUAL * near.get(near.len() / 2).copied().unwrap_or(1.0).max(1.0);
        decay
    }

    /// From point `p` to the `k`-th nearest of `others`, or to the farthest if there are fewer, px.
    fn distance_px(&self, p: usize, others: &[usize], k: usize) -> f64 {
        let mut nearest: Vec<f64> = Vec::with_capacity(k + 1);
        for &o in others {
            let (a, b) = (self.points[p].at_px, self.points[o].at_px);
            let d = (a[0] - b[0]).hypot(a[1] - b[1]);
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
    /// Where it ends, px, and those begin that it carries.
    pub end_px: [f64; 2],
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
        let ones = std::iter::once(vec![1.0; self.decay.times_s.len()]);
        let modes = of.iter().filter_map(|b| self.branches[*b].mode.as_ref());
        let columns = ones
            .chain(modes.flat_map(|m| self.decay.columns(m)))
            .collect();
        Design {
            of,
            qr: Qr::new(columns),
        }
    }

    /// Squares of a point that a design leaves, with those of noise, px².
    pub fn left(&self, design: &Design, point: usize) -> f64 {
        let point = &self.decay.points[point];
        let taken = |y: &Vec<f64>| design.qr.q.iter().map(|q| dot(q, y).powi(2)).sum::<f64>();
        (point.squares - point.values.iter().map(taken).sum::<f64>()).max(0.0) + point.floor
    }

    /// What it costs `points` to be on `branch`.
    pub fn costs(&self, branch: usize, points: &[usize]) -> Vec<f64> {
        let design = self.design(branch);
        let modes = design.of.len() as f64;
        points
            .iter()
            .map(|&p| VALUES * self.left(&design, p).ln() + PER_POINT * modes)
            .collect()
    }

    /// What some branches cost with their own points and modes.
    pub fn cost(&self, branches: &[usize]) -> f64 {
        let of = |&b: &usize| {
            let points = self.own(b);
            let own: f64 = if points.is_empty() {
                0.0
            } else {
                self.costs(b, &points).iter().sum()
            };
            own + self.branches[b]
                .mode
                .map_or(0.0, |m| PER_MODE + unusual(&m))
        };
        branches.iter().map(of).sum()
    }

    /// What it costs points to be where they are in the picture if they are on `branch`.
    pub fn far(&self, branch: usize, points: &[usize]) -> Vec<f64> {
        let others = self.all(branch);
        let of = |&p: &usize| {
            if others.is_empty() {
                return ALONE;
            }
            let d = self.decay.distance_px(p, &others, NEIGHBOUR) / self.decay.usual_px;
            FAR * (d * d).min(FARTHEST)
        };
        points.iter().map(of).collect()
    }
}

/// What a damping costs that branches hardly have.
pub(super) fn unusual(mode: &Mode) -> f64 {
    ((mode.damping / USUAL_DAMPING).ln() / DAMPING_SD).powi(2)
}

/// How that changes with the logarithm of the damping, by half: slope and curvature.
pub(super) fn unusual_slope(mode: &Mode) -> [f64; 2] {
    let curvature = 1.0 / (DAMPING_SD * DAMPING_SD);
    [(mode.damping / USUAL_DAMPING).ln() * curvature, curvature]
}
