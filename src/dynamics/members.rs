//! Which points of a film speak for which branch.

use super::film::Film;
use crate::model::Skeleton;

/// Points of a branch at most that are fitted; more cost time and tell little more.
const MOST: usize = 20;
/// So many points that were always seen are enough, if they are half of all.
const ENOUGH: usize = 12;
/// A point must have been seen in this share of the frames, and in so many.
const SEEN: f64 = 0.5;
const LEAST_FRAMES: usize = 24;

/// The signals of some points from some frame on, two a point.
pub(super) struct Points {
    /// Of the film's tracks.
    pub tracks: Vec<usize>,
    /// Displacement to the right and down from the mean, px, in turn; no number where it was not
    /// seen.
    pub signals: Vec<Vec<f64>>,
}

/// Points of every measured node and of all above it, by node index.
pub(super) fn members(skeleton: &Skeleton, film: &Film) -> Vec<Vec<usize>> {
    let mut out = vec![Vec::new(); skeleton.measured()];
    for (k, track) in film.tracks.iter().enumerate() {
        for node in std::iter::once(track.node).chain(skeleton.ancestors(track.node)) {
            let Some(members) = out.get_mut(node.index()) else {
                break;
            };
            members.push(k);
        }
    }
    out
}

impl Points {
    /// Of those of `tracks` that were seen for long enough, in the film's frames from `from` on.
    pub fn of(film: &Film, tracks: &[usize], from: usize) -> Self {
        let rows = film.times_s.len() - from;
        let least = ((SEEN * rows as f64) as usize).max(LEAST_FRAMES);
        let seen = |k: &usize| {
            film.tracks[*k].at_px[from..]
                .iter()
                .filter(|p| is_seen(p))
                .count()
                >= least
        };
        let mut all: Vec<usize> = tracks.iter().copied().filter(seen).collect();
        let whole: Vec<usize> = all
            .iter()
            .copied()
            .filter(|&k| film.tracks[k].at_px[from..].iter().all(is_seen))
            .collect();
        // Points with gaps cost a fit of their own each.
        if whole.len() >= ENOUGH && 2 * whole.len() >= all.len() {
            all = whole;
        }
        let n = all.len().min(MOST);
        let tracks: Vec<usize> = (0..n).map(|i| all[i * all.len() / n]).collect();
        let signals = tracks
            .iter()
            .flat_map(|&k| centred(&film.tracks[k].at_px[from..]))
            .collect();
        Self { tracks, signals }
    }

    /// Squares that noise makes in all signals, px²: of what every frame shows against its
    /// neighbours, in which a sway changes little.
    pub fn noise(&self) -> f64 {
        let of = |s: &Vec<f64>| {
            let third = |w: &[f64]| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0];
            let thirds: Vec<f64> = s.windows(4).map(third).filter(|d| d.is_finite()).collect();
            let seen = s.iter().filter(|x| x.is_finite()).count() as f64;
            // The squares of 1, 3, 3, 1 make 20.
            seen * thirds.iter().map(|d| d * d).sum::<f64>()
                / (20.0 * (thirds.len() as f64).max(1.0))
        };
        self.signals.iter().map(of).sum()
    }

    /// Root of the mean square of all signals, px.
    pub fn rms_px(&self) -> f64 {
        let all = || self.signals.iter().flatten().filter(|x| x.is_finite());
        (all().map(|x| x * x).sum::<f64>() / (all().count() as f64).max(1.0)).sqrt()
    }
}

pub(super) fn is_seen(p: &[f64; 2]) -> bool {
    p[0].is_finite() && p[1].is_finite()
}

/// Mean of the places at which a point was seen, px.
pub(super) fn mean_px(at_px: &[[f64; 2]]) -> [f64; 2] {
    let n = at_px.iter().filter(|p| is_seen(p)).count().max(1) as f64;
    at_px
        .iter()
        .filter(|p| is_seen(p))
        .fold([0.0; 2], |m, p| [m[0] + p[0] / n, m[1] + p[1] / n])
}

fn centred(at_px: &[[f64; 2]]) -> [Vec<f64>; 2] {
    let mean = mean_px(at_px);
    [0, 1].map(|c| {
        at_px
            .iter()
            .map(|p| if is_seen(p) { p[c] - mean[c] } else { f64::NAN })
            .collect()
    })
}
