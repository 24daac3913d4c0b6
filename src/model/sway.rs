//! How a branch sways, as far as the film says.

use std::fmt;

/// A value with its 95 % interval, all in one unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub value: f64,
    pub lo: f64,
    pub hi: f64,
}

impl Interval {
    /// Half a 95 % interval in standard deviations: quantile of the normal distribution.
    pub const Z: f64 = 1.96;

    /// Whether the interval holds `x`.
    pub fn holds(&self, x: f64) -> bool {
        self.lo <= x && x <= self.hi
    }

    /// Half of its width as a share of the value.
    pub fn within(&self) -> f64 {
        0.5 * (self.hi - self.lo) / self.value
    }

    /// Whether some value is in both.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.lo <= other.hi && other.lo <= self.hi
    }
}

/// What made the tree sway.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Excitation {
    /// Pulled and released: the sway decays freely.
    Release,
    /// Driven all the time by something irregular.
    Wind,
}

/// How a branch sways against the one that carries it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sway {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: Interval,
    /// Share of critical damping; `None` where only the frequency is known.
    pub damping_ratio: Option<Interval>,
    pub excitation: Excitation,
    /// Of the sway in the angle to the carrier: at its largest after a release, square root of 2
    /// times the root mean square in wind; degrees. No number where it is not known.
    pub amplitude_deg: f64,
}

/// Why a branch has no frequency of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unidentified {
    /// Nothing was measured on it: the foot, a branch that no point follows, a tree that was
    /// not filmed.
    NotMeasured,
    /// Too few frames, or too few periods of its sway.
    TooShort,
    /// It does not move beyond what noise does.
    TooLittleMotion,
    /// It moves only as those that carry it do.
    AncestorsSway,
    /// It may sway faster than the real times of the frames can tell.
    AboveSampling,
    /// It moves, but there is no oscillation that can be told from the rest.
    NoOscillation,
    /// There is one, but the data allow frequencies that are too far apart.
    TooUncertain,
    /// The end was wanted before its turn came: the capture has all that is needed to tell it.
    NotInTime,
}

/// The sway of a branch, or why there is none to tell.
pub type Swaying = Result<Sway, Unidentified>;

impl Excitation {
    /// One word for files and options.
    pub fn word(self) -> &'static str {
        match self {
            Self::Release => "release",
            Self::Wind => "wind",
        }
    }

    /// The excitation of that [`word`](Self::word).
    pub fn of_word(word: &str) -> Option<Self> {
        [Self::Release, Self::Wind]
            .into_iter()
            .find(|e| e.word() == word)
    }
}

impl Unidentified {
    pub const ALL: [Self; 8] = [
        Self::NotMeasured,
        Self::TooShort,
        Self::TooLittleMotion,
        Self::AncestorsSway,
        Self::AboveSampling,
        Self::NoOscillation,
        Self::TooUncertain,
        Self::NotInTime,
    ];

    /// One word for files.
    pub fn word(self) -> &'static str {
        match self {
            Self::NotMeasured => "not_measured",
            Self::TooShort => "too_short",
            Self::TooLittleMotion => "too_little_motion",
            Self::AncestorsSway => "ancestors_sway",
            Self::AboveSampling => "above_sampling",
            Self::NoOscillation => "no_oscillation",
            Self::TooUncertain => "too_uncertain",
            Self::NotInTime => "not_in_time",
        }
    }

    /// The reason of that [`word`](Self::word).
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|u| u.word() == word)
    }
}

impl fmt::Display for Unidentified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotMeasured => "not measured",
            Self::TooShort => "the film is too short",
            Self::TooLittleMotion => "too little motion",
            Self::AncestorsSway => "moves only with the branch that carries it",
            Self::AboveSampling => "may be faster than the frames can tell",
            Self::NoOscillation => "no oscillation of its own",
            Self::TooUncertain => "too uncertain",
            Self::NotInTime => "not looked at: the end was wanted first",
        })
    }
}
