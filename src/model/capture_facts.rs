//! What is known of a capture when it is judged, and what of it is not as it should be.

use super::verdict::{Finding, Grade};
use super::{Excitation, FootBasis, ModeSummary, Skeleton, Sway, Swaying, TreeMode, Unidentified};
use serde::{Deserialize, Serialize};

/// The sway of a branch is identified well from so many of its periods: in wind, the 95 % interval of a
/// branch with 2 % of damping is then some 5 % to either side.
const PERIODS_NEEDED: f64 = 10.0;
/// What is to be filmed where no frequency is known, s: ten periods at 0.33 Hz, the slowest sway of
/// a full-grown tree.
const NEEDED_S: f64 = 30.0;
/// The trunk's frequency in wind is to be known within this share of it, either way: what ten periods
/// are meant to give. Its interval shrinks with the root of the length of the film.
const TRUNK_WITHIN: f64 = 0.05;
/// What the trunk asks for is rounded up to multiples of this, s: its interval is itself an estimate, that of
/// the next answer is another one.
const ROUNDED_TO_S: f64 = 5.0;
/// A longer film is not looked at as a whole, s (`dynamics.window_s`, unless it is changed).
const LONGEST_S: f64 = 60.0;
/// Below this share of the length that is needed a film is poor: two or three periods tell a
/// release, and no wind.
const POOR_SHARE: f64 = 0.4;
/// Half a second is not missed.
const LENGTH_SLACK_S: f64 = 0.5;

/// Below this amplitude, px, motion is that of the noise of tracking (0.03 to 0.1 px) as much as of
/// the tree.
const POOR_AMPLITUDE_PX: f64 = 0.3;
/// Below this one, px, the noise is more than a tenth of the motion, and small branches drown in
/// it.
const FAIR_AMPLITUDE_PX: f64 = 1.0;

/// Frames for each period of the fastest sway that is asked for: two by Nyquist, half a one more
/// as frames are not evenly spaced.
const FRAMES_PER_PERIOD: f64 = 2.5;
/// With fewer frames a second not even a trunk (up to 2 Hz) is identified, and points jump too far from
/// frame to frame to be followed.
const POOR_RATE_HZ: f64 = 5.0;

/// Points that are followed for less, s, are lost before a branch has swayed to and fro ten times.
const FAIR_LIFE_S: f64 = 15.0;
/// The same for one period of a slow tree and what a point needs to pass its trial, s.
const POOR_LIFE_S: f64 = 5.0;

/// Mean grey, of 255, below which a picture is mostly black: what is seen in it is the sensor's
/// noise.
const POOR_GREY: f64 = 16.0;
/// The same where bark and twigs have a few grey levels only.
const FAIR_GREY: f64 = 35.0;

/// A camera that shakes by more, px, shakes as much as small branches move.
const FAIR_SHAKE_PX: f64 = 0.5;
/// By more than this the background leaves the places at which it is compared.
const POOR_SHAKE_PX: f64 = 5.0;

/// What is known of a capture when it is judged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CaptureFacts {
    /// More may come: what is not there yet is not called missing.
    #[serde(skip)]
    pub is_filming: bool,
    /// How far points move, px: amplitude of a quarter of them or more; `None` where none was
    /// followed.
    pub amplitude_px: Option<f64>,
    /// Length of the film, s.
    pub filmed_s: f64,
    /// Frames a second by their own times.
    pub rate_hz: Option<f64>,
    /// Highest frequency that is looked for, Hz.
    pub highest_hz: f64,
    pub points: PointFacts,
    /// Mean grey of the picture, 0 to 255.
    pub brightness: Option<f64>,
    /// `None` without a tree.
    pub foot: Option<FootBasis>,
    /// The outline that was found by motion holds another trunk.
    #[serde(default)]
    pub has_other_trunk: bool,
    /// `None` where it was not analysed to the end.
    pub sway: Option<SwayFacts>,
    /// How the camera shakes; `None` where that is not known.
    pub shake: Option<Shake>,
    /// Nothing around the tree shows how it moves, nor does the foot of the trunk.
    pub is_camera_unknown: bool,
    /// Nothing but the foot of the trunk shows how it moves: its shift is known, not its turn.
    #[serde(default)]
    pub is_camera_by_foot: bool,
    /// Since when the camera looks elsewhere, s since the first frame; `None` where it does not, or
    /// where that is not known.
    pub camera_moved_at_s: Option<f64>,
    /// Where a piece of the film is missing, or its picture stands still, while its times run on, s
    /// since the first frame; `None` where the film is in one piece, or that is not known.
    pub cut_at_s: Option<f64>,
}

/// What a film lacks that is not in one piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmCut {
    /// Where it is first cut, or its picture stands still, s since the first frame.
    pub at_s: f64,
    /// How much of it is left out, s.
    pub left_out_s: f64,
}

/// How the points were followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointFacts {
    pub followed: u64,
    /// How many of them were still followed at the end.
    pub alive: u64,
    pub lost_per_s: Option<f64>,
}

/// What the sway was found to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SwayFacts {
    /// Branches that were analysed, and those with a frequency.
    pub branches: usize,
    pub identified: usize,
    /// The trunk's own frequency, Hz.
    pub trunk_hz: Option<f64>,
    /// Half of its 95 % interval in wind, as a share of it; `None` after a release, which no longer film
    /// makes surer.
    #[serde(default)]
    pub trunk_within: Option<f64>,
    /// How much film that is by, s; `None`: the whole one.
    #[serde(skip)]
    pub looked_at_s: Option<f64>,
    /// The slowest mode that is surely slower than the trunk's, Hz. The trunk carries all, and what sways
    /// as a whole sways slowest, but for a stout trunk with limp branches.
    #[serde(default)]
    pub slower_hz: Option<f64>,
}

/// How a camera shakes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shake {
    /// Root mean square, px.
    pub rms_px: f64,
    /// The strongest frequency in it, Hz, if one stands out.
    pub frequency_hz: Option<f64>,
}

impl Shake {
    /// Whether it shakes as much as small branches move.
    pub fn is_strong(&self) -> bool {
        self.rms_px >= FAIR_SHAKE_PX
    }
}

/// A mode of the whole tree, as far as a verdict asks for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownMode {
    pub sway: Sway,
    /// Whether it is the trunk's own.
    pub is_trunks: bool,
}

impl From<&TreeMode> for KnownMode {
    fn from(mode: &TreeMode) -> Self {
        Self {
            sway: mode.sway,
            is_trunks: mode.is_trunks,
        }
    }
}

impl From<&ModeSummary> for KnownMode {
    fn from(mode: &ModeSummary) -> Self {
        Self {
            sway: mode.sway,
            is_trunks: mode.is_trunks,
        }
    }
}

impl SwayFacts {
    /// What was found of the sway, by node index, and of the modes of the whole tree; `None` where some of
    /// it was not looked at.
    pub fn of(
        skeleton: &Skeleton,
        sways: &[Swaying],
        modes: impl Iterator<Item = KnownMode>,
    ) -> Option<Self> {
        let mut facts = Self::default();
        let modes: Vec<KnownMode> = modes.collect();
        if let Some(trunk) = modes.iter().find(|mode| mode.is_trunks) {
            let own = trunk.sway.frequency_hz;
            facts.trunk_hz = Some(own.value);
            facts.trunk_within = (trunk.sway.excitation == Excitation::Wind).then(|| own.within());
            let slower = modes
                .iter()
                .map(|mode| mode.sway.frequency_hz)
                .filter(|hz| hz.hi < own.lo);
            facts.slower_hz = slower.map(|hz| hz.value).min_by(f64::total_cmp);
        }
        for node in skeleton.measured_branches() {
            match sways.get(node.index())? {
                Err(Unidentified::NotInTime) => return None,
                Err(Unidentified::NotMeasured) => continue,
                Err(_) => {}
                Ok(_) => facts.identified += 1,
            }
            facts.branches += 1;
        }
        Some(facts)
    }
}

impl CaptureFacts {
    /// The same of a film that was found to be `cut`. One that was known to be cut stays as it is:
    /// of a part of the film it is not known whether another one is cut.
    pub fn with_cut(self, cut: Option<FilmCut>) -> Self {
        match cut {
            Some(cut) if self.cut_at_s.is_none() => Self {
                filmed_s: (self.filmed_s - cut.left_out_s).max(0.0),
                cut_at_s: Some(cut.at_s),
                ..self
            },
            _ => self,
        }
    }

    /// All that is not as it should be, the worst first.
    pub(super) fn findings(&self) -> Vec<Finding> {
        let found = [
            self.camera_moved(),
            self.is_cut(),
            self.shakes(),
            self.hides_shake(),
            self.is_dark(),
            self.has_few_frames(),
            self.moves_little(),
            self.is_short(),
            self.is_unsure_of_trunk(),
            self.has_slower_than_trunk(),
            self.loses_points(),
            self.has_no_foot(),
            self.is_not_alone(),
        ];
        let mut findings: Vec<Finding> = found.into_iter().flatten().collect();
        let sway = self.tells_no_sway(findings.is_empty());
        findings.extend(sway);
        // The order of equals stays: causes come before what follows from them.
        findings.sort_by_key(|finding| std::cmp::Reverse(finding.grade));
        findings
    }

    /// What is still to be filmed for the frequencies of the branches, s; 0 where nothing is.
    pub fn missing_s(&self) -> f64 {
        let missing_s = self
            .missing_for_branches_s()
            .max(self.missing_for_trunk_s());
        if missing_s < LENGTH_SLACK_S {
            return 0.0;
        }
        missing_s
    }

    fn missing_for_branches_s(&self) -> f64 {
        self.needed_s() - self.filmed_s
    }

    fn missing_for_trunk_s(&self) -> f64 {
        self.needed_for_trunk_s() - self.filmed_s
    }

    /// What had to be filmed in wind for the trunk to be known well enough, s, as far as that is looked at;
    /// 0 where it is. It stays as it is until the next answer of the sway.
    fn needed_for_trunk_s(&self) -> f64 {
        let within = self.sway.and_then(|sway| sway.trunk_within);
        let share = within.map_or(0.0, |within| within / TRUNK_WITHIN);
        if share <= 1.0 {
            return 0.0;
        }
        let looked_at_s = self.sway.and_then(|sway| sway.looked_at_s);
        let needed_s = share * share * looked_at_s.unwrap_or(self.filmed_s);
        (ROUNDED_TO_S * (needed_s / ROUNDED_TO_S).ceil()).min(LONGEST_S)
    }

    /// What had to be filmed for branches.
    fn needed_s(&self) -> f64 {
        let known_hz = self.sway.and_then(|sway| sway.trunk_hz);
        known_hz.map_or(NEEDED_S, |hz| {
            (PERIODS_NEEDED / hz.max(f64::MIN_POSITIVE)).min(NEEDED_S)
        })
    }

    fn camera_moved(&self) -> Option<Finding> {
        let at_s = self.camera_moved_at_s?;
        Some(Finding {
            grade: Grade::Fair,
            reason: format!("camera moved at {at_s:.1} s"),
            advice: "fix the camera and film again".into(),
        })
    }

    fn is_cut(&self) -> Option<Finding> {
        let at_s = self.cut_at_s?;
        Some(Finding {
            grade: Grade::Fair,
            reason: format!("film cut or stalled at {at_s:.1} s"),
            advice: "film again in one piece".into(),
        })
    }

    fn shakes(&self) -> Option<Finding> {
        let Shake {
            rms_px,
            frequency_hz,
        } = self.shake?;
        let grade = Grade::of(-rms_px, -FAIR_SHAKE_PX, -POOR_SHAKE_PX)?;
        let at = frequency_hz.map_or(String::new(), |hz| format!(" at {hz:.1} Hz"));
        Some(Finding {
            grade,
            reason: format!("shakes {rms_px:.1} px{at}"),
            advice: "shelter the camera from wind and load the tripod".into(),
        })
    }

    fn hides_shake(&self) -> Option<Finding> {
        let reason = if self.is_camera_unknown {
            "nothing around the tree shows how the camera moves"
        } else if self.is_camera_by_foot {
            "nothing around the tree but its foot shows how the camera moves"
        } else {
            return None;
        };
        Some(Finding {
            grade: Grade::Fair,
            reason: reason.into(),
            advice: "film more of the ground and of what stands still".into(),
        })
    }

    fn is_dark(&self) -> Option<Finding> {
        let grade = Grade::of(self.brightness?, FAIR_GREY, POOR_GREY)?;
        Some(Finding {
            grade,
            reason: "too dark".into(),
            advice: "film with more light".into(),
        })
    }

    fn has_few_frames(&self) -> Option<Finding> {
        let rate_hz = self.rate_hz?;
        let wanted_hz = FRAMES_PER_PERIOD * self.highest_hz;
        let grade = Grade::of(rate_hz, wanted_hz, POOR_RATE_HZ.min(wanted_hz))?;
        Some(Finding {
            grade,
            reason: format!("{rate_hz:.1} frames/s are too few"),
            advice: format!("film with {:.0} frames/s or more", wanted_hz.ceil()),
        })
    }

    fn moves_little(&self) -> Option<Finding> {
        let amplitude_px = self.amplitude_px?;
        let grade = Grade::of(amplitude_px, FAIR_AMPLITUDE_PX, POOR_AMPLITUDE_PX)?;
        Some(Finding {
            grade,
            reason: format!("moves by {amplitude_px:.1} px only"),
            advice: "come nearer, or film in more wind".into(),
        })
    }

    fn is_short(&self) -> Option<Finding> {
        let needed_s = self.needed_s();
        if self.missing_for_branches_s() < LENGTH_SLACK_S {
            return None;
        }
        let grade = Grade::of(self.filmed_s, needed_s, POOR_SHARE * needed_s)?;
        let (filmed_s, needed_s) = (self.filmed_s.round(), self.needed_in_all_s());
        Some(Finding {
            grade,
            reason: format!("{filmed_s:.0} of {needed_s:.0} s filmed"),
            advice: self.film_more(),
        })
    }

    /// What had to be filmed for branches and trunk: one number for both, in whole seconds.
    fn needed_in_all_s(&self) -> f64 {
        self.needed_s().ceil().max(self.needed_for_trunk_s())
    }

    /// What is still to be filmed, in whole seconds that add up with what is filmed.
    fn film_more(&self) -> String {
        let missing_s = self.needed_in_all_s() - self.filmed_s.round();
        format!("film {:.0} s more", missing_s.max(1.0))
    }

    fn is_unsure_of_trunk(&self) -> Option<Finding> {
        let within = self.sway?.trunk_within?;
        if within <= TRUNK_WITHIN {
            return None;
        }
        Some(Finding {
            grade: Grade::Fair,
            reason: format!("trunk's frequency within {:.1} % only", 100.0 * within),
            advice: match self.missing_for_trunk_s() >= LENGTH_SLACK_S {
                true => self.film_more(),
                false => "pull the tree and release it".into(),
            },
        })
    }

    fn has_slower_than_trunk(&self) -> Option<Finding> {
        let sway = self.sway?;
        let (trunk_hz, slower_hz) = (sway.trunk_hz?, sway.slower_hz?);
        Some(Finding {
            grade: Grade::Fair,
            reason: format!(
                "a part sways at {slower_hz:.2} Hz, slower than the trunk at {trunk_hz:.2} Hz, which is rare: one of \
                 the two may be wrong"
            ),
            advice: match sway.trunk_within {
                Some(_) => "pull the tree and release it".into(),
                None => "pull it at another place, and film that".into(),
            },
        })
    }

    fn loses_points(&self) -> Option<Finding> {
        let PointFacts {
            followed,
            alive,
            lost_per_s,
        } = self.points;
        // Where as many are found as are lost, a point is followed for so long in the mean.
        let life_s = alive as f64 / lost_per_s.filter(|lost| *lost > 0.0)?;
        let grade = Grade::of(life_s, FAIR_LIFE_S, POOR_LIFE_S)?;
        let lost = followed.saturating_sub(alive);
        Some(Finding {
            grade,
            reason: format!("{lost} of {followed} points lost"),
            advice: "keep people and traffic out of the view, and focus and exposure fixed".into(),
        })
    }

    fn has_no_foot(&self) -> Option<Finding> {
        let (reason, advice) = match self.foot? {
            FootBasis::CutOff => ("foot cut off", "film the whole tree with its foot"),
            FootBasis::Guessed => ("foot is a guess", "draw the outline down to the foot"),
            FootBasis::Outline | FootBasis::Drawn => return None,
        };
        Some(Finding {
            grade: Grade::Fair,
            reason: reason.into(),
            advice: advice.into(),
        })
    }

    fn is_not_alone(&self) -> Option<Finding> {
        self.has_other_trunk.then(|| Finding {
            grade: Grade::Fair,
            reason: "two trunks in the outline".into(),
            advice: "draw an outline around one tree".into(),
        })
    }

    /// A tree or a frequency that was not found; what to do about it is said by its causes, where
    /// there are some.
    fn tells_no_sway(&self, no_cause: bool) -> Option<Finding> {
        let (grade, reason) = match (self.foot, self.sway) {
            (None, _) if self.is_filming => (Grade::Poor, "no tree yet"),
            (None, _) => (Grade::Poor, "no tree found"),
            (Some(_), None) => return None,
            (Some(_), Some(sway)) if sway.identified == 0 && sway.branches > 0 => {
                (Grade::Poor, "no frequency identified")
            }
            (Some(_), Some(sway)) if sway.trunk_hz.is_none() && sway.branches > 0 => {
                (Grade::Fair, "the trunk's frequency not identified")
            }
            _ => return None,
        };
        let advice = if no_cause {
            "film longer, or pull the tree and release it"
        } else {
            ""
        };
        Some(Finding {
            grade,
            reason: reason.into(),
            advice: advice.into(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Bounds;
    use crate::model::{Interval, Node, Size};

    fn sway(hz: f64) -> Swaying {
        let Bounds { lo, hi } = Bounds::new(0.95 * hz, 1.05 * hz);
        Ok(Sway {
            frequency_hz: Interval { value: hz, lo, hi },
            damping_ratio: None,
            excitation: Excitation::Wind,
            amplitude_deg: 1.0,
        })
    }

    /// Two branches on the foot, of which the first is the trunk, and a mode of a branch that the tree
    /// lacks.
    #[test]
    fn the_trunk_is_the_one_that_the_analysis_took_for_it() {
        let tree = Skeleton {
            nodes: vec![
                Node::made_up(0, None, [0.0; 3]),
                Node::made_up(1, Some(0), [0.0, 50.0, 0.0]),
                Node::made_up(2, Some(0), [0.0, 60.0, 0.0]),
            ],
            foot_px: [0.0; 2].into(),
            image_size: Size::new(64, 64),
        };
        let none = Err(Unidentified::NotMeasured);
        let facts_of = |trunk: Swaying, other_hz: f64| {
            let sways = [none, trunk, sway(0.8)];
            let modes = [trunk, sway(other_hz), sway(0.8)]
                .into_iter()
                .zip([true, false, false]);
            let known = modes.filter_map(|(swaying, is_trunks)| {
                let sway = swaying.ok()?;
                Some(KnownMode { sway, is_trunks })
            });
            SwayFacts::of(&tree, &sways, known).expect("facts")
        };
        let facts = facts_of(sway(0.5), 0.4);
        assert_eq!((facts.identified, facts.trunk_hz), (2, Some(0.5)));
        assert!(
            facts
                .trunk_within
                .is_some_and(|share| (share - 0.05).abs() < 1e-9)
        );
        // Its interval and that of 0.5 Hz have nothing in common.
        assert_eq!(facts.slower_hz, Some(0.4));
        assert_eq!(facts_of(sway(0.5), 0.46).slower_hz, None);
        let facts = facts_of(Err(Unidentified::TooUncertain), 0.4);
        assert_eq!((facts.branches, facts.trunk_hz), (2, None));
        assert_eq!((facts.trunk_within, facts.slower_hz), (None, None));
    }
}
