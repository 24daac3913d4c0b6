//! Which points of a film speak for which branch.

use super::branch_tree::BranchTree;
use super::film::Film;
use crate::model::NodeId;
use crate::signal::statistics::{noise_variance, rms};
use nalgebra::{Point2, Vector2};

/// Points of a branch at most that are fitted; more cost time and tell little more.
const MAX_POINTS: usize = 20;
/// So many points that were always seen are enough, if they are half of all.
const ENOUGH_WHOLE: usize = 12;
/// A point must have been seen in this share of the frames, and in so many.
const MIN_SEEN_SHARE: f64 = 0.5;
const MIN_SEEN_FRAMES: usize = 24;

/// The signals of some points, two a point.
pub(super) struct Points {
    /// Of the film's tracks.
    pub tracks: Vec<usize>,
    /// Displacement to the right and down from the mean, px, in turn; no number where it was not
    /// seen.
    pub signals: Vec<Vec<f64>>,
}

/// Points of every branch and of all that it carries.
pub(super) fn members(tree: &BranchTree, film: &Film) -> Vec<Vec<usize>> {
    let mut out = vec![Vec::new(); tree.len()];
    for (k, track) in film.tracks.iter().enumerate() {
        for branch in std::iter::once(track.node).chain(tree.carriers(track.node)) {
            let Some(members) = out.get_mut(branch.index()) else {
                break;
            };
            members.push(k);
        }
    }
    out
}

/// The branch on the foot that most points are on or above.
pub(super) fn trunk(tree: &BranchTree, members: &[Vec<usize>]) -> NodeId {
    let branches = (1..members.len() as u32).map(NodeId);
    let on_foot = branches.filter(|b| tree.branches[b.index()].parent == Some(NodeId(0)));
    let largest = on_foot.max_by_key(|b| (members[b.index()].len(), std::cmp::Reverse(*b)));
    largest.unwrap_or(NodeId(1))
}

impl Points {
    /// Of those of `tracks` that were seen for long enough.
    pub fn of(film: &Film, tracks: &[usize]) -> Self {
        Self::up_to(MAX_POINTS, film, tracks)
    }

    /// The same, of at most so many points.
    pub fn up_to(most: usize, film: &Film, tracks: &[usize]) -> Self {
        let rows = film.times_s.len();
        let least = ((MIN_SEEN_SHARE * rows as f64) as usize).max(MIN_SEEN_FRAMES);
        let (mut all, mut whole) = (Vec::new(), Vec::new());
        for &k in tracks {
            let seen = count_seen(&film.tracks[k].at_px);
            if seen >= least {
                all.push(k);
            }
            if seen >= least && seen == rows {
                whole.push(k);
            }
        }
        // Points with gaps cost a fit of their own each.
        if whole.len() >= ENOUGH_WHOLE && 2 * whole.len() >= all.len() {
            all = whole;
        }
        let tracks = evenly_chosen(&all, most);
        let mut signals = Vec::with_capacity(2 * tracks.len());
        for &k in &tracks {
            signals.extend(centred(&film.tracks[k].at_px));
        }
        Self { tracks, signals }
    }

    /// Squares that noise makes in all signals, px²: of what every frame shows against its
    /// neighbours, in which a sway changes little.
    pub fn noise(&self) -> f64 {
        let mut sum = 0.0;
        for signal in &self.signals {
            let seen = signal.iter().filter(|x| x.is_finite()).count() as f64;
            sum += seen * noise_variance([signal.as_slice()]);
        }
        sum
    }

    /// All values that were seen, px.
    pub fn seen_values(&self) -> impl Iterator<Item = f64> {
        let values = self.signals.iter().flatten().copied();
        values.filter(|x| x.is_finite())
    }

    /// Root of the mean square of all signals, px.
    pub fn rms_px(&self) -> f64 {
        rms(self.seen_values())
    }

    /// Sum of the squares of all signals, px².
    pub fn squares(&self) -> f64 {
        self.seen_values().map(|x| x * x).sum()
    }
}

/// At most `most` of some indices, evenly from all of them.
pub(super) fn evenly_chosen(all: &[usize], most: usize) -> Vec<usize> {
    let n = all.len().min(most);
    (0..n).map(|i| all[i * all.len() / n]).collect()
}

/// How many of some points are among `others`, which are in order.
pub(super) fn count_among(points: &[usize], others: &[usize]) -> usize {
    let is_among = |k: &&usize| others.binary_search(k).is_ok();
    points.iter().filter(is_among).count()
}

/// Share of some points that are among `others`, which are in order.
pub(super) fn share_among(points: &[usize], others: &[usize]) -> f64 {
    count_among(points, others) as f64 / points.len() as f64
}

/// Number of frames in which a point was seen.
pub(super) fn count_seen(at_px: &[Point2<f64>]) -> usize {
    at_px.iter().filter(|p| is_seen(p)).count()
}

pub(super) fn is_seen(p: &Point2<f64>) -> bool {
    p.x.is_finite() && p.y.is_finite()
}

/// Mean of the places at which a point was seen, px; no numbers where it never was.
pub(super) fn mean_px(at_px: &[Point2<f64>]) -> Point2<f64> {
    let n = count_seen(at_px) as f64;
    let seen = at_px.iter().filter(|p| is_seen(p));
    Point2::from(seen.map(|p| p.coords).sum::<Vector2<f64>>() / n)
}

/// From a place to where each of some tracks of a film is in its mean, px.
pub(super) fn arms_px<'a>(
    film: &'a Film,
    tracks: &'a [usize],
    from_px: Point2<f64>,
) -> impl Iterator<Item = Vector2<f64>> + 'a {
    tracks
        .iter()
        .map(move |k| mean_px(&film.tracks[*k].at_px) - from_px)
}

/// Displacement of a point to the right and down from its mean place, px; no number where it was not seen.
pub(super) fn centred(at_px: &[Point2<f64>]) -> [Vec<f64>; 2] {
    let mean = mean_px(at_px);
    [0, 1].map(|c| {
        at_px
            .iter()
            .map(|p| if is_seen(p) { p[c] - mean[c] } else { f64::NAN })
            .collect()
    })
}
