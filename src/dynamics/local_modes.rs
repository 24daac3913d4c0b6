//! Modes that wind drives in a branch and what carries it.
//!
//! They are looked for in several rounds, each with covariances up to a lag of its own and with bands
//! in places of their own: what all rounds find does not hang on where the search began.

use super::branch_tree::BranchTree;
use super::branches::LnDeviations;
use super::decay::Mode;
use super::driven_modes::{Band, DrivenMode, Spectrum, Start};
use super::film::Film;
use super::gap_free::frames_with;
use super::members::{Points, mean_px};
use super::motions::Motions;
use super::subspace::{LAGS_S, StablePole, stable_poles};
use super::turns::{TurnedPoints, turned_points};
use super::wind;
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::NodeId;
use nalgebra::{DVector, Point2, Vector2};

/// Rounds of the search.
const ROUNDS: usize = LAGS_S.len();
/// Points of a branch and all that it carries, and own points of what carries it, at most.
pub(super) const MOST_POINTS: usize = 60;
const MOST_OF_CARRIERS: usize = 40;
/// Modes are reported from a core of so much from the lowest to the highest frequency; the band
/// reaches so much farther to either side. The first core begins where no tree sways so slowly.
const CORE: f64 = 1.35;
const LOWEST_HZ: f64 = 0.05;
const MARGIN: f64 = 1.22;
/// Modes in a band at most.
const MOST_MODES: usize = 4;
/// Starts that are nearer than this share are one.
const SAME_START: f64 = 0.015;
/// Points that a branch must have.
const MIN_POINTS: usize = 3;
/// Periods of the lowest frequency of a band in the film at least.
const LEAST_PERIODS: f64 = 1.2;

/// A mode of the points near a branch.
#[derive(Clone, Debug)]
pub(super) struct LocalMode {
    pub mode: Mode,
    pub ln_sd: LnDeviations,
    pub at_limit: bool,
    /// Points that it turns about one place, as indices of the film's tracks, in order.
    pub turned: Vec<usize>,
    /// That place, px.
    pub pivot_px: Point2<f64>,
    /// Root of the mean square of the turn, rad.
    pub angle: f64,
    /// Share of its motion that is this turn.
    pub share: f64,
    /// Points that were looked at, in order.
    pub looked_at: Vec<usize>,
}

/// The points of a branch and of what carries it, with their motions.
struct Window {
    /// Of the film's tracks.
    tracks: Vec<usize>,
    at_px: Vec<Point2<f64>>,
    motions: Motions,
    /// What of the motions a small turn of the branch about its base is.
    own_turn: DVector<f64>,
}

/// The modes near every captured branch; `members` are the points of each and of what it carries.
pub(super) fn local_modes(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    frequencies_hz: Bounds,
    cancel: &CancelToken,
) -> Vec<LocalMode> {
    let mut out = Vec::new();
    for branch in (1..members.len() as u32).map(NodeId) {
        if cancel.is_cancelled() {
            break;
        }
        if let Some(window) = Window::of(tree, film, members, branch) {
            out.extend(window.modes(frequencies_hz, cancel));
        }
    }
    out
}

/// The points on the branches that carry one and on nothing that these carry, in order.
fn points_of_carriers(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
    branch: NodeId,
) -> Vec<usize> {
    let mut out = Vec::new();
    for carrier in tree.carriers(branch) {
        let of_carrier = members.get(carrier.index()).into_iter().flatten();
        let own = of_carrier.filter(|k| film.tracks[**k].node == carrier);
        out.extend(own.copied());
    }
    out.sort_unstable();
    out
}

impl Window {
    fn of(tree: &BranchTree, film: &Film, members: &[Vec<usize>], branch: NodeId) -> Option<Self> {
        let mut points = Points::up_to(MOST_POINTS, film, &members[branch.index()]);
        let own = points.tracks.len();
        if own < MIN_POINTS {
            return None;
        }
        let of_carriers = points_of_carriers(tree, film, members, branch);
        let carriers = Points::up_to(MOST_OF_CARRIERS, film, &of_carriers);
        points.tracks.extend(carriers.tracks);
        points.signals.extend(carriers.signals);
        let frames = frames_with(film, &[&points], wind::MIN_FRAMES)?;
        let motions = Motions::of(film, &points, &frames);
        let mut at_px = Vec::with_capacity(points.tracks.len());
        for &k in &points.tracks {
            at_px.push(mean_px(&film.tracks[k].at_px));
        }
        let base_px = tree.branches[branch.index()].base_px;
        let mut own_turn = vec![Vector2::zeros(); at_px.len()];
        for (moved, at) in own_turn.iter_mut().zip(&at_px).take(own) {
            let arm = at - base_px;
            *moved = Vector2::new(-arm.y, arm.x);
        }
        Some(Self {
            tracks: points.tracks,
            at_px,
            own_turn: motions.sizes_of(&own_turn),
            motions,
        })
    }

    fn modes(&self, within_hz: Bounds, cancel: &CancelToken) -> Vec<LocalMode> {
        let lowest_hz = within_hz.lo.max(LEAST_PERIODS / self.motions.span_s());
        let within_hz = Bounds::new(lowest_hz, within_hz.hi);
        let spectrum = self.motions.spectrum(within_hz);
        let channels = self.motions.of_like_size();
        let mut out = Vec::new();
        for (round, lag_s) in LAGS_S.iter().enumerate() {
            let step_s = self.motions.step_s();
            let poles = stable_poles(&channels, step_s, within_hz, &[*lag_s]);
            for core in cores(round, within_hz) {
                if cancel.is_cancelled() {
                    return out;
                }
                if poles.iter().any(|pole| core.contains(pole.frequency_hz)) {
                    out.extend(self.modes_in(core, &spectrum, &poles, within_hz, cancel));
                }
            }
        }
        out
    }

    /// The modes of one core.
    fn modes_in(
        &self,
        core: Bounds,
        spectrum: &Spectrum,
        poles: &[StablePole],
        within_hz: Bounds,
        cancel: &CancelToken,
    ) -> Vec<LocalMode> {
        let band_hz = Bounds::new(
            (core.lo / MARGIN).max(within_hz.lo),
            (core.hi * MARGIN).min(within_hz.hi),
        );
        let Some(band) = Band::of(spectrum, band_hz) else {
            return Vec::new();
        };
        let mut starts = starts(&band, poles, band_hz);
        if let Some(shape) = band.shape_of(&self.own_turn) {
            let others: Vec<_> = starts.iter().map(|s| s.shape).collect();
            let frequency_hz = band.peak_hz(&shape, &others);
            starts.push(Start {
                frequency_hz,
                shape,
            });
        }
        if starts.is_empty() {
            return Vec::new();
        }
        let fit = band.fit(&starts, cancel);
        let mut out = Vec::new();
        for found in band.modes(&fit) {
            if core.contains(found.mode.frequency_hz) {
                out.extend(self.local(&found));
            }
        }
        out
    }

    fn local(&self, found: &DrivenMode) -> Option<LocalMode> {
        let moved = self.motions.in_points(&found.motions_px);
        let TurnedPoints {
            points,
            share,
            pivot_px,
            angle,
        } = turned_points(&self.at_px, &moved)?;
        Some(LocalMode {
            mode: found.mode,
            ln_sd: found.ln_sd,
            at_limit: found.at_limit,
            turned: in_order(points.iter().map(|p| self.tracks[*p])),
            pivot_px,
            angle,
            share,
            looked_at: in_order(self.tracks.iter().copied()),
        })
    }
}

fn in_order(indices: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut out: Vec<usize> = indices.collect();
    out.sort_unstable();
    out
}

/// Bands that modes are reported from, side by side; those of each round lie between those of the
/// others.
fn cores(round: usize, within_hz: Bounds) -> Vec<Bounds> {
    let mut out = Vec::new();
    let mut lo = LOWEST_HZ * CORE.powf(round as f64 / ROUNDS as f64);
    while lo < within_hz.hi {
        if CORE * lo > within_hz.lo {
            out.push(Bounds::new(lo, CORE * lo));
        }
        lo *= CORE;
    }
    out
}

/// Poles of a band, those met with most, by frequency.
fn starts(band: &Band, poles: &[StablePole], band_hz: Bounds) -> Vec<Start> {
    let mut inside: Vec<StablePole> = Vec::new();
    for pole in poles.iter().filter(|p| band_hz.contains(p.frequency_hz)) {
        match inside.last_mut() {
            Some(last) if pole.frequency_hz < (1.0 + SAME_START) * last.frequency_hz => {
                if pole.met > last.met {
                    *last = *pole;
                }
            }
            _ => inside.push(*pole),
        }
    }
    inside.sort_by_key(|p| std::cmp::Reverse(p.met));
    inside.truncate(MOST_MODES - 1);
    inside
        .iter()
        .map(|p| Start {
            frequency_hz: p.frequency_hz,
            shape: band.shape_near(p.frequency_hz),
        })
        .collect()
}
