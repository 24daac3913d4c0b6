//! The pattern of frequency and damping across the levels of a tree (Hu et al. sect. 5.4).

use super::study::Study;
use crate::model::{Interval, Sway};

/// Branches that a trend is told from, at least.
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
        let fold = |f: fn(f64, f64) -> f64| values.iter().copied().reduce(f);
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let middle = |k: usize| sorted.get(k).copied();
        let median = 0.5 * (middle(values.len() / 2)? + middle((values.len() - 1) / 2)?);
        Some(Self {
            n: values.len(),
            median,
            least: fold(f64::min)?,
            largest: fold(f64::max)?,
        })
    }
}

/// All levels of a capture that have branches, the trunk's first.
pub fn levels(study: &Study) -> Vec<Level> {
    let mut numbers: Vec<u8> = study.branches.iter().map(|b| b.level).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let level = |level: u8| {
        let of = || study.branches.iter().filter(move |b| b.level == level);
        let known: Vec<Sway> = of().filter_map(|b| b.known()).collect();
        let frequencies: Vec<f64> = known.iter().map(|s| s.frequency_hz.value).collect();
        let dampings: Vec<f64> = known
            .iter()
            .filter_map(|s| Some(s.damping_ratio?.value))
            .collect();
        Level {
            level,
            branches: of().count(),
            answers: known.len(),
            frequency_hz: Spread::of(&frequencies),
            damping_ratio: Spread::of(&dampings),
        }
    };
    numbers.into_iter().map(level).collect()
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
    if points.len() < LEAST {
        return None;
    }
    let mean = points
        .iter()
        .fold((0.0, 0.0), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let sum = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>();
    let wide = sum(&|p| (p.0 - mean.0).powi(2));
    if wide <= 0.0 {
        return None;
    }
    let slope = sum(&|p| (p.0 - mean.0) * (p.1 - mean.1)) / wide;
    let left = sum(&|p| (p.1 - mean.1 - slope * (p.0 - mean.0)).powi(2));
    let half = students_975(n - 2.0) * (left / (n - 2.0) / wide).sqrt();
    let percent = |x: f64| 100.0 * x.exp_m1();
    let percent = Interval {
        value: percent(slope),
        lo: percent(slope - half),
        hi: percent(slope + half),
    };
    Some(Growth {
        percent,
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
