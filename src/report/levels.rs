//! The pattern of frequency and damping across the levels of a tree (Hu et al. sect. 5.4).

use super::compare::percent_of_log;
use super::study::Study;
use crate::model::{Interval, Sway};

/// Branches that a trend is estimated from, at least.
const LEAST: usize = 4;

/// The branches of one level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    pub level: u8,
    pub branches: usize,
    /// How many of them have a frequency.
    pub answers: usize,
    pub frequency_hz: Option<Spread>,
    /// Of those that have one.
    pub damping_ratio: Option<Spread>,
}

/// The middle of some values, and the least and the largest of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    pub n: usize,
    pub median: f64,
    pub least: f64,
    pub largest: f64,
}

/// How a value grows from level to level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// By so many % a level, with the 95 % interval that the scatter of the branches leaves.
    pub percent: Interval,
    pub branches: usize,
}

impl Spread {
    /// Of some values; `None` of none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        if n == 0 {
            return None;
        }
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        Some(Self {
            n,
            // Of an even number the mean of the middle two.
            median: 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]),
            least: values.iter().copied().reduce(f64::min)?,
            largest: values.iter().copied().reduce(f64::max)?,
        })
    }
}

/// All levels of a capture that have branches, the trunk's first.
pub fn levels(study: &Study) -> Vec<Level> {
    let mut numbers: Vec<u8> = study.branches.iter().map(|b| b.level).collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers.into_iter().map(|n| level(study, n)).collect()
}

fn level(study: &Study, level: u8) -> Level {
    let branches = study.branches.iter().filter(|b| b.level == level);
    let known: Vec<Sway> = branches.clone().filter_map(|b| b.known()).collect();
    let frequencies: Vec<f64> = known.iter().map(|s| s.frequency_hz.value).collect();
    let dampings: Vec<f64> = known
        .iter()
        .filter_map(|s| Some(s.damping_ratio?.value))
        .collect();
    Level {
        level,
        branches: branches.count(),
        answers: known.len(),
        frequency_hz: Spread::of(&frequencies),
        damping_ratio: Spread::of(&dampings),
    }
}

/// How `value` grows from level to level: a straight line through its logarithms. `None` for fewer
/// than four branches, or all on one level.
pub fn growth(study: &Study, value: impl Fn(&Sway) -> Option<f64>) -> Option<Growth> {
    let points: Vec<(f64, f64)> = study
        .branches
        .iter()
        .filter_map(|b| {
            Some((
                f64::from(b.level),
                value(&b.known()?).filter(|v| *v > 0.0)?.ln(),
            ))
        })
        .collect();
    let n = points.len() as f64;
    // Sums are rounded: of one level the squares below are not always 0.
    let is_one_level = points.iter().all(|point| point.0 == points[0].0);
    if points.len() < LEAST || is_one_level {
        return None;
    }
    let mean = points
        .iter()
        .fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let (mut squares, mut products) = (0.0, 0.0);
    for (level, log) in &points {
        squares += (level - mean.0).powi(2);
        products += (level - mean.0) * (log - mean.1);
    }
    if squares <= 0.0 {
        return None;
    }
    let slope = products / squares;
    let mut left = 0.0;
    for (level, log) in &points {
        left += (log - mean.1 - slope * (level - mean.0)).powi(2);
    }
    let half = students_975(n - 2.0) * (left / (n - 2.0) / squares).sqrt();
    Some(Growth {
        percent: percent_of_log(slope, half),
        branches: points.len(),
    })
}

/// Quantile of Student's distribution that leaves 2.5 % above it: Cornish and Fisher's expansion,
/// good to 2 % from two degrees of freedom on.
fn students_975(freedom: f64) -> f64 {
    let z = 1.959_964_f64;
    let terms = [
        (z.powi(3) + z) / 4.0,
        (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0,
        (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0,
        (79.0 * z.powi(9) + 776.0 * z.powi(7) + 1482.0 * z.powi(5)
            - 1920.0 * z.powi(3)
            - 945.0 * z)
            / 92160.0,
    ];
    terms
        .iter()
        .enumerate()
        .fold(z, |sum, (i, t)| sum + t / freedom.powi(i as i32 + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_quantiles_are_those_of_the_tables() {
        for (freedom, wanted) in [
            (2.0, 4.303),
            (3.0, 3.182),
            (5.0, 2.571),
            (10.0, 2.228),
            (100.0, 1.984),
        ] {
            let found = students_975(freedom);
            assert!(
                (found / wanted - 1.0).abs() < 0.02,
                "{freedom}: {found}, not {wanted}"
            );
        }
    }

    #[test]
    fn the_spread_of_none_is_none() {
        assert_eq!(Spread::of(&[]), None);
        let three = Spread::of(&[3.0, 1.0, 2.0]);
        assert_eq!(
            three,
            Some(Spread {
                n: 3,
                median: 2.0,
                least: 1.0,
                largest: 3.0
            })
        );
    }
}
