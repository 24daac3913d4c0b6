//! What a tree of modes says of its branches.

use super::super::columns::{Qr, dot};
use super::super::decay::Mode;
use super::super::signals::Factor;
use super::super::swing::Arms;
use super::search::LEAST;
use super::tree::{Tree, VALUES};

/// What a point must gain by a mode to be taken for one that has it.
const HAS: f64 = 10.0;
/// Points that have a mode are of one branch if it moves them as one swing, and begin with those
/// that go one way, by the cosine.
const ONE_SWING: f64 = 0.95;
const ONE_WAY: f64 = 0.8;
/// Parts of the points that are left out in turn to see whether they agree, and rounds of each fit.
const PARTS: usize = 4;
const FITS: usize = 8;

/// A mode and the points that it moves as one swing.
pub(super) struct Reading {
    pub mode: Mode,
    /// Standard deviations of the logarithms of frequency and damping, by the curvature alone.
    pub sd: [f64; 2],
    /// Standard deviation of the logarithm of the frequency as the points themselves have it: where
    /// some are left out.
    pub spread: f64,
    /// In order.
    pub points: Vec<usize>,
    /// What the quarter of them that gains least by the mode gains at most.
    pub gain: f64,
    pub amplitude_deg: f64,
}

/// What one point has of a mode.
struct Share {
    point: usize,
    gain: f64,
    /// Factors of u and v, as [`Arms`] takes them.
    factors: [Vec<Factor>; 2],
}

impl Tree<'_> {
    /// The branches that can be told.
    pub fn readings(&self) -> Vec<Reading> {
        let (of, normal) = self.all_normal();
        let Some(deviations) = normal.deviations() else {
            return Vec::new();
        };
        let reading = |(k, &branch): (usize, &usize)| {
            let mode = self.branches[branch].mode?;
            let base_px = self.branches[branch]
                .parent
                .map_or([0.0; 2], |p| self.branches[p].end_px);
            let shares = one_swing(self, self.shares(branch), base_px);
            if shares.len() < LEAST {
                return None;
            }
            let mut gains: Vec<f64> = shares.iter().map(|s| s.gain).collect();
            gains.sort_unstable_by(f64::total_cmp);
            let all: Vec<&Share> = shares.iter().collect();
            let (arms, factors) = swing_of(self, &all, base_px);
            let points: Vec<usize> = shares.iter().map(|s| s.point).collect();
            Some(Reading {
                mode,
                sd: [deviations[2 * k], deviations[2 * k + 1]],
                spread: self.spread(branch, &points),
                points,
                gain: gains[gains.len() / 4],
                amplitude_deg: arms.amplitude_deg(&factors, 0),
            })
        };
        of.iter().enumerate().filter_map(reading).collect()
    }

    /// Standard deviation of the logarithm of a branch's frequency by the jackknife: fitted anew
    /// without each part of its `points` in turn. Points of two branches that lie close together in
    /// frequency have a mode in common that is neither's, and without some of either's it changes.
    fn spread(&self, branch: usize, points: &[usize]) -> f64 {
        let within = self.within(branch);
        let without = |part: usize| {
            let mut other = self.clone();
            // The foot has no mode.
            points
                .iter()
                .skip(part)
                .step_by(PARTS)
                .for_each(|&p| other.branch_of[p] = 0);
            other.refit(&[branch], &within, FITS);
            other.branches[branch]
                .mode
                .map_or(f64::NAN, |m| m.frequency_hz.ln())
        };
        let fitted: Vec<f64> = (0..PARTS).map(without).collect();
        let n = PARTS as f64;
        let mean = fitted.iter().sum::<f64>() / n;
        ((n - 1.0) / n * fitted.iter().map(|f| (f - mean).powi(2)).sum::<f64>()).sqrt()
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
            let ones = std::iter::once(vec![1.0; self.decay.times_s.len()]);
            let others = of
                .iter()
                .filter(|m| **m != branch)
                .filter_map(|m| self.branches[*m].mode.as_ref());
            let without = Qr::new(
                ones.chain(others.flat_map(|m| self.decay.columns(m)))
                    .collect(),
            );
            for point in points {
                let values = &self.decay.points[point].values;
                let squares = |qr: &Qr| {
                    values
                        .iter()
                        .flat_map(|y| qr.q.iter().map(move |q| dot(q, y).powi(2)))
                        .sum::<f64>()
                };
                let left = self.left(&design, point);
                let taken = (squares(&design.qr) - squares(&without)).max(0.0);
                let factors = [0, 1].map(|c| {
                    let f = &design.qr.solve(&values[c]).1[own.clone()];
                    let sine = f.get(1).copied().unwrap_or(0.0);
                    vec![Factor {
                        cosine: f[0],
                        sine,
                        ..Factor::default()
                    }]
                });
                out.push(Share {
                    point,
                    gain: VALUES * (taken / left).ln_1p(),
                    factors,
                });
            }
        }
        out.retain(|s| s.gain > HAS);
        out.sort_by_key(|s| s.point);
        out
    }
}

fn swing_of(tree: &Tree, shares: &[&Share], base_px: [f64; 2]) -> (Arms, Vec<Vec<Factor>>) {
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
fn one_swing(tree: &Tree, shares: Vec<Share>, base_px: [f64; 2]) -> Vec<Share> {
    let is_one = |some: &[&Share]| {
        let (arms, factors) = swing_of(tree, some, base_px);
        arms.one_swing(&factors, 0) >= ONE_SWING
    };
    let all: Vec<&Share> = shares.iter().collect();
    if is_one(&all) {
        return shares;
    }
    let way = |s: &Share| {
        [
            s.factors[0][0].cosine,
            s.factors[0][0].sine,
            s.factors[1][0].cosine,
            s.factors[1][0].sine,
        ]
    };
    let cosine = |a: &[f64; 4], b: &[f64; 4]| {
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt().max(f64::MIN_POSITIVE)
    };
    let mut best: Vec<usize> = Vec::new();
    for from in &all {
        let mut some: Vec<&Share> = all
            .iter()
            .copied()
            .filter(|s| cosine(&way(from), &way(s)) > ONE_WAY)
            .collect();
        while some.len() > best.len().max(LEAST - 1) {
            if is_one(&some) {
                best = some.iter().map(|s| s.point).collect();
                break;
            }
            let sum = some.iter().map(|s| way(s)).fold([0.0; 4], |mut sum, w| {
                sum.iter_mut().zip(w).for_each(|(s, w)| *s += w);
                sum
            });
            let cosines: Vec<f64> = some.iter().map(|s| cosine(&sum, &way(s))).collect();
            let least = (0..some.len()).min_by(|&a, &b| cosines[a].total_cmp(&cosines[b]));
            least.map(|k| some.remove(k));
        }
    }
    shares
        .into_iter()
        .filter(|s| best.contains(&s.point))
        .collect()
}
