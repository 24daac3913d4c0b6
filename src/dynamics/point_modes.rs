//! Modes with the points that have them, and the branches that these points are.
//!
//! Whichever way modes were found: one that is in most points of a captured branch, and in few
//! others, is that branch's own; one that is in some points of a branch only is that of a branch
//! that the tree lacks.

use super::branch_tree::BranchTree;
use super::decay::{Mode, USUAL_DAMPING};
use super::film::Film;
use super::members::{arms_px, centred, count_among};
use crate::model::{NodeId, Sway, Swaying, Unidentified};
use crate::signal::statistics::rms;
use nalgebra::Point2;

/// A mode is a captured branch's own if it is in so many of its points at least, and if so much of
/// the points that have it are on that.
const MIN_POINTS: usize = 4;
const MIN_SHARE_OF_MODE: f64 = 0.6;
/// A shoot is on the captured branch that has this share of its points, and begins with those that
/// are on no branch of that.
const MIN_SHARE_ON_CARRIER: f64 = 0.75;
const MIN_SHARE_OF_ITS_OWN: f64 = 0.6;
/// Points that one must have. Nothing but its mode shows it, and four agree by chance more often
/// than five.
const MIN_POINTS_OF_SHOOT: usize = 5;

/// A branch of its own on a captured one that is not known to fork there: some of its points have a
/// mode in common that the others have not.
#[derive(Clone, Debug, PartialEq)]
pub struct Shoot {
    /// The captured branch that carries it.
    pub on: NodeId,
    /// Its points, as indices of the film's tracks, in order.
    pub tracks: Vec<usize>,
}

/// A mode and the points that it moves as one swing.
#[derive(Clone, Debug)]
pub(super) struct PointMode {
    pub mode: Mode,
    /// The captured branch whose own it is, where it was looked for in that branch's points.
    pub branch: Option<usize>,
    /// As indices of the film's tracks, in order.
    pub tracks: Vec<usize>,
    /// The clearest are believed first.
    pub clearness: f64,
    /// A frequency that is no farther from a carrier's than this share is the carrier's.
    pub same_within: f64,
    /// As the answer for a branch, if it is sure enough for one.
    pub sway: Sway,
    pub is_sure: bool,
    /// How much of its motion is one swing of these points, 0 to 1.
    pub collinearity: f64,
    /// The place that it turns them about, px.
    pub pivot_px: Point2<f64>,
}

/// All modes that were found, and the captured tree.
pub(super) struct PointModes {
    pub modes: Vec<PointMode>,
    /// Points on every captured branch and on what it carries, in order, of those that were looked
    /// at.
    pub on: Vec<Vec<usize>>,
    /// Share of a captured branch's points that its own mode is in.
    pub min_share_of_branch: f64,
}

/// Whether a branch has no answer, but might have one.
pub(super) fn is_open(sway: &Swaying) -> bool {
    matches!(
        sway,
        Err(Unidentified::NoOscillation | Unidentified::AncestorsSway | Unidentified::TooUncertain)
    )
}

/// Whether all points at once may have another answer for a branch.
pub(super) fn may_have_other(sway: &Swaying) -> bool {
    sway.is_ok() || is_open(sway)
}

/// The mode that an answer stands for.
pub(super) fn mode_of(sway: &Sway) -> Mode {
    Mode {
        frequency_hz: sway.frequency_hz.value,
        damping: sway.damping_ratio.map_or(USUAL_DAMPING, |d| d.value),
    }
}

/// Of those of some branches that have an answer.
fn known_modes(branches: impl Iterator<Item = NodeId>, sways: &[Swaying]) -> Vec<Mode> {
    let known = branches.filter_map(|b| sways[b.index()].as_ref().ok());
    known.map(mode_of).collect()
}

impl PointMode {
    /// Whether an answer's interval and that of the mode have no frequency in common.
    fn contradicts(&self, answer: &Swaying) -> bool {
        let own = &self.sway.frequency_hz;
        answer
            .as_ref()
            .is_ok_and(|answer| !own.overlaps(&answer.frequency_hz))
    }

    /// The sway of a branch that begins at `base_px`: the points go as far as they do about the pivot by a turn about
    /// that place. They go no farther than they were seen to move; an oscillator that chance drives may be fitted so.
    fn sway_about(&self, base_px: Point2<f64>, film: &Film) -> Sway {
        let arm_px = self.arm_px(self.pivot_px, film);
        let fitted_px = self.sway.amplitude_deg.to_radians() * arm_px;
        // Of both directions together, at its largest.
        let tracks = self.tracks.iter().map(|k| &film.tracks[*k].at_px);
        let moves_px = tracks.flat_map(|at_px| centred(at_px)).flatten();
        let seen_px = 2.0 * rms(moves_px.filter(|px| px.is_finite()));
        let as_seen = (seen_px / fitted_px).min(1.0);
        let as_far = arm_px / self.arm_px(base_px, film);
        Sway {
            amplitude_deg: self.sway.amplitude_deg * as_seen * as_far,
            ..self.sway
        }
    }

    /// How far its points are from a place, root mean square, px.
    fn arm_px(&self, from_px: Point2<f64>, film: &Film) -> f64 {
        rms(arms_px(film, &self.tracks, from_px).map(|arm| arm.norm()))
    }

    fn is_of_carrier(&self, carriers: &[Mode]) -> bool {
        let mut carriers = carriers.iter();
        carriers.any(|c| c.has_frequency_of(&self.mode, self.same_within))
    }
}

impl PointModes {
    /// Answers for the branches of `sways`, but for the trunk, that have none, and for those whose
    /// own mode was looked for in their points. Where that and the answer that is there contradict
    /// each other, nothing is known.
    pub fn answer(&self, tree: &BranchTree, sways: &mut [Swaying]) {
        for b in 2..sways.len() {
            if !may_have_other(&sways[b]) {
                continue;
            }
            let carriers = known_modes(tree.carriers(NodeId(b as u32)), sways);
            if let Some(mode) = self.own_mode(b) {
                if mode.is_sure && !mode.is_of_carrier(&carriers) {
                    sways[b] = if mode.contradicts(&sways[b]) {
                        Err(Unidentified::TooUncertain)
                    } else {
                        Ok(mode.sway)
                    };
                }
                continue;
            }
            if !is_open(&sways[b]) {
                continue;
            }
            let mode = self.mode_of(b, &carriers);
            if let Some(mode) = mode.filter(|mode| mode.is_sure) {
                sways[b] = Ok(mode.sway);
            }
        }
    }

    /// Gives answers that are of these modes their amplitudes about the places where their branches begin.
    pub fn turn_about_bases(&self, tree: &BranchTree, film: &Film, sways: &mut [Swaying]) {
        for (branch, sway) in tree.branches.iter().zip(sways) {
            let Ok(known) = sway else { continue };
            if let Some(mode) = self.modes.iter().find(|mode| mode.sway == *known) {
                *known = mode.sway_about(branch.base_px, film);
            }
        }
    }

    /// The branches that the tree lacks, at most one for every point. The clearest takes them first.
    pub fn shoots(&self, tree: &BranchTree, film: &Film, sways: &[Swaying]) -> Vec<Shoot> {
        let mut modes: Vec<&PointMode> = self.modes.iter().collect();
        modes.sort_by(|a, b| b.clearness.total_cmp(&a.clearness));
        let mut taken = vec![false; film.tracks.len()];
        let mut out = Vec::new();
        for mode in modes {
            let Some(on) = self.carrier_of(mode) else {
                continue;
            };
            let branch = NodeId(on as u32);
            let own = mode.tracks.iter().copied();
            let own: Vec<usize> = own
                .filter(|&k| film.tracks[k].node == branch && !taken[k])
                .collect();
            let least = MIN_SHARE_OF_ITS_OWN * mode.tracks.len() as f64;
            if own.len() < MIN_POINTS_OF_SHOOT || (own.len() as f64) < least {
                continue;
            }
            let carriers: Vec<NodeId> = std::iter::once(branch)
                .chain(tree.carriers(branch))
                .collect();
            let mut of_carriers = known_modes(carriers.iter().copied(), sways);
            for carrier in carriers {
                of_carriers.extend(self.own_mode(carrier.index()).map(|mode| mode.mode));
            }
            if mode.is_of_carrier(&of_carriers) {
                continue;
            }
            for &k in &own {
                taken[k] = true;
            }
            out.push(Shoot {
                on: tree.branches[on].node,
                tracks: own,
            });
        }
        out
    }

    /// The mode that was looked for in the points of captured branch `b`.
    fn own_mode(&self, b: usize) -> Option<&PointMode> {
        self.modes.iter().find(|mode| mode.branch == Some(b))
    }

    /// The smallest captured branch that has most of a mode's points; `None` where there is none,
    /// or the mode is that of a captured branch.
    fn carrier_of(&self, mode: &PointMode) -> Option<usize> {
        let captured = 1..self.on.len();
        let is_captured =
            mode.branch.is_some() || captured.clone().any(|b| self.similarity(b, mode).is_some());
        if is_captured {
            return None;
        }
        let least = MIN_SHARE_ON_CARRIER * mode.tracks.len() as f64;
        captured
            .filter(|&b| count_among(&mode.tracks, &self.on[b]) as f64 >= least)
            .min_by_key(|&b| self.on[b].len())
    }

    /// How alike the points of a mode and those of captured branch `b` are, 0 to 1, if they are of
    /// one branch.
    fn similarity(&self, b: usize, mode: &PointMode) -> Option<f64> {
        let both = count_among(&mode.tracks, &self.on[b]);
        let (here, there) = (self.on[b].len() as f64, mode.tracks.len() as f64);
        let share = both as f64;
        let is_one = both >= MIN_POINTS
            && share >= self.min_share_of_branch * here
            && share >= MIN_SHARE_OF_MODE * there;
        is_one.then(|| share / (here + there - share))
    }

    /// The mode that is most likely captured branch `b`'s.
    fn mode_of(&self, b: usize, carriers: &[Mode]) -> Option<&PointMode> {
        let mut best: Option<(f64, &PointMode)> = None;
        for mode in self.modes.iter().filter(|mode| mode.branch.is_none()) {
            let Some(similarity) = self.similarity(b, mode) else {
                continue;
            };
            if mode.is_of_carrier(carriers) {
                continue;
            }
            if best.is_none_or(|(most, _)| similarity >= most) {
                best = Some((similarity, mode));
            }
        }
        best.map(|(_, mode)| mode)
    }
}

#[cfg(test)]
mod tests {
    use super::super::film::FilmTrack;
    use super::*;
    use crate::model::{Excitation, Interval, Node, Size, Skeleton};

    fn sway(frequency_hz: f64) -> Sway {
        Sway {
            frequency_hz: Interval {
                value: frequency_hz,
                lo: 0.97 * frequency_hz,
                hi: 1.03 * frequency_hz,
            },
            damping_ratio: None,
            excitation: Excitation::Wind,
            amplitude_deg: 1.0,
        }
    }

    /// A trunk of 0.5 Hz, and what is said of a limb on it of which all points at once say 1 Hz and
    /// one branch after the other `before`.
    fn limb_after(before: Swaying, voted_hz: f64) -> Swaying {
        let nodes = vec![
            Node::made_up(0, None, [0.0, 0.0, 0.0]),
            Node::made_up(1, Some(0), [0.0, 100.0, 0.0]),
            Node::made_up(2, Some(1), [50.0, 150.0, 0.0]),
        ];
        let skeleton = Skeleton {
            nodes,
            foot_px: Point2::new(300.0, 340.0),
            image_size: Size {
                width: 640,
                height: 360,
            },
        };
        let found = PointModes {
            modes: vec![PointMode {
                mode: mode_of(&sway(voted_hz)),
                branch: Some(2),
                tracks: (0..5).collect(),
                clearness: 3.0,
                same_within: 0.05,
                sway: sway(voted_hz),
                is_sure: true,
                collinearity: 1.0,
                pivot_px: Point2::new(300.0, 240.0),
            }],
            on: vec![(0..9).collect(), (0..9).collect(), (0..5).collect()],
            min_share_of_branch: 0.6,
        };
        let mut sways = vec![Err(Unidentified::NotMeasured), Ok(sway(0.5)), before];
        let tree = BranchTree::of(&skeleton);
        found.answer(&tree, &mut sways);
        assert_eq!(sways[1], Ok(sway(0.5)), "the trunk's stays");
        sways[2]
    }

    /// Nine points that swing by a pixel at a distance from a place, px.
    fn film_about(place_px: [f64; 2], off_px: f64) -> Film {
        let [u, v] = place_px;
        let track = FilmTrack {
            node: NodeId(2),
            at_px: [-1.0, 0.0, 1.0]
                .map(|by| Point2::new(u + by, v - off_px))
                .to_vec(),
        };
        Film::new(&[0.0, 0.1, 0.2], vec![track; 9])
    }

    /// A branch of 130 px was said to swing by 56 degrees: about a place right beside its points.
    #[test]
    fn an_amplitude_is_about_the_place_where_the_branch_begins() {
        let mode = PointMode {
            mode: mode_of(&sway(1.0)),
            branch: None,
            tracks: (0..5).collect(),
            clearness: 3.0,
            same_within: 0.05,
            sway: sway(1.0),
            is_sure: true,
            collinearity: 1.0,
            pivot_px: Point2::new(300.0, 240.0),
        };
        let film = film_about([300.0, 240.0], 10.0);
        let far = mode.sway_about(Point2::new(300.0, 330.0), &film);
        assert!((far.amplitude_deg - 0.1).abs() < 1e-3, "{far:?}");
        assert_eq!(far.frequency_hz, mode.sway.frequency_hz);
        // No farther than the points were seen to move: 1.15 px at 10 px.
        let wild = PointMode {
            sway: Sway {
                amplitude_deg: 60.0,
                ..mode.sway
            },
            ..mode
        };
        let seen = wild.sway_about(wild.pivot_px, &film);
        assert!((seen.amplitude_deg - 6.6).abs() < 0.1, "{seen:?}");
    }

    #[test]
    fn a_branch_gets_the_mode_that_its_points_have() {
        let unknown = Err(Unidentified::NoOscillation);
        assert_eq!(limb_after(unknown, 1.0), Ok(sway(1.0)));
        assert_eq!(
            limb_after(Ok(sway(1.02)), 1.0),
            Ok(sway(1.0)),
            "much the same"
        );
        let contradiction = limb_after(Ok(sway(1.2)), 1.0);
        assert_eq!(contradiction, Err(Unidentified::TooUncertain));
        assert_eq!(limb_after(unknown, 0.51), unknown, "the trunk's frequency");
        let still = Err(Unidentified::TooLittleMotion);
        assert_eq!(limb_after(still, 1.0), still);
    }
}
