//! Several captures side by side: the same branch under different force, or several trees (Hu et
//! al. sect. 5.4).

use super::matching::{Landmark, Match, MatchedBy, View, is_same_mode, matched};
use super::study::{Branch, Study};
use crate::model::{Interval, Sway};

/// Captures are of one tree if this share of the branches that could be found again is found again,
/// and of different ones if at most the other; in between, and of fewer branches than this, it
/// cannot be told by places. Made films of one tree had 36 to 59 %, those of two 8 to 42 %.
const SAME_TREE: f64 = 0.7;
const OTHER_TREE: f64 = 0.25;
const LEAST_BRANCHES: usize = 5;
/// They are of one tree, too, if so many branches in the same place have the same frequency, and
/// they are the most of those that have one in both. Of 98 pairs of made films of two trees 3 had
/// one.
const LEAST_ALIKE: usize = 2;

/// Several captures beside the first.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Whether all are of one tree, and whether the user said so; `None` where that cannot be told,
    /// and nothing but the trunks is compared.
    pub same_tree: Option<bool>,
    pub said: bool,
    /// For every capture but the first, the share of branches found again; of the capture that has
    /// fewer.
    pub shares: Vec<f64>,
    /// The branches of the tree, those of the first capture first; the trunk alone unless all are
    /// of one tree.
    pub rows: Vec<Row>,
    /// For every capture but the first, by number: branches that the first one does not have.
    pub left_over: Vec<Vec<u32>>,
}

/// One branch in all captures.
#[derive(Clone, Debug)]
pub struct Row {
    /// Its number in the capture that shows it first.
    pub name: u32,
    /// What became of it in every capture.
    pub matches: Vec<Match>,
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
        let (log, half) = log_change(a, b)?;
        Some(Self {
            percent: percent_of_log(log, half),
            beyond: log.abs() > half,
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

/// The logarithm of the second value over the first, and half of its 95 % interval.
pub(super) fn log_change(a: &Interval, b: &Interval) -> Option<(f64, f64)> {
    let half = Interval::Z * log_deviation(a)?.hypot(log_deviation(b)?);
    Some(((b.value / a.value).ln(), half))
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
    let landmarks = Tree::of(first).landmarks;
    let (mut shares, mut each) = (Vec::new(), Vec::new());
    for other in others {
        let matches = matched(&landmarks, first.size_px(), other).matches;
        let found = matches.iter().filter_map(Match::off_by_place).count();
        let fewer = first.branches.len().min(other.branches.len());
        let share = found as f64 / fewer.max(1) as f64;
        shares.push(share);
        each.push(
            if sways_alike(first, other, &matches) || has_its_markers(&matches) {
                Some(true)
            } else {
                told(share, fewer)
            },
        );
    }
    let same = same_tree.or(all_one_tree(&each));
    let rows = match same {
        Some(true) => branch_rows(first, others),
        _ => trunk_row(first, others).into_iter().collect(),
    };
    let mut left_over = Vec::with_capacity(others.len());
    for (k, other) in others.iter().enumerate() {
        left_over.push(match same {
            Some(true) => not_in_first(&rows, k + 1, other),
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

/// Whether the branches in the same place have the same frequencies, which by chance those of two
/// trees do not have. Other frequencies say nothing: a tree may have grown leaves.
fn sways_alike(first: &Study, other: &Study, matches: &[Match]) -> bool {
    let (mut alike, mut both) = (0, 0);
    for (branch, m) in first.branches.iter().zip(matches) {
        let there = m.branch().and_then(|j| other.branches[j].known());
        if let Some((a, b)) = branch.known().zip(there) {
            both += 1;
            alike += usize::from(is_same_mode(&a.frequency_hz, &b.frequency_hz));
        }
    }
    alike >= LEAST_ALIKE && 2 * alike > both
}

/// Whether so many branches end in markers of the same names and about the same places, as by chance they do not.
fn has_its_markers(matches: &[Match]) -> bool {
    let named = matches.iter().filter(|m| m.is_by_name());
    named.count() >= LEAST_ALIKE
}

/// Whether all captures are of the first one's tree: one that is of another is enough for trees to
/// be several.
fn all_one_tree(told: &[Option<bool>]) -> Option<bool> {
    if told.contains(&Some(false)) {
        return Some(false);
    }
    told.iter().all(|t| *t == Some(true)).then_some(true)
}

/// A row for each branch of one tree, wherever it was seen first.
fn branch_rows(first: &Study, others: &[Study]) -> Vec<Row> {
    let mut tree = Tree::of(first);
    for other in others {
        tree.add(other);
    }
    tree.rows
}

/// The branches of one tree that its captures so far have shown.
struct Tree {
    rows: Vec<Row>,
    /// By row.
    landmarks: Vec<Landmark>,
    /// In the first capture.
    size_px: f64,
    captures: usize,
}

impl Tree {
    /// As the first capture shows it.
    fn of(first: &Study) -> Self {
        let mut tree = Self {
            rows: Vec::new(),
            landmarks: Vec::new(),
            size_px: first.size_px(),
            captures: 0,
        };
        for branch in 0..first.branches.len() {
            tree.push(first, branch, &View::first());
        }
        tree.captures = 1;
        tree
    }

    /// Matches one more capture with all branches so far, and adds those that it shows first. One
    /// that may be a known branch is not added: it would make the next capture unclear, too.
    fn add(&mut self, other: &Study) {
        let found = matched(&self.landmarks, self.size_px, other);
        let known = self.rows.iter_mut().zip(&mut self.landmarks);
        let mut is_new: Vec<bool> = found.unclear.iter().map(|unclear| !unclear).collect();
        for ((row, landmark), m) in known.zip(found.matches) {
            row.matches.push(m);
            if let Some(branch) = m.branch() {
                let sway = other.branches[branch].known();
                let frequency_hz = sway.map(|s| s.frequency_hz);
                landmark.frequency_hz = landmark.frequency_hz.or(frequency_hz);
                is_new[branch] = false;
            }
        }
        for (branch, is_new) in is_new.into_iter().enumerate() {
            if is_new {
                self.push(other, branch, &found.view);
            }
        }
        self.captures += 1;
    }

    /// A branch that the capture after those so far shows first.
    fn push(&mut self, study: &Study, branch: usize, view: &View) {
        let seen = &study.branches[branch];
        let is_trunk = study.trunk() == Some(branch);
        let mut matches = vec![Match::Missing; self.captures];
        matches.push(Match::First { branch });
        self.rows.push(Row {
            name: seen.name,
            matches,
        });
        self.landmarks.push(Landmark::of(seen, view, is_trunk));
    }
}

/// The trunks of several trees.
fn trunk_row(first: &Study, others: &[Study]) -> Option<Row> {
    let trunk = first.trunk()?;
    let mut matches = vec![Match::First { branch: trunk }];
    for other in others {
        matches.push(match other.trunk() {
            Some(branch) => Match::Found {
                branch,
                // Pictures of different trees do not lie on each other.
                off: f64::NAN,
                by: MatchedBy::Trunk,
            },
            None => Match::Missing,
        });
    }
    Some(Row {
        name: first.branches[trunk].name,
        matches,
    })
}

/// Names of the branches of capture `k` that are none of the first one's.
fn not_in_first(rows: &[Row], k: usize, study: &Study) -> Vec<u32> {
    let of_first = rows.iter().filter(|row| row.is_in_first());
    let taken: Vec<usize> = of_first.filter_map(|r| r.matches[k].branch()).collect();
    let left = study.branches.iter().enumerate();
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

impl Comparison {
    /// The branches that the first capture has; none where it cannot be told whether all are of one
    /// tree.
    pub fn rows_of_first(&self) -> impl Iterator<Item = &Row> {
        let rows = self.rows.iter().filter(|row| row.is_in_first());
        rows.filter(|_| self.same_tree.is_some())
    }
}

impl Row {
    /// Whether the first capture has it.
    fn is_in_first(&self) -> bool {
        matches!(self.matches.first(), Some(Match::First { .. }))
    }

    /// What it is called in the capture that shows it first.
    pub fn called(&self, studies: &[Study]) -> String {
        let first = (0..studies.len()).find_map(|k| self.branch(studies, k));
        first.map_or_else(|| self.name.to_string(), Branch::called)
    }

    /// The branch in capture `k`, the first being 0.
    pub fn branch<'a>(&self, studies: &'a [Study], k: usize) -> Option<&'a Branch> {
        let branch = self.matches.get(k)?.branch()?;
        studies.get(k)?.branches.get(branch)
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
    use crate::report::tests::{TREE, set_frequency, study};
    use nalgebra::Point2;

    /// The branches of the tree at these places, from nearer or farther away.
    fn seen(scale: f64, branches: &[usize]) -> Study {
        let tips = branches.iter().map(|&k| scale * TREE[k]);
        study(&tips.collect::<Vec<Point2<f64>>>())
    }

    fn in_all(row: &Row) -> Vec<Option<usize>> {
        row.matches.iter().map(Match::branch).collect()
    }

    /// The first capture lacks branch 3, which both others have.
    #[test]
    fn a_third_capture_is_matched_with_what_the_second_shows_first() {
        let studies = [
            seen(1.0, &[0, 1, 2, 4, 5]),
            seen(0.8, &[0, 3, 1, 2, 4, 5]),
            seen(1.2, &[0, 1, 2, 3, 4]),
        ];
        let comparison = compare(&studies, None).unwrap();
        assert_eq!(comparison.same_tree, Some(true));
        assert_eq!(comparison.rows_of_first().count(), 5);
        assert_eq!(comparison.left_over, [vec![2], vec![4]]);
        let rows: Vec<_> = comparison.rows.iter().map(in_all).collect();
        assert_eq!(
            rows,
            [
                [Some(0), Some(0), Some(0)],
                [Some(1), Some(2), Some(1)],
                [Some(2), Some(3), Some(2)],
                [Some(3), Some(4), Some(4)],
                [Some(4), Some(5), None],
                [None, Some(1), Some(3)],
            ]
        );
        let new = &comparison.rows[5].matches;
        assert_eq!(new[..2], [Match::Missing, Match::First { branch: 1 }]);
    }

    /// Two places of five are no evidence, two frequencies are.
    #[test]
    fn the_same_frequencies_tell_one_tree() {
        let first = seen(1.0, &[0, 1, 2, 3, 4]);
        let mut other = study(&[TREE[0], TREE[1], TREE[2], -TREE[4], -TREE[5]]);
        for (hz, expected) in [([0.5, 1.2], Some(true)), ([0.5, 1.5], None)] {
            let mut first = first.clone();
            for branch in 0..2 {
                set_frequency(&mut first, branch, [0.5, 1.2][branch]);
                set_frequency(&mut other, branch, hz[branch]);
            }
            let studies = [first, other.clone()];
            assert_eq!(compare(&studies, None).unwrap().same_tree, expected);
        }
    }

    #[test]
    fn of_different_trees_the_trunks_alone_are_compared() {
        let studies = [seen(1.0, &[0, 1, 2]), seen(1.0, &[0, 1, 2])];
        for same_tree in [Some(false), None] {
            let comparison = compare(&studies, same_tree).unwrap();
            let rows: Vec<_> = comparison.rows.iter().map(in_all).collect();
            assert_eq!(
                (comparison.same_tree, rows),
                (same_tree, vec![vec![Some(0); 2]])
            );
        }
    }

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
