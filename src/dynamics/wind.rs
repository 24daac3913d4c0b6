//! Sway of every branch in wind, from the trunk up.
//!
//! In wind nothing decays: a branch is an oscillator that chance keeps driving. Every motion that
//! its carrier's points show is taken off (any multiple of each, so that no lever arm need be
//! known), and the rest is the sum of its own oscillator, what is left of its ancestors', drift and
//! noise. The likelihood of that sum tells frequency and damping, at the real times
//! (`driven_oscillators.rs`). It is the branch's own if its points move with it as one swing.

use super::ambient;
use super::branch_tree::BranchTree;
use super::branch_turns::turn_of;
use super::branches::{
    BranchEstimator, BranchInFilm, BranchMode, Estimate, LnDeviations, SearchLimits,
    from_the_trunk_up,
};
use super::decay::Mode;
use super::driven_modes::Spectrum;
use super::driven_oscillators::{Driven, Oscillator, about_highest_hz};
use super::film::Film;
use super::gap_free::{GapFree, frames_with};
use super::members::{Points, arms_px};
use super::swing::rank_one_fraction;
use crate::cancel::CancelToken;
use crate::model::{Excitation, NodeId, Sway, Swaying, Unidentified};
use crate::signal::principal::{PrincipalComponents, along};
use crate::signal::qr::Qr;
use crate::signal::vectors::dot;
use nalgebra::Point2;

/// Points of a branch and of its carrier that are needed.
const MIN_POINTS: usize = 2;
/// Points that are needed on a branch and all that it carries: two or three move alike by chance.
const MIN_POINTS_IN_ALL: usize = 4;
/// So many points that are on a branch and on none that it carries speak for it alone.
const ENOUGH_OWN_POINTS: usize = 3;
/// Ancestors that are kept.
const MAX_ANCESTORS: usize = 2;
/// Motions of the carrier's points that are taken off at most. Each, and a second motion of the
/// branch, must have so many times the variance of noise, and the second such a share of the first.
const MAX_CARRIED_MOTIONS: usize = 4;
const MIN_VARIANCE_OVER_NOISE: f64 = 10.0;
const MIN_SECOND_VARIANCE: f64 = 0.02;
/// Frames that are needed.
pub(super) const MIN_FRAMES: usize = 48;
/// Motion that is taken for noise, px.
pub(super) const NOISE_PX: f64 = 0.15;
/// 95 % of the places of markers are no farther off in films of bare trees (docs/markers.md), and not by
/// chance: what swings before a marker pulls at its middle. A smaller sway of a single one is none.
const MARKER_OFF_PX: f64 = 0.9;
/// Variance of the trunk's oscillator at least, as a share of the largest in the whole tree's
/// motion.
const MIN_VARIANCE_OF_TRUNK: f64 = 0.1;
/// An oscillator is one swing if its points move alike in time, each by a lever of its own, to a
/// share of the squares ([`rank_one_fraction`]), and if such a share of them has it.
const MIN_POINTS_SHARE: f64 = 0.75;
/// Oscillators in a trunk's turn, and in a branch beyond its ancestors', at most.
const MOST_OF_TRUNK: usize = 2;
const MOST_OF_BRANCH: usize = 3;
/// The curvature of the likelihood is that at its top, and gusts are no exact process: intervals
/// are so much wider. Found on made-up trees (tests/sway_trees.rs).
const CI_INFLATION: f64 = 1.1;
/// A mode whose interval is so many times wider than is asked for is no answer, but serves to tell
/// those of the branches on it.
const MAX_CI_TO_SERVE: f64 = 2.0;

/// What is asked of an answer, by the points that it comes from. Found on made-up trees
/// (tests/sway_trees.rs).
struct AcceptanceCriteria {
    /// Share of the squares that is one swing.
    min_rank_one: f64,
    /// Below these none is believed, however long the film is: what the carrier's points show is
    /// not all that it does.
    min_ln_sd: LnDeviations,
}

/// Where a branch and its carrier have points of their own.
const OWN_POINTS: AcceptanceCriteria = AcceptanceCriteria {
    min_rank_one: 0.85,
    min_ln_sd: LnDeviations {
        frequency: 0.008,
        damping: 0.25,
    },
};
/// Where those of the branches on them must serve: they sway by themselves besides.
const SHARED_POINTS: AcceptanceCriteria = AcceptanceCriteria {
    min_rank_one: 0.87,
    min_ln_sd: LnDeviations {
        frequency: 0.015,
        damping: 0.25,
    },
};

impl AcceptanceCriteria {
    /// An oscillation as a branch's mode, with the standard deviations that are believed.
    fn mode_of(&self, mode: Mode, ln_sd: &LnDeviations) -> BranchMode {
        BranchMode {
            mode,
            ln_sd: ln_sd.inflated(CI_INFLATION, &self.min_ln_sd),
        }
    }
}

/// The sway of every branch.
pub(super) fn sways(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    trunk: NodeId,
    limits: &SearchLimits,
    cancel: &CancelToken,
) -> Vec<Swaying> {
    let mut estimator = InWind {
        trunk,
        fundamental: None,
        tree,
        film,
        members,
        limits,
        known: vec![Known::Nothing; members.len()],
        cancel,
    };
    estimator.fundamental = estimator.whole_tree();
    from_the_trunk_up(tree, members, trunk, cancel, &mut estimator)
}

/// What the analysis of a branch leaves for those on it.
#[derive(Clone, Copy)]
enum Known {
    Nothing,
    /// It moves only as its ancestors do.
    HasNoneOfItsOwn,
    Mode(BranchMode),
}

struct InWind<'a> {
    trunk: NodeId,
    /// The sway of the whole tree, where all points at once tell it.
    fundamental: Option<(BranchMode, Sway)>,
    tree: &'a BranchTree,
    film: &'a Film,
    members: &'a [Vec<usize>],
    limits: &'a SearchLimits,
    /// By branch.
    known: Vec<Known>,
    cancel: &'a CancelToken,
}

/// Points that stand for a branch.
struct Speaking {
    tracks: Vec<usize>,
    /// Whether none of them is on a branch that it carries.
    are_its_own: bool,
}

impl BranchEstimator for InWind<'_> {
    fn estimate(&mut self, branch: &BranchInFilm) -> Swaying {
        let by_own_points = self.by_own_points(branch);
        if branch.node == self.trunk {
            self.or_fundamental(branch, by_own_points)
        } else {
            by_own_points
        }
    }
}

impl InWind<'_> {
    /// The sway of a branch from its points and those of its carrier.
    fn by_own_points(&mut self, branch: &BranchInFilm) -> Swaying {
        let speaking = self.speaking(branch.node, branch.tracks);
        let points = Points::of(self.film, &speaking.tracks);
        let least = self.film.least_points(MIN_POINTS);
        let least_in_all = self.film.least_points(MIN_POINTS_IN_ALL);
        if branch.tracks.len() < least_in_all || points.tracks.len() < least {
            return Err(Unidentified::NotMeasured);
        }
        let of_carrier = self.speaking(branch.parent, &self.beside(branch));
        let carrier = Points::of(self.film, &of_carrier.tracks);
        // What a carrier's own sway is must be known, or be none, and its motion seen, for that of
        // the branch to be told from it.
        let carrier_is_unknown = matches!(self.known[branch.parent.index()], Known::Nothing)
            || carrier.tracks.len() < least;
        if !branch.is_on_foot() && carrier_is_unknown {
            return Err(Unidentified::AncestorsSway);
        }
        let own_points = speaking.are_its_own && (branch.is_on_foot() || of_carrier.are_its_own);
        let criteria = if own_points {
            OWN_POINTS
        } else {
            SHARED_POINTS
        };
        let found = self.estimate_from(branch, &points, &carrier, &criteria);
        self.known[branch.node.index()] = match &found {
            Ok(estimate) => Known::Mode(estimate.mode),
            Err(Unidentified::AncestorsSway) => Known::HasNoneOfItsOwn,
            Err(_) => Known::Nothing,
        };
        found?.sway
    }
}

impl InWind<'_> {
    /// The trunk's sway: by its own points, if all points at once say the same or nothing. Its own
    /// points say it more exactly, but where they are few a limb's sway is taken for its own.
    fn or_fundamental(&mut self, branch: &BranchInFilm, by_own_points: Swaying) -> Swaying {
        let Some((mode, sway)) = self.fundamental else {
            return by_own_points;
        };
        if let (Ok(_), Known::Mode(own)) = (&by_own_points, self.known[branch.node.index()])
            && is_of_ancestor(&own, &[mode])
        {
            return by_own_points;
        }
        self.known[branch.node.index()] = Known::Mode(mode);
        Ok(sway)
    }

    /// The sway of the whole tree from all points at once; `None` where these do not tell it. It is
    /// the one answer that every film should give, and as uncertain as it must be.
    fn whole_tree(&self) -> Option<(BranchMode, Sway)> {
        let tracks = self.members.get(self.trunk.index())?;
        let base_px = self.tree.branches.get(self.trunk.index())?.base_px;
        let points = Points::up_to(ambient::MOST_POINTS, self.film, tracks);
        let frames = frames_with(self.film, &[&points], MIN_FRAMES)?;
        if points.rms_px() < NOISE_PX {
            return None;
        }
        let within_hz = self.limits.frequencies_hz;
        let by_modes = ambient::fundamental(self.film, &points, &frames, within_hz, self.cancel);
        let by_modes = by_modes.filter(|o| !o.at_limit);
        let by_turn = self.by_turn_of_trunk(&points, &frames);
        let found = slower_where_apart(by_turn.as_ref(), by_modes.as_ref())?;
        let mut mode = OWN_POINTS.mode_of(found.mode, &found.ln_sd);
        // With itself it agrees as it is.
        for other in [&by_turn, &by_modes].into_iter().flatten() {
            mode = mode.agreed_with(&OWN_POINTS.mode_of(other.mode, &other.ln_sd));
        }
        if !self.limits.may_be_trunks(&mode, self.film) {
            return None;
        }
        let sway = Sway {
            frequency_hz: mode.frequency_hz(),
            damping_ratio: mode.damping_ratio(),
            excitation: Excitation::Wind,
            amplitude_deg: self.amplitude_deg(base_px, &points, found.variance),
        };
        Some((mode, sway))
    }

    /// The slowest of the larger oscillators in the trunk's turn.
    fn by_turn_of_trunk(&self, points: &Points, frames: &[usize]) -> Option<Oscillator> {
        let angles = turn_of(self.trunk, self.tree, self.film, frames)?;
        let times_s = self.film.times_of(frames);
        let within_hz = about_highest_hz(&angles, &times_s, self.limits.frequencies_hz);
        let turn = Driven::new(&[angles], &[], &times_s, Vec::new(), within_hz)?;
        let fit = turn.likeliest(MOST_OF_TRUNK, self.cancel)?;
        let mut all = fit.oscillators();
        let slowest = *by_variance(&all, true).first()?;
        let mut found = all.swap_remove(slowest);
        // From the square of an angle to that of all points' motion.
        let base_px = self.tree.branches.get(self.trunk.index())?.base_px;
        found.variance *= self.arms_px2(base_px, points);
        (!found.at_limit).then_some(found)
    }

    /// Those of a branch's points that are on none of the branches that it carries, if they are
    /// enough, else all.
    fn speaking(&self, node: NodeId, tracks: &[usize]) -> Speaking {
        let own = tracks.iter().copied();
        let own: Vec<usize> = own.filter(|&k| self.film.tracks[k].node == node).collect();
        if own.len() >= ENOUGH_OWN_POINTS || own.len() == tracks.len() {
            Speaking {
                tracks: own,
                are_its_own: true,
            }
        } else {
            Speaking {
                tracks: tracks.to_vec(),
                are_its_own: false,
            }
        }
    }

    /// Points on a branch's carrier that are not on the branch.
    fn beside(&self, branch: &BranchInFilm) -> Vec<usize> {
        if branch.is_on_foot() {
            return Vec::new();
        }
        let of_carrier = self.members[branch.parent.index()].iter().copied();
        of_carrier.filter(|k| !branch.tracks.contains(k)).collect()
    }

    /// The modes of the nearest ancestors that have one.
    fn ancestors(&self, branch: &BranchInFilm) -> Vec<BranchMode> {
        let mut out = Vec::new();
        for above in self.tree.carriers_with(self.trunk, branch.node) {
            if let Known::Mode(mode) = self.known[above.index()] {
                out.push(mode);
            }
        }
        out.truncate(MAX_ANCESTORS);
        out
    }

    /// The oscillator that a branch has beyond its ancestors', and its sway if that can be told.
    fn estimate_from(
        &self,
        branch: &BranchInFilm,
        points: &Points,
        carrier: &Points,
        criteria: &AcceptanceCriteria,
    ) -> Result<Estimate, Unidentified> {
        let frames = frames_with(self.film, &[points, carrier], MIN_FRAMES);
        let frames = frames.ok_or(Unidentified::TooShort)?;
        let ancestors = self.ancestors(branch);
        let motion = OwnMotion::of(points, carrier, &frames)?;
        let times_s = self.film.times_of(&frames);
        let driven = Driven::new(
            &motion.along_directions(&motion.all),
            &motion.carried,
            &times_s,
            ancestors.iter().map(|a| a.mode).collect(),
            self.limits.frequencies_hz,
        );
        let driven = driven.ok_or(Unidentified::TooShort)?;
        let fitted = driven.likeliest(MOST_OF_BRANCH, self.cancel);
        let fitted = fitted.ok_or(Unidentified::NotInTime)?;
        let found = fitted.oscillators();
        let k = own_oscillator(&found, &ancestors, criteria)?;
        let mode = criteria.mode_of(found[k].mode, &found[k].ln_sd);
        let max_relative_ci = self.limits.max_relative_ci;
        if found[k].ln_sd.frequency <= 0.0 || !mode.is_within(MAX_CI_TO_SERVE * max_relative_ci) {
            return Err(Unidentified::TooUncertain);
        }
        let squares_px2 = 2.0 * found[k].variance / points.tracks.len() as f64;
        if self.film.are_markers && squares_px2 < MARKER_OFF_PX * MARKER_OFF_PX {
            return Err(Unidentified::AncestorsSway);
        }
        let shares = fitted.shares(k, motion.noise_px2_per_hz(&times_s));
        let own = Spectrum::of(&motion.own, &times_s, self.limits.frequencies_hz);
        check_one_swing(&own, &shares, criteria)?;
        // Gusts are not known well enough for a likelihood to tell a frequency from its mirror
        // image at such a rate.
        if self
            .limits
            .may_be_aliased(mode.mode.frequency_hz, self.film)
        {
            return Err(Unidentified::AboveSampling);
        }
        let has_damping = found[k].ln_sd.damping > 0.0;
        let sway = Sway {
            frequency_hz: mode.frequency_hz(),
            damping_ratio: mode.damping_ratio().filter(|_| has_damping),
            excitation: Excitation::Wind,
            amplitude_deg: self.amplitude_deg(branch.base_px, points, found[k].variance),
        };
        let sway = if mode.is_within(max_relative_ci) {
            Ok(sway)
        } else {
            Err(Unidentified::TooUncertain)
        };
        Ok(Estimate { mode, sway })
    }

    /// Of an oscillator of this variance in all of the points together, px².
    fn amplitude_deg(&self, base_px: Point2<f64>, points: &Points, variance: f64) -> f64 {
        let arms_px2 = self.arms_px2(base_px, points);
        (2.0 * variance).sqrt().atan2(arms_px2.sqrt()).to_degrees()
    }

    /// Sum of the squares of the distances of some points from a place.
    fn arms_px2(&self, base_px: Point2<f64>, points: &Points) -> f64 {
        let arms_px = arms_px(self.film, &points.tracks, base_px);
        arms_px.map(|arm| arm.norm_squared()).sum()
    }
}

/// What a branch's points do beyond those of its carrier.
struct OwnMotion {
    /// All that the points do, two signals a point.
    all: Vec<Vec<f64>>,
    /// What of it is no multiple of the carrier's motions.
    own: Vec<Vec<f64>>,
    /// The motions of the carrier's points.
    carried: Vec<Vec<f64>>,
    /// The one or two directions, in all signals at once, in which most of the own motion is.
    directions: Vec<Vec<f64>>,
    /// Variance of noise in every value, px².
    noise: f64,
}

impl OwnMotion {
    /// In some frames; the reason where there is none.
    fn of(points: &Points, carrier: &Points, frames: &[usize]) -> Result<Self, Unidentified> {
        let GapFree {
            signals: all,
            noise,
        } = GapFree::of(points, frames);
        let carrier = GapFree::of(carrier, frames);
        let mut carried = Vec::new();
        let of_carrier = PrincipalComponents::of_signals(&carrier.signals);
        for (direction, variance) in of_carrier.directions.iter().zip(&of_carrier.variances) {
            let is_clear = *variance > MIN_VARIANCE_OVER_NOISE * carrier.noise;
            if is_clear && carried.len() < MAX_CARRIED_MOTIONS {
                carried.push(along(&carrier.signals, direction));
            }
        }
        let constant = vec![1.0; frames.len()];
        let qr = Qr::new([&[constant], carried.as_slice()].concat());
        let own: Vec<Vec<f64>> = all.iter().map(|s| qr.solve(s).0).collect();
        let values = (points.tracks.len() * frames.len()) as f64;
        if rms_px(&all, values) < NOISE_PX {
            return Err(Unidentified::TooLittleMotion);
        }
        if rms_px(&own, values) < NOISE_PX {
            return Err(Unidentified::AncestorsSway);
        }
        let PrincipalComponents {
            variances,
            mut directions,
        } = PrincipalComponents::of_signals(&own);
        let least = (MIN_SECOND_VARIANCE * variances[0]).max(MIN_VARIANCE_OVER_NOISE * noise);
        let has_second = variances.get(1).is_some_and(|v| *v > least);
        directions.truncate(if has_second { 2 } else { 1 });
        Ok(Self {
            all,
            own,
            carried,
            directions,
            noise,
        })
    }

    fn along_directions(&self, signals: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.directions.iter().map(|d| along(signals, d)).collect()
    }

    /// Power of the noise, px²/Hz.
    fn noise_px2_per_hz(&self, times_s: &[f64]) -> f64 {
        let span_s = times_s.last().copied().unwrap_or(0.0) - times_s[0];
        2.0 * self.noise * span_s / times_s.len() as f64
    }
}

/// Whether an oscillator that has these shares of the power moves the points as one swing. Real and
/// imaginary parts of coefficients are as good as values in time (Parseval).
fn check_one_swing(
    own: &Spectrum,
    shares: &[f64],
    criteria: &AcceptanceCriteria,
) -> Result<(), Unidentified> {
    let signals = own.coefficients.first().map_or(0, |c| c.len());
    let mut filtered = vec![Vec::with_capacity(2 * shares.len()); signals];
    for (coefficients, share) in own.coefficients.iter().zip(shares) {
        for (signal, coefficient) in filtered.iter_mut().zip(coefficients) {
            signal.extend([share * coefficient.re, share * coefficient.im]);
        }
    }
    let swing = rank_one_fraction(&filtered);
    if swing.of_squares < criteria.min_rank_one || swing.of_points < MIN_POINTS_SHARE {
        return Err(Unidentified::NoOscillation);
    }
    Ok(())
}

/// Of the trunk's two answers that from its turn where they may be one, else the slower: the whole tree
/// sways slowest, and what takes it and a limb near it for one oscillation is too fast
/// (docs/design/sway.md).
fn slower_where_apart<'a>(
    by_turn: Option<&'a Oscillator>,
    by_modes: Option<&'a Oscillator>,
) -> Option<&'a Oscillator> {
    let (Some(turn), Some(modes)) = (by_turn, by_modes) else {
        return by_turn.or(by_modes);
    };
    let [of_turn, of_modes] = [turn, modes].map(|o| OWN_POINTS.mode_of(o.mode, &o.ln_sd));
    let modes_answer =
        !of_turn.agrees_with(&of_modes) && modes.mode.frequency_hz < turn.mode.frequency_hz;
    Some(if modes_answer { modes } else { turn })
}

/// Root of the mean square displacement of a point.
fn rms_px(signals: &[Vec<f64>], values: f64) -> f64 {
    (signals.iter().map(|s| dot(s, s)).sum::<f64>() / values).sqrt()
}

/// Which of the oscillators is the branch's own, and no ancestor's; the reason where none is.
fn own_oscillator(
    found: &[Oscillator],
    ancestors: &[BranchMode],
    criteria: &AcceptanceCriteria,
) -> Result<usize, Unidentified> {
    if found.is_empty() && !ancestors.is_empty() {
        return Err(Unidentified::AncestorsSway);
    }
    let mut reason = Unidentified::NoOscillation;
    for k in by_variance(found, ancestors.is_empty()) {
        if found[k].at_limit {
            continue;
        }
        if !is_of_ancestor(&criteria.mode_of(found[k].mode, &found[k].ln_sd), ancestors) {
            return Ok(k);
        }
    }
    for oscillator in found.iter().filter(|o| !o.at_limit) {
        if is_of_ancestor(
            &criteria.mode_of(oscillator.mode, &oscillator.ln_sd),
            ancestors,
        ) {
            reason = Unidentified::AncestorsSway;
        }
    }
    Err(reason)
}

fn is_of_ancestor(mode: &BranchMode, ancestors: &[BranchMode]) -> bool {
    ancestors.iter().any(|a| mode.agrees_with(a))
}

/// The largest first. Of the trunk the slowest of the larger ones: it carries all, and all else
/// sways faster than the whole tree.
fn by_variance(found: &[Oscillator], is_trunk: bool) -> Vec<usize> {
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|a, b| found[*b].variance.total_cmp(&found[*a].variance));
    if is_trunk && !order.is_empty() {
        let strong = MIN_VARIANCE_OF_TRUNK * found[order[0]].variance;
        order.retain(|&k| found[k].variance >= strong);
        order.sort_by(|a, b| {
            let [a, b] = [a, b].map(|k| found[*k].mode.frequency_hz);
            a.total_cmp(&b)
        });
    }
    order
}
