//! Several captures side by side: the same branch under different force, or several trees (Hu et
//! al. sect. 5.4).

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
        let half = Interval::Z * log_deviation(a)?.hypot(log_deviation(b)?);
        let ratio = (b.value / a.value).ln();
        Some(Self {
            percent: percent_of_log(ratio, half),
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

/// Standard deviation of a value's logarithm by its 95 % interval; `None` if it is not above 0.
fn log_deviation(i: &Interval) -> Option<f64> {
    let positive = i.lo > 0.0 && i.value > 0.0 && i.hi.is_finite() && i.hi >= i.lo;
    positive.then(|| (i.hi / i.lo).ln() / (2.0 * Interval::Z))
}

/// A difference of logarithms, with half its interval, in %.
pub(super) fn percent_of_log(log: f64, half: f64) -> Interval {
    let [value, lo, hi] = [log, log - half, log + half].map(|x| 100.0 * x.exp_m1());
    Interval { value, lo, hi }
}

/// Compares captures with the first of them; `same_tree` is what the user says. `None` for fewer
/// than two.
pub fn compare(studies: &[Study], same_tree: Option<bool>) -> Option<Comparison> {
    let (first, others) = studies
        .split_first()
        .filter(|(_, others)| !others.is_empty())?;
    let all: Vec<Vec<Match>> = others.iter().map(|other| matched(first, other)).collect();
    let (mut shares, mut by_places) = (Vec::new(), Vec::new());
    for (matches, other) in all.iter().zip(others) {
        let found = matches.iter().filter(|m| m.branch().is_some()).count();
        let fewer = first.branches.len().min(other.branches.len());
        let share = found as f64 / fewer.max(1) as f64;
        shares.push(share);
        by_places.push(told(share, fewer));
    }
    let same = same_tree.or(all_one_tree(&by_places));
    let rows = match same {
        Some(true) => branch_rows(first, &all),
        Some(false) => trunk_row(first, others).into_iter().collect(),
        None => Vec::new(),
    };
    let mut left_over = Vec::with_capacity(others.len());
    for (k, other) in others.iter().enumerate() {
        left_over.push(match same {
            Some(true) => in_no_row(&rows, k, other),
            _ => Vec::new(),
        });
    }
    Some(Comparison {
        same_tree: same,
        said: same_tree.is_some(),
        shares,
        rows,
        left_over,
    })
}

/// Whether all captures are of the first one's tree: one that is of another is enough for trees to
/// be several.
fn all_one_tree(told: &[Option<bool>]) -> Option<bool> {
    if told.contains(&Some(false)) {
        return Some(false);
    }
    told.iter().all(|t| *t == Some(true)).then_some(true)
}

/// A row for each branch of the first capture; `matches` are those of each other capture.
fn branch_rows(first: &Study, matches: &[Vec<Match>]) -> Vec<Row> {
    let mut rows = Vec::with_capacity(first.branches.len());
    for (i, branch) in first.branches.iter().enumerate() {
        rows.push(Row {
            name: branch.name,
            first: i,
            others: matches.iter().map(|m| m[i]).collect(),
        });
    }
    rows
}

/// The trunks of several trees.
fn trunk_row(first: &Study, others: &[Study]) -> Option<Row> {
    let trunk = trunk_of(first)?;
    let mut found = Vec::with_capacity(others.len());
    for other in others {
        found.push(match trunk_of(other) {
            Some(branch) => Match::Found { branch, off: 0.0 },
            None => Match::Missing,
        });
    }
    Some(Row {
        name: first.branches[trunk].name,
        first: trunk,
        others: found,
    })
}

/// Index of the branch that nothing carries.
fn trunk_of(study: &Study) -> Option<usize> {
    study.branches.iter().position(|b| b.parent.is_none())
}

/// Names of the branches of capture `k` after the first that stand in no row.
fn in_no_row(rows: &[Row], k: usize, other: &Study) -> Vec<u32> {
    let taken: Vec<usize> = rows.iter().filter_map(|r| r.others[k].branch()).collect();
    let left = other.branches.iter().enumerate();
    left.filter(|(j, _)| !taken.contains(j))
        .map(|(_, b)| b.name)
        .collect()
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
            Some(other) => study.branches.get(self.others.get(other)?.branch()?),
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

    /// An interval that goes half of its length on logarithms either way.
    fn at(value: f64, half: f64) -> Interval {
        Interval {
            value,
            lo: value * (-half).exp(),
            hi: value * half.exp(),
        }
    }

    fn change(a: Interval, b: Interval) -> Change {
        Change::between(&a, &b).unwrap()
    }

    #[test]
    fn a_difference_counts_only_beyond_both_intervals() {
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
