//! Sway of every branch in wind, from the trunk up.
//!
//! In wind nothing decays: a branch is an oscillator that chance keeps driving. What its carrier's points show is taken
//! off (any multiple of it, so that no lever arm need be known), and the rest is the sum of its own oscillator, what is
//! left of its ancestors', drift and noise. The likelihood of that sum tells frequency and damping, at the real times.

use super::columns::{Qr, dot};
use super::common::Common;
use super::decay::{Mode, Start};
use super::film::Film;
use super::free::{Demands, Z, interval};
use super::members::Points;
use super::minimum::{curvature, minimum};
use super::process::{Part, minus_2_log_likelihood};
use super::signals::{Fit, Signals};
use crate::model::{Excitation, NodeId, Skeleton, Sway, Swaying, Unidentified};

/// Points of a branch and of its carrier that are needed.
const LEAST_POINTS: usize = 2;
/// Oscillators that are looked for beyond the ancestors', and ancestors that are kept.
const MOST_NEW: usize = 3;
const ANCESTORS: usize = 2;
/// Frames a period of the highest frequency beyond which neighbours are taken together as their mean: they cost time and tell
/// little.
const FRAMES_PER_PERIOD: f64 = 3.0;
/// Longer films, in frames that are left, are thinned to so many a second, if there are as many; and frequencies are looked for
/// up to this share of the rate. A mean over neighbours hides what is faster, and does not show it as something slower.
const LONG: usize = 900;
const LONG_HZ: f64 = 7.5;
const OF_RATE: f64 = 0.3;
const LEAST_FRAMES: usize = 48;
/// Motion that is taken for noise, px.
const NOISE_PX: f64 = 0.15;
/// Variance of the trunk's oscillator at least, as a share of the largest in the whole tree's motion.
const LEAST_OF_TRUNK: f64 = 0.1;
/// A frequency that is nearer to an ancestor's than so many standard deviations is the ancestor's.
const APART: f64 = 2.0;
/// How often the gusts of a wind forget themselves, 1/s, at the least and at the most, which is white noise to a tree; and how
/// often what drifts does in a film.
const GUSTS_PER_S: [f64; 2] = [0.1, 60.0];
const DRIFTS: f64 = 4.0;
const DAMPING: [f64; 2] = [0.003, 0.4];
/// The curvature of the likelihood is that at its top, and gusts are no exact process: intervals are so much wider. Found on
/// made-up trees (tests/sway_trees.rs).
const WIDER: f64 = 1.1;
/// And they do not shrink below these standard deviations of the logarithms of frequency and damping, however long the film is: the
/// carrier's motion is taken off as a multiple of what its points show, which is not all of it. Found likewise.
const LEAST_SD: [f64; 2] = [0.012, 0.25];
/// Trees are damped by some hundredths of the critical: a weak prior for films that are too short to tell, as the standard
/// deviation of a logarithm.
const USUAL_DAMPING: f64 = 0.05;
const DAMPING_SD: f64 = 0.7;

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
    go_on: &dyn Fn() -> bool,
) -> Vec<Swaying> {
    let mut own: Vec<Option<Own>> = vec![None; members.len()];
    let mut out = vec![Err(Unidentified::NotMeasured); members.len()];
    let mut untold = vec![false; members.len()];
    for (i, tracks) in members.iter().enumerate().skip(1) {
        if tracks.is_empty() {
            continue;
        }
        if !go_on() {
            out[i] = Err(Unidentified::NotInTime);
            continue;
        }
        let node = NodeId(i as u32);
        let parent = skeleton.ancestors(node).next().unwrap_or(NodeId(0));
        let ancestors: Vec<Own> = skeleton.ancestors(node).filter_map(|a| own[a.index()]).take(ANCESTORS).collect();
        let points = Points::of(film, tracks, 0);
        if points.tracks.len() < LEAST_POINTS {
            continue;
        }
        let carrier: Vec<usize> = members[parent.index()].iter().copied().filter(|k| !tracks.contains(k)).collect();
        let carrier = Points::of(film, if parent.index() == 0 { &[] } else { &carrier }, 0);
        let base_px = skeleton.image_from_model(&skeleton.nodes[parent.index()].position);
        // What a carrier's own sway is must be known, or be none, for that of the branch to be told from it.
        let told = |s: &Swaying| matches!(s, Ok(_) | Err(Unidentified::AncestorsSway));
        if parent.index() > 0 && (untold[parent.index()] || !told(&out[parent.index()])) {
            out[i] = Err(Unidentified::AncestorsSway);
            untold[i] = true;
            continue;
        }
        out[i] = branch(film, &points, &carrier, &ancestors, base_px, demands).map(|(found, sway)| {
            own[i] = Some(found);
            sway
        });
    }
    out
}

/// What is fitted for one branch.
struct Problem {
    times_s: Vec<f64>,
    values: Vec<f64>,
    known: Vec<Vec<f64>>,
    ancestors: Vec<Mode>,
    drift_per_s: f64,
}

impl Problem {
    /// Logarithms of noise, of the drift's variance, of the rate of the gusts, of the ancestors' variances; then variance,
    /// frequency and damping of each new oscillator.
    fn cost(&self, x: &[f64]) -> f64 {
        let (of_ancestors, of_new) = x[3..].split_at(self.ancestors.len());
        let drift = Part::Drift { variance: x[1].exp(), rate_per_s: self.drift_per_s };
        let oscillator = |variance: f64, frequency_hz: f64, damping: f64| Part::Oscillator {
            variance,
            frequency_hz,
            damping,
            gusts_per_s: x[2].exp(),
        };
        let old = self.ancestors.iter().zip(of_ancestors).map(|(m, v)| oscillator(v.exp(), m.frequency_hz, m.damping));
        let new = of_new.chunks(3).map(|p| oscillator(p[0].exp(), p[1].exp(), p[2].exp()));
        let parts: Vec<Part> = std::iter::once(drift).chain(old).chain(new).collect();
        let prior: f64 = of_new.chunks(3).map(|p| ((p[2] - USUAL_DAMPING.ln()) / DAMPING_SD).powi(2)).sum();
        minus_2_log_likelihood(&self.times_s, &self.values, &self.known, &parts, x[0].exp()) + prior
    }
}

fn branch(
    film: &Film,
    points: &Points,
    carrier: &Points,
    ancestors: &[Own],
    base_px: [f64; 2],
    demands: &Demands,
) -> Result<(Own, Sway), Unidentified> {
    let common = Common::of(film, points).ok_or(Unidentified::NotMeasured)?;
    let carried = (carrier.tracks.len() >= LEAST_POINTS).then(|| Common::of(film, carrier)).flatten();
    let of_carrier: Vec<&Vec<f64>> = carried.iter().flat_map(Common::signals).collect();
    let rows: Vec<usize> = (0..film.times_s.len())
        .filter(|&k| common.shift_px.iter().chain(of_carrier.iter().copied()).all(|s| s[k].is_finite()))
        .collect();
    let at_rate = |hz: f64| ((1.0 / film.step_s()) / hz).round().max(1.0) as usize;
    let fine = at_rate(FRAMES_PER_PERIOD * demands.highest_hz);
    let every = if rows.len() / fine > LONG { at_rate(LONG_HZ).max(fine) } else { fine };
    let rows = neighbours(&rows, &film.times_s, every, film.step_s());
    if rows.len() < LEAST_FRAMES {
        return Err(Unidentified::TooShort);
    }
    let mean = |s: &Vec<f64>, of: &Vec<usize>| of.iter().map(|&k| s[k]).sum::<f64>() / of.len() as f64;
    let pick = |s: &Vec<f64>| rows.iter().map(|of| mean(s, of)).collect::<Vec<f64>>();
    let times_s = pick(&film.times_s);
    let known: Vec<Vec<f64>> = std::iter::once(vec![1.0; rows.len()]).chain(of_carrier.into_iter().map(pick)).collect();
    let shifts = [pick(&common.shift_px[0]), pick(&common.shift_px[1])];
    let qr = Qr::new(known.clone());
    let rest: Vec<Vec<f64>> = shifts.iter().map(|s| qr.solve(s).0).collect();
    let (cos, sin) = principal(&rest);
    let along = |s: &[Vec<f64>]| s[0].iter().zip(&s[1]).map(|(u, v)| cos * u + sin * v).collect::<Vec<f64>>();
    let (values, rest) = (along(&shifts), along(&rest));
    let variance = dot(&rest, &rest) / rest.len() as f64;
    let before = dot(&values, &values) / values.len() as f64;
    if before.sqrt() < NOISE_PX {
        return Err(Unidentified::TooLittleMotion);
    }
    if variance.sqrt() < NOISE_PX {
        return Err(Unidentified::AncestorsSway);
    }
    let [lowest_hz, highest_hz] = demands.frequencies_hz;
    let frequencies_hz = match every {
        1 => demands.frequencies_hz,
        _ => [lowest_hz, highest_hz.min(OF_RATE / (every as f64 * film.step_s()))],
    };
    let problem = Problem {
        times_s: times_s.clone(),
        values,
        known,
        ancestors: ancestors.iter().map(|a| a.mode).collect(),
        drift_per_s: DRIFTS / film.span_s(),
    };
    let signals = Signals::new(times_s, &[rest], Start::Moving, 1.0, frequencies_hz);
    let (x, bounds) = best(&problem, &signals, variance, frequencies_hz);
    let first_new = 3 + ancestors.len();
    if x.len() == first_new {
        return Err(if ancestors.is_empty() { Unidentified::NoOscillation } else { Unidentified::AncestorsSway });
    }
    let cost = |x: &[f64]| problem.cost(x);
    let covariance = (0.5 * curvature(cost, &x)).try_inverse();
    let at_bound = |k: usize| (x[k] - bounds[k][0]).abs() < 1e-6 || (x[k] - bounds[k][1]).abs() < 1e-6;
    // The largest of those that are no ancestor's.
    let mut last = Unidentified::NoOscillation;
    let mut order: Vec<usize> = (first_new..x.len()).step_by(3).collect();
    order.sort_by(|a, b| x[*b].total_cmp(&x[*a]));
    if ancestors.is_empty() {
        // The trunk carries all, and all else sways faster than the whole tree.
        let strong = x[order[0]] + LEAST_OF_TRUNK.ln();
        order.retain(|&k| x[k] >= strong);
        order.sort_by(|a, b| x[a + 1].total_cmp(&x[b + 1]));
    }
    for k in order {
        let sd = |i: usize| covariance.as_ref().map_or(f64::INFINITY, |c| c[(i, i)]).max(0.0).sqrt() * WIDER;
        let (mode, sd) = (
            Mode { frequency_hz: x[k + 1].exp(), damping: x[k + 2].exp() },
            [sd(k + 1).hypot(LEAST_SD[0]), sd(k + 2).hypot(LEAST_SD[1])],
        );
        let same = |a: &Own| (a.mode.frequency_hz / mode.frequency_hz).ln().abs() < APART * a.sd[0].hypot(sd[0]);
        if at_bound(k + 1) || at_bound(k + 2) {
            continue;
        }
        if ancestors.iter().any(same) {
            last = Unidentified::AncestorsSway;
            continue;
        }
        if !(sd[0] > LEAST_SD[0] && Z * sd[0] <= demands.widest) {
            return Err(Unidentified::TooUncertain);
        }
        // Gusts are not known well enough for a likelihood to tell a frequency from its mirror image at such a rate.
        if 1.0 / film.step_s() - mode.frequency_hz <= demands.highest_hz {
            return Err(Unidentified::AboveSampling);
        }
        let arm = (common.middle_px[0] - base_px[0]).hypot(common.middle_px[1] - base_px[1]);
        let sway = Sway {
            frequency_hz: interval(mode.frequency_hz, sd[0]),
            damping_ratio: (sd[1] > LEAST_SD[1] && Z * sd[1] <= 1.0).then(|| interval(mode.damping, sd[1])),
            excitation: Excitation::Wind,
            amplitude_deg: (2.0 * x[k].exp()).sqrt().atan2(arm).to_degrees(),
        };
        return Ok((Own { mode, sd }, sway));
    }
    Err(last)
}

/// The parameters with as many new oscillators as the data carry (Schwarz 1978), and their bounds.
fn best(problem: &Problem, signals: &Signals, variance: f64, frequencies_hz: [f64; 2]) -> (Vec<f64>, Vec<[f64; 2]>) {
    let level = variance.ln();
    let of_variance = [level - 16.0, level + 4.0];
    let mut bounds = vec![[level - 16.0, level + 1.0], of_variance, GUSTS_PER_S.map(f64::ln)];
    let mut x = vec![level - 4.0, level - 2.0, 0.0];
    bounds.extend(problem.ancestors.iter().map(|_| of_variance));
    x.extend(problem.ancestors.iter().map(|_| level - 2.0));
    let cost = |x: &[f64]| problem.cost(x);
    let (mut found, mut value) = minimum(cost, &x, &bounds);
    let mut found_bounds = bounds.clone();
    let penalty = (problem.times_s.len() as f64).ln();
    let mut fit = Fit { modes: problem.ancestors.clone(), ..Fit::default() };
    let mut x = found.clone();
    for _ in 0..MOST_NEW {
        let Some(new) = signals.search(&fit) else { break };
        fit.modes.push(new);
        x.extend([level - 1.0, new.frequency_hz.ln(), 0.05_f64.ln()]);
        bounds.extend([of_variance, frequencies_hz.map(f64::ln), DAMPING.map(f64::ln)]);
        let there = minimum(cost, &x, &bounds);
        x = there.0;
        if there.1 + 3.0 * penalty >= value {
            break;
        }
        (found, value, found_bounds) = (x.clone(), there.1, bounds.clone());
    }
    (found, found_bounds)
}

/// Frames by `every` neighbours; those between which frames are missing are not put together.
fn neighbours(rows: &[usize], times_s: &[f64], every: usize, step_s: f64) -> Vec<Vec<usize>> {
    let mut out: Vec<Vec<usize>> = Vec::with_capacity(rows.len() / every + 1);
    for &k in rows {
        match out.last_mut() {
            Some(last) if last.len() < every && times_s[k] - times_s[last[0]] < (every as f64 - 0.5) * step_s => {
                last.push(k)
            }
            _ => out.push(vec![k]),
        }
    }
    out
}

/// Cosine and sine of the direction in which two signals together vary most.
fn principal(s: &[Vec<f64>]) -> (f64, f64) {
    let (xx, xy, yy) = (dot(&s[0], &s[0]), dot(&s[0], &s[1]), dot(&s[1], &s[1]));
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    (cos, sin)
}
