//! Plain words for what the tables say in one.

use super::pattern::{LEVELS, Pattern};
use super::study::{Gap, Study};
use super::values::number;
use crate::dynamics::Start;
use crate::model::{Excitation, Unidentified};

/// What made the tree sway, and how that was judged.
pub fn excitation(study: &Study) -> String {
    let Some(onset) = study.onset else {
        return "unknown: the film is too short to judge it".into();
    };
    let by = match study.given {
        Some(_) => "as --excitation or the settings say",
        None => match (onset.excitation, onset.start) {
            (Excitation::Release, Start::Rest) => {
                "judged from the motion, which begins from rest and decays"
            }
            (Excitation::Release, Start::Moving) => {
                "judged from the motion, which decays as free vibration does"
            }
            (Excitation::Wind, _) => {
                "judged from the motion, which does not decay as free vibration does"
            }
        },
    };
    match (onset.excitation, onset.start) {
        (Excitation::Release, Start::Rest) => {
            format!("pulled and let go at {:.2} s, {by}", onset.at_s)
        }
        (Excitation::Release, Start::Moving) => {
            format!("swinging freely from {:.2} s on, {by}", onset.at_s)
        }
        (Excitation::Wind, _) => format!("wind, {by}"),
    }
}

/// What part of the film was analysed, and how many frames that is.
pub fn frames(study: &Study) -> String {
    let rate = study.rate_hz();
    let rate = if rate.is_finite() {
        format!(" at {rate:.1} frames/s")
    } else {
        String::new()
    };
    format!(
        "{:.1} to {:.1} s of the film, {}{rate}",
        study.span_s.lo,
        study.span_s.hi,
        number_of(study.frames, "frame")
    )
}

/// What is missing between the frames.
pub fn gaps(study: &Study) -> String {
    let longest = study
        .gaps
        .iter()
        .max_by(|a, b| a.length_s.total_cmp(&b.length_s));
    match longest {
        None => "no gaps".into(),
        Some(Gap { after_s, length_s }) => {
            format!(
                "{}, the longest {length_s:.2} s after {after_s:.2} s",
                number_of(study.gaps.len(), "gap")
            )
        }
    }
}

/// `common to levels 1 to 3: 0.76 Hz, in 11 of 14 branches (frequencies within 0.05 Hz count as
/// one)`, or why there is none.
pub fn common_peaks(pattern: &Pattern) -> String {
    let common = match &pattern.common {
        Err(why) => format!("none: {why}"),
        Ok(peaks) => {
            let mut words = Vec::with_capacity(peaks.len());
            for peak in peaks {
                words.push(format!(
                    "{} Hz, in {} of {}",
                    number(peak.frequency_hz, 2),
                    peak.branches_with,
                    number_of(peak.branches, "branch")
                ));
            }
            words.join("; ")
        }
    };
    let within = match pattern.resolution_hz {
        Some(hz) => format!(" (within {} Hz frequencies count as one)", number(hz, 2)),
        None => String::new(),
    };
    format!(
        "dominant peak common to levels {} to {}: {common}{within}",
        LEVELS.start(),
        LEVELS.end()
    )
}

/// `1 gap`, `2 gaps`.
pub fn number_of(n: usize, what: &str) -> String {
    match n {
        1 => format!("1 {what}"),
        n => format!("{n} {}", plural(what)),
    }
}

fn plural(what: &str) -> String {
    match what.strip_suffix("ch") {
        Some(stem) => format!("{stem}ches"),
        None => format!("{what}s"),
    }
}

/// Why a branch has no frequency, and what would help, in a sentence.
pub fn why(reason: Unidentified) -> &'static str {
    match reason {
        Unidentified::NotMeasured => {
            "Too few points could be followed there for long enough: after a release four are needed, in wind two."
        }
        Unidentified::TooShort => {
            "The film is too short, or shows too few periods of the sway: film for longer."
        }
        Unidentified::TooLittleMotion => {
            "Hardly more motion than the noise of the points: pull harder, wait for more wind, or film from nearer."
        }
        Unidentified::AncestorsSway => {
            "The points move with the parent branch, and no motion beyond that was found. The \
             branch has a frequency of its own, which this film does not show; pulling at the \
             branch itself may."
        }
        Unidentified::AboveSampling => {
            "At this rate of frames a faster sway would look the same: film with more frames a second."
        }
        Unidentified::NoOscillation => {
            "There is motion, but the points do not share one oscillation: they may lie on several \
             branches, or be few and noisy."
        }
        Unidentified::TooUncertain => {
            "There is an oscillation, but the film allows frequencies too far apart: film for longer."
        }
        Unidentified::NotInTime => {
            "The capture ended before this branch was analysed: `arborcam analyze` does it."
        }
    }
}
