//! Sway of every branch in wind, from the trunk up.
//!
//! In wind nothing decays: a branch is an oscillator that chance keeps driving. Every motion that
//! its carrier's points show is taken off (any multiple of each, so that no lever arm need be
//! known), and the rest is the sum of its own oscillator, what is left of its ancestors', drift and
//! noise. The likelihood of that sum tells frequency and damping, at the real times (`gusts.rs`).
//! It is the branch's own if its points move with it as one swing.

use super::columns::{Qr, dot};
use super::common::{Common, along, enough, principal};
use super::decay::Mode;
use super::film::Film;
use super::free::{Demands, Z, interval};
use super::gusts::{Oscillator, Problem};
use super::members::{Points, mean_px};
use super::process::Times;
use super::swing::levers;
use crate::cancel::CancelToken;
use crate::model::{Excitation, NodeId, Skeleton, Sway, Swaying, Unidentified};
use std::cell::RefCell;

/// Points of a branch and of its carrier that are needed.
const LEAST_POINTS: usize = 2;
/// So many points that are on a branch and on none that it carries speak for it alone.
const ENOUGH_OWN: usize = 3;
/// Ancestors that are kept.
const ANCESTORS: usize = 2;
/// Motions of the carrier's points that are taken off at most. Each, and a second motion of the
/// branch, must have so many times the variance of noise, and the second such a share of the first.
const MOST_CARRIED: usize = 4;
const CLEAR: f64 = 10.0;
const SECOND: f64 = 0.02;
/// Frames a period of the highest frequency beyond which neighbours are taken together as their
/// mean: they cost time and tell little.
const FRAMES_PER_PERIOD: f64 = 3.0;
/// Longer films, in frames that are left, are thinned to so many a second, if there are as many;
/// and frequencies are looked for up to this share of the rate. A mean over neighbours hides what
/// is faster, and does not show it as something slower.
const LONG: usize = 900;
const LONG_HZ: f64 = 7.5;
const OF_RATE: f64 = 0.3;
const LEAST_FRAMES: usize = 48;
/// Motion that is taken for noise, px.
const NOISE_PX: f64 = 0.15;
/// Variance of the trunk's oscillator at least, as a share of the largest in the whole tree's
/// motion.
const LEAST_OF_TRUNK: f64 = 0.1;
/// A frequency that is nearer to an ancestor's than so many standard deviations is the ancestor's.
const APART: f64 = 2.0;
/// An oscillator is one swing if its points move alike in time, each by a lever of its own, to this
/// share of the squares ([`levers`]), and if such a share of them has it.
const SHARED: f64 = 0.75;
/// What drifts forgets itself so often in a film.
const DRIFTS: f64 = 4.0;
/// The curvature of the likelihood is that at its top, and gusts are no exact process: intervals
/// are so much wider. Found on made-up trees (tests/sway_trees.rs).
const WIDER: f64 = 1.1;
/// A mode whose interval is so many times wider than is asked for is no answer, but serves to tell
/// those of the branches on it.
const SERVES: f64 = 2.0;

/// What is asked of an answer, by the points that it comes from. Found on made-up trees
/// (tests/sway_trees.rs).
struct Asked {
    one_swing: f64,
    /// Standard deviations of the logarithms of frequency and damping below which none is believed,
    /// however long the film is: what the carrier's points show is not all that it does.
    least_sd: [f64; 2],
}

/// Where a branch and its carrier have points of their own.
const ALONE: Asked = Asked {
    one_swing: 0.85,
    least_sd: [0.008, 0.25],
};
/// Where those of the branches on them must serve: they sway by themselves besides.
const MIXED: Asked = Asked {
    one_swing: 0.87,
    least_sd: [0.015, 0.25],
};

/// A branch's own oscillator.
#[derive(Clone, Copy)]
struct Own {
    mode: Mode,
    sd: [f64; 2],
}

/// The sway of every measured node.
pub(super) fn sways(
    skeleton: &Skeleton,
    film: &Film,
    members: &[Vec<usize>],
    demands: &Demands,
    cancel: &CancelToken,
) -> Vec<Swaying> {
    let mut own: Vec<Option<Own>> = vec![None; members.len()];
    let mut out = vec![Err(Unidentified::NotMeasured); members.len()];
    let mut untold = vec![false; members.len()];
    for (i, tracks) in members.iter().enumerate().skip(1) {
        if tracks.is_empty() {
            continue;
        }
        if cancel.is_cancelled() {
            out[i] = Err(Unidentified::NotInTime);
            continue;
        }
        let node = NodeId(i as u32);
        let parent = skeleton.ancestors(node).next().unwrap_or(NodeId(0)).index();
        let ancestors: Vec<Own> = skeleton
            .ancestors(node)
            .filter_map(|a| own[a.index()])
            .take(ANCESTORS)
            .collect();
        let (speaking_of, alone) = speaking(film, i, tracks);
        let points = Points::of(film, &speaking_of, 0);
        if points.tracks.len() < LEAST_POINTS {
            continue;
        }
        let beside: Vec<usize> = match parent {
            0 => Vec::new(),
            _ => members[parent]
                .iter()
                .copied()
                .filter(|k| !tracks.contains(k))
                .collect(),
        };
        let (beside, carrier_alone) = speaking(film, parent, &beside);
        let carrier = Points::of(film, &beside, 0);
        let asked = if alone && (parent == 0 || carrier_alone) {
            ALONE
        } else {
            MIXED
        };
        // What a carrier's own sway is must be known, or be none, and its motion seen, for that of
        // the branch to be told from it.
        let told = own[parent].is_some()
            || out[parent] == Err(Unidentified::AncestorsSway) && !untold[parent];
        if parent > 0 && (!told || carrier.tracks.len() < LEAST_POINTS) {
            out[i] = Err(Unidentified::AncestorsSway);
            untold[i] = true;
            continue;
        }
        let base_px = skeleton.image_from_model(&skeleton.nodes[parent].position);
        out[i] = branch(
            film,
            &points,
            &carrier,
            &ancestors,
            base_px,
            (demands, &asked),
        )
        .and_then(|(found, sway)| {
            own[i] = Some(found);
            sway
        });
    }
    out
}

/// Those of a branch's points that are on none of the branches that it carries, if they are enough,
/// else all; and whether it is the former.
fn speaking(film: &Film, i: usize, tracks: &[usize]) -> (Vec<usize>, bool) {
    let own: Vec<usize> = tracks
        .iter()
        .copied()
        .filter(|&k| film.tracks[k].node.index() == i)
        .collect();
    if own.len() >= ENOUGH_OWN || own.len() == tracks.len() {
        (own, true)
    } else {
        (tracks.to_vec(), false)
    }
}

/// The oscillator that a branch has beyond its ancestors', for the branches on it, and its sway if
/// that can be told.
fn branch(
    film: &Film,
    points: &Points,
    carrier: &Points,
    ancestors: &[Own],
    base_px: [f64; 2],
    (demands, asked): (&Demands, &Asked),
) -> Result<(Own, Swaying), Unidentified> {
    let at_rate = |hz: f64| ((1.0 / film.step_s()) / hz).round().max(1.0) as usize;
    let fine = at_rate(FRAMES_PER_PERIOD * demands.highest_hz);
    let every = if film.times_s.len() / fine > LONG {
        at_rate(LONG_HZ).max(fine)
    } else {
        fine
    };
    let mut frames = film.neighbours(0..film.times_s.len(), every);
    frames.retain(|of| enough(points, of) && enough(carrier, of));
    if frames.len() < LEAST_FRAMES {
        return Err(Unidentified::TooShort);
    }
    let times_s: Vec<f64> = frames.iter().map(|of| film.mean_s(of)).collect();
    let (common, carried) = (Common::of(points, &frames), Common::of(carrier, &frames));
    let of_carrier = principal(&carried.signals);
    let clear = of_carrier
        .ways
        .iter()
        .zip(&of_carrier.variances)
        .filter(|(_, v)| **v > CLEAR * carried.noise);
    let mut known = vec![vec![1.0; frames.len()]];
    known.extend(
        clear
            .take(MOST_CARRIED)
            .map(|(way, _)| along(&carried.signals, way)),
    );
    let qr = Qr::new(known.clone());
    let rest: Vec<Vec<f64>> = common.signals.iter().map(|s| qr.solve(s).0).collect();
    let of_rest = principal(&rest);
    let values = (points.tracks.len() * frames.len()) as f64;
    let rms_px =
        |signals: &[Vec<f64>]| (signals.iter().map(|s| dot(s, s)).sum::<f64>() / values).sqrt();
    if rms_px(&common.signals) < NOISE_PX {
        return Err(Unidentified::TooLittleMotion);
    }
    if rms_px(&rest) < NOISE_PX {
        return Err(Unidentified::AncestorsSway);
    }
    let second = (SECOND * of_rest.variances[0]).max(CLEAR * common.noise);
    let motions = if of_rest.variances.get(1).is_some_and(|v| *v > second) {
        2
    } else {
        1
    };
    let motions = &of_rest.ways[..motions];
    let [lowest_hz, highest_hz] = demands.frequencies_hz;
    let frequencies_hz = match every {
        1 => demands.frequencies_hz,
        _ => [
            lowest_hz,
            highest_hz.min(OF_RATE / (every as f64 * film.step_s())),
        ],
    };
    let left: Vec<Vec<f64>> = motions.iter().map(|way| along(&rest, way)).collect();
    let problem = Problem {
        times: Times::new(times_s),
        motions: motions
            .iter()
            .map(|way| along(&common.signals, way))
            .collect(),
        known,
        ancestors: ancestors.iter().map(|a| a.mode).collect(),
        drift_per_s: DRIFTS / film.span_s(),
        had: RefCell::default(),
    };
    let fitted = problem.fit(&left, common.noise, frequencies_hz);
    let found = fitted.oscillators();
    if found.is_empty() {
        return Err(if ancestors.is_empty() {
            Unidentified::NoOscillation
        } else {
            Unidentified::AncestorsSway
        });
    }
    let wider = |sd: [f64; 2]| [0, 1].map(|i| (WIDER * sd[i]).hypot(asked.least_sd[i]));
    let same = |o: &Oscillator, a: &Own| {
        (a.mode.frequency_hz / o.mode.frequency_hz).ln().abs()
            < APART * a.sd[0].hypot(wider(o.sd)[0])
    };
    let of_ancestor = |o: &Oscillator| ancestors.iter().any(|a| same(o, a));
    let Some(k) = order(&found, ancestors.is_empty())
        .into_iter()
        .find(|&k| !found[k].at_limit && !of_ancestor(&found[k]))
    else {
        let of_ancestors = found.iter().any(|o| !o.at_limit && of_ancestor(o));
        return Err(if of_ancestors {
            Unidentified::AncestorsSway
        } else {
            Unidentified::NoOscillation
        });
    };
    let (mode, sd) = (found[k].mode, wider(found[k].sd));
    if !(found[k].sd[0] > 0.0 && Z * sd[0] <= SERVES * demands.widest) {
        return Err(Unidentified::TooUncertain);
    }
    let filter = fitted
        .filter(k, common.noise)
        .ok_or(Unidentified::TooUncertain)?;
    let (one_swing, shared) = levers(&rest.iter().map(|s| filter.of(s)).collect::<Vec<_>>());
    if one_swing < asked.one_swing || shared < SHARED {
        return Err(Unidentified::NoOscillation);
    }
    // Gusts are not known well enough for a likelihood to tell a frequency from its mirror image at
    // such a rate.
    if 1.0 / film.step_s() - mode.frequency_hz <= demands.highest_hz {
        return Err(Unidentified::AboveSampling);
    }
    let arm = |k: &usize| {
        let at = mean_px(&film.tracks[*k].at_px);
        (at[0] - base_px[0]).powi(2) + (at[1] - base_px[1]).powi(2)
    };
    let arms: f64 = points.tracks.iter().map(arm).sum();
    let sway = Sway {
        frequency_hz: interval(mode.frequency_hz, sd[0]),
        damping_ratio: (found[k].sd[1] > 0.0 && Z * sd[1] <= 1.0)
            .then(|| interval(mode.damping, sd[1])),
        excitation: Excitation::Wind,
        amplitude_deg: (2.0 * found[k].variance)
            .sqrt()
            .atan2(arms.sqrt())
            .to_degrees(),
    };
    let sure = Z * sd[0] <= demands.widest;
    Ok((
        Own { mode, sd },
        if sure {
            Ok(sway)
        } else {
            Err(Unidentified::TooUncertain)
        },
    ))
}

/// The largest first. Of the trunk the slowest of the larger ones: it carries all, and all else
/// sways faster than the whole tree.
fn order(found: &[Oscillator], trunk: bool) -> Vec<usize> {
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|a, b| found[*b].variance.total_cmp(&found[*a].variance));
    if trunk {
        let strong = LEAST_OF_TRUNK * found[order[0]].variance;
        order.retain(|&k| found[k].variance >= strong);
        order.sort_by(|a, b| {
            found[*a]
                .mode
                .frequency_hz
                .total_cmp(&found[*b].mode.frequency_hz)
        });
    }
    order
}
