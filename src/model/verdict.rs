//! What a capture is worth, in plain words: good, fair or poor, why, and what to do.

use super::CaptureFacts;
use serde::{Deserialize, Serialize};

/// What a capture is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    #[default]
    Good,
    /// To be used with care.
    Fair,
    /// Not to be trusted.
    Poor,
}

/// What a capture is worth, why, and what to do.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Verdict {
    pub grade: Grade,
    /// What is not as it should be, the worst first.
    pub reasons: Vec<String>,
    /// What to do about it, in the same order.
    pub advice: Vec<String>,
}

/// A verdict, and what it rests on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    pub verdict: Verdict,
    pub facts: CaptureFacts,
}

/// One thing that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    pub grade: Grade,
    /// Half a sentence.
    pub reason: String,
    /// What to do, likewise.
    /// Empty where it follows from the others.
    pub advice: String,
}

impl Judgement {
    /// Judges a capture.
    pub fn of(facts: CaptureFacts) -> Self {
        let verdict = Verdict::of(&facts);
        Self { verdict, facts }
    }
}

impl Grade {
    /// One word for files and screens.
    pub fn word(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Fair => "fair",
            Self::Poor => "poor",
        }
    }

    /// The grade of a value of which more is better; `None` is good.
    pub fn of(value: f64, fair: f64, poor: f64) -> Option<Self> {
        if value < poor {
            Some(Self::Poor)
        } else if value < fair {
            Some(Self::Fair)
        } else {
            None
        }
    }
}

impl Verdict {
    /// Judges a capture.
    pub fn of(facts: &CaptureFacts) -> Self {
        Self::of_findings(facts.findings())
    }

    /// The verdict of these findings, the worst first.
    pub fn of_findings(findings: impl IntoIterator<Item = Finding>) -> Self {
        findings.into_iter().fold(Self::default(), Self::with)
    }

    /// The same with one more finding at the end, which is no worse than those before.
    pub fn with(mut self, finding: Finding) -> Self {
        let Finding {
            grade,
            reason,
            advice,
        } = finding;
        self.grade = self.grade.max(grade);
        self.reasons.push(reason);
        if !advice.is_empty() && !self.advice.contains(&advice) {
            self.advice.push(advice);
        }
        self
    }

    /// The verdict in a line: `poor, because moves by 0.4 px only; come nearer`.
    pub fn line(&self) -> String {
        let grade = self.grade.word();
        if self.reasons.is_empty() {
            return grade.into();
        }
        let because = format!("{grade}, because: {}", self.reasons.join("; "));
        if self.advice.is_empty() {
            return because;
        }
        format!("{because}. To do: {}", self.advice.join("; "))
    }

    /// The same as a line of its own, for terminals and tables.
    pub fn labelled_line(&self) -> String {
        format!("verdict: {}", self.line())
    }

    /// As much of it as fits `room` columns, what matters most before all else: the grade, the
    /// worst reason, after an arrow what to do first; how many further reasons there are stands for those.
    pub fn line_within(&self, room: usize) -> String {
        let grade = self.grade.word();
        let Some(worst) = self.reasons.first() else {
            return grade.chars().take(room).collect();
        };
        let all = format!("{grade}: {}", self.reasons.join("; "));
        let further = match self.reasons.len() - 1 {
            0 => String::new(),
            n => format!(" (+{n})"),
        };
        let first = format!("{grade}: {worst}{further}");
        let mut lines = Vec::new();
        if let Some(advice) = self.advice.first() {
            lines.push(format!("{all} → {}", self.advice.join("; ")));
            lines.push(format!("{all} → {advice}"));
            lines.push(format!("{first} → {advice}"));
        }
        lines.extend([all, first, format!("{grade}: {worst}")]);
        let fits = |line: &String| line.chars().count() <= room;
        let whole = lines.into_iter().find(fits);
        whole.unwrap_or_else(|| grade.chars().take(room).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{FootBasis, PointFacts, Shake, SwayFacts};

    /// A minute in good wind, all of it told.
    fn good() -> CaptureFacts {
        CaptureFacts {
            is_filming: false,
            amplitude_px: Some(4.0),
            filmed_s: 60.0,
            rate_hz: Some(30.0),
            highest_hz: 5.0,
            points: PointFacts {
                followed: 322,
                alive: 280,
                lost_per_s: Some(0.7),
            },
            brightness: Some(110.0),
            foot: Some(FootBasis::Outline),
            has_other_trunk: false,
            sway: Some(SwayFacts {
                branches: 12,
                identified: 5,
                trunk_hz: Some(0.5),
                trunk_within: Some(0.04),
                looked_at_s: None,
                slower_hz: None,
            }),
            shake: None,
            is_camera_unknown: false,
            is_camera_by_foot: false,
            camera_moved_at_s: None,
            cut_at_s: None,
        }
    }

    fn check(name: &str, change: impl FnOnce(&mut CaptureFacts), expected: &str) {
        let mut facts = good();
        change(&mut facts);
        assert_eq!(Verdict::of(&facts).line(), expected, "{name}");
    }

    fn sway(identified: usize, trunk_hz: Option<f64>) -> Option<SwayFacts> {
        Some(SwayFacts {
            branches: 12,
            identified,
            trunk_hz,
            ..SwayFacts::default()
        })
    }

    /// What was found in wind, where the trunk is known within a share of its frequency.
    fn in_wind(trunk_within: f64) -> Option<SwayFacts> {
        let found = sway(5, Some(0.5))?;
        Some(SwayFacts {
            trunk_within: Some(trunk_within),
            ..found
        })
    }

    #[test]
    fn a_verdict_says_what_is_wrong_and_what_to_do() {
        check("all well", |_| {}, "good");
        check(
            "night",
            |f| f.brightness = Some(9.0),
            "poor, because: too dark. To do: film with more light",
        );
        check(
            "calm",
            |f| f.amplitude_px = Some(0.4),
            "fair, because: moves by 0.4 px only. To do: come nearer, or film in more wind",
        );
        check(
            "still",
            |f| (f.amplitude_px, f.sway) = (Some(0.1), sway(0, None)),
            "poor, because: moves by 0.1 px only; no frequency identified. To do: come nearer, \
             or film in more wind",
        );
        check(
            "wind that tells the trunk roughly",
            |f| (f.filmed_s, f.sway) = (40.0, in_wind(0.06)),
            "fair, because: trunk's frequency within 6.0 % only. To do: film 20 s more",
        );
        check(
            "too little of it for branches and trunk",
            |f| (f.filmed_s, f.sway) = (8.0, in_wind(0.06)),
            "fair, because: 8 of 20 s filmed; trunk's frequency within 6.0 % only. To do: film 12 s \
             more",
        );
        check(
            "a minute of it",
            |f| (f.filmed_s, f.sway) = (60.0, in_wind(0.08)),
            "fair, because: trunk's frequency within 8.0 % only. To do: pull the tree and release it",
        );
        check(
            "ten seconds after its sway was looked at",
            |f| {
                let found = in_wind(0.06);
                f.filmed_s = 40.0;
                f.sway = found.map(|sway| SwayFacts {
                    looked_at_s: Some(30.0),
                    ..sway
                });
            },
            "fair, because: trunk's frequency within 6.0 % only. To do: film 5 s more",
        );
        check(
            "more for the trunk than for branches",
            |f| (f.filmed_s, f.sway) = (15.0, in_wind(0.08)),
            "fair, because: 15 of 40 s filmed; trunk's frequency within 8.0 % only. To do: film 25 s \
             more",
        );
        check(
            "a part slower than the trunk of a tree that was pulled",
            |f| {
                f.sway = sway(5, Some(0.5)).map(|sway| SwayFacts {
                    slower_hz: Some(0.41),
                    ..sway
                });
            },
            "fair, because: a part sways at 0.41 Hz, slower than the trunk at 0.50 Hz, which is \
             rare: one of the two may be wrong. To do: pull it at another place, and film that",
        );
        check(
            "a limb slower than the trunk",
            |f| {
                let found = in_wind(0.04);
                f.sway = found.map(|sway| SwayFacts {
                    slower_hz: Some(0.41),
                    ..sway
                });
            },
            "fair, because: a part sways at 0.41 Hz, slower than the trunk at 0.50 Hz, which is \
             rare: one of the two may be wrong. To do: pull the tree and release it",
        );
        check(
            "12 s of wind that tell nothing",
            |f| (f.filmed_s, f.sway) = (12.0, sway(0, None)),
            "poor, because: no frequency identified; 12 of 30 s filmed. To do: film 18 s more",
        );
        check(
            "12 s of a release",
            |f| (f.filmed_s, f.sway) = (12.0, sway(7, Some(0.9))),
            "good",
        );
        check(
            "4 s",
            |f| (f.filmed_s, f.sway) = (4.0, None),
            "poor, because: 4 of 30 s filmed. To do: film 26 s more",
        );
        check(
            "a time lapse",
            |f| f.rate_hz = Some(2.3),
            "poor, because: 2.3 frames/s are too few. To do: film with 13 frames/s or more",
        );
        check(
            "a slow camera for slow trees",
            |f| (f.rate_hz, f.highest_hz) = (Some(4.0), 1.5),
            "good",
        );
        check(
            "somebody walks through",
            |f| {
                f.points = PointFacts {
                    followed: 322,
                    alive: 54,
                    lost_per_s: Some(9.0),
                };
            },
            "fair, because: 268 of 322 points lost. To do: keep people and traffic out of the \
             view, and focus and exposure fixed",
        );
        check(
            "hours of film in which points come and go",
            |f| {
                f.points = PointFacts {
                    followed: 9000,
                    alive: 300,
                    lost_per_s: Some(2.4),
                };
            },
            "good",
        );
        check(
            "close-up",
            |f| f.foot = Some(FootBasis::CutOff),
            "fair, because: foot cut off. To do: film the whole tree with its foot",
        );
        check(
            "a tree behind it moves, too, and no outline was drawn",
            |f| f.has_other_trunk = true,
            "fair, because: two trunks in the outline. To do: draw an outline around one tree",
        );
        check(
            "only branches are identified",
            |f| f.sway = sway(3, None),
            "fair, because: the trunk's frequency not identified. To do: film longer, or pull the \
             tree and release it",
        );
        check(
            "no tree",
            |f| (f.foot, f.sway, f.amplitude_px) = (None, None, None),
            "poor, because: no tree found. To do: film longer, or pull the tree and release it",
        );
        check(
            "no tree yet",
            |f| (f.foot, f.sway, f.filmed_s, f.is_filming) = (None, None, 9.0, true),
            "poor, because: 9 of 30 s filmed; no tree yet. To do: film 21 s more",
        );
        check(
            "a tripod in the wind",
            |f| {
                f.shake = Some(Shake {
                    rms_px: 1.5,
                    frequency_hz: Some(2.2),
                });
            },
            "fair, because: shakes 1.5 px at 2.2 Hz. To do: shelter the camera from wind and load \
             the tripod",
        );
        check(
            "a tree before the sky",
            |f| f.is_camera_unknown = true,
            "fair, because: nothing around the tree shows how the camera moves. To do: film more of \
             the ground and of what stands still",
        );
        check(
            "a tree before the sky, with its foot",
            |f| f.is_camera_by_foot = true,
            "fair, because: nothing around the tree but its foot shows how the camera moves. To do: \
             film more of the ground and of what stands still",
        );
        check(
            "somebody kicked the tripod in the dark",
            |f| (f.camera_moved_at_s, f.brightness) = (Some(12.34), Some(30.0)),
            "fair, because: camera moved at 12.3 s; too dark. To do: fix the camera and film \
             again; film with more light",
        );
        check(
            "two seconds are cut out",
            |f| (f.cut_at_s, f.filmed_s) = (Some(5.04), 12.0),
            "fair, because: film cut or stalled at 5.0 s; 12 of 20 s filmed. To do: film again in \
             one piece; film 8 s more",
        );
    }

    /// Live, before there are two frames.
    #[test]
    fn what_is_not_known_is_no_reason() {
        let unknown = CaptureFacts {
            filmed_s: 30.0,
            foot: Some(FootBasis::Outline),
            ..CaptureFacts::default()
        };
        assert_eq!(Verdict::of(&unknown), Verdict::default());
    }

    /// A line of a narrow screen says the grade, then the worst reason, then what to do about it.
    #[test]
    fn a_short_line_says_what_matters_most() {
        let verdict = Verdict {
            grade: Grade::Poor,
            reasons: vec!["too dark".into(), "9 of 30 s filmed".into()],
            advice: vec!["film with more light".into(), "film 21 s more".into()],
        };
        for (room, expected) in [
            (
                90,
                "poor: too dark; 9 of 30 s filmed → film with more light; film 21 s more",
            ),
            (
                70,
                "poor: too dark; 9 of 30 s filmed → film with more light",
            ),
            (42, "poor: too dark (+1) → film with more light"),
            (41, "poor: too dark; 9 of 30 s filmed"),
            (19, "poor: too dark (+1)"),
            (18, "poor: too dark"),
            (13, "poor"),
            (2, "po"),
            (0, ""),
        ] {
            assert_eq!(verdict.line_within(room), expected);
        }
        assert_eq!(Verdict::default().line_within(80), "good");
        assert_eq!(Verdict::default().labelled_line(), "verdict: good");
    }
}
