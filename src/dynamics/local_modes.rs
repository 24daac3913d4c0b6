//! Modes that wind drives in a branch and what carries it.

use super::branch_tree::BranchTree;
use super::branches::LnDeviations;
use super::decay::Mode;
use super::driven_modes::{Band, DrivenMode, Start};
use super::film::Film;
use super::members::{Points, mean_px};
use super::motions::Motions;
use super::sampling::Sampling;
use super::subspace::{ONE_LAG_S, StablePole, stable_poles};
use super::tree_modes::FoundMode;
use super::turns::{TurnedPoints, turned_points};
use crate::bounds::Bounds;
use crate::cancel::CancelToken;
use crate::model::NodeId;
use nalgebra::{Point2, Vector2};
use std::collections::BTreeSet;

/// Points of a branch and all that it carries, and own points of what carries it, at most.
const MOST_POINTS: usize = 60;
const MOST_OF_CARRIERS: usize = 40;
/// Modes are reported from a core of so much from the lowest to the highest frequency; the band
/// reaches so much farther to either side.
const CORE: f64 = 1.35;
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
    /// Number of the view that shows it, and whether that is of a mode that was found before.
    pub view: usize,
    pub is_second_look: bool,
    /// Points that it turns about one place, as indices of the film's tracks.
    pub turned: Vec<usize>,
    /// That place, px.
    pub pivot_px: Point2<f64>,
    /// Root of the mean square of the turn, rad.
    pub angle: f64,
    /// Share of its motion that is this turn.
    pub share: f64,
    /// Points that were looked at.
    pub looked_at: Vec<usize>,
}

/// Points that modes are looked for in together.
#[derive(Clone, Debug)]
pub(super) struct View {
    /// Points of a branch and of all that it carries, as indices of the film's tracks.
    pub branch: Vec<usize>,
    /// Points of what carries it.
    pub carriers: Vec<usize>,
    /// Where the branch begins, px.
    pub base_px: Point2<f64>,
}

/// A view with its motions.
struct Window {
    number: usize,
    /// Of the film's tracks.
    tracks: Vec<usize>,
    at_px: Vec<Point2<f64>>,
    motions: Motions,
    /// A small turn of the branch about its base.
    own_turn: Vec<Vector2<f64>>,
}

/// One view of every captured branch.
pub(super) fn views_of_branches(
    tree: &BranchTree,
    film: &Film,
    members: &[Vec<usize>],
) -> Vec<View> {
    let mut out = Vec::with_capacity(members.len());
    for branch in (1..members.len() as u32).map(NodeId) {
        let mut carriers = Vec::new();
        for carrier in tree.carriers(branch) {
            let of_carrier = members.get(carrier.index()).into_iter().flatten();
            let own = of_carrier.filter(|k| film.tracks[**k].node == carrier);
            carriers.extend(own.copied());
        }
        carriers.sort_unstable();
        out.push(View {
            branch: members[branch.index()].clone(),
            carriers,
            base_px: tree.branches[branch.index()].base_px,
        });
    }
    out
}

/// One view of every mode: of the points that it turns, and of what carries them.
pub(super) fn views_of_modes(modes: &[FoundMode]) -> Vec<View> {
    let mut out = Vec::with_capacity(modes.len());
    for mode in modes {
        let mut carriers = BTreeSet::new();
        for other in modes.iter().filter(|other| other.carries(mode)) {
            carriers.extend(other.tracks.iter().copied());
        }
        for k in &mode.tracks {
            carriers.remove(k);
        }
        out.push(View {
            branch: mode.tracks.clone(),
            carriers: carriers.into_iter().collect(),
            base_px: mode.pivot_px,
        });
    }
    out
}

/// The modes of all views; each view's number is its place.
pub(super) fn local_modes(
    film: &Film,
    views: &[View],
    sampling: &Sampling,
    cancel: &CancelToken,
) -> Vec<LocalMode> {
    let mut out = Vec::new();
    for (number, view) in views.iter().enumerate() {
        if cancel.is_cancelled() {
            break;
        }
        if let Some(window) = Window::of(film, view, sampling, number) {
            out.extend(window.modes(sampling.frequencies_hz, cancel));
        }
    }
    out
}

impl Window {
    fn of(film: &Film, view: &View, sampling: &Sampling, number: usize) -> Option<Self> {
        let mut points = Points::up_to(MOST_POINTS, film, &view.branch, 0);
        let own = points.tracks.len();
        if own < MIN_POINTS {
            return None;
        }
        let carriers = Points::up_to(MOST_OF_CARRIERS, film, &view.carriers, 0);
        points.tracks.extend(carriers.tracks);
        points.signals.extend(carriers.signals);
        let frames = sampling.frames_with(&[&points]).ok()?;
        let motions = Motions::of(film, &points, &frames);
        let mut at_px = Vec::with_capacity(points.tracks.len());
        for &k in &points.tracks {
            at_px.push(mean_px(&film.tracks[k].at_px));
        }
        let mut own_turn = vec![Vector2::zeros(); at_px.len()];
        for (moved, at) in own_turn.iter_mut().zip(&at_px).take(own) {
            let arm = at - view.base_px;
            *moved = Vector2::new(-arm.y, arm.x);
        }
        Some(Self {
            number,
            tracks: points.tracks,
            at_px,
            motions,
            own_turn,
        })
    }

    fn modes(&self, within_hz: Bounds, cancel: &CancelToken) -> Vec<LocalMode> {
        let lowest_hz = within_hz.lo.max(LEAST_PERIODS / self.motions.span_s());
        let within_hz = Bounds::new(lowest_hz, within_hz.hi);
        let channels = self.motions.of_like_size();
        let poles = stable_poles(&channels, self.motions.step_s(), within_hz, &ONE_LAG_S);
        let spectrum = self.motions.spectrum(within_hz);
        let own_turn = self.motions.sizes_of(&self.own_turn);
        let mut out = Vec::new();
        for core in cores(&poles, within_hz) {
            let band_hz = Bounds::new(
                (core.lo / MARGIN).max(within_hz.lo),
                (core.hi * MARGIN).min(within_hz.hi),
            );
            let Some(band) = Band::of(&spectrum, band_hz) else {
                continue;
            };
            let mut starts = starts(&band, &poles, band_hz);
            if let Some(shape) = band.shape_of(&own_turn) {
                let others: Vec<_> = starts.iter().map(|s| s.shape).collect();
                let frequency_hz = band.peak_hz(&shape, &others);
                starts.push(Start {
                    frequency_hz,
                    shape,
                });
            }
            if starts.is_empty() || cancel.is_cancelled() {
                continue;
            }
            let fit = band.fit(&starts, cancel);
            for found in band.modes(&fit) {
                if core.contains(found.mode.frequency_hz) {
                    out.extend(self.local(&found));
                }
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
            view: self.number,
            is_second_look: false,
            turned: points.iter().map(|p| self.tracks[*p]).collect(),
            pivot_px,
            angle,
            share,
            looked_at: self.tracks.clone(),
        })
    }
}

/// Bands that modes are reported from: each begins at the lowest pole that is in none before.
fn cores(poles: &[StablePole], within_hz: Bounds) -> Vec<Bounds> {
    let mut out: Vec<Bounds> = Vec::new();
    for pole in poles {
        if out.last().is_none_or(|last| pole.frequency_hz > last.hi) {
            let lo = (0.97 * pole.frequency_hz).max(within_hz.lo);
            let lo = out.last().map_or(lo, |last| lo.max(last.hi));
            out.push(Bounds::new(lo, CORE * lo));
        }
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
