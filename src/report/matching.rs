//! Which branch of one capture is which of another one of the same tree.
//!
//! A capture names its branches as it finds them, so that numbers say nothing across captures. What
//! lasts is where a branch stands in the picture: from the trunk's foot, in sizes of the tree, so
//! that camera and zoom may differ.

use super::study::{Branch, Study};
use nalgebra::{Point2, Vector2, distance};

/// A branch may have moved by this share of the tree's size from one capture to the next.
const FARTHEST: f64 = 0.08;
/// Another branch that is at most so many times as far makes it unclear which one is meant, unless
/// it is as near as this.
const AS_NEAR: f64 = 1.3;
const NEAR: f64 = 0.02;
/// Where a branch ends says more than where it begins: forks are seen as far up as points move
/// together.
const BASE: f64 = 0.5;
/// How often the pictures are laid on each other anew, by so many branches at least.
const ROUNDS: usize = 3;
const LEAST_PAIRS: usize = 3;
/// Sizes of two films of one tree are as its farthest branches that were seen, which need not be
/// the same ones.
const SIZES: [f64; 5] = [1.0, 0.9, 1.1, 0.8, 1.25];

/// What became of a branch of the first capture in another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Match {
    /// The branch of that place in [`Study::branches`]; `off` is how far the two are apart, as a
    /// share of the tree's size.
    Found { branch: usize, off: f64 },
    /// There is none near enough.
    Missing,
    /// Two are as near.
    Unclear,
}

impl Match {
    /// The branch that was found.
    pub fn branch(&self) -> Option<usize> {
        match self {
            Self::Found { branch, .. } => Some(*branch),
            Self::Missing | Self::Unclear => None,
        }
    }
}

/// What became of every branch of `first` in `other`; no branch of `other` stands twice.
pub fn matched(first: &Study, other: &Study) -> Vec<Match> {
    let size_px = first.size_px();
    // A camera that stood still, and one that did not.
    let ratio = size_px / other.size_px();
    let scales = std::iter::once(1.0).chain(SIZES.iter().map(|s| s * ratio));
    let starts = scales.map(|scale| Frame {
        scale,
        shift: Vector2::zeros(),
    });
    let tried = starts.filter(|f| f.scale.is_finite()).map(|start| {
        let mut frame = start;
        let mut found = seen_from(first, other, &frame, size_px);
        for _ in 0..ROUNDS {
            frame = frame.refined(first, other, &found);
            found = seen_from(first, other, &frame, size_px);
        }
        let offs: Vec<f64> = found
            .iter()
            .filter_map(|m| {
                if let Match::Found { off, .. } = m {
                    Some(*off)
                } else {
                    None
                }
            })
            .collect();
        (offs.len(), offs.iter().sum::<f64>(), found)
    });
    let best = tried.reduce(|a, b| if (b.0, a.1) > (a.0, b.1) { b } else { a });
    best.map_or_else(
        || vec![Match::Missing; first.branches.len()],
        |(_, _, found)| found,
    )
}

/// Where the other capture's picture lies on the first one's: its places times `scale` and on by
/// `shift`, px.
struct Frame {
    scale: f64,
    shift: Vector2<f64>,
}

impl Frame {
    fn place(&self, p: Point2<f64>) -> Point2<f64> {
        self.scale * p + self.shift
    }

    /// The scale and shift by which the branches that were found lie on each other best; the same
    /// for few of them.
    fn refined(&self, first: &Study, other: &Study, found: &[Match]) -> Self {
        // Where a branch ends here and there.
        let mut pairs: Vec<[Point2<f64>; 2]> = Vec::new();
        for (branch, m) in first.branches.iter().zip(found) {
            if let Some(there) = m.branch() {
                pairs.push([
                    branch.tip_from_foot_px,
                    other.branches[there].tip_from_foot_px,
                ]);
            }
        }
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
        if pairs.len() < LEAST_PAIRS || !scale.is_finite() || scale <= 0.0 {
            return Self { ..*self };
        }
        Self {
            scale,
            shift: a - scale * b,
        }
    }

    /// How far two branches lie from each other, tips and bases, as a share of the tree's size.
    fn off(&self, a: &Branch, b: &Branch, size_px: f64) -> f64 {
        let tips = self.distance_px(a.tip_from_foot_px, b.tip_from_foot_px) / size_px;
        let bases = self.distance_px(a.base_from_foot_px, b.base_from_foot_px) / size_px;
        tips.hypot(BASE * bases)
    }

    /// From a place in the first capture to one in the other.
    fn distance_px(&self, p: Point2<f64>, q: Point2<f64>) -> f64 {
        distance(&p, &self.place(q))
    }
}

/// Whether a branch that is `d` away makes it unclear that the one `off` away is meant.
fn is_rival(d: f64, off: f64) -> bool {
    d < AS_NEAR * off && off > NEAR
}

/// What became of the branches if the other capture's picture lies so on the first one's; nearest
/// pairs first.
fn seen_from(first: &Study, other: &Study, frame: &Frame, size_px: f64) -> Vec<Match> {
    let mut table: Vec<Vec<f64>> = Vec::with_capacity(first.branches.len());
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, a) in first.branches.iter().enumerate() {
        let row = other.branches.iter().map(|b| frame.off(a, b, size_px));
        let row: Vec<f64> = row.collect();
        let near = row.iter().enumerate().filter(|(_, d)| **d <= FARTHEST);
        pairs.extend(near.map(|(j, &d)| (d, i, j)));
        table.push(row);
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut out = vec![Match::Missing; first.branches.len()];
    let mut taken = vec![false; other.branches.len()];
    for (off, i, j) in pairs {
        if out[i] != Match::Missing || taken[j] {
            continue;
        }
        let others_i = (0..taken.len()).any(|k| k != j && !taken[k] && is_rival(table[i][k], off));
        let others_j = (0..out.len())
            .any(|k| k != i && out[k] == Match::Missing && is_rival(table[k][j], off));
        if others_i || others_j {
            out[i] = Match::Unclear;
        } else {
            out[i] = Match::Found { branch: j, off };
            taken[j] = true;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Bounds;
    use crate::model::Unidentified;

    /// A tree whose branches end at `tips`, each carried by the trunk.
    fn study(tips: &[Point2<f64>]) -> Study {
        let branches = tips.iter().enumerate().map(|(i, tip)| Branch {
            name: i as u32 + 1,
            piece: String::new(),
            order: 0,
            parent: (i > 0).then_some(1),
            level: if i > 0 { 2 } else { 1 },
            points: 9,
            base_from_foot_px: if i > 0 { tips[0] } else { Point2::origin() },
            tip_from_foot_px: *tip,
            sway: Err(Unidentified::TooShort),
            amplitude_deg: f64::NAN,
            by_points_deg: f64::NAN,
            in_angle_deg: f64::NAN,
            times_s: Vec::new(),
            plane_deg: Vec::new(),
            space_deg: Vec::new(),
            fitted_deg: None,
            spectrum: None,
            reference: None,
            way_px: Vec::new(),
        });
        Study {
            name: String::new(),
            source: String::new(),
            origin: Default::default(),
            verdict: None,
            size: [640, 360],
            span_s: Bounds::new(0.0, 1.0),
            frames: 30,
            gaps: Vec::new(),
            onset: None,
            used_s: Bounds::new(0.0, 1.0),
            given: None,
            metres_per_px: 0.0,
            highest_hz: 5.0,
            foot_px: Point2::new(320.0, 340.0),
            outline_px: Vec::new(),
            picture: None,
            branches: branches.collect(),
            notes: Vec::new(),
        }
    }

    fn found(matches: &[Match]) -> Vec<Option<usize>> {
        matches.iter().map(Match::branch).collect()
    }

    const TREE: [Point2<f64>; 6] = [
        Point2::new(0.0, 100.0),
        Point2::new(-80.0, 180.0),
        Point2::new(-40.0, 240.0),
        Point2::new(10.0, 260.0),
        Point2::new(70.0, 230.0),
        Point2::new(90.0, 150.0),
    ];

    /// The second film is from farther away, its outline's foot lies elsewhere, and it was cut into
    /// branches in another order.
    #[test]
    fn a_tree_seen_from_farther_away_and_with_another_foot_is_the_same_tree() {
        let order = [0, 5, 4, 2, 1];
        let other: Vec<Point2<f64>> = order
            .iter()
            .map(|&k| Point2::new(0.7 * TREE[k].x + 6.0, 0.7 * TREE[k].y - 9.0))
            .collect();
        let matches = matched(&study(&TREE), &study(&other));
        assert_eq!(
            found(&matches),
            [Some(0), Some(4), Some(3), None, Some(2), Some(1)]
        );
        assert_eq!(matches[3], Match::Missing);
    }

    /// Where two grow together it is not guessed which one is meant.
    #[test]
    fn a_branch_with_two_as_near_is_unclear() {
        let mut other = TREE.to_vec();
        other[4] = Point2::new(58.0, 230.0);
        other.push(Point2::new(82.0, 231.0));
        let matches = matched(&study(&TREE), &study(&other));
        assert_eq!(matches[4], Match::Unclear);
        assert_eq!(found(&matches)[..4], [Some(0), Some(1), Some(2), Some(3)]);
    }

    #[test]
    fn nothing_is_found_in_a_tree_without_branches() {
        assert_eq!(found(&matched(&study(&TREE), &study(&[]))), [None; 6]);
        assert!(matched(&study(&[]), &study(&TREE)).is_empty());
    }
}
