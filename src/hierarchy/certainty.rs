//! How sure it is that two parts of a tree move apart.

use super::binary::Binary;
use super::signals::Signals;

/// Time over which one vote is taken, s: longer than the slowest tracking error, shorter than most
/// periods.
const VOTE_S: f64 = 1.0;
/// Standard errors at which a split is as likely chance as not. Where nothing but noise tells
/// points apart, the best split found among very many stands out by up to so many.
const CHANCE_ERRORS: f64 = 3.0;

/// For every part of `tree` how sure it is that its halves move apart, 0 to 1; 0 for one without
/// halves, or with a half of one point, of which nothing can be said.
///
/// In every second that was seen the points of the halves are more like each other within the
/// halves than across, or not. With t the mean of that contrast over its standard error, it is t^2
/// / (t^2 + 9) for positive t: 0.5 where chance alone might give the same, 0.8 at twice as many
/// standard errors.
pub fn certainties(tree: &Binary, signals: &Signals, times_s: &[f64]) -> Vec<f32> {
    let votes = Votes::new(times_s, signals.steps());
    let mut sums: Vec<Option<Sums>> = vec![None; tree.parts.len()];
    let mut certain = vec![0.0; tree.parts.len()];
    for (k, part) in tree.parts.iter().enumerate().rev() {
        let Some(halves) = part.halves else {
            let mut sum = vec![[0.0f32; 2]; signals.steps()];
            let mut own = vec![0.0f32; votes.count];
            for &i in tree.points(k) {
                let unit = signals.unit(i);
                own.iter_mut()
                    .zip(votes.products(&unit, &unit))
                    .for_each(|(o, e)| *o += e);
                add(&mut sum, &unit);
            }
            sums[k] = Some((sum, own));
            continue;
        };
        // Each part is a half of one other only, so that what it kept is used up here.
        let (Some((mut a, mut own_a)), Some((b, own_b))) =
            (sums[halves[0]].take(), sums[halves[1]].take())
        else {
            continue;
        };
        let [n_a, n_b] = halves.map(|h| tree.parts[h].len() as f32);
        if n_a > 1.0 && n_b > 1.0 {
            let within = |sum: &[[f32; 2]], own: &[f32], n: f32| -> Vec<f32> {
                votes
                    .products(sum, sum)
                    .iter()
                    .zip(own)
                    .map(|(all, own)| (all - own) / (n * (n - 1.0)))
                    .collect()
            };
            let (in_a, in_b) = (within(&a, &own_a, n_a), within(&b, &own_b, n_b));
            let across = votes.products(&a, &b);
            let contrast = (0..votes.count)
                .map(|v| f64::from((in_a[v] + in_b[v]) / 2.0 - across[v] / (n_a * n_b)))
                .collect::<Vec<f64>>();
            certain[k] = certainty(&contrast);
        }
        add(&mut a, &b);
        own_a.iter_mut().zip(&own_b).for_each(|(x, y)| *x += y);
        sums[k] = Some((a, own_a));
    }
    certain
}

/// Sum of the motion of a part's points, step by step, and of their energies, vote by vote.
type Sums = (Vec<[f32; 2]>, Vec<f32>);

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

fn add(sum: &mut [[f32; 2]], more: &[[f32; 2]]) {
    sum.iter_mut()
        .zip(more)
        .for_each(|(s, m)| *s = [s[0] + m[0], s[1] + m[1]]);
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
        let (mut count, mut last) = (0, None);
        let of = |&time_s: &f64| {
            let span = ((time_s - start_s) * spans / span_s).clamp(0.0, spans - 1.0) as u64;
            count += usize::from(last != Some(span));
            last = Some(span);
            count.max(1) - 1
        };
        Self {
            of_step: times_s.iter().take(steps).map(of).collect(),
            count,
        }
    }

    /// Sums of the products of two motions, vote by vote.
    fn products(&self, a: &[[f32; 2]], b: &[[f32; 2]]) -> Vec<f32> {
        let mut out = vec![0.0; self.count];
        for ((x, y), &vote) in a.iter().zip(b).zip(&self.of_step) {
            out[vote] += x[0] * y[0] + x[1] * y[1];
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::TrackId;
    use crate::model::TrackTable;

    /// Two pairs of points that swing at different rates, seen at `times_s`, and how sure it is
    /// that they are two.
    fn certain(times_s: Vec<f64>) -> f32 {
        let at = |i: usize, t: f64| {
            let noise = (((i * 7919) as f64 + t * 78.233).sin() * 43758.5453).fract();
            let rate = if i < 2 { 0.3 } else { 0.7 };
            Some([
                (100.0 * i as f64 + 5.0 * (rate * t).sin() + noise) as f32,
                50.0,
            ])
        };
        let table = TrackTable {
            ids: (0..4).map(TrackId).collect(),
            positions: (0..4)
                .map(|i| times_s.iter().map(|&t| at(i, t)).collect())
                .collect(),
            times_s,
            fb_errors_px: vec![0.1; 4],
        };
        let tree = Binary::divided((0..4).collect(), |_, depth| {
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
