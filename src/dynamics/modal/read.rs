//! What a tree of modes says of its branches.

use super::super::branches::LnDeviations;
use super::super::decay::Mode;
use super::super::signals::Factor;
use super::super::swing::Arms;
use super::search::MIN_POINTS;
use super::tree::{EFFECTIVE_VALUES, Tree};
use crate::signal::qr::Qr;
use crate::signal::statistics::nth_smallest;
use crate::signal::vectors::{add_scaled, dot};
use nalgebra::Point2;
use std::ops::Range;

/// What a point must gain by a mode to be taken for one that has it.
const MIN_GAIN: f64 = 10.0;
/// Points that have a mode are of one branch if it moves them as one swing, and begin with those
/// that go one way, by the cosine.
const MIN_COLLINEARITY: f64 = 0.95;
const MIN_COSINE: f64 = 0.8;
/// Parts of the points that are left out in turn to see whether they agree, and rounds of each fit.
const PARTS: usize = 4;
const MAX_STEPS: usize = 8;

/// A mode and the points that it moves as one swing.
pub(super) struct ModeEstimate {
    pub mode: Mode,
    /// By the curvature alone.
    pub ln_sd: LnDeviations,
    /// Standard deviation of the logarithm of the frequency as the points themselves have it: where
    /// some are left out.
    pub jackknife_sd: f64,
    /// In order.
    pub points: Vec<usize>,
    /// What the quarter of them that gains least by the mode gains at most.
    pub gain: f64,
    pub amplitude_deg: f64,
    /// How much of the points' motion is one swing, 0 to 1.
    pub collinearity: f64,
    /// Where the branch begins, px.
    pub base_px: Point2<f64>,
}

/// What one point has of a mode.
struct Share {
    point: usize,
    gain: f64,
    /// Factors of u and v, as [`Arms`] takes them.
    factors: [Vec<Factor>; 2],
}

impl Share {
    /// Of the motion in the space of cosine and sine of u and v.
    fn direction(&self) -> [f64; 4] {
        let [u, v] = [&self.factors[0][0], &self.factors[1][0]];
        [u.cosine, u.sine, v.cosine, v.sine]
    }
}

impl Tree<'_> {
    /// The branches that can be told.
    pub fn estimates(&self) -> Vec<ModeEstimate> {
        let (of, normal) = self.all_normal_equations();
        let Some(deviations) = normal.deviations() else {
            return Vec::new();
        };
        let mut out = Vec::new();
        for (&branch, ln_sd) in of.iter().zip(deviations.chunks_exact(2)) {
            out.extend(self.estimate(branch, LnDeviations::of_parameters(ln_sd)));
        }
        out
    }

    fn estimate(&self, branch: usize, ln_sd: LnDeviations) -> Option<ModeEstimate> {
        let mode = self.branches[branch].mode?;
        let base_px = self.branches[branch].base_px;
        let shares = one_swing(self, self.shares(branch), base_px);
        if shares.len() < MIN_POINTS {
            return None;
        }
        let all: Vec<&Share> = shares.iter().collect();
        let (arms, factors) = swing_of(self, &all, base_px);
        let points: Vec<usize> = shares.iter().map(|s| s.point).collect();
        let gains: Vec<f64> = shares.iter().map(|s| s.gain).collect();
        Some(ModeEstimate {
            mode,
            ln_sd,
            jackknife_sd: self.jackknife_sd(branch, &points),
            points,
            gain: nth_smallest(gains, shares.len() / 4)?,
            amplitude_deg: arms.amplitude_deg(&factors, 0),
            collinearity: arms.one_swing(&factors, 0),
            base_px,
        })
    }

    /// Standard deviation of the logarithm of a branch's frequency by the jackknife: fitted anew
    /// without each part of its `points` in turn. Points of two branches that lie close together in
    /// frequency have a mode in common that is neither's, and without some of either's it changes.
    fn jackknife_sd(&self, branch: usize, points: &[usize]) -> f64 {
        let within = self.within(branch);
        let mut fitted = [f64::NAN; PARTS];
        for (part, ln_frequency) in fitted.iter_mut().enumerate() {
            let mut other = self.clone();
            for &p in points.iter().skip(part).step_by(PARTS) {
                // The foot has no mode.
                other.branch_of[p] = 0;
            }
            other.refit(&[branch], &within, MAX_STEPS);
            if let Some(mode) = other.branches[branch].mode {
                *ln_frequency = mode.frequency_hz.ln();
            }
        }
        let n = PARTS as f64;
        let mean = fitted.iter().sum::<f64>() / n;
        let squares: f64 = fitted.iter().map(|f| (f - mean).powi(2)).sum();
        ((n - 1.0) / n * squares).sqrt()
    }

    /// The points that have the mode of `branch`, in order.
    fn shares(&self, branch: usize) -> Vec<Share> {
        let mut out = Vec::new();
        for b in self.within(branch) {
            let points = self.own(b);
            let of = self.modes_of(b);
            let Some(place) = of.iter().position(|m| *m == branch) else {
                continue;
            };
            if points.is_empty() {
                continue;
            }
            let design = self.design(b);
            let per_mode = (design.qr.q.len() - 1) / of.len();
            let own = 1 + place * per_mode..1 + (place + 1) * per_mode;
            let others: Vec<usize> = of.iter().copied().filter(|m| *m != branch).collect();
            let without = Qr::new(self.columns_of(&others));
            for point in points {
                let left = self.left(&design.qr, point);
                let values = &self.decay.points[point].values;
                let mut taken = 0.0;
                for y in values {
                    taken += design.qr.explained(y) - without.explained(y);
                }
                out.push(Share {
                    point,
                    gain: EFFECTIVE_VALUES * (taken.max(0.0) / left).ln_1p(),
                    factors: [0, 1].map(|c| vec![factor_of(&design.qr, &values[c], &own)]),
                });
            }
        }
        out.retain(|s| s.gain > MIN_GAIN);
        out.sort_by_key(|s| s.point);
        out
    }
}

/// The factor of the mode whose columns are `own` in one signal.
fn factor_of(qr: &Qr, signal: &[f64], own: &Range<usize>) -> Factor {
    Factor::of(&qr.solve(signal).1[own.clone()])
}

fn swing_of(tree: &Tree, shares: &[&Share], base_px: Point2<f64>) -> (Arms, Vec<Vec<Factor>>) {
    let arms = Arms::at(
        shares.iter().map(|s| tree.decay.points[s.point].at_px),
        base_px,
    );
    (
        arms,
        shares
            .iter()
            .flat_map(|s| s.factors.iter().cloned())
            .collect(),
    )
}

/// As many of `shares` as are moved as one swing.
fn one_swing(tree: &Tree, shares: Vec<Share>, base_px: Point2<f64>) -> Vec<Share> {
    let all: Vec<&Share> = shares.iter().collect();
    if is_one_swing(tree, &all, base_px) {
        return shares;
    }
    let mut best: Vec<usize> = Vec::new();
    for from in &all {
        let mut some = all.clone();
        some.retain(|s| cosine(&from.direction(), &s.direction()) > MIN_COSINE);
        while some.len() > best.len().max(MIN_POINTS - 1) {
            if is_one_swing(tree, &some, base_px) {
                best = some.iter().map(|s| s.point).collect();
                break;
            }
            remove_most_oblique(&mut some);
        }
    }
    shares
        .into_iter()
        .filter(|s| best.contains(&s.point))
        .collect()
}

fn is_one_swing(tree: &Tree, shares: &[&Share], base_px: Point2<f64>) -> bool {
    let (arms, factors) = swing_of(tree, shares, base_px);
    arms.one_swing(&factors, 0) >= MIN_COLLINEARITY
}

/// Removes the one whose direction is farthest from that of all together.
fn remove_most_oblique(shares: &mut Vec<&Share>) {
    let mut sum = [0.0; 4];
    for share in shares.iter() {
        add_scaled(&mut sum, 1.0, &share.direction());
    }
    let mut least = (f64::INFINITY, 0);
    for (k, share) in shares.iter().enumerate() {
        let cosine = cosine(&sum, &share.direction());
        if cosine < least.0 {
            least = (cosine, k);
        }
    }
    shares.remove(least.1);
}

fn cosine(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt().max(f64::MIN_POSITIVE)
}
