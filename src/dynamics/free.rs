//! Sway of every branch after a release, from the trunk up.
//!
//! The picture shows a branch moving with everything that carries it, so its points share the modes
//! of all its ancestors and have its own besides. The ancestors' modes are known when its turn
//! comes; what is new is its own if all of its points have it, and else that of a branch above it.

use super::decay::Mode;
use super::film::Film;
use super::fit::Prior;
use super::members::{Points, mean_px};
use super::release::{MOMENT_SD, Onset};
use super::signals::{Factor, Fit, Signals};
use super::spread::deviations;
use super::swing::Arms;
use crate::cancel::CancelToken;
use crate::model::{Excitation, Interval, NodeId, Skeleton, Sway, Swaying, Unidentified};
use crate::signal::along_principal_direction;

/// Modes that are looked for beyond those of the ancestors.
const MOST_MODES: usize = 5;
/// A further mode must leave at most this share of the squares.
const WORTH: f64 = 0.93;
/// And take off so many times what one takes off noise by chance.
const BY_CHANCE: f64 = 4.0;
/// Two modes that almost cancel each other have factors so many times larger than the signals: they
/// are one.
const CANCELS: f64 = 3.0;
/// A branch's own mode is in this share of its points, each with a factor of so many standard
/// deviations, and in the quarter that has least of it with this share of the mean.
const SHARED: f64 = 0.75;
const SIGNIFICANT: f64 = 4.0;
const LEAST_SHARE: f64 = 0.3;
/// Parts of a branch that hold such a share of its points must have its mode, in so many of their
/// points.
const PART: [f64; 2] = [0.15, 0.85];
const IN_PART: f64 = 0.75;
/// Its parts, or halves, of so many points must give the same frequency: within this share, and so
/// many standard deviations.
const LEAST_IN_PART: usize = 3;
const ALIKE: f64 = 0.003;
const FAR: f64 = 4.0;
/// And they are moved as by one swing ([`Arms::one_swing`]), which points of several branches that
/// are alike in frequency are not. Found on clips of our own (docs/dynamics.md).
const ONE_SWING: f64 = 0.95;
/// Frequencies that are no farther apart than this share are one.
const ONE: f64 = 0.01;
/// Points that a branch must have: two or three agree by chance.
const LEAST_POINTS: usize = 4;
/// Periods that must have been seen: of fewer, branches that lie close together in frequency look
/// like one.
pub(super) const LEAST_PERIODS: f64 = 3.0;
/// Damping above which an oscillation is none that could be seen.
const HARDLY: f64 = 0.2;
/// Motion that is taken for noise, px.
const NOISE_PX: f64 = 0.2;
/// What the ancestors may leave of the motion of a branch that has none of its own.
const LEFT: f64 = 0.2;
/// Points of one branch err together more than the spread of their fit shows: intervals are so much
/// wider. Found on made-up trees (tests/sway_trees.rs).
const WIDER: f64 = 1.25;
/// And the frequency's does not shrink below this standard deviation of its logarithm, however
/// clear the decay is: most branches as they are found have some points of their neighbours. Found
/// likewise.
const LEAST_SD: f64 = 0.0015;
/// Half an interval, in standard deviations.
pub(super) const Z: f64 = Interval::Z;

/// What is asked of the estimates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Demands {
    /// Frequencies that are looked for, Hz.
    pub frequencies_hz: [f64; 2],
    /// Highest frequency that a tree may have, Hz.
    pub highest_hz: f64,
    /// Half a 95 % interval of the frequency at most, as a share of it.
    pub widest: f64,
}

/// A branch's own mode, with the standard deviations of the logarithms of its frequency and
/// damping.
#[derive(Clone, Copy, Debug)]
struct Own {
    mode: Mode,
    sd: [f64; 2],
}

/// The sway of every measured node.
pub(super) fn sways(
    skeleton: &Skeleton,
    film: &Film,
    members: &[Vec<usize>],
    onset: &Onset,
    demands: &Demands,
    cancel: &CancelToken,
) -> Vec<Swaying> {
    let mut own: Vec<Option<Own>> = vec![None; members.len()];
    // Modes of branches that may not be theirs alone: perhaps that of a branch on them.
    let mut mixed: Vec<Option<Mode>> = vec![None; members.len()];
    let mut out = vec![Err(Unidentified::NotMeasured); members.len()];
    let all = members;
    // The release, and how sure that is, s: the trunk's own fit knows it better than the eye.
    let mut moment = [onset.at_s, MOMENT_SD * film.step_s()];
    // Whether the trunk's sway, which all points have, could be told.
    let mut told = false;
    for (i, members) in members.iter().enumerate().skip(1) {
        if members.is_empty() {
            continue;
        }
        if cancel.is_cancelled() {
            out[i] = Err(Unidentified::NotInTime);
            continue;
        }
        let node = NodeId(i as u32);
        let parent = skeleton.ancestors(node).next();
        let ancestors: Vec<Own> = skeleton
            .ancestors(node)
            .filter_map(|a| own[a.index()])
            .collect();
        let doubted: Vec<Mode> = skeleton
            .ancestors(node)
            .filter_map(|a| mixed[a.index()])
            .collect();
        let points = Points::of(film, members, onset.from);
        if points.tracks.len() < LEAST_POINTS {
            continue;
        }
        let base_px = skeleton
            .image_from_model(&skeleton.nodes[parent.unwrap_or(NodeId(0)).index()].position);
        let parts = parts(members, &points.tracks, i, all);
        let found = branch(
            film,
            &points,
            (&ancestors, &doubted),
            &parts,
            base_px,
            (onset, &mut moment),
            demands,
        );
        // All points have the trunk's sway: where it is not known, a branch would be given it.
        let found = if i == 1 || told {
            found
        } else {
            found.and(Err(Unidentified::AncestorsSway))
        };
        told |= i == 1 && found.is_ok();
        out[i] = found.and_then(|(found, sway)| {
            match sway {
                Ok(_) => own[i] = Some(found),
                Err(_) => mixed[i] = Some(found.mode),
            }
            sway
        });
    }
    out
}

/// The mode that the branch has beyond its ancestors', for the branches on it, and its sway if that
/// can be told. Another one is taken rather than one that is `doubted`, which may be of a branch
/// below.
fn branch(
    film: &Film,
    points: &Points,
    (ancestors, doubted): (&[Own], &[Mode]),
    parts: &[Vec<usize>],
    base_px: [f64; 2],
    (onset, moment): (&Onset, &mut [f64; 2]),
    demands: &Demands,
) -> Result<(Own, Swaying), Unidentified> {
    let all_px = points.rms_px();
    if all_px < NOISE_PX {
        return Err(Unidentified::TooLittleMotion);
    }
    let times: Vec<f64> = film.times_s[onset.from..]
        .iter()
        .map(|t| t - moment[0])
        .collect();
    let span_s = times.last().copied().unwrap_or(0.0) - times.first().copied().unwrap_or(0.0);
    let signals = Signals::new(
        times,
        &points.signals,
        onset.start,
        moment[1],
        demands.frequencies_hz,
    );
    let old = ancestors.len();
    let mut priors: Vec<Prior> = ancestors.iter().map(|a| Some((a.mode, a.sd))).collect();
    let mut fit = Fit {
        modes: ancestors.iter().map(|a| a.mode).collect(),
        ..Fit::default()
    };
    fit.rss = signals.rss(&fit);
    let carried = fit.rss;
    let noise = points.noise().min(0.9 * carried);
    let free_factors = signals.factors_per_mode() as f64;
    let largest = largest(&points.signals);
    // One more than is taken shows how much the answer hangs on how many there are.
    let mut beyond: Vec<Mode> = Vec::new();
    for _ in 0..MOST_MODES {
        let Some(new) = signals.search(&fit) else {
            break;
        };
        let mut more = fit.clone();
        more.modes.push(new);
        priors.push(None);
        let more = signals.fit(&more, &priors);
        let factors = signals.factors(&more, points.signals.len());
        let cancels = (old..more.modes.len())
            .any(|m| rms(factors.iter().map(|f| f[m].size())) > CANCELS * largest);
        let by_chance = BY_CHANCE * free_factors * more.rss / signals.values as f64;
        let worth = more.rss - noise < WORTH * (fit.rss - noise) && fit.rss - more.rss > by_chance;
        if cancels || !worth {
            if !cancels {
                beyond = more.modes;
            }
            priors.pop();
            break;
        }
        fit = more;
    }
    let factors = signals.factors(&fit, points.signals.len());
    let arms = Arms::new(film, points, onset.from, base_px);
    let doubted = |mode: &Mode| {
        doubted
            .iter()
            .any(|d| (d.frequency_hz / mode.frequency_hz).ln().abs() < ONE)
    };
    let chosen = (old..fit.modes.len())
        .filter(|&m| {
            fit.modes[m].damping < HARDLY && fit.modes[m].frequency_hz * span_s >= LEAST_PERIODS
        })
        .filter(|&m| !signals.at_limit(&fit.modes[m]))
        .filter_map(|m| Some((m, shared(&factors, m)?)))
        .filter(|(m, _)| parts.iter().all(|part| everywhere(&factors, *m, part)))
        // The trunk carries every point: there is nothing it could be mixed up with.
        .map(|(m, has)| {
            (
                m,
                has,
                [
                    old == 0 || arms.one_swing(&factors, m) >= ONE_SWING,
                    !doubted(&fit.modes[m]),
                ],
            )
        })
        .max_by(|a, b| {
            a.2.cmp(&b.2)
                .then(a.1.0.total_cmp(&b.1.0))
                .then(a.1.1.total_cmp(&b.1.1))
        });
    let Some((m, _, [one_swing, _])) = chosen else {
        let all = all_px * all_px * signals.values as f64;
        let still = old > 0 && carried - noise < LEFT * (all - noise);
        return Err(if still {
            Unidentified::AncestorsSway
        } else {
            Unidentified::NoOscillation
        });
    };
    // Films of few frames a second show a fast sway as a slow one.
    if 1.0 / film.step_s() - fit.modes[m].frequency_hz <= demands.highest_hz {
        return Err(Unidentified::AboveSampling);
    }
    let spread = deviations(&signals, &fit, &priors).ok_or(Unidentified::TooUncertain)?;
    let mode = fit.modes[m];
    let mut sd = [spread[2 * m], spread[2 * m + 1]];
    let near = |b: &&Mode| (b.frequency_hz / mode.frequency_hz).ln().abs();
    if let Some(other) = beyond.iter().min_by(|a, b| near(a).total_cmp(&near(b))) {
        sd[0] = sd[0].hypot((other.frequency_hz / mode.frequency_hz).ln());
        sd[1] = sd[1].hypot((other.damping / mode.damping).ln());
    }
    let known: Vec<Prior> = (0..fit.modes.len())
        .map(|k| (k != m).then(|| (fit.modes[k], [spread[2 * k], spread[2 * k + 1]])))
        .collect();
    let halves = if parts.is_empty() {
        halves(film, points, onset.from)
    } else {
        Vec::new()
    };
    let mut apart = [0.0; 2];
    let mut count = 0.0;
    for part in parts
        .iter()
        .chain(&halves)
        .filter(|p| p.len() >= LEAST_IN_PART)
    {
        let own: Vec<Vec<f64>> = part
            .iter()
            .flat_map(|&k| points.signals[2 * k..2 * k + 2].iter().cloned())
            .collect();
        let signals = Signals::new(
            signals.times_s.clone(),
            &own,
            onset.start,
            moment[1],
            demands.frequencies_hz,
        );
        let there = signals.fit(&fit, &known);
        let Some(spread) = deviations(&signals, &there, &known) else {
            continue;
        };
        let off = (there.modes[m].frequency_hz / mode.frequency_hz).ln();
        if off.abs() > ALIKE + FAR * spread[2 * m].hypot(sd[0]) {
            return Err(Unidentified::NoOscillation);
        }
        count += 1.0;
        apart[0] += off * off;
        apart[1] += (there.modes[m].damping / mode.damping).ln().powi(2);
    }
    if count > 1.0 {
        (0..2).for_each(|i| sd[i] = sd[i].hypot((apart[i] / (count * (count - 1.0_f64))).sqrt()));
    }
    if let Some(found) = spread.get(2 * fit.modes.len()).filter(|_| old == 0) {
        *moment = [moment[0] + fit.moment_s, found.min(moment[1])];
    }
    let sd = [(WIDER * sd[0]).hypot(LEAST_SD), WIDER * sd[1]];
    let own = Own { mode, sd };
    let frequency_hz = interval(mode.frequency_hz, sd[0]);
    if !(sd[0] > 0.0 && Z * sd[0] <= demands.widest) {
        return Err(Unidentified::TooUncertain);
    }
    let damping_ratio = (sd[1] > 0.0 && Z * sd[1] <= 1.0).then(|| interval(mode.damping, sd[1]));
    let amplitude_deg = arms.amplitude_deg(&factors, m);
    let sway = Sway {
        frequency_hz,
        damping_ratio,
        excitation: Excitation::Release,
        amplitude_deg,
    };
    Ok((
        own,
        if one_swing {
            Ok(sway)
        } else {
            Err(Unidentified::NoOscillation)
        },
    ))
}

pub(super) fn interval(value: f64, sd: f64) -> Interval {
    Interval {
        value,
        lo: value * (-Z * sd).exp(),
        hi: value * (Z * sd).exp(),
    }
}

fn rms(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count().max(1) as f64;
    (values.map(|x| x * x).sum::<f64>() / n).sqrt()
}

/// Root mean square of the signals' largest values.
fn largest(signals: &[Vec<f64>]) -> f64 {
    rms(signals.iter().map(|s| {
        s.iter()
            .filter(|x| x.is_finite())
            .fold(0.0_f64, |m, x| m.max(x.abs()))
    }))
}

/// If mode `m` is common to the points: the share that has it, and the significance that most
/// reach.
fn shared(factors: &[Vec<Factor>], m: usize) -> Option<(f64, f64)> {
    let points: Vec<(f64, f64)> = factors
        .chunks(2)
        .map(|uv| {
            (
                uv.iter().map(|f| f[m].significance).sum::<f64>().sqrt(),
                rms(uv.iter().map(|f| f[m].size())),
            )
        })
        .collect();
    let n = points.len();
    let share = points.iter().filter(|p| p.0 > SIGNIFICANT).count() as f64 / n as f64;
    let quantile = |mut all: Vec<f64>, q: f64| {
        all.sort_unstable_by(f64::total_cmp);
        all[(q * (n - 1) as f64) as usize]
    };
    let sizes: Vec<f64> = points.iter().map(|p| p.1).collect();
    let whole = rms(sizes.iter().copied());
    let common = share >= SHARED && quantile(sizes, 0.25) >= LEAST_SHARE * whole;
    common.then(|| (share, quantile(points.iter().map(|p| p.0).collect(), 0.3)))
}

/// The points of `tracks`, by their place there, that lie on each larger part of branch `i`.
fn parts(members: &[usize], tracks: &[usize], i: usize, all: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let size = members.len() as f64;
    let is_part =
        |m: &&Vec<usize>| (m.len() as f64) >= PART[0] * size && (m.len() as f64) <= PART[1] * size;
    let places = |m: &Vec<usize>| {
        (0..tracks.len())
            .filter(|&k| m.binary_search(&tracks[k]).is_ok())
            .collect()
    };
    // A node that comes later and shares points is above this one.
    let above = all[i + 1..]
        .iter()
        .filter(|m| m.first().is_some_and(|k| members.binary_search(k).is_ok()));
    above.filter(is_part).map(places).collect()
}

/// The two halves of the points by their place along the direction in which they are spread most.
fn halves(film: &Film, points: &Points, from: usize) -> Vec<Vec<usize>> {
    let at: Vec<[f64; 2]> = points
        .tracks
        .iter()
        .map(|&k| mean_px(&film.tracks[k].at_px[from..]))
        .collect();
    let along = along_principal_direction(&at);
    let mut order: Vec<usize> = (0..at.len()).collect();
    order.sort_by(|a, b| along[*a].total_cmp(&along[*b]));
    let second = order.split_off(order.len() / 2);
    vec![order, second]
}

/// Whether mode `m` is in most points of a part.
fn everywhere(factors: &[Vec<Factor>], m: usize, part: &[usize]) -> bool {
    let has = |k: &&usize| {
        factors[2 * **k][m].significance + factors[2 * **k + 1][m].significance
            > SIGNIFICANT.powi(2)
    };
    part.iter().filter(has).count() as f64 >= IN_PART * part.len() as f64
}
