//! Modes that points have beyond those of the branch that they are on.

use super::super::columns::dot;
use super::super::decay::Mode;
use super::tree::{Decay, Design, PER_POINT, Tree, VALUES};

/// Frequencies that are tried per factor of e, up to which, Hz, and dampings.
const PER_E: f64 = 33.0;
const HIGHEST_HZ: f64 = 4.5;
const DAMPING: [f64; 3] = [0.02, 0.05, 0.1];
/// A column of which less is left than this share, when the others are taken off, adds nothing that
/// could be told from them.
const ALIKE: f64 = 0.04;
/// What a point must gain by a mode to have it clearly.
pub(super) const CLEAR: f64 = 5.0;
/// A mode is a branch's if this share of its points, and of the points of every branch on it with
/// so many, gains so much.
const SHARE: f64 = 0.75;
const IN_PART: usize = 3;
const GAIN: f64 = 16.0;
/// Points that a branch must have.
pub(super) const LEAST: usize = 4;

/// The modes that are tried, as columns.
pub(super) struct Tried(Vec<(Mode, Vec<Vec<f64>>)>);

/// A mode that some of the points have.
pub(super) struct Found {
    pub mode: Mode,
    /// What it gains in all.
    pub worth: f64,
    pub points: Vec<usize>,
}

impl Tried {
    pub fn new(decay: &Decay) -> Self {
        let [lo, hi] = decay.frequencies_hz;
        let n = (PER_E * (hi.min(HIGHEST_HZ) / lo).ln()).max(0.0) as usize;
        let frequencies_hz = (0..=n).map(|k| lo * (k as f64 / PER_E).exp());
        let modes = frequencies_hz.flat_map(|frequency_hz| {
            DAMPING.map(|damping| Mode {
                frequency_hz,
                damping,
            })
        });
        Self(modes.map(|m| (m, decay.columns(&m))).collect())
    }
}

/// Some points with the same modes, and what those leave of them.
struct Rests {
    design: Design,
    points: Vec<usize>,
    left: Vec<f64>,
    rests: Vec<[Vec<f64>; 2]>,
}

impl Rests {
    fn new(tree: &Tree, branch: usize, points: Vec<usize>) -> Self {
        let design = tree.design(branch);
        let left = points.iter().map(|&p| tree.left(&design, p)).collect();
        let rests = points
            .iter()
            .map(|&p| [0, 1].map(|c| design.qr.solve(&tree.decay.points[p].values[c]).0))
            .collect();
        Self {
            design,
            points,
            left,
            rests,
        }
    }

    /// What a mode with these columns takes off; nothing if it could not be told from what the
    /// points have.
    fn taken(&self, columns: &[Vec<f64>]) -> Vec<f64> {
        let by: Vec<Vec<f64>> = columns
            .iter()
            .map(|c| self.design.qr.q.iter().map(|q| dot(q, c)).collect())
            .collect();
        let product = |a: usize, b: usize| dot(&columns[a], &columns[b]) - dot(&by[a], &by[b]);
        let alone = |k: usize| product(k, k) < ALIKE * ALIKE * dot(&columns[k], &columns[k]);
        if (0..columns.len()).any(alone) {
            return vec![0.0; self.points.len()];
        }
        let first = product(0, 0);
        let second = (columns.len() > 1).then(|| {
            let both = product(0, 1);
            (both / first, product(1, 1) - both * both / first)
        });
        let of = |y: &Vec<f64>| {
            let a = dot(&columns[0], y);
            let more = second.map_or(0.0, |(share, own)| {
                let b = dot(&columns[1], y) - share * a;
                if own > ALIKE * ALIKE * first {
                    b * b / own
                } else {
                    0.0
                }
            });
            a * a / first + more
        };
        self.rests
            .iter()
            .map(|uv| uv.iter().map(of).sum())
            .collect()
    }
}

impl Tree<'_> {
    /// The mode that nearly all points of `branch` and of what is on it have beyond theirs.
    pub fn common_mode(&self, branch: usize, tried: &Tried) -> Option<Mode> {
        let within = self.within(branch);
        let rests: Vec<Rests> = within
            .iter()
            .map(|&b| (b, self.own(b)))
            .filter(|(_, p)| !p.is_empty())
            .map(|(b, p)| Rests::new(self, b, p))
            .collect();
        // Of every branch on this one that is large enough: which of the groups are its.
        let parts: Vec<Vec<usize>> = within
            .iter()
            .filter(|&&b| self.branches[b].parent == Some(branch) && self.all(b).len() >= IN_PART)
            .map(|&b| {
                let all = self.all(b);
                (0..rests.len())
                    .filter(|&g| all.binary_search(&rests[g].points[0]).is_ok())
                    .collect()
            })
            .collect();
        let worth = |columns: &[Vec<f64>]| -> Option<f64> {
            let gains: Vec<Vec<f64>> = rests
                .iter()
                .map(|r| {
                    r.taken(columns)
                        .iter()
                        .zip(&r.left)
                        .map(|(t, l)| VALUES * t / l)
                        .collect()
                })
                .collect();
            let shared = |groups: &mut dyn Iterator<Item = usize>| {
                let mut all: Vec<f64> = groups.flat_map(|g| gains[g].iter().copied()).collect();
                all.sort_unstable_by(f64::total_cmp);
                all.get(((1.0 - SHARE) * all.len().saturating_sub(1) as f64) as usize)
                    .is_some_and(|g| *g > GAIN)
            };
            let all_have = shared(&mut (0..gains.len()))
                && parts.iter().all(|p| shared(&mut p.iter().copied()));
            all_have.then(|| gains.iter().flatten().map(|g| (g / GAIN).ln_1p()).sum())
        };
        let best = tried
            .0
            .iter()
            .filter_map(|(m, columns)| Some((worth(columns)?, m)));
        best.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, m)| *m)
    }

    /// The mode that some of the `points` of `branch` itself have beyond theirs.
    pub fn mode_of_some(&self, branch: usize, points: Vec<usize>, tried: &Tried) -> Option<Found> {
        let rests = Rests::new(self, branch, points);
        let mut best: Option<(f64, &Mode, Vec<usize>)> = None;
        for (mode, columns) in &tried.0 {
            let taken = rests.taken(columns);
            let gain =
                |(taken, left): (&f64, &f64)| -VALUES * (1.0 - taken / left).ln() - PER_POINT;
            let each: Vec<f64> = taken.iter().zip(&rests.left).map(gain).collect();
            let worth = each.iter().map(|g| g.max(0.0)).sum();
            let clear: Vec<usize> = (0..each.len())
                .filter(|&i| each[i] > CLEAR)
                .map(|i| rests.points[i])
                .collect();
            if clear.len() >= LEAST && best.as_ref().is_none_or(|b| worth > b.0) {
                best = Some((worth, mode, clear));
            }
        }
        best.map(|(worth, mode, points)| Found {
            mode: *mode,
            worth,
            points,
        })
    }
}
