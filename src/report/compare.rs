//! Several captures side by side: the same branch under different force, or several trees (Hu
//! et al. sect. 5.4).

use super::matching::{Match, matched};
use super::study::Study;
use crate::model::{Interval, Sway};

/// Captures are of one tree if this share of the branches that could be found again is found again,
/// and of different ones if at most the other; in between, and of fewer branches than this, it
/// cannot be told. Films of one tree had from 35 % on, those of two trees up to 43 %.
const SAME_TREE: f64 = 0.7;
const OTHER_TREE: f64 = 0.25;
const LEAST_BRANCHES: usize = 5;

/// Several captures beside the first.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Whether all are of one tree, and whether the user said so; `None` where that cannot be told,
    /// and nothing is compared.
    pub same_tree: Option<bool>,
    pub said: bool,
    /// For every capture but the first, the share of branches found again; of the capture that has
    /// fewer.
    pub shares: Vec<f64>,
    /// The first capture's branches; of several trees, the trunks alone; none where it is unknown
    /// which of both it is.
    pub rows: Vec<Row>,
    /// For every capture but the first, by number: branches that stand in no row.
    pub left_over: Vec<Vec<u32>>,
}

/// One branch in all captures.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its number in the first capture.
    pub name: u32,
    /// Its place in the first capture's branches, and what became of it in every other capture.
    pub first: usize,
    pub others: Vec<Match>,
}

/// How a value differs between two captures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The second against the first, %, with its 95 % interval.
    pub percent: Interval,
    /// Whether it is beyond what the two values' own intervals allow.
    pub beyond: bool,
}

impl Change {
    /// Of two values with 95 % intervals that are even on logarithms and independent of each other.
    /// `None` where one is not above 0.
    pub fn between(a: &Interval, b: &Interval) -> Option<Self> {
        let positive =
            |i: &Interval| i.lo > 0.0 && i.value > 0.0 && i.hi.is_finite() && i.hi >= i.lo;
        if !positive(a) || !positive(b) {
            return None;
        }
        let sd = |i: &Interval| (i.hi / i.lo).ln() / (2.0 * Interval::Z);
        let (ratio, half) = ((b.value / a.value).ln(), Interval::Z * sd(a).hypot(sd(b)));
        let percent = |log: f64| 100.0 * log.exp_m1();
        let percent = Interval {
            value: percent(ratio),
            lo: percent(ratio - half),
            hi: percent(ratio + half),
        };
        Some(Self {
            percent,
            beyond: ratio.abs() > half,
        })
    }

    /// Of the frequency of one branch in two captures.
    pub fn of_frequency(a: &Sway, b: &Sway) -> Option<Self> {
        Self::between(&a.frequency_hz, &b.frequency_hz)
    }

    /// Of its damping.
    pub fn of_damping(a: &Sway, b: &Sway) -> Option<Self> {
        Self::between(&a.damping_ratio?, &b.damping_ratio?)
    }
}

/// Compares captures with the first of them; `same_tree` is what the user says. `None` for fewer
/// than two.
pub fn compare(studies: &[Study], same_tree: Option<bool>) -> Option<Comparison> {
    let (first, others) = studies
        .split_first()
        .filter(|(_, others)| !others.is_empty())?;
    let all: Vec<Vec<Match>> = others.iter().map(|other| matched(first, other)).collect();
    let found = |m: &Vec<Match>| {
        m.iter()
            .filter(|m| matches!(m, Match::Found { .. }))
            .count()
    };
    let fewer = |other: &Study| first.branches.len().min(other.branches.len());
    let share = |(m, other): (&Vec<Match>, &Study)| found(m) as f64 / fewer(other).max(1) as f64;
    let shares: Vec<f64> = all.iter().zip(others).map(share).collect();
    let told: Vec<Option<bool>> = shares
        .iter()
        .zip(others)
        .map(|(share, other)| told(*share, fewer(other)))
        .collect();
    // One that is another tree is enough for trees to be several.
    let by_places = if told.contains(&Some(false)) {
        Some(false)
    } else {
        told.iter().all(|t| *t == Some(true)).then_some(true)
    };
    let same = same_tree.or(by_places);
    let row = |(i, branch): (usize, &super::Branch)| Row {
        name: branch.name,
        first: i,
        others: all.iter().map(|m| m[i]).collect(),
    };
    let trunk = |other: &Study| {
        let at = other.branches.iter().position(|b| b.parent.is_none());
        at.map_or(Match::Missing, |branch| Match::Found { branch, off: 0.0 })
    };
    let rows: Vec<Row> = match same {
        Some(true) => first.branches.iter().enumerate().map(row).collect(),
        Some(false) => {
            let trunks = first
                .branches
                .iter()
                .enumerate()
                .filter(|(_, b)| b.parent.is_none())
                .take(1);
            trunks
                .map(|(i, b)| Row {
                    name: b.name,
                    first: i,
                    others: others.iter().map(trunk).collect(),
                })
                .collect()
        }
        None => Vec::new(),
    };
    let left_over = others
        .iter()
        .enumerate()
        .map(|(k, other)| {
            let taken = |j: usize| {
                rows.iter()
                    .any(|r| matches!(r.others[k], Match::Found { branch, .. } if branch == j))
            };
            let left = other
                .branches
                .iter()
                .enumerate()
                .filter(|(j, _)| same == Some(true) && !taken(*j));
            left.map(|(_, b)| b.name).collect()
        })
        .collect();
    Some(Comparison {
        same_tree: same,
        said: same_tree.is_some(),
        shares,
        rows,
        left_over,
    })
}

/// Whether two captures are of one tree, by the share of `branches` that stand in the same place;
/// `None` where that is no evidence.
fn told(share: f64, branches: usize) -> Option<bool> {
    match share {
        _ if branches < LEAST_BRANCHES => None,
        s if s >= SAME_TREE => Some(true),
        s if s <= OTHER_TREE => Some(false),
        _ => None,
    }
}

impl Row {
    /// The branch in capture `k`, the first being 0.
    pub fn branch<'a>(&self, studies: &'a [Study], k: usize) -> Option<&'a super::Branch> {
        let study = studies.get(k)?;
        match k.checked_sub(1) {
            None => study.branches.get(self.first),
            Some(other) => match self.others.get(other)? {
                Match::Found { branch, .. } => study.branches.get(*branch),
                Match::Missing | Match::Unclear => None,
            },
        }
    }

    /// Whether it has a frequency in at least one capture.
    pub fn is_told(&self, studies: &[Study]) -> bool {
        (0..studies.len()).any(|k| self.sway(studies, k).is_some())
    }

    /// What is known of its sway in capture `k`.
    pub fn sway(&self, studies: &[Study], k: usize) -> Option<Sway> {
        self.branch(studies, k)?.known()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An oak beside its own first eight seconds had 35 %, two different trees 43 %: neither is a
    /// reason to compare them branch by branch, or not to.
    #[test]
    fn weak_evidence_is_no_answer() {
        assert_eq!(
            [0.9, 0.52, 0.35, 0.43, 0.1].map(|s| told(s, 30)),
            [Some(true), None, None, None, Some(false)]
        );
        assert_eq!((told(1.0, 3), told(0.0, 1)), (None, None));
    }

    #[test]
    fn a_difference_counts_only_beyond_both_intervals() {
        let at = |value: f64, half: f64| Interval {
            value,
            lo: value * (-half).exp(),
            hi: value * half.exp(),
        };
        let change = |a, b| Change::between(&a, &b).unwrap();
        // Half intervals of 3 and 4 % make one of 5 %.
        assert!(!change(at(1.0, 0.03), at(1.049, 0.04)).beyond);
        let far = change(at(1.0, 0.03), at(1.06, 0.04));
        assert!(far.beyond && far.percent.lo > 0.0, "{far:?}");
        assert!((far.percent.value - 6.0).abs() < 1e-9);
        assert!(change(at(2.0, 0.001), at(1.0, 0.001)).percent.hi < -49.0);
        assert_eq!(
            Change::between(
                &at(1.0, 0.1),
                &Interval {
                    value: 1.0,
                    lo: 0.0,
                    hi: 2.0
                }
            ),
            None
        );
    }
}
