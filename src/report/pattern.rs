//! The pattern of natural frequency in the sense of Hu et al. (sect. 5.4): the dominant peaks in
//! the spectra of the angles to the parent branch, by level, and those that levels 1 to 3 share.

use super::study::{Branch, Study};
use crate::dynamics::{DominantPeak, RelativeSpectrum, shared_peaks};
use std::fmt;
use std::ops::RangeInclusive;

/// The levels that the pattern is of, the trunk's first.
pub const LEVELS: RangeInclusive<u8> = 1..=3;

/// The dominant peaks of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// Frequencies that are no farther apart than this are one, Hz: one over the length of what the
    /// spectra are taken from. `None` without spectra.
    pub resolution_hz: Option<f64>,
    /// Every level of which a branch has a spectrum, the trunk's first.
    pub levels: Vec<LevelPeaks>,
    /// What levels 1 to 3 share, the clearest first; at least one, or why there is none.
    pub common: Result<Vec<CommonPeak>, NoCommonPeak>,
}

/// The peaks of one level.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelPeaks {
    /// As in `nodes.csv`: how many forks there are from the foot to a branch's end, 1 for the trunk.
    /// Hu et al. count so; the pieces of one botanical branch are on several levels.
    pub level: u8,
    /// Botanical orders of its branches, 0 for the trunk.
    pub orders: RangeInclusive<u32>,
    /// Branches with a spectrum.
    pub branches: usize,
    /// Those that at least half of these have, the highest over the background first.
    pub peaks: Vec<DominantPeak>,
}

/// A dominant peak that levels 1 to 3 share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonPeak {
    /// Mean over the levels, Hz.
    pub frequency_hz: f64,
    /// Power over the background's in the level in which it is least.
    pub over_background: f64,
    /// Branches of these levels with a dominant peak of their own there, and with a spectrum.
    pub branches_with: usize,
    pub branches: usize,
}

/// Why there is no common peak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoCommonPeak {
    /// There are no poses to take angles from.
    NoAngles,
    /// No angle has a spectrum.
    TooShort,
    /// No branch of this level has one.
    NoBranch(u8),
    /// At least half of the branches of this level share no peak.
    NoPeak(u8),
    /// The peaks of the levels lie at different frequencies.
    Apart,
}

impl NoCommonPeak {
    /// One word for programs.
    pub fn word(self) -> &'static str {
        match self {
            Self::NoAngles => "no_angles",
            Self::TooShort => "too_short",
            Self::NoBranch(_) => "no_branch",
            Self::NoPeak(_) => "no_peak",
            Self::Apart => "apart",
        }
    }
}

impl fmt::Display for NoCommonPeak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAngles => f.write_str("there are no poses to take angles from"),
            Self::TooShort => f.write_str("the film is too short for spectra"),
            Self::NoBranch(level) => write!(f, "no branch of level {level} was measured"),
            Self::NoPeak(level) => write!(
                f,
                "half of the branches of level {level} share no peak beyond chance"
            ),
            Self::Apart => {
                f.write_str("the peaks of the levels are farther apart than can be told")
            }
        }
    }
}

/// The pattern of a capture.
pub fn pattern(study: &Study) -> Pattern {
    let mut levels: Vec<u8> = study
        .branches
        .iter()
        .filter(|b| b.over_background.is_some())
        .map(|b| b.level)
        .collect();
    levels.sort_unstable();
    levels.dedup();
    let levels: Vec<LevelPeaks> = levels.into_iter().map(|l| level(study, l)).collect();
    let mut spectra = study.branches.iter().filter_map(spectrum_of);
    let resolution_hz = spectra.next().map(|s| s.resolution_hz);
    let common = match resolution_hz {
        Some(resolution_hz) => common(study, &levels, resolution_hz),
        None if study.branches.iter().all(|b| b.times_s.is_empty()) => Err(NoCommonPeak::NoAngles),
        None => Err(NoCommonPeak::TooShort),
    };
    Pattern {
        resolution_hz,
        levels,
        common,
    }
}

/// The dominant peaks of one branch, the highest over the background first.
pub fn peaks_of(branch: &Branch) -> Vec<DominantPeak> {
    shared_peaks(&Vec::from_iter(spectrum_of(branch)))
}

fn has_peak(branch: &Branch, frequency_hz: f64, resolution_hz: f64) -> bool {
    let peaks = peaks_of(branch);
    let mut off_hz = peaks.iter().map(|p| (p.frequency_hz - frequency_hz).abs());
    off_hz.any(|off_hz| off_hz <= resolution_hz)
}

fn spectrum_of(branch: &Branch) -> Option<&RelativeSpectrum> {
    branch.over_background.as_ref()
}

fn level(study: &Study, level: u8) -> LevelPeaks {
    let of_level = study.branches.iter().filter(|b| b.level == level);
    let branches: Vec<&Branch> = of_level.filter(|b| b.over_background.is_some()).collect();
    let orders = branches.iter().map(|b| b.order);
    let spectra: Vec<&RelativeSpectrum> = branches.iter().filter_map(|b| spectrum_of(b)).collect();
    LevelPeaks {
        level,
        orders: orders.clone().min().unwrap_or(0)..=orders.max().unwrap_or(0),
        branches: branches.len(),
        peaks: shared_peaks(&spectra),
    }
}

/// The peaks of the first level that all others have within the resolution.
fn common(
    study: &Study,
    levels: &[LevelPeaks],
    resolution_hz: f64,
) -> Result<Vec<CommonPeak>, NoCommonPeak> {
    let mut by_level: Vec<Vec<DominantPeak>> = Vec::new();
    for number in LEVELS {
        let level = levels.iter().find(|l| l.level == number);
        let peaks = level.ok_or(NoCommonPeak::NoBranch(number))?.peaks.clone();
        by_level.push(peaks);
    }
    let empty = LEVELS.zip(&by_level).find(|(_, peaks)| peaks.is_empty());
    if let Some((number, _)) = empty {
        return Err(NoCommonPeak::NoPeak(number));
    }
    let mut out = Vec::new();
    let (first, others) = by_level.split_at_mut(1);
    for peak in &first[0] {
        let Some(places) = nearest(peak.frequency_hz, others, resolution_hz) else {
            continue;
        };
        // A peak counts once.
        let mut all = vec![*peak];
        all.extend(others.iter_mut().zip(places).map(|(of, at)| of.remove(at)));
        out.push(common_peak(study, &all, resolution_hz));
    }
    out.sort_by(|a, b| b.over_background.total_cmp(&a.over_background));
    if out.is_empty() {
        return Err(NoCommonPeak::Apart);
    }
    Ok(out)
}

/// Where in each level the peak nearest to a frequency is; `None` where all of them are not within
/// the resolution of each other.
fn nearest(hz: f64, levels: &[Vec<DominantPeak>], resolution_hz: f64) -> Option<Vec<usize>> {
    let (mut least, mut largest) = (hz, hz);
    let mut places = Vec::with_capacity(levels.len());
    for peaks in levels {
        let off = |at: &usize| (peaks[*at].frequency_hz - hz).abs();
        let at = (0..peaks.len()).min_by(|a, b| off(a).total_cmp(&off(b)))?;
        least = peaks[at].frequency_hz.min(least);
        largest = peaks[at].frequency_hz.max(largest);
        places.push(at);
    }
    (largest - least <= resolution_hz).then_some(places)
}

fn common_peak(study: &Study, of_levels: &[DominantPeak], resolution_hz: f64) -> CommonPeak {
    let sum: f64 = of_levels.iter().map(|p| p.frequency_hz).sum();
    let frequency_hz = sum / of_levels.len() as f64;
    let powers = of_levels.iter().map(|p| p.over_background);
    let in_levels = study.branches.iter().filter(|b| LEVELS.contains(&b.level));
    let branches: Vec<&Branch> = in_levels.filter(|b| b.over_background.is_some()).collect();
    let with_it = branches
        .iter()
        .filter(|b| has_peak(b, frequency_hz, resolution_hz));
    CommonPeak {
        frequency_hz,
        over_background: powers.fold(f64::INFINITY, f64::min),
        branches_with: with_it.count(),
        branches: branches.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Bounds;
    use crate::report::tests::{TREE, study};
    use rand::RngExt;
    use std::f64::consts::TAU;

    const SPAN_S: f64 = 20.0;

    /// A spectrum of noise with waves of these frequencies, Hz.
    fn spectrum(seed: u64, waves_hz: &[f64]) -> RelativeSpectrum {
        let mut random = crate::random::generator(seed, 0);
        let (mut times_s, mut angle_deg) = (Vec::new(), Vec::new());
        for k in 0..600 {
            let time_s = f64::from(k) / 30.0;
            times_s.push(time_s);
            let noise = random.random_range(-1.0..1.0);
            let waves = waves_hz.iter().map(|hz| (TAU * hz * time_s).sin());
            angle_deg.push(noise + waves.sum::<f64>());
        }
        let piece = Bounds::new(0.0, SPAN_S);
        let within_hz = Bounds::new(0.1, 5.0);
        RelativeSpectrum::of(&times_s, &angle_deg, &[piece], within_hz).expect("a spectrum")
    }

    /// The trunk, three branches of level 2 and two of level 3, each with these waves, Hz.
    fn study_of(waves_hz: [&[f64]; 6]) -> Study {
        let mut study = study(&TREE);
        for (i, waves_hz) in waves_hz.into_iter().enumerate() {
            let branch = &mut study.branches[i];
            branch.level = [1, 2, 2, 2, 3, 3][i];
            branch.order = [0, 0, 1, 1, 1, 2][i];
            branch.times_s = vec![0.0];
            branch.over_background = Some(spectrum(i as u64, waves_hz));
        }
        study
    }

    const TREE_HZ: &[f64] = &[0.8];

    #[test]
    fn what_the_trunk_and_half_of_the_others_have_is_common() {
        let none: &[f64] = &[];
        let found = pattern(&study_of([
            TREE_HZ,
            TREE_HZ,
            &[0.8, 1.7],
            none,
            &[0.8, 2.4],
            &[2.4],
        ]));
        assert_eq!(found.resolution_hz, Some(1.0 / SPAN_S));
        let common = found.common.expect("a common peak");
        assert_eq!(common.len(), 1);
        assert!((common[0].frequency_hz - 0.8).abs() < 0.01, "{common:?}");
        assert_eq!((common[0].branches_with, common[0].branches), (4, 6));
        let orders: Vec<_> = found.levels.iter().map(|l| l.orders.clone()).collect();
        assert_eq!(orders, [0..=0, 0..=1, 1..=2]);
        let peaks = |level: usize| found.levels[level].peaks.len();
        // Of level 2 one branch has 1.7 Hz, of level 3 half have 0.8 Hz and both 2.4 Hz.
        assert_eq!([peaks(0), peaks(1), peaks(2)], [1, 1, 2]);
    }

    #[test]
    fn the_clearest_common_peak_is_the_first_and_each_counts_once() {
        let both: &[f64] = &[0.8, 0.8, 1.7];
        let found = pattern(&study_of([both; 6]));
        let common = found.common.expect("common peaks");
        let hz: Vec<f64> = common.iter().map(|p| p.frequency_hz).collect();
        assert_eq!(hz.len(), 2, "{common:?}");
        assert!((hz[0] - 0.8).abs() < 0.02 && (hz[1] - 1.7).abs() < 0.02);
        assert!(common[0].over_background > common[1].over_background);
    }

    #[test]
    fn where_there_is_none_the_reason_is_said() {
        let silent: &[f64] = &[];
        let apart: &[f64] = &[1.2];
        let of = |waves_hz| pattern(&study_of(waves_hz)).common;
        assert_eq!(
            of([TREE_HZ, TREE_HZ, TREE_HZ, TREE_HZ, apart, apart]),
            Err(NoCommonPeak::Apart)
        );
        assert_eq!(
            of([TREE_HZ, silent, silent, TREE_HZ, TREE_HZ, TREE_HZ]),
            Err(NoCommonPeak::NoPeak(2))
        );
        let mut flat = study_of([TREE_HZ; 6]);
        flat.branches.truncate(4);
        assert_eq!(pattern(&flat).common, Err(NoCommonPeak::NoBranch(3)));
        for branch in &mut flat.branches {
            branch.over_background = None;
        }
        let short = pattern(&flat);
        assert_eq!(short.common, Err(NoCommonPeak::TooShort));
        assert!(short.levels.is_empty() && short.resolution_hz.is_none());
        assert_eq!(pattern(&study(&TREE)).common, Err(NoCommonPeak::NoAngles));
    }
}
