//! Certainty that the two halves of a part of the dendrogram move differently.

use super::dendrogram::Dendrogram;
use super::signals::Signals;
use nalgebra::Vector2;

/// Time over which one vote is taken, s: longer than the slowest tracking error, shorter than most
/// periods.
const VOTE_S: f64 = 1.0;
/// Standard errors at which a split is as likely chance as not. Where nothing but noise tells
/// points apart, the best split found among very many stands out by up to so many.
const CHANCE_ERRORS: f64 = 3.0;

/// For every part of `tree` the certainty that its halves move differently, 0 to 1; 0 for one
/// without halves, or with a half of one point, of which nothing can be said.
///
/// In every second that was seen the points of the halves are more alike within the halves than
/// across, or not. With t the mean of that contrast over its standard error, it is t^2 / (t^2 + 9)
/// for positive t: 0.5 where chance alone might give the same, 0.8 at twice as many standard
/// errors.
pub fn certainties(tree: &Dendrogram, signals: &Signals, times_s: &[f64]) -> Vec<f32> {
    let votes = Votes::new(times_s, signals.steps());
    let mut sums: Vec<Option<Sums>> = vec![None; tree.parts.len()];
    let mut certain = vec![0.0; tree.parts.len()];
    for (k, part) in tree.parts.iter().enumerate().rev() {
        let Some([a, b]) = part.halves else {
            sums[k] = Some(Sums::of(tree.points(k), signals, &votes));
            continue;
        };
        // Each part is a half of one other only, so that what it kept is used up here.
        let (Some(mut in_a), Some(in_b)) = (sums[a].take(), sums[b].take()) else {
            continue;
        };
        if in_a.points > 1.0 && in_b.points > 1.0 {
            certain[k] = certainty(&votes.contrast(&in_a, &in_b));
        }
        in_a.add(&in_b);
        sums[k] = Some(in_a);
    }
    certain
}

/// Sums over the points of a part.
#[derive(Clone)]
struct Sums {
    /// Number of points.
    points: f32,
    /// Of their motion, step by step.
    motion: Vec<Vector2<f32>>,
    /// Of their energies, vote by vote.
    energy: Vec<f32>,
}

impl Sums {
    fn of(points: &[usize], signals: &Signals, votes: &Votes) -> Self {
        let mut sums = Self {
            points: 0.0,
            motion: vec![Vector2::zeros(); signals.steps()],
            energy: vec![0.0; votes.count],
        };
        for &point in points {
            let motion = signals.unit(point);
            sums.add(&Self {
                points: 1.0,
                energy: votes.products(&motion, &motion),
                motion,
            });
        }
        sums
    }

    fn add(&mut self, other: &Self) {
        self.points += other.points;
        for (sum, more) in self.motion.iter_mut().zip(&other.motion) {
            *sum += more;
        }
        for (sum, more) in self.energy.iter_mut().zip(&other.energy) {
            *sum += more;
        }
    }
}

/// t^2 / (t^2 + 9) of one contrast per vote.
fn certainty(contrast: &[f64]) -> f32 {
    let n = contrast.len() as f64;
    if n < 2.0 {
        return 0.0;
    }
    let mean = contrast.iter().sum::<f64>() / n;
    let variance = contrast.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let t_sq = mean.max(0.0).powi(2) / (variance / n).max(f64::MIN_POSITIVE);
    // Infinite for a contrast without any spread: as sure as can be.
    if t_sq.is_finite() {
        (t_sq / (t_sq + CHANCE_ERRORS.powi(2))) as f32
    } else {
        1.0
    }
}

/// The steps dealt to the votes.
struct Votes {
    of_step: Vec<usize>,
    count: usize,
}

impl Votes {
    /// The steps are those of `times_s`, from two seconds on in votes of a second or little more,
    /// so that none is a remainder. When nothing was seen there is no vote, and of a slow camera
    /// every step is one.
    fn new(times_s: &[f64], steps: usize) -> Self {
        let (start_s, end_s) = (
            times_s.first().copied().unwrap_or(0.0),
            times_s.last().copied().unwrap_or(0.0),
        );
        let span_s = end_s - start_s;
        let spans = (span_s / VOTE_S).floor().max(2.0);
        let (mut of_step, mut count, mut last) = (Vec::with_capacity(steps), 0, None);
        for time_s in times_s.iter().take(steps) {
            let span = ((time_s - start_s) * spans / span_s).clamp(0.0, spans - 1.0) as u64;
            count += usize::from(last != Some(span));
            last = Some(span);
            of_step.push(count - 1);
        }
        Self { of_step, count }
    }

    /// Vote by vote the mean similarity of the points within the two parts less that across; each
    /// part has more than one point.
    fn contrast(&self, a: &Sums, b: &Sums) -> Vec<f64> {
        let (in_a, in_b) = (self.mean_within(a), self.mean_within(b));
        let mut contrast = self.products(&a.motion, &b.motion);
        for (v, across) in contrast.iter_mut().enumerate() {
            *across = (in_a[v] + in_b[v]) / 2.0 - *across / (a.points * b.points);
        }
        contrast.into_iter().map(f64::from).collect()
    }

    /// Vote by vote the mean product of the motions of two different points of a part.
    fn mean_within(&self, part: &Sums) -> Vec<f32> {
        let pairs = part.points * (part.points - 1.0);
        let mut mean = self.products(&part.motion, &part.motion);
        for (product, energy) in mean.iter_mut().zip(&part.energy) {
            *product = (*product - energy) / pairs;
        }
        mean
    }

    /// Sums of the products of two motions, vote by vote.
    fn products(&self, a: &[Vector2<f32>], b: &[Vector2<f32>]) -> Vec<f32> {
        let mut out = vec![0.0; self.count];
        for ((x, y), &vote) in a.iter().zip(b).zip(&self.of_step) {
            out[vote] += x.dot(y);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TrackId;
    use crate::model::TrackTable;
    use nalgebra::Point2;

    fn place_px(point: usize, time_s: f64) -> Point2<f32> {
        let noise = (((point * 7919) as f64 + time_s * 78.233).sin() * 43758.5453).fract();
        let rate = if point < 2 { 0.3 } else { 0.7 };
        let u = 100.0 * point as f64 + 5.0 * (rate * time_s).sin() + noise;
        Point2::new(u as f32, 50.0)
    }

    /// Two pairs of points that swing at different rates, seen at `times_s`, and how sure it is
    /// that they are two.
    fn certain(times_s: Vec<f64>) -> f32 {
        let table = TrackTable {
            ids: (0..4).map(TrackId).collect(),
            positions: (0..4)
                .map(|i| times_s.iter().map(|&t| Some(place_px(i, t))).collect())
                .collect(),
            times_s,
            fb_errors_px: vec![0.1; 4],
        };
        let tree = Dendrogram::divided((0..4).collect(), |_, depth| {
            (depth == 0).then(|| vec![true, true, false, false])
        });
        let signals = Signals::displacements(&table, &[0, 1, 2, 3]);
        certainties(&tree, &signals, &table.times_s)[0]
    }

    /// A vote of which nothing was seen says nothing, neither for nor against.
    #[test]
    fn a_slow_camera_and_a_gap_give_no_empty_votes() {
        let slow: Vec<f64> = (0..31).map(|k| 2.0 * f64::from(k)).collect();
        let votes = Votes::new(&slow, slow.len());
        assert_eq!(
            (votes.count, votes.of_step),
            (31, (0..31).collect()),
            "each frame is a vote"
        );
        let certainty = certain(slow);
        assert!(certainty > 0.8, "{certainty}");
        let gap: Vec<f64> = (0..300)
            .map(|k| f64::from(k) / 15.0 + if k < 150 { 0.0 } else { 30.0 })
            .collect();
        let votes = Votes::new(&gap, gap.len());
        let mut sizes = vec![0; votes.count];
        votes.of_step.iter().for_each(|&v| sizes[v] += 1);
        assert!(
            (19..=22).contains(&votes.count) && sizes.iter().all(|n| *n > 0),
            "{sizes:?}"
        );
        let votes = Votes::new(&[3.0; 5], 5);
        assert_eq!(
            (votes.count, votes.of_step),
            (1, vec![0; 5]),
            "no time at all"
        );
    }
}
