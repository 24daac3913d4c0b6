//! Which branch of one capture is which of the other captures of the same tree.
//!
//! A capture names its branches as it finds them, and cuts them into pieces at forks that another
//! one does not see, so that neither numbers nor ends say much across captures. What lasts is where
//! the points on a branch and on all that it carries lie in the picture: from the trunk's foot, in
//! sizes of the tree, so that camera and zoom may differ. The trunk is the trunk wherever it ends;
//! and where two branches are about as near, the one that sways at the same frequency is meant. A branch that ends in a
//! coloured marker is the one whose marker has the same name.

use super::compare::log_change;
use super::study::{Branch, Study};
use crate::model::Interval;
use nalgebra::{Point2, Vector2, distance};

/// A branch may have moved by this share of the tree's size from one capture to the next.
const FARTHEST: f64 = 0.08;
/// Another branch that is at most so many times as far makes it unclear which one is meant, unless
/// it is as near as this. With 1.3 a third of the pairs of 4 made trees were lost, and no fewer of
/// the others were wrong.
const AS_NEAR: f64 = 1.15;
const NEAR: f64 = 0.02;
/// How often the pictures are laid on each other anew, by so many branches at least.
const ROUNDS: usize = 3;
const LEAST_PAIRS: usize = 3;
/// The trunk's foot, which both pictures show, says as much of how they lie on each other as so
/// many branches: without it a few wrong pairs move a picture onto more of them.
const FOOT_PAIRS: usize = 10;
/// Sizes of two films of one tree are as its farthest branches that were seen, which need not be
/// the same ones.
const SIZES: [f64; 5] = [1.0, 0.9, 1.1, 0.8, 1.25];
/// Markers of the same name are the same if they are no farther apart: who picks them anew may do it in another order.
const FARTHEST_NAMED: f64 = 3.0 * FARTHEST;
/// Frequencies are the same if they differ by no more than their intervals allow, or by this share.
const SAME_FREQUENCY: f64 = 0.02;

/// What a branch of the captures so far is known again by.
#[derive(Clone, Debug)]
pub struct Landmark {
    /// Where the points on it lie, px from the trunk's foot, and how far about that, both as in the
    /// first capture's picture.
    pub centre_px: Point2<f64>,
    pub spread_px: f64,
    /// Of its sway, in the first capture that tells it.
    pub frequency_hz: Option<Interval>,
    /// Whether it is the trunk.
    pub is_trunk: bool,
    /// The marker that it ends in, by the name that the user gave it.
    pub marker: Option<String>,
}

/// What a branch was known again by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MatchedBy {
    /// They end in markers of the same name.
    Name,
    /// Both are the trunk.
    Trunk,
    /// They stand in the same place.
    Place,
    /// Of several in about the same place they are those with the same frequency.
    Mode,
}

/// What became of a branch in a capture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Match {
    /// It is the branch of that place in [`Study::branches`], and none of an earlier capture.
    First { branch: usize },
    /// It is the branch of that place; `off` is how far the two are apart, as a share of the tree's
    /// size.
    Found {
        branch: usize,
        off: f64,
        by: MatchedBy,
    },
    /// There is none near enough.
    Missing,
    /// Two are as near.
    Unclear,
}

/// Another capture beside the branches that are known.
#[derive(Clone, Debug)]
pub struct Matched {
    /// What became of every known branch; no branch of the capture stands twice.
    pub matches: Vec<Match>,
    /// Whether each branch of the capture may be a known one, but it is unclear which.
    pub unclear: Vec<bool>,
    /// How the capture's picture lies on the first one's.
    pub view: View,
}

/// Where another capture's picture lies on the first one's: its places times `scale` and on by
/// `shift`, px.
#[derive(Clone, Copy, Debug)]
pub struct View {
    scale: f64,
    shift: Vector2<f64>,
}

impl MatchedBy {
    /// One word for files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Name => "name",
            Self::Trunk => "trunk",
            Self::Place => "place",
            Self::Mode => "mode",
        }
    }
}

impl Match {
    /// The branch that was found.
    pub fn branch(&self) -> Option<usize> {
        match self {
            Self::First { branch } | Self::Found { branch, .. } => Some(*branch),
            Self::Missing | Self::Unclear => None,
        }
    }

    /// Whether it ends in the marker of the same name.
    pub fn is_by_name(&self) -> bool {
        matches!(
            self,
            Self::Found {
                by: MatchedBy::Name,
                ..
            }
        )
    }

    /// How far it is off, if its place alone shows which branch it is.
    pub fn off_by_place(&self) -> Option<f64> {
        match self {
            Self::Found { off, by, .. } if *by != MatchedBy::Mode && *off <= FARTHEST => Some(*off),
            _ => None,
        }
    }
}

impl Landmark {
    /// A branch as seen in a capture whose picture lies so on the first one's.
    pub fn of(branch: &Branch, view: &View, is_trunk: bool) -> Self {
        Self {
            centre_px: view.place(branch.centre_from_foot_px),
            spread_px: view.scale * branch.spread_px,
            frequency_hz: branch.known().map(|sway| sway.frequency_hz),
            is_trunk,
            marker: branch.marker.clone(),
        }
    }
}

impl View {
    /// The first capture's own.
    pub fn first() -> Self {
        Self {
            scale: 1.0,
            shift: Vector2::zeros(),
        }
    }

    fn place(&self, p: Point2<f64>) -> Point2<f64> {
        self.scale * p + self.shift
    }

    /// The scale and shift by which the branches that were found lie on each other best; the same
    /// for few of them.
    fn refined(&self, known: &[Landmark], other: &Study, found: &[Match]) -> Self {
        // The places of a branch here and there.
        let mut pairs: Vec<[Point2<f64>; 2]> = Vec::new();
        for (landmark, m) in known.iter().zip(found) {
            if m.off_by_place().is_some()
                && let Some(there) = m.branch()
            {
                let there = &other.branches[there];
                pairs.push([landmark.centre_px, there.centre_from_foot_px]);
            }
        }
        let enough = pairs.len() >= LEAST_PAIRS;
        pairs.extend([[Point2::origin(); 2]; FOOT_PAIRS]);
        let n = pairs.len() as f64;
        let [a, b] = [0, 1].map(|k| {
            let sum: Vector2<f64> = pairs.iter().map(|p| p[k].coords).sum();
            Point2::from(sum / n)
        });
        let (mut products, mut squares) = (0.0, 0.0);
        for [p, q] in &pairs {
            let (p, q) = (p - a, q - b);
            products += p.dot(&q);
            squares += q.norm_squared();
        }
        let scale = (products / n) / (squares / n);
        if !enough || !scale.is_finite() || scale <= 0.0 {
            return *self;
        }
        Self {
            scale,
            shift: a - scale * b,
        }
    }

    /// How far a branch lies from a known one, as a share of the tree's size; no number where it has
    /// no points.
    fn off(&self, a: &Landmark, b: &Branch, size_px: f64) -> f64 {
        let centres = distance(&a.centre_px, &self.place(b.centre_from_foot_px));
        let spreads = a.spread_px - self.scale * b.spread_px;
        centres.hypot(spreads) / size_px
    }
}

/// What became of every one of the `known` branches in `other`; `size_px` is the tree's in the
/// first capture.
pub fn matched(known: &[Landmark], size_px: f64, other: &Study) -> Matched {
    // A camera that stood still, and one that did not.
    let ratio = size_px / other.size_px();
    let scales = std::iter::once(1.0).chain(SIZES.iter().map(|s| s * ratio));
    let mut best: Option<Matched> = None;
    for scale in scales.filter(|scale| scale.is_finite()) {
        let start = View {
            scale,
            shift: Vector2::zeros(),
        };
        let mut tried = Table::new(known, other, start, size_px).matched();
        for _ in 0..ROUNDS {
            let view = tried.view.refined(known, other, &tried.matches);
            tried = Table::new(known, other, view, size_px).matched();
        }
        if best.as_ref().is_none_or(|best| tried.is_better_than(best)) {
            best = Some(tried);
        }
    }
    best.unwrap_or_else(|| Matched {
        matches: vec![Match::Missing; known.len()],
        unclear: vec![false; other.branches.len()],
        view: View::first(),
    })
}

impl Matched {
    /// Whether more branches stand in the same place, or as many and nearer.
    fn is_better_than(&self, other: &Self) -> bool {
        let [(own, own_off), (others, others_off)] = [self, other].map(Self::by_place);
        own > others || own == others && own_off < others_off
    }

    /// How many branches stand in the same place, and how far they are off together.
    fn by_place(&self) -> (usize, f64) {
        let offs = self.matches.iter().filter_map(Match::off_by_place);
        (offs.clone().count(), offs.sum())
    }
}

/// All known branches against all of another capture while they are matched.
struct Table<'a> {
    known: &'a [Landmark],
    other: &'a Study,
    view: View,
    /// By known branch and branch of the capture: how far they are apart, as a share of the tree's
    /// size.
    off: Vec<Vec<f64>>,
    /// By known branch: what became of it.
    matches: Vec<Match>,
    /// By branch of the capture: whether it stands for a known one; and whether it stood in doubt.
    taken: Vec<bool>,
    unclear: Vec<bool>,
}

impl<'a> Table<'a> {
    fn new(known: &'a [Landmark], other: &'a Study, view: View, size_px: f64) -> Self {
        let mut off: Vec<Vec<f64>> = Vec::with_capacity(known.len());
        for a in known {
            let row = other.branches.iter().map(|b| view.off(a, b, size_px));
            off.push(row.collect());
        }
        Self {
            known,
            other,
            view,
            off,
            matches: vec![Match::Missing; known.len()],
            taken: vec![false; other.branches.len()],
            unclear: vec![false; other.branches.len()],
        }
    }

    /// Markers first, then the trunk, then the nearest pairs.
    fn matched(mut self) -> Matched {
        for (i, landmark) in self.known.iter().enumerate() {
            if let Some(j) = landmark
                .marker
                .as_ref()
                .and_then(|name| self.marked(i, name))
            {
                self.take(i, j, MatchedBy::Name);
            }
        }
        let trunk = self.known.iter().position(|a| a.is_trunk);
        if let Some((i, j)) = trunk.zip(self.other.trunk())
            && self.is_open(i)
            && !self.taken[j]
        {
            self.take(i, j, MatchedBy::Trunk);
        }
        for (i, j) in self.near_pairs() {
            if self.is_open(i) && !self.taken[j] {
                self.decide(i, j);
            }
        }
        Matched {
            matches: self.matches,
            unclear: self.unclear,
            view: self.view,
        }
    }

    /// The branch of the capture that ends in the marker of this name, if it may be the known branch `i`.
    fn marked(&self, i: usize, name: &str) -> Option<usize> {
        let mut branches = self.other.branches.iter();
        let j = branches.position(|b| b.marker.as_deref() == Some(name))?;
        (self.off[i][j] <= FARTHEST_NAMED && !self.taken[j]).then_some(j)
    }

    /// Pairs that are near enough to be one branch, the nearest first.
    fn near_pairs(&self) -> Vec<(usize, usize)> {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (i, row) in self.off.iter().enumerate() {
            let near = row.iter().enumerate().filter(|(_, off)| **off <= FARTHEST);
            pairs.extend(near.map(|(j, off)| (*off, i, j)));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        pairs.into_iter().map(|(_, i, j)| (i, j)).collect()
    }

    /// Whether a known branch may still be found.
    fn is_open(&self, i: usize) -> bool {
        self.matches[i] == Match::Missing
    }

    fn take(&mut self, i: usize, j: usize, by: MatchedBy) {
        self.matches[i] = Match::Found {
            branch: j,
            off: self.off[i][j],
            by,
        };
        self.taken[j] = true;
        self.unclear[j] = false;
    }

    /// Decides on the nearest pair of those that are left.
    fn decide(&mut self, i: usize, j: usize) {
        let off = self.off[i][j];
        let there: Vec<usize> = (0..self.taken.len())
            .filter(|&k| k != j && !self.taken[k] && is_rival(self.off[i][k], off))
            .collect();
        let here: Vec<usize> = (0..self.matches.len())
            .filter(|&k| k != i && self.is_open(k) && is_rival(self.off[k][j], off))
            .collect();
        if there.is_empty() && here.is_empty() {
            self.take(i, j, MatchedBy::Place);
            return;
        }
        let rivals_alike =
            there.iter().any(|&k| self.is_alike(i, k)) || here.iter().any(|&k| self.is_alike(k, j));
        match (self.is_alike(i, j), rivals_alike) {
            (true, false) => self.take(i, j, MatchedBy::Mode),
            // A rival's turn comes later.
            (false, true) => self.unclear[j] = true,
            _ => {
                self.matches[i] = Match::Unclear;
                self.unclear[j] = true;
            }
        }
    }

    /// Whether a known branch and one of the capture sway at the same frequency.
    fn is_alike(&self, i: usize, j: usize) -> bool {
        let known = self.known[i].frequency_hz;
        let there = self.other.branches[j].known().map(|s| s.frequency_hz);
        known.zip(there).is_some_and(|(a, b)| is_same_mode(&a, &b))
    }
}

/// Whether two frequencies may be one.
pub fn is_same_mode(a: &Interval, b: &Interval) -> bool {
    log_change(a, b).is_some_and(|(log, half)| log.abs() <= half.max(SAME_FREQUENCY))
}

/// Whether a branch that is `d` away makes it unclear that the one `off` away is meant.
fn is_rival(d: f64, off: f64) -> bool {
    d < AS_NEAR * off && off > NEAR
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::tests::{TREE, set_frequency, study};

    /// What became of the branches of `first` in `other`.
    fn matches(first: &Study, other: &Study) -> Vec<Match> {
        let mut known = Vec::new();
        for (i, branch) in first.branches.iter().enumerate() {
            let is_trunk = first.trunk() == Some(i);
            known.push(Landmark::of(branch, &View::first(), is_trunk));
        }
        matched(&known, first.size_px(), other).matches
    }

    fn found(matches: &[Match]) -> Vec<Option<usize>> {
        matches.iter().map(Match::branch).collect()
    }

    /// Two markers that nearly change places are known by their names.
    #[test]
    fn markers_of_the_same_name_are_the_same() {
        let mut named = [study(&TREE[..3]), study(&TREE[..3])];
        let [near, other] = [1, 2].map(|k| TREE[k]);
        for (k, at) in [
            (1, near + (other - near) * 0.8),
            (2, other + (near - other) * 0.8),
        ] {
            named[1].branches[k].centre_from_foot_px = at;
        }
        let by_place = matches(&named[0], &named[1]);
        assert_eq!(found(&by_place), [Some(0), Some(2), Some(1)]);
        for study in &mut named {
            for (branch, name) in study.branches.iter_mut().zip(["A", "B", "C"]) {
                branch.marker = Some(name.to_owned());
            }
        }
        let by_name = matches(&named[0], &named[1]);
        assert_eq!(found(&by_name), [Some(0), Some(1), Some(2)]);
        assert!(by_name.iter().all(Match::is_by_name), "{by_name:?}");
        // Far away a name says nothing.
        named[1].branches[1].centre_from_foot_px = TREE[5];
        let far = matches(&named[0], &named[1])[1];
        assert!(!far.is_by_name(), "{far:?}");
    }

    fn by(m: &Match) -> Option<MatchedBy> {
        match m {
            Match::Found { by, .. } => Some(*by),
            _ => None,
        }
    }

    /// The second film is from farther away, its outline's foot lies elsewhere, and it was cut into
    /// branches in another order.
    #[test]
    fn a_tree_seen_from_farther_away_and_with_another_foot_is_the_same_tree() {
        let order = [0, 5, 4, 2, 1];
        let other: Vec<Point2<f64>> = order
            .iter()
            .map(|&k| Point2::new(0.7 * TREE[k].x + 6.0, 0.7 * TREE[k].y - 9.0))
            .collect();
        let matches = matches(&study(&TREE), &study(&other));
        assert_eq!(
            found(&matches),
            [Some(0), Some(4), Some(3), None, Some(2), Some(1)]
        );
        assert_eq!(matches[3], Match::Missing);
        assert_eq!(by(&matches[1]), Some(MatchedBy::Place));
    }

    /// In the second capture the points on the trunk lie much lower, and there is a branch where
    /// they lay in the first one.
    #[test]
    fn the_trunk_is_the_trunk_wherever_it_stands() {
        let mut other = TREE.to_vec();
        other[0] = Point2::new(0.0, 40.0);
        other.push(TREE[0]);
        let matches = matches(&study(&TREE), &study(&other));
        assert_eq!(found(&matches), [0, 1, 2, 3, 4, 5].map(Some));
        assert_eq!(by(&matches[0]), Some(MatchedBy::Trunk));
        assert_eq!(matches[0].off_by_place(), None);
    }

    /// Two branches of the second capture, places 4 and 6, are as near to branch 4 of the first.
    fn with_two_as_near() -> [Study; 2] {
        let mut other = TREE.to_vec();
        other[4] = Point2::new(58.0, 230.0);
        other.push(Point2::new(82.0, 231.0));
        [study(&TREE), study(&other)]
    }

    /// Where two grow together it is not guessed which one is meant.
    #[test]
    fn a_branch_with_two_as_near_is_unclear() {
        let [first, other] = with_two_as_near();
        let matches = matches(&first, &other);
        assert_eq!(matches[4], Match::Unclear);
        assert_eq!(found(&matches)[..4], [Some(0), Some(1), Some(2), Some(3)]);
    }

    /// What branch 4 becomes if it sways at 1.5 Hz and the two that are as near at these.
    fn with_frequencies(near_hz: [Option<f64>; 2]) -> Match {
        let [mut first, mut other] = with_two_as_near();
        set_frequency(&mut first, 4, 1.5);
        for (branch, hz) in [4, 6].into_iter().zip(near_hz) {
            if let Some(hz) = hz {
                set_frequency(&mut other, branch, hz);
            }
        }
        matches(&first, &other)[4]
    }

    #[test]
    fn of_two_as_near_the_one_with_the_same_frequency_is_meant() {
        for (near_hz, expected) in [
            ([Some(1.51), Some(2.2)], Some(4)),
            ([Some(2.2), Some(1.51)], Some(6)),
            ([None, Some(1.49)], Some(6)),
            ([Some(1.5), Some(1.5)], None),
            ([Some(1.6), Some(2.2)], None),
            ([None, None], None),
        ] {
            let m = with_frequencies(near_hz);
            assert_eq!(m.branch(), expected, "{near_hz:?}");
            assert_eq!(by(&m), expected.map(|_| MatchedBy::Mode), "{near_hz:?}");
        }
    }

    /// Where the place is plain the frequency may be another: that is what captures are compared
    /// for.
    #[test]
    fn a_branch_in_its_place_is_found_whatever_its_frequency() {
        let [mut first, mut other] = [study(&TREE), study(&TREE)];
        set_frequency(&mut first, 2, 1.0);
        set_frequency(&mut other, 2, 1.4);
        set_frequency(&mut other, 3, 1.0);
        let matches = matches(&first, &other);
        assert_eq!(found(&matches), [0, 1, 2, 3, 4, 5].map(Some));
        assert_eq!(by(&matches[2]), Some(MatchedBy::Place));
    }

    #[test]
    fn nothing_is_found_in_a_tree_without_branches() {
        assert_eq!(found(&matches(&study(&TREE), &study(&[]))), [None; 6]);
        assert!(matches(&study(&[]), &study(&TREE)).is_empty());
    }
}
