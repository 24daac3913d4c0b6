//! Modes of the whole tree in wind: those that were found near its branches, each once.
//!
//! A mode is seen from many windows: from the branch that swings in it, from those on that, and from
//! what carries it. What has one frequency and turns the same points is one mode; the window that
//! shows most of it knows it best, and how far the others are off tells how sure it is.

use super::branch_tree::BranchTree;
use super::branches::{BranchMode, LnDeviations, SearchLimits};
use super::film::Film;
use super::local_modes::{LocalMode, local_modes, views_of_branches, views_of_modes};
use super::members::share_among;
use super::point_modes::{PointMode, PointModes};
use super::sampling::Sampling;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::{Excitation, Sway};
use crate::signal::median;
use nalgebra::Point2;
use std::collections::BTreeSet;
use std::f64::consts::SQRT_2;

/// A local mode counts if the logarithm of its frequency is known to this standard deviation, it is
/// damped as a tree may be, and so much of its motion is one turn of so many points.
const MAX_LN_FREQUENCY_SD: f64 = 0.03;
const DAMPING: Bounds = Bounds::new(0.005, 0.12);
const MIN_SHARE: f64 = 0.8;
const MIN_POINTS: usize = 4;
/// Two are one if their frequencies are no farther apart than this share, and if of the points that
/// either turns and both windows have, so many are turned by both.
const SAME_FREQUENCY: f64 = 0.05;
const SAME_POINTS: f64 = 0.6;
/// Of fewer points that two windows have in common nothing follows.
const MIN_COMMON: usize = 3;
/// A point has a mode if so many of the windows that show it say so.
const MIN_SHARE_OF_WINDOWS: f64 = 0.5;
/// What one window alone shows must be so much one turn, of so many points.
const MIN_SHARE_ALONE: f64 = 0.9;
const MIN_POINTS_ALONE: usize = 6;
/// A standard deviation is so much wider than the curvature says, by such a share of how far the
/// windows are apart, and no less than this.
const CI_INFLATION: f64 = 1.1;
const SHARE_OF_SPREAD: f64 = 0.5;
const MIN_LN_SD: LnDeviations = LnDeviations {
    frequency: 0.01,
    damping: 0.25,
};
/// A mode with so many of its points in a clearer one, and a frequency that is no more standard
/// deviations from it, is that one seen badly.
const SHARE_IN_CLEARER: f64 = 0.6;
const SAME_SIGMAS: f64 = 3.0;

/// It is a captured branch's own if it is in so much of its points.
const MIN_SHARE_OF_BRANCH: f64 = 0.6;
/// A mode is carried by another one that has this share of its points.
const SHARE_ON_CARRIER: f64 = 0.75;

/// A mode with the points that swing in it: those on a branch and on what it carries.
#[derive(Clone, Debug)]
pub(super) struct FoundMode {
    pub mode: BranchMode,
    /// Indices of the film's tracks, in order.
    pub tracks: Vec<usize>,
    /// Place that they turn about, px.
    pub pivot_px: Point2<f64>,
    /// Root of the mean square of the turn, rad, and the share of the motion that it is.
    pub angle: f64,
    pub collinearity: f64,
    /// Points times share of the motion, over all windows: how clear it is.
    pub clearness: f64,
}

/// The modes of the tree, in two looks: near every captured branch, then near every mode that was
/// found. What the second does not show is not believed. `None` where `cancel` ends the work before.
pub(super) fn point_modes(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    limits: &SearchLimits,
    cancel: &CancelToken,
) -> Option<PointModes> {
    let sampling = Sampling::of(film, limits);
    let tracks = film.tracks.len();
    let views = views_of_branches(tree, film, members);
    let mut local = local_modes(film, &views, &sampling, cancel);
    let candidates = merged(&local, tracks, |group| group.first());
    let mut again = local_modes(film, &views_of_modes(&candidates), &sampling, cancel);
    for mode in &mut again {
        mode.view += views.len();
        mode.is_second_look = true;
    }
    local.extend(again);
    if cancel.is_cancelled() {
        return None;
    }
    let modes = merged(&local, tracks, |group| {
        group.iter().find(|seen| seen.mode.is_second_look)
    });
    let modes = modes
        .iter()
        .filter(|m| !limits.may_be_aliased(m.mode.mode.frequency_hz, film))
        .map(|m| m.point_mode(limits.max_relative_ci))
        .collect();
    Some(PointModes {
        modes,
        on: members.to_vec(),
        min_share_of_branch: MIN_SHARE_OF_BRANCH,
    })
}

/// The modes, the clearest first; `tracks` is the number of the film's. `best` chooses from the
/// local modes that are one, clearest first, the one that tells it best.
fn merged(
    local: &[LocalMode],
    tracks: usize,
    best: impl for<'a, 'b> Fn(&'b [Seen<'a>]) -> Option<&'b Seen<'a>>,
) -> Vec<FoundMode> {
    let mut seen: Vec<Seen> = Vec::new();
    for mode in local.iter().filter(|m| counts(m)) {
        seen.push(Seen::of(mode, tracks));
    }
    seen.sort_by(|a, b| b.weight().total_cmp(&a.weight()));
    let mut groups: Vec<Vec<Seen>> = Vec::new();
    for mode in seen {
        let nearest = groups
            .iter_mut()
            .filter_map(|group| Some((mode.likeness(group)?, group)))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match nearest {
            Some((_, group)) => group.push(mode),
            None => groups.push(vec![mode]),
        }
    }
    let mut modes: Vec<FoundMode> = groups
        .iter()
        .filter_map(|group| together(group, best(group)?))
        .collect();
    modes.sort_by(|a, b| b.clearness.total_cmp(&a.clearness));
    let mut out: Vec<FoundMode> = Vec::new();
    for mode in modes {
        if !out.iter().any(|o| mode.is_badly_seen(o)) {
            out.push(mode);
        }
    }
    out
}

fn counts(mode: &LocalMode) -> bool {
    !mode.at_limit
        && mode.ln_sd.frequency < MAX_LN_FREQUENCY_SD
        && DAMPING.contains(mode.mode.damping)
        && mode.share > MIN_SHARE
        && mode.turned.len() >= MIN_POINTS
}

/// A local mode with its points as flags, by track.
struct Seen<'a> {
    mode: &'a LocalMode,
    looked_at: Vec<bool>,
    turned: Vec<bool>,
}

impl<'a> Seen<'a> {
    fn of(mode: &'a LocalMode, tracks: usize) -> Self {
        Self {
            mode,
            looked_at: flags(&mode.looked_at, tracks),
            turned: flags(&mode.turned, tracks),
        }
    }

    fn weight(&self) -> f64 {
        self.mode.share * self.mode.turned.len() as f64
    }

    /// How much a mode is that of a group; `None` where it is another one.
    fn likeness(&self, group: &[Seen]) -> Option<f64> {
        let first = group.first()?;
        let apart = self.mode.mode.ln_frequency_ratio(&first.mode.mode).abs();
        let overlaps = group.iter().map(|other| self.overlap(other));
        let overlap = overlaps.sum::<f64>() / group.len() as f64;
        let is_same = apart < SAME_FREQUENCY && overlap >= SAME_POINTS;
        is_same.then(|| overlap - apart / SAME_FREQUENCY)
    }

    /// Of the points that either turns and both windows have, the share that both turn.
    fn overlap(&self, other: &Seen) -> f64 {
        let (mut both, mut either) = (0, 0);
        for k in 0..self.turned.len() {
            if self.looked_at[k] && other.looked_at[k] {
                both += usize::from(self.turned[k] && other.turned[k]);
                either += usize::from(self.turned[k] || other.turned[k]);
            }
        }
        if either < MIN_COMMON {
            return 0.0;
        }
        both as f64 / either as f64
    }
}

fn flags(indices: &[usize], len: usize) -> Vec<bool> {
    let mut out = vec![false; len];
    for &k in indices {
        out[k] = true;
    }
    out
}

/// One mode from a group, which `first` tells best; `None` where too little shows it.
fn together(group: &[Seen], first: &Seen) -> Option<FoundMode> {
    let mut tracks = Vec::new();
    for k in 0..first.turned.len() {
        let looked_at = group.iter().filter(|s| s.looked_at[k]).count() as f64;
        let turned = group.iter().filter(|s| s.turned[k]).count() as f64;
        if turned > 0.0 && turned >= MIN_SHARE_OF_WINDOWS * looked_at {
            tracks.push(k);
        }
    }
    let windows: BTreeSet<usize> = group.iter().map(|s| s.mode.view).collect();
    let is_alone = windows.len() == 1;
    let is_clear_alone = first.mode.share > MIN_SHARE_ALONE && tracks.len() >= MIN_POINTS_ALONE;
    if tracks.len() < MIN_POINTS || is_alone && !is_clear_alone {
        return None;
    }
    let mut squares = 0.0;
    let mut deviations: Vec<f64> = Vec::new();
    for seen in group {
        squares += seen.mode.mode.ln_frequency_ratio(&first.mode.mode).powi(2);
        deviations.push(seen.mode.ln_sd.frequency);
    }
    let spread = SHARE_OF_SPREAD * (squares / group.len() as f64).sqrt();
    let ln_sd = LnDeviations {
        frequency: median(deviations, f64::total_cmp)?.max(first.mode.ln_sd.frequency),
        damping: first.mode.ln_sd.damping,
    };
    let mut ln_sd = ln_sd.inflated(CI_INFLATION, &MIN_LN_SD);
    ln_sd.frequency = ln_sd.frequency.hypot(spread);
    Some(FoundMode {
        mode: BranchMode {
            mode: first.mode.mode,
            ln_sd,
        },
        tracks,
        pivot_px: first.mode.pivot_px,
        angle: first.mode.angle,
        collinearity: first.mode.share,
        clearness: group.iter().map(Seen::weight).sum(),
    })
}

impl FoundMode {
    fn is_badly_seen(&self, clearer: &FoundMode) -> bool {
        let share = share_among(&self.tracks, &clearer.tracks);
        let sd = self
            .mode
            .ln_sd
            .frequency
            .hypot(clearer.mode.ln_sd.frequency);
        share >= SHARE_IN_CLEARER
            && self
                .mode
                .mode
                .has_frequency_of(&clearer.mode.mode, SAME_SIGMAS * sd)
    }

    /// Whether most of another mode's points swing in this one, too, and more besides.
    pub fn carries(&self, other: &FoundMode) -> bool {
        share_among(&other.tracks, &self.tracks) >= SHARE_ON_CARRIER
            && self.tracks.len() > other.tracks.len()
    }

    fn point_mode(&self, max_relative_ci: f64) -> PointMode {
        let sway = Sway {
            frequency_hz: self.mode.frequency_hz(),
            damping_ratio: self.mode.damping_ratio(),
            excitation: Excitation::Wind,
            amplitude_deg: (SQRT_2 * self.angle).to_degrees(),
        };
        PointMode {
            mode: self.mode.mode,
            tracks: self.tracks.clone(),
            clearness: self.clearness,
            same_within: SAME_SIGMAS * self.mode.ln_sd.frequency,
            sway,
            is_sure: self.mode.is_within(max_relative_ci),
            collinearity: self.collinearity,
            pivot_px: self.pivot_px,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::film::FilmTrack;
    use super::super::shoots;
    use super::*;
    use crate::config::{Dynamics, Excited};
    use crate::model::{Node, NodeId, Size, Skeleton};
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
    fn both_modes_are_told_with_their_points() {
        let (skeleton, film) = filmed();
        let tree = BranchTree::of(&skeleton);
        let limits = SearchLimits {
            frequencies_hz: Bounds::new(0.05, 5.0),
            highest_hz: 5.0,
            max_relative_ci: 0.05,
        };
        let members = super::super::members::members(&tree, &film);
        let cancel = CancelToken::new();
        let found = point_modes(&tree, &film, &members, &limits, &cancel).expect("modes");
        for (frequency_hz, points) in [(0.6, 20), (1.3, 8)] {
            let holds = |m: &&PointMode| m.sway.frequency_hz.holds(frequency_hz);
            let mode = found.modes.iter().find(holds);
            let mode = mode.unwrap_or_else(|| panic!("{frequency_hz} Hz: {:?}", found.modes));
            let off = mode.tracks.len().abs_diff(points);
            assert!(off <= 2, "{frequency_hz} Hz: {:?}", mode.tracks);
        }
    }
}
