//! Plain words for what the tables say in one.

use super::study::Study;
use crate::dynamics::Start;
use crate::model::{Excitation, Unidentified};

/// What made the tree sway, and how that was told.
pub fn excitation(study: &Study) -> String {
    let Some(onset) = study.onset else {
        return "too little film to tell what made it sway".into();
    };
    let by = match study.given {
        Some(_) => "as --excitation or the settings say",
        None => match (onset.excitation, onset.start) {
            (Excitation::Release, Start::Rest) => {
                "told by the motion: it begins from rest and dies down"
            }
            (Excitation::Release, Start::Moving) => {
                "told by the motion: it dies down as free sway does"
            }
            (Excitation::Wind, _) => "told by the motion: it does not die down as free sway does",
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
    let [from, to] = study.span_s;
    let rate = study.rate_hz();
    let rate = if rate.is_finite() {
        format!(" at {rate:.1} frames/s")
    } else {
        String::new()
    };
    format!(
        "{from:.1} to {to:.1} s of the film, {}{rate}",
        number_of(study.frames, "frame")
    )
}

/// What is missing between the frames.
pub fn gaps(study: &Study) -> String {
    let longest = study
        .gaps_s
        .iter()
        .copied()
        .max_by(|a, b| a[1].total_cmp(&b[1]));
    match longest {
        None => "no gaps".into(),
        Some([at, long]) => {
            format!(
                "{}, the longest {long:.2} s after {at:.2} s",
                number_of(study.gaps_s.len(), "gap")
            )
        }
    }
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
            "The points move as those of the carrier do, and nothing beyond that could be told. There is a frequency, and this \
             film does not show it; pulling at the branch itself may."
        }
        Unidentified::AboveSampling => {
            "At this rate of frames a faster sway would look the same: film with more frames a second."
        }
        Unidentified::NoOscillation => {
            "There is motion, but the points do not share one oscillation: they may lie on several branches, or be few and \
             noisy."
        }
        Unidentified::TooUncertain => {
            "There is an oscillation, but the film allows frequencies too far apart: film for longer."
        }
        Unidentified::NotInTime => {
            "The end of the capture was wanted before this branch was looked at: `arborcam analyze` does it."
        }
    }
}
