//! Modes of the tree in wind: what all local modes say together.
//!
//! A local mode votes for the captured branches whose points it turns, the more the better its points
//! are the branch's. A branch's own mode is where most votes are along the frequency (mean shift,
//! Fukunaga and Hostetler 1975), not counting those at the frequencies of what carries it. Local
//! modes that vote for no captured branch are those of branches that the tree lacks: of these, like
//! ones vote together.

use super::branch_tree::BranchTree;
use super::branches::{BranchMode, LnDeviations, SearchLimits};
use super::decay::Mode;
use super::film::Film;
use super::local_modes::{LocalMode, MOST_POINTS, local_modes};
use super::members::count_among;
use super::point_modes::{PointMode, PointModes};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::{Excitation, NodeId, Sway};
use nalgebra::{Point2, Vector2};
use std::f64::consts::SQRT_2;

/// A local mode counts if the logarithm of its frequency is known to this standard deviation, it is
/// damped as a tree may be, and so much of its motion is one turn of so many points.
const MAX_LN_FREQUENCY_SD: f64 = 0.03;
const DAMPING: Bounds = Bounds::new(0.005, 0.12);
/// No branch swings so far, rad. Two modes that are near in frequency may both come out far too
/// large, as they almost cancel.
const LARGEST_ANGLE: f64 = 1.0;
const MIN_SHARE: f64 = 0.8;
const MIN_POINTS: usize = 4;
/// It votes for a branch that has so much of its points, if it turns so much of that branch's, and if
/// so much of the branch was looked at.
const MIN_SHARE_OF_POINTS: f64 = 0.5;
const MIN_SHARE_LOOKED_AT: f64 = 0.5;
/// It votes for the branch that fits best, and for those that fit to this share of how well that does.
const NEAR_BEST: f64 = 0.9;
/// Votes that a mode needs, over all rounds and branches near which it was looked for; one whose
/// points fit perfectly counts 1.
const MIN_VOTES: f64 = 2.0;
/// Votes are counted together if their frequencies are about this share apart, which is as far as the
/// frequency of one may be uncertain.
const KERNEL: f64 = MAX_LN_FREQUENCY_SD;
const MEAN_SHIFTS: usize = 10;
/// A point that less than this share of the votes for a mode shows is not known to have it.
const MIN_WEIGHT_OF_POINT: f64 = 0.1;
/// A vote that is nearer to a carrier's mode than so many standard deviations is for that.
const CARRIER_SIGMAS: f64 = 2.0;
/// A standard deviation is so much wider than the curvature says, by such a share of how far the
/// votes are apart, and no less than this.
const CI_INFLATION: f64 = 1.1;
const SHARE_OF_SPREAD: f64 = 0.5;
const MIN_LN_SD: LnDeviations = LnDeviations {
    frequency: 0.01,
    damping: 0.25,
};
/// Local modes that are no captured branch's are alike if their frequencies are no farther apart than
/// this share, and if of the points that either turns and both show so many are turned by both. Of
/// fewer points than these nothing follows.
const SAME_FREQUENCY: f64 = 0.05;
const SAME_POINTS: f64 = 0.6;
const MIN_COMMON: usize = 3;
/// A frequency that is no more standard deviations from a carrier's is the carrier's.
const SAME_SIGMAS: f64 = 3.0;

/// It is a captured branch's own if it is in so much of its points.
const MIN_SHARE_OF_BRANCH: f64 = 0.6;

/// The modes of the tree: those of captured branches, and those of branches that it lacks; `None`
/// where `cancel` ends the work before.
pub(super) fn point_modes(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    trunk: NodeId,
    limits: &SearchLimits,
    cancel: &CancelToken,
) -> Option<PointModes> {
    let mut local = local_modes(tree, film, members, limits.frequencies_hz, cancel);
    if cancel.is_cancelled() {
        return None;
    }
    local.retain(counts);
    let voters: Vec<Voter> = local.iter().map(|m| Voter::of(m, members)).collect();
    let of_branches = modes_of_branches(tree, members, &voters);
    let trunk = trunk.index();
    let mut modes = Vec::new();
    for (branch, found) in of_branches.iter().enumerate() {
        // The trunk's is the fundamental of all points.
        let found = found.as_ref().filter(|_| branch != trunk);
        modes.extend(found.map(|m| m.point_mode(Some(branch), limits)));
    }
    for found in modes_of_no_branch(&voters) {
        modes.push(found.point_mode(None, limits));
    }
    modes.retain(|m| !limits.may_be_aliased(m.mode.frequency_hz, film));
    Some(PointModes {
        modes,
        on: members.to_vec(),
        min_share_of_branch: MIN_SHARE_OF_BRANCH,
    })
}

fn counts(mode: &LocalMode) -> bool {
    !mode.at_limit
        && mode.ln_sd.frequency < MAX_LN_FREQUENCY_SD
        && DAMPING.contains(mode.mode.damping)
        && SQRT_2 * mode.angle < LARGEST_ANGLE
        && mode.share > MIN_SHARE
        && mode.turned.len() >= MIN_POINTS
}

/// A local mode, and the branches that it may vote for.
struct Voter<'a> {
    mode: &'a LocalMode,
    /// By branch: how alike its points and those of the branch are that it shows, 0 to 1; 0 where it
    /// has no vote.
    fits: Vec<f64>,
    /// The largest.
    best: f64,
}

/// A local mode, and how much it counts for a branch.
#[derive(Clone, Copy)]
struct Vote<'a> {
    mode: &'a LocalMode,
    weight: f64,
}

/// What votes say together.
struct FoundMode {
    mode: BranchMode,
    votes: f64,
    /// Points that most of the votes which show them turn, as indices of the film's tracks, in order.
    tracks: Vec<usize>,
    /// Place that they turn about, px.
    pivot_px: Point2<f64>,
    /// Root of the mean square of the turn, rad, and the share of the motion that it is.
    angle: f64,
    collinearity: f64,
}

/// By branch: whether it has points that no one branch on it has, by which the two can be told
/// apart.
fn are_told_apart(tree: &BranchTree, members: &[Vec<usize>]) -> Vec<bool> {
    let mut out = vec![true; members.len()];
    for (branch, points) in tree.branches.iter().zip(members) {
        if let Some(carrier) = branch.parent.map(NodeId::index) {
            let all = members[carrier].len() as f64;
            out[carrier] &= (points.len() as f64) < NEAR_BEST * all;
        }
    }
    out
}

/// By branch: its own mode.
fn modes_of_branches(
    tree: &BranchTree,
    members: &[Vec<usize>],
    voters: &[Voter],
) -> Vec<Option<FoundMode>> {
    let mut out: Vec<Option<FoundMode>> = Vec::with_capacity(members.len());
    for (branch, is_told_apart) in are_told_apart(tree, members).into_iter().enumerate() {
        if !is_told_apart {
            out.push(None);
            continue;
        }
        let mut carriers: Vec<BranchMode> = Vec::new();
        for carrier in tree.carriers(NodeId(branch as u32)) {
            let found = out.get(carrier.index()).and_then(Option::as_ref);
            carriers.extend(found.map(|found| found.mode));
        }
        let mut votes = Vec::new();
        for voter in voters {
            let vote = voter.vote(branch);
            votes.extend(vote.filter(|_| !carriers.iter().any(|c| voter.is_of_carrier(c))));
        }
        out.push(FoundMode::of(&votes).filter(FoundMode::is_believed));
    }
    out
}

impl<'a> Voter<'a> {
    fn of(mode: &'a LocalMode, members: &[Vec<usize>]) -> Self {
        let fits: Vec<f64> = members.iter().map(|points| fit(mode, points)).collect();
        let best = fits.iter().copied().fold(0.0, f64::max);
        Self { mode, fits, best }
    }

    /// For a branch that fits best, or nearly so.
    fn vote(&self, branch: usize) -> Option<Vote<'a>> {
        let fit = self.fits[branch];
        (fit > 0.0 && fit >= NEAR_BEST * self.best).then_some(Vote {
            mode: self.mode,
            weight: self.mode.share * fit,
        })
    }

    fn is_of_carrier(&self, carrier: &BranchMode) -> bool {
        let sd = self.mode.ln_sd.frequency.hypot(carrier.ln_sd.frequency);
        self.mode
            .mode
            .has_frequency_of(&carrier.mode, CARRIER_SIGMAS * sd)
    }
}

/// How alike the points of a mode and those `points` of a branch are that it shows, 0 to 1; 0 where
/// it has no vote.
fn fit(mode: &LocalMode, points: &[usize]) -> f64 {
    let looked_at = count_among(&mode.looked_at, points) as f64;
    let both = count_among(&mode.turned, points) as f64;
    let turned = mode.turned.len() as f64;
    let has_vote = looked_at >= MIN_SHARE_LOOKED_AT * points.len().min(MOST_POINTS) as f64
        && both >= MIN_POINTS as f64
        && both >= MIN_SHARE_OF_POINTS * looked_at
        && both >= MIN_SHARE_OF_POINTS * turned;
    if has_vote {
        both / (looked_at + turned - both)
    } else {
        0.0
    }
}

/// Modes of points that are no captured branch's, those with most votes first.
fn modes_of_no_branch(voters: &[Voter]) -> Vec<FoundMode> {
    let mut votes: Vec<Vote> = Vec::new();
    for voter in voters.iter().filter(|voter| voter.best == 0.0) {
        votes.push(Vote {
            mode: voter.mode,
            weight: voter.mode.share,
        });
    }
    votes.sort_by(|a, b| {
        let [a, b] = [a, b].map(|v| v.weight * v.mode.turned.len() as f64);
        b.total_cmp(&a)
    });
    let mut groups: Vec<Vec<Vote>> = Vec::new();
    for vote in votes {
        let mut like = groups.iter_mut().filter(|g| is_like(vote.mode, g[0].mode));
        match like.next() {
            Some(group) => group.push(vote),
            None => groups.push(vec![vote]),
        }
    }
    let mut out: Vec<FoundMode> = groups.iter().filter_map(|g| FoundMode::of(g)).collect();
    out.retain(FoundMode::is_believed);
    out.sort_by(|a, b| b.votes.total_cmp(&a.votes));
    out
}

/// Whether two local modes are of the same points and have the same frequency.
fn is_like(a: &LocalMode, b: &LocalMode) -> bool {
    let both = count_among(&a.turned, &b.turned);
    let either = count_among(&a.turned, &b.looked_at) + count_among(&b.turned, &a.looked_at) - both;
    either >= MIN_COMMON
        && both as f64 >= SAME_POINTS * either as f64
        && a.mode.has_frequency_of(&b.mode, SAME_FREQUENCY)
}

impl FoundMode {
    /// Where most of some votes are; `None` where there are none.
    fn of(votes: &[Vote]) -> Option<Self> {
        let mut most = (0.0, None);
        for vote in votes {
            let near = Near::of(votes, &vote.mode.mode);
            if near.weight > most.0 {
                most = (near.weight, Some(vote.mode.mode));
            }
        }
        let mut mode = most.1?;
        for _ in 0..MEAN_SHIFTS {
            mode = Near::of(votes, &mode).mean;
        }
        Near::of(votes, &mode).found()
    }

    fn is_believed(&self) -> bool {
        self.votes >= MIN_VOTES && self.tracks.len() >= MIN_POINTS
    }

    fn point_mode(&self, branch: Option<usize>, limits: &SearchLimits) -> PointMode {
        let sway = Sway {
            frequency_hz: self.mode.frequency_hz(),
            damping_ratio: self.mode.damping_ratio(),
            excitation: Excitation::Wind,
            amplitude_deg: (SQRT_2 * self.angle).to_degrees(),
        };
        PointMode {
            mode: self.mode.mode,
            branch,
            tracks: self.tracks.clone(),
            clearness: self.votes,
            same_within: SAME_SIGMAS * self.mode.ln_sd.frequency,
            sway,
            is_sure: self.mode.is_within(limits.max_relative_ci),
            collinearity: self.collinearity,
            pivot_px: self.pivot_px,
        }
    }
}

/// Votes near a mode, weighted by how near they are.
struct Near<'a> {
    votes: Vec<Vote<'a>>,
    weight: f64,
    /// Their mean frequency and damping ratio, by logarithms.
    mean: Mode,
}

impl<'a> Near<'a> {
    fn of(votes: &[Vote<'a>], mode: &Mode) -> Self {
        let mut near = Vec::with_capacity(votes.len());
        let (mut sum, mut parameters) = (0.0, Vector2::zeros());
        for vote in votes {
            let off = vote.mode.mode.ln_frequency_ratio(mode) / KERNEL;
            let weight = vote.weight * (-0.5 * off * off).exp();
            sum += weight;
            parameters += weight * Vector2::from(vote.mode.mode.parameters());
            near.push(Vote { weight, ..*vote });
        }
        parameters /= sum.max(f64::MIN_POSITIVE);
        Self {
            votes: near,
            weight: sum,
            mean: Mode::of_parameters(parameters.as_slice()),
        }
    }

    /// Weighted mean of a value.
    fn mean_of(&self, value: impl Fn(&LocalMode) -> f64) -> f64 {
        let sum: f64 = self.votes.iter().map(|v| v.weight * value(v.mode)).sum();
        sum / self.weight
    }

    fn found(&self) -> Option<FoundMode> {
        let variances = LnDeviations {
            frequency: self.mean_of(|m| m.ln_sd.frequency.powi(2)),
            damping: self.mean_of(|m| m.ln_sd.damping.powi(2)),
        };
        let ln_sd = LnDeviations {
            frequency: variances.frequency.sqrt(),
            damping: variances.damping.sqrt(),
        };
        let apart = self.mean_of(|m| m.mode.ln_frequency_ratio(&self.mean).powi(2));
        let mut ln_sd = ln_sd.inflated(CI_INFLATION, &MIN_LN_SD);
        ln_sd.frequency = ln_sd.frequency.hypot(SHARE_OF_SPREAD * apart.sqrt());
        // A place and an angle about it belong together.
        let votes = self.votes.iter();
        let first = votes.max_by(|a, b| a.weight.total_cmp(&b.weight))?.mode;
        Some(FoundMode {
            mode: BranchMode {
                mode: self.mean,
                ln_sd,
            },
            votes: self.weight,
            tracks: self.tracks(),
            pivot_px: first.pivot_px,
            angle: first.angle,
            collinearity: self.mean_of(|m| m.share),
        })
    }

    /// Points that most of the votes which show them turn; not those that hardly any shows.
    fn tracks(&self) -> Vec<usize> {
        let (mut shown, mut turned) = (Vec::new(), Vec::new());
        for vote in &self.votes {
            add(&mut shown, &vote.mode.looked_at, vote.weight);
            add(&mut turned, &vote.mode.turned, vote.weight);
        }
        let mut out = Vec::new();
        for (k, (turned, shown)) in turned.iter().zip(&shown).enumerate() {
            if *shown >= MIN_WEIGHT_OF_POINT * self.weight && *turned > 0.5 * shown {
                out.push(k);
            }
        }
        out
    }
}

/// Adds a weight to some places, which are in order; there may be new ones among them.
fn add(sums: &mut Vec<f64>, places: &[usize], weight: f64) {
    let most = places.last().map_or(0, |last| last + 1);
    if sums.len() < most {
        sums.resize(most, 0.0);
    }
    for &k in places {
        sums[k] += weight;
    }
}

#[cfg(test)]
mod tests {
    use super::super::film::FilmTrack;
    use super::super::{Depth, analyse, shoots};
    use super::*;
    use crate::config::{Dynamics, Excited};
    use crate::model::{Node, NodeId, Size, Skeleton, TreeMode};
    use crate::random::generator;
    use nalgebra::Vector2;
    use rand::RngExt;
    use std::f64::consts::TAU;

    const RATE_HZ: f64 = 15.0;
    const FRAMES: usize = 675;
    /// Places where trunk and limb begin, px.
    const FOOT_PX: Point2<f64> = Point2::new(300.0, 340.0);
    const FORK_PX: Point2<f64> = Point2::new(300.0, 200.0);

    /// The angle of an oscillator that chance drives.
    fn driven(frequency_hz: f64, damping: f64, seed: u64) -> Vec<f64> {
        let mut random = generator(seed, 0);
        let omega = TAU * frequency_hz;
        let step_s = 1.0 / (20.0 * RATE_HZ);
        let (mut at, mut speed) = (0.0, 0.0);
        let mut out = Vec::with_capacity(FRAMES);
        for _ in 0..FRAMES {
            for _ in 0..20 {
                let force: f64 = random.random_range(-1.0..1.0);
                speed += step_s * (force - 2.0 * damping * omega * speed - omega * omega * at);
                at += step_s * speed;
            }
            out.push(at);
        }
        let rms = (out.iter().map(|x| x * x).sum::<f64>() / FRAMES as f64).sqrt();
        out.iter().map(|x| 0.03 * x / rms).collect()
    }

    fn turned(at_px: Point2<f64>, about_px: Point2<f64>, angle: f64) -> Vector2<f64> {
        let arm = at_px - about_px;
        angle * Vector2::new(-arm.y, arm.x)
    }

    /// A trunk with twelve points, and a limb on it with eight, all of which the skeleton has on the
    /// trunk.
    fn filmed() -> (Skeleton, Film) {
        let (trunk, limb) = (driven(0.6, 0.03, 11), driven(1.3, 0.03, 12));
        let mut random = generator(13, 0);
        let mut tracks = Vec::new();
        for k in 0..20 {
            let on_limb = k >= 12;
            let along = f64::from(k % 12);
            let rest_px = if on_limb {
                FORK_PX + Vector2::new(15.0 + 8.0 * along, -10.0 - 4.0 * along)
            } else {
                FOOT_PX + Vector2::new(2.0 * along - 12.0, -80.0 - 15.0 * along)
            };
            let mut at_px = Vec::with_capacity(FRAMES);
            for (trunk, limb) in trunk.iter().zip(&limb) {
                let mut place = rest_px + turned(rest_px, FOOT_PX, *trunk);
                if on_limb {
                    place += turned(rest_px, FORK_PX, *limb);
                }
                let mut noise = || random.random_range(-0.1..0.1);
                at_px.push(place + Vector2::new(noise(), noise()));
            }
            let node = NodeId(1);
            tracks.push(FilmTrack { node, at_px });
        }
        let times_s: Vec<f64> = (0..FRAMES).map(|k| k as f64 / RATE_HZ).collect();
        let skeleton = Skeleton {
            nodes: vec![
                Node::made_up(0, None, [0.0, 0.0, 0.0]),
                Node {
                    level: 1,
                    ..Node::made_up(1, Some(0), [0.0, 260.0, 0.0])
                },
            ],
            foot_px: FOOT_PX,
            image_size: Size {
                width: 640,
                height: 360,
            },
        };
        (skeleton, Film::new(&times_s, tracks))
    }

    #[test]
    fn a_limb_that_the_tree_lacks_is_found_in_wind() {
        let (skeleton, film) = filmed();
        let config = Dynamics {
            excitation: Excited::Wind,
            ..Dynamics::default()
        };
        let found = shoots(&skeleton, &film, &config, &CancelToken::new());
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].on, NodeId(1));
        let of_limb = found[0].tracks.iter().filter(|k| **k >= 12).count();
        assert!(
            of_limb >= 6 && of_limb == found[0].tracks.len(),
            "{found:?}"
        );
        let cancelled = CancelToken::new();
        cancelled.cancel();
        assert!(shoots(&skeleton, &film, &config, &cancelled).is_empty());
    }

    #[test]
    fn both_modes_are_found_with_their_points() {
        let (skeleton, film) = filmed();
        let config = Dynamics {
            excitation: Excited::Wind,
            ..Dynamics::default()
        };
        let cancel = CancelToken::new();
        let found = analyse(&skeleton, &film, &config, Depth::Full, &cancel).modes;
        for (frequency_hz, points) in [(0.6, 20), (1.3, 8)] {
            let holds = |m: &&TreeMode| m.sway.frequency_hz.holds(frequency_hz);
            let mode = found.iter().find(holds);
            let mode = mode.unwrap_or_else(|| panic!("{frequency_hz} Hz: {found:?}"));
            let off = mode.points.abs_diff(points);
            assert!(off <= 2, "{frequency_hz} Hz: {mode:?}");
        }
    }
}
