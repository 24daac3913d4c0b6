//! Sway of every branch after a release, from the trunk up.
//!
//! The picture shows a branch moving with everything that carries it, so its points share the modes
//! of all its ancestors and have its own besides. The ancestors' modes are known when its turn
//! comes; what is new is its own if all of its points have it, and else that of a branch above it.

use super::branch_tree::BranchTree;
use super::branches::{
    BranchEstimator, BranchInFilm, BranchMode, Estimate, LnDeviations, SearchLimits,
    from_the_trunk_up,
};
use super::decay::Mode;
use super::film::Film;
use super::fit::Prior;
use super::members::{Points, mean_px};
use super::release::{Onset, ReleaseTime};
use super::sandwich::deviations;
use super::signals::{Factor, Fit, Signals};
use super::sway::UsableFilm;
use super::swing::Arms;
use super::whole_decay::{Fundamental, fundamental};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::{Excitation, NodeId, Sway, Swaying, Unidentified};
use crate::signal::along_principal_direction;
use crate::signal::statistics::{quantile, rms};
use nalgebra::Point2;

/// Modes that are looked for beyond those of the ancestors.
const MAX_NEW_MODES: usize = 5;
/// A further mode must leave at most this share of the squares.
const MAX_RSS_LEFT: f64 = 0.93;
/// And take off so many times what one takes off noise by chance.
const MIN_GAIN_OVER_CHANCE: f64 = 4.0;
/// Two modes that almost cancel each other have factors so many times larger than the signals: they
/// are one.
const MAX_FACTOR_SIZE: f64 = 3.0;
/// A branch's own mode is in this share of its points, each with a factor of so many standard
/// deviations, and in the quarter that has least of it with this share of the mean.
const MIN_POINTS_SHARE: f64 = 0.75;
const MIN_SIGNIFICANCE: f64 = 4.0;
const MIN_SIZE_OF_QUARTER: f64 = 0.3;
/// Of the significances of the points this quantile tells how clear a mode is.
const CLEARNESS_QUANTILE: f64 = 0.3;
/// Parts of a branch that hold such a share of its points must have its mode, in so many of their
/// points.
const PART_SIZE: Bounds = Bounds::new(0.15, 0.85);
const MIN_POINTS_SHARE_OF_PART: f64 = 0.75;
/// Its parts, or halves, of so many points must give the same frequency: within this share, and so
/// many standard deviations.
const MIN_POINTS_OF_PART: usize = 3;
const PART_FREQ_TOLERANCE: f64 = 0.003;
const PART_FREQ_SIGMAS: f64 = 4.0;
/// And they are moved as by one swing ([`Arms::one_swing`]), which points of several branches that
/// are alike in frequency are not. Found on clips of our own (docs/design/sway.md).
const MIN_COLLINEARITY: f64 = 0.95;
/// A mode that is no farther from a doubted one than this share is that one.
const DOUBT_FREQ_TOLERANCE: f64 = 0.01;
/// Points that a branch must have: two or three agree by chance.
const MIN_POINTS: usize = 4;
/// Periods that must have been seen: of fewer, branches that lie close together in frequency look
/// like one.
pub(super) const MIN_PERIODS: f64 = 3.0;
/// Damping above which an oscillation is none that could be seen.
const MAX_DAMPING: f64 = 0.2;
/// Motion that is taken for noise, px.
const NOISE_PX: f64 = 0.2;
/// Noise is at most this share of what the ancestors leave.
const MAX_NOISE_SHARE: f64 = 0.9;
/// What the ancestors may leave of the motion of a branch that has none of its own.
const MAX_LEFT_BY_ANCESTORS: f64 = 0.2;
/// Points of one branch err together more than the spread of their fit shows: intervals are so much
/// wider. Found on made-up trees (tests/sway_trees.rs).
const CI_INFLATION: f64 = 1.25;
/// And the frequency's does not shrink below this standard deviation of its logarithm, however
/// clear the decay is: most branches as they are found have some points of their neighbours. Found
/// likewise.
const MIN_LN_SD: LnDeviations = LnDeviations {
    frequency: 0.0015,
    damping: 0.0,
};

/// The sway of every branch.
pub(super) fn sways(tree: &BranchTree, usable: &UsableFilm, cancel: &CancelToken) -> Vec<Swaying> {
    let UsableFilm {
        film,
        members,
        trunk,
        onset,
        release,
        limits,
        ..
    } = usable;
    // Scaled to like size, rounding would be motion.
    let decaying = usable
        .decaying
        .as_ref()
        .filter(|all| all.points.rms_px() >= NOISE_PX);
    let with_motions = tree.branches.get(trunk.index()).zip(decaying);
    let fundamental = match with_motions {
        Some((trunk, motions)) => fundamental(
            motions,
            film,
            trunk.base_px,
            onset.start,
            release,
            limits,
            cancel,
        ),
        None => Err(Unidentified::NotMeasured),
    };
    let mut estimator = FreeDecay {
        fundamental,
        trunk: *trunk,
        tree,
        film,
        members,
        onset,
        limits,
        release: *release,
        own: vec![None; members.len()],
        mixed: vec![None; members.len()],
        trunk_is_known: false,
    };
    from_the_trunk_up(tree, members, *trunk, cancel, &mut estimator)
}

struct FreeDecay<'a> {
    trunk: NodeId,
    /// The trunk's sway by all points at once.
    fundamental: Result<Fundamental, Unidentified>,
    tree: &'a BranchTree,
    film: &'a Film,
    members: &'a [Vec<usize>],
    onset: &'a Onset,
    limits: &'a SearchLimits,
    /// The trunk's own fit knows it better than the eye.
    release: ReleaseTime,
    /// By branch: modes that are a branch's own.
    own: Vec<Option<BranchMode>>,
    /// By branch: modes of branches that may not be theirs alone, but that of a branch on them.
    mixed: Vec<Option<Mode>>,
    /// Whether the trunk's sway, which all points have, could be told.
    trunk_is_known: bool,
}

impl BranchEstimator for FreeDecay<'_> {
    fn estimate(&mut self, branch: &BranchInFilm) -> Swaying {
        let by_own_points = self.by_own_points(branch);
        if branch.node == self.trunk {
            self.or_fundamental(branch, by_own_points)
        } else {
            by_own_points
        }
    }
}

impl FreeDecay<'_> {
    /// The sway of a branch by its points and the modes of its carriers.
    fn by_own_points(&mut self, branch: &BranchInFilm) -> Swaying {
        let points = Points::of(self.film, branch.tracks);
        if points.tracks.len() < self.film.least_points(MIN_POINTS) {
            return Err(Unidentified::NotMeasured);
        }
        let found = self.estimate_from(branch, &points)?;
        // All points have the trunk's sway: where it is not known, a branch would be given it.
        let is_trunk = branch.node == self.trunk;
        if !is_trunk && !self.trunk_is_known {
            return Err(Unidentified::AncestorsSway);
        }
        self.trunk_is_known |= is_trunk;
        match found.sway {
            Ok(_) => self.own[branch.node.index()] = Some(found.mode),
            Err(_) => self.mixed[branch.node.index()] = Some(found.mode.mode),
        }
        found.sway
    }

    /// The trunk's sway: by its own points, where all points at once agree with it, are less sure, or
    /// show none. Its own points show it more exactly, but take modes close together for one; in all
    /// points these differ in their shapes. Where these show that too few periods were seen there is
    /// no answer: its own points would have a limb's.
    fn or_fundamental(&mut self, trunk: &BranchInFilm, by_own_points: Swaying) -> Swaying {
        let found = match self.fundamental {
            Ok(found) => found,
            Err(Unidentified::TooShort) => {
                self.own[trunk.node.index()] = None;
                self.trunk_is_known = false;
                return Err(Unidentified::TooShort);
            }
            Err(_) => return by_own_points,
        };
        let mode = mode_of(found.mode.mode, &found.mode.ln_sd);
        let own = self.own[trunk.node.index()];
        let own_serves = own.is_some_and(|own| {
            own.agrees_with(&mode) || own.ln_sd.frequency <= mode.ln_sd.frequency
        });
        if own_serves || !self.limits.may_be_trunks(&mode, self.film) {
            return by_own_points;
        }
        self.own[trunk.node.index()] = Some(mode);
        self.trunk_is_known = true;
        Ok(Sway {
            frequency_hz: mode.frequency_hz(),
            damping_ratio: mode.damping_ratio(),
            excitation: Excitation::Release,
            amplitude_deg: found.amplitude_deg,
        })
    }

    /// The mode that the branch has beyond its ancestors', and its sway if that can be told.
    fn estimate_from(
        &mut self,
        branch: &BranchInFilm,
        points: &Points,
    ) -> Result<Estimate, Unidentified> {
        if points.rms_px() < NOISE_PX {
            return Err(Unidentified::TooLittleMotion);
        }
        let fitted = self.fit(branch.node, points);
        let arms = Arms::new(self.film, points, branch.base_px);
        let parts = self.parts_of(branch, points);
        let Some(chosen) = self.choose(branch.node, &fitted, &arms, &parts) else {
            return Err(fitted.reason_for_none(points));
        };
        let mode = fitted.fit.modes[chosen.index];
        if self.limits.may_be_aliased(mode.frequency_hz, self.film) {
            return Err(Unidentified::AboveSampling);
        }
        let spread = deviations(&fitted.signals, &fitted.fit, &fitted.priors)
            .ok_or(Unidentified::TooUncertain)?;
        let ln_sd = fitted.deviations_with_one_more(chosen.index, &spread);
        let ln_sd = self.checked_by_parts(&fitted, chosen.index, &spread, ln_sd, points, &parts)?;
        if fitted.has_no_ancestors() {
            self.learn_release(&fitted.fit, &spread);
        }
        let mode = mode_of(mode, &ln_sd);
        if !mode.is_within(self.limits.max_relative_ci) {
            return Err(Unidentified::TooUncertain);
        }
        let sway = Sway {
            frequency_hz: mode.frequency_hz(),
            damping_ratio: mode.damping_ratio(),
            excitation: Excitation::Release,
            amplitude_deg: arms.amplitude_deg(&fitted.factors, chosen.index),
        };
        let sway = if chosen.is_one_swing {
            Ok(sway)
        } else {
            Err(Unidentified::NoOscillation)
        };
        Ok(Estimate { mode, sway })
    }

    /// Fits the modes of the ancestors and as many more as the points carry.
    fn fit(&self, node: NodeId, points: &Points) -> FittedModes {
        let carriers = self.tree.carriers_with(self.trunk, node);
        let known = carriers.iter().filter_map(|above| self.own[above.index()]);
        let ancestors: Vec<BranchMode> = known.collect();
        let times_s = self.film.times_s.iter();
        let signals = Signals::new(
            times_s.map(|t| t - self.release.at_s).collect(),
            &points.signals,
            self.onset.start,
            self.release.sd_s,
            self.limits.frequencies_hz,
        );
        FittedModes::new(signals, points, &ancestors)
    }

    /// The new mode that is the branch's own. Another one is taken rather than one that may be of a
    /// branch below.
    fn choose(
        &self,
        node: NodeId,
        fitted: &FittedModes,
        arms: &Arms,
        parts: &[Vec<usize>],
    ) -> Option<Candidate> {
        let mut best: Option<Candidate> = None;
        for index in fitted.ancestors..fitted.fit.modes.len() {
            if !fitted.may_be_own(index, parts) {
                continue;
            }
            // On the trunk low points move little, and still have its sway.
            let least_size = if fitted.has_no_ancestors() {
                0.0
            } else {
                MIN_SIZE_OF_QUARTER
            };
            let Some(common) = common_to_points(&fitted.factors, index, least_size) else {
                continue;
            };
            let candidate = Candidate {
                index,
                // The trunk carries every point: there is nothing it could be mixed up with.
                is_one_swing: fitted.has_no_ancestors()
                    || arms.one_swing(&fitted.factors, index) >= MIN_COLLINEARITY,
                is_new: !self.is_doubted(node, &fitted.fit.modes[index]),
                common,
            };
            if best.as_ref().is_none_or(|b| !b.is_better_than(&candidate)) {
                best = Some(candidate);
            }
        }
        best
    }

    /// Whether a mode is one that is not surely that of an ancestor.
    fn is_doubted(&self, node: NodeId, mode: &Mode) -> bool {
        for ancestor in self.tree.carriers(node) {
            let doubted = self.mixed[ancestor.index()];
            if doubted.is_some_and(|d| d.has_frequency_of(mode, DOUBT_FREQ_TOLERANCE)) {
                return true;
            }
        }
        false
    }

    /// The parts of the points, by their place among them, that lie on each larger branch on this
    /// one.
    fn parts_of(&self, branch: &BranchInFilm, points: &Points) -> Vec<Vec<usize>> {
        let size = branch.tracks.len() as f64;
        let mut out = Vec::new();
        for above in &self.members[branch.node.index() + 1..] {
            // A node that comes later and shares points is above this one.
            let shares = above
                .first()
                .is_some_and(|k| branch.tracks.binary_search(k).is_ok());
            let part_size = above.len() as f64 / size;
            if shares && PART_SIZE.contains(part_size) {
                let places = 0..points.tracks.len();
                out.push(
                    places
                        .filter(|&k| above.binary_search(&points.tracks[k]).is_ok())
                        .collect(),
                );
            }
        }
        out
    }

    /// The two halves of the points by their place along the direction in which they are spread
    /// most.
    fn halves_of(&self, points: &Points) -> Vec<Vec<usize>> {
        let mut at_px: Vec<Point2<f64>> = Vec::with_capacity(points.tracks.len());
        for &k in &points.tracks {
            at_px.push(mean_px(&self.film.tracks[k].at_px));
        }
        let along = along_principal_direction(&at_px);
        let mut order: Vec<usize> = (0..at_px.len()).collect();
        order.sort_by(|a, b| along[*a].total_cmp(&along[*b]));
        let second = order.split_off(order.len() / 2);
        vec![order, second]
    }

    /// Fits mode `m` to the parts of the branch, or its halves, one by one: the standard deviations
    /// `ln_sd` with their scatter, or the reason if the parts do not agree.
    fn checked_by_parts(
        &self,
        fitted: &FittedModes,
        m: usize,
        spread: &[f64],
        mut ln_sd: LnDeviations,
        points: &Points,
        parts: &[Vec<usize>],
    ) -> Result<LnDeviations, Unidentified> {
        // The trunk carries every point: parts at odds make it less sure, but leave it its sway.
        let is_trunk = fitted.has_no_ancestors();
        let known = fitted.priors_of_others(m, spread);
        let mode = &fitted.fit.modes[m];
        let halves = if parts.is_empty() {
            self.halves_of(points)
        } else {
            Vec::new()
        };
        let (mut frequency_squares, mut damping_squares, mut count) = (0.0, 0.0, 0.0_f64);
        for part in parts.iter().chain(&halves) {
            if part.len() < MIN_POINTS_OF_PART {
                continue;
            }
            let signals = self.signals_of_part(fitted, points, part);
            let there = signals.fit(&fitted.fit, &known);
            let Some(spread) = deviations(&signals, &there, &known) else {
                continue;
            };
            let off = there.modes[m].ln_frequency_ratio(mode);
            let sd = spread[2 * m].hypot(ln_sd.frequency);
            if !is_trunk && off.abs() > PART_FREQ_TOLERANCE + PART_FREQ_SIGMAS * sd {
                return Err(Unidentified::NoOscillation);
            }
            count += 1.0;
            frequency_squares += off * off;
            damping_squares += (there.modes[m].damping / mode.damping).ln().powi(2);
        }
        if count > 1.0 {
            let pairs = count * (count - 1.0);
            ln_sd = LnDeviations {
                frequency: ln_sd.frequency.hypot((frequency_squares / pairs).sqrt()),
                damping: ln_sd.damping.hypot((damping_squares / pairs).sqrt()),
            };
        }
        Ok(ln_sd)
    }

    fn signals_of_part(&self, fitted: &FittedModes, points: &Points, part: &[usize]) -> Signals {
        let mut own: Vec<Vec<f64>> = Vec::with_capacity(2 * part.len());
        for &k in part {
            own.extend(points.signals[2 * k..2 * k + 2].iter().cloned());
        }
        Signals::new(
            fitted.signals.times_s.clone(),
            &own,
            self.onset.start,
            self.release.sd_s,
            self.limits.frequencies_hz,
        )
    }

    /// Takes the moment of the release from the fit of a branch that nothing carries.
    fn learn_release(&mut self, fit: &Fit, spread: &[f64]) {
        if let Some(sd_s) = spread.get(2 * fit.modes.len()) {
            self.release = ReleaseTime {
                at_s: self.release.at_s + fit.moment_s,
                sd_s: sd_s.min(self.release.sd_s),
            };
        }
    }
}

/// Whether a tree may sway like a mode that was fitted to `signals`, and that is seen for long enough.
pub(super) fn may_be_sway(signals: &Signals, mode: &Mode) -> bool {
    oscillates(signals, mode) && mode.frequency_hz * signals.span_s() >= MIN_PERIODS
}

/// Whether a tree may sway like it, but is seen for too few periods.
pub(super) fn is_too_brief(signals: &Signals, mode: &Mode) -> bool {
    oscillates(signals, mode) && mode.frequency_hz * signals.span_s() < MIN_PERIODS
}

fn oscillates(signals: &Signals, mode: &Mode) -> bool {
    mode.damping < MAX_DAMPING && !signals.at_limit(mode)
}

/// A mode with the standard deviations that are believed.
fn mode_of(mode: Mode, ln_sd: &LnDeviations) -> BranchMode {
    BranchMode {
        mode,
        ln_sd: ln_sd.inflated(CI_INFLATION, &MIN_LN_SD),
    }
}

/// The modes of a branch's points: those of its ancestors, then new ones.
struct FittedModes {
    signals: Signals,
    fit: Fit,
    /// Of the first modes: those of so many ancestors.
    ancestors: usize,
    priors: Vec<Prior>,
    /// `[signal][mode]`.
    factors: Vec<Vec<Factor>>,
    /// The same modes when one more is fitted than is taken: it shows how much the answer hangs on
    /// how many there are.
    one_more: Vec<Mode>,
    /// Squares that the ancestors' modes leave, and those of noise.
    left_by_ancestors: f64,
    noise: f64,
}

impl FittedModes {
    fn new(signals: Signals, points: &Points, ancestors: &[BranchMode]) -> Self {
        let mut fit = Fit {
            modes: ancestors.iter().map(|a| a.mode).collect(),
            ..Fit::default()
        };
        fit.rss = signals.rss(&fit);
        let mut out = Self {
            ancestors: ancestors.len(),
            priors: ancestors.iter().copied().map(Some).collect(),
            factors: Vec::new(),
            one_more: Vec::new(),
            left_by_ancestors: fit.rss,
            noise: points.noise().min(MAX_NOISE_SHARE * fit.rss),
            signals,
            fit,
        };
        let largest_px = largest_values_rms(&points.signals);
        while out.fit.modes.len() < out.ancestors + MAX_NEW_MODES && out.add_mode(largest_px) {}
        out.factors = out.signals.factors(&out.fit, points.signals.len());
        out
    }

    /// Whether no mode of an ancestor is known, as on the trunk.
    fn has_no_ancestors(&self) -> bool {
        self.ancestors == 0
    }

    /// Whether one more mode is worth it, and was taken.
    fn add_mode(&mut self, largest_px: f64) -> bool {
        let Some(new) = self.signals.search(&self.fit) else {
            return false;
        };
        let mut start = self.fit.clone();
        start.modes.push(new);
        self.priors.push(None);
        let more = self.signals.fit(&start, &self.priors);
        let cancels = self.has_modes_that_cancel(&more, largest_px);
        if !cancels && self.is_worth_it(&more) {
            self.fit = more;
            return true;
        }
        self.priors.pop();
        if !cancels {
            self.one_more = more.modes;
        }
        false
    }

    fn has_modes_that_cancel(&self, fit: &Fit, largest_px: f64) -> bool {
        let signals: usize = self.signals.groups.iter().map(|g| g.signals.count()).sum();
        let factors = self.signals.factors(fit, signals);
        let mut new = self.ancestors..fit.modes.len();
        new.any(|m| rms(factors.iter().map(|f| f[m].size())) > MAX_FACTOR_SIZE * largest_px)
    }

    fn is_worth_it(&self, more: &Fit) -> bool {
        let factors = self.signals.factors_per_mode() as f64;
        let by_chance = factors * more.rss / self.signals.values as f64;
        more.rss - self.noise < MAX_RSS_LEFT * (self.fit.rss - self.noise)
            && self.fit.rss - more.rss > MIN_GAIN_OVER_CHANCE * by_chance
    }

    /// Whether a branch may sway like mode `m`, and each of its `parts` does.
    fn may_be_own(&self, m: usize, parts: &[Vec<usize>]) -> bool {
        let mode = &self.fit.modes[m];
        may_be_sway(&self.signals, mode)
            && parts.iter().all(|p| is_in_most_points(&self.factors, m, p))
    }

    /// Why no mode is the branch's own.
    fn reason_for_none(&self, points: &Points) -> Unidentified {
        let all = points.rms_px().powi(2) * self.signals.values as f64;
        let left = self.left_by_ancestors - self.noise;
        if self.ancestors > 0 && left < MAX_LEFT_BY_ANCESTORS * (all - self.noise) {
            Unidentified::AncestorsSway
        } else {
            Unidentified::NoOscillation
        }
    }

    /// Of the logarithms of frequency and damping of mode `m`: those of the fit with the change
    /// that one more mode makes.
    fn deviations_with_one_more(&self, m: usize, spread: &[f64]) -> LnDeviations {
        let mode = &self.fit.modes[m];
        let own = LnDeviations::of_parameters(&spread[2 * m..]);
        let nearest = self.one_more.iter().min_by(|a, b| {
            let [a, b] = [a, b].map(|o| o.ln_frequency_ratio(mode).abs());
            a.total_cmp(&b)
        });
        let Some(other) = nearest else {
            return own;
        };
        LnDeviations {
            frequency: own.frequency.hypot(other.ln_frequency_ratio(mode)),
            damping: own.damping.hypot((other.damping / mode.damping).ln()),
        }
    }

    /// All modes but `m`, as they were fitted.
    fn priors_of_others(&self, m: usize, spread: &[f64]) -> Vec<Prior> {
        let mut out = Vec::with_capacity(self.fit.modes.len());
        for (k, mode) in self.fit.modes.iter().enumerate() {
            out.push((k != m).then(|| BranchMode {
                mode: *mode,
                ln_sd: LnDeviations::of_parameters(&spread[2 * k..]),
            }));
        }
        out
    }
}

/// A mode that may be the branch's own.
struct Candidate {
    /// Among the modes of the fit.
    index: usize,
    is_one_swing: bool,
    /// Not a doubted one.
    is_new: bool,
    common: Common,
}

impl Candidate {
    fn is_better_than(&self, other: &Self) -> bool {
        let flags = (self.is_one_swing, self.is_new).cmp(&(other.is_one_swing, other.is_new));
        let points = self.common.share.total_cmp(&other.common.share);
        let clear = self
            .common
            .significance
            .total_cmp(&other.common.significance);
        flags.then(points).then(clear).is_gt()
    }
}

/// How far a mode is common to the points.
struct Common {
    /// The share of them that has it.
    share: f64,
    /// The significance that most reach.
    significance: f64,
}

/// If mode `m` is common to the points, and the quarter that has least of it has `least_size` of the
/// mean.
fn common_to_points(factors: &[Vec<Factor>], m: usize, least_size: f64) -> Option<Common> {
    let (mut significances, mut sizes) = (Vec::new(), Vec::new());
    for uv in factors.chunks(2) {
        significances.push(uv.iter().map(|f| f[m].significance).sum::<f64>().sqrt());
        sizes.push(rms(uv.iter().map(|f| f[m].size())));
    }
    let have = significances.iter().filter(|s| **s > MIN_SIGNIFICANCE);
    let share = have.count() as f64 / sizes.len() as f64;
    let least_size = least_size * rms(sizes.iter().copied());
    if share < MIN_POINTS_SHARE || quantile(sizes, 0.25)? < least_size {
        return None;
    }
    Some(Common {
        share,
        significance: quantile(significances, CLEARNESS_QUANTILE)?,
    })
}

/// Whether mode `m` is in most points of a part.
fn is_in_most_points(factors: &[Vec<Factor>], m: usize, part: &[usize]) -> bool {
    let mut have = 0;
    for &k in part {
        let square = factors[2 * k][m].significance + factors[2 * k + 1][m].significance;
        have += usize::from(square > MIN_SIGNIFICANCE * MIN_SIGNIFICANCE);
    }
    have as f64 >= MIN_POINTS_SHARE_OF_PART * part.len() as f64
}

/// Root mean square of the signals' largest values.
fn largest_values_rms(signals: &[Vec<f64>]) -> f64 {
    rms(signals.iter().map(|s| {
        let seen = s.iter().filter(|x| x.is_finite());
        seen.fold(0.0_f64, |most, x| most.max(x.abs()))
    }))
}
