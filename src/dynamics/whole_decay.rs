//! The fundamental of a tree after a release, from all its points at once.
//!
//! The points' motions are compressed to their principal components, and damped cosines with common
//! frequencies and damping ratios are fitted to these, one more at a time: modes as near to each
//! other as a trunk's and a limb's differ in how large they are in each component. How many there
//! are is not known: the fundamental is what most numbers of modes say (a stabilisation diagram, as
//! of `subspace.rs`).

use super::branches::{BranchMode, LnDeviations, SearchLimits};
use super::decay::{Mode, Start};
use super::decaying_motions::DecayingMotions;
use super::film::Film;
use super::free_decay::{is_too_brief, may_be_sway};
use super::members::mean_px;
use super::motions::{Motions, OF_SUBSPACE};
use super::release::ReleaseTime;
use super::sandwich::deviations;
use super::signals::{Factor, Fit, Signals};
use super::swing::Arms;
use crate::cancel::CancelToken;
use crate::model::Unidentified;
use crate::signal::statistics::quantile;
use nalgebra::{DVector, Point2};

/// Numbers of modes that are asked.
const LEAST_MODES: usize = 3;
const MOST_MODES: usize = 7;
/// Energy of the fundamental at least, as a share of that of the mode that has most.
const MIN_ENERGY: f64 = 0.1;
/// From the median of distances to the standard deviation of a normal distribution.
const SD_OF_MEDIAN: f64 = 1.4826;

/// The slowest of the larger modes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fundamental {
    pub mode: BranchMode,
    /// Angle at its largest, as the points move about the place where the trunk begins, degrees.
    pub amplitude_deg: f64,
}

/// Of the motions since a release in `film`, of points which turn about `base_px`.
///
/// # Errors
/// By most numbers of modes a larger mode is seen for too few periods: a faster one would be taken for
/// it. Or there are too few points, no motion is more than noise, fewer than half of the numbers have
/// a mode that a tree may have, or `cancel` ends the work before.
pub(super) fn fundamental(
    decaying: &DecayingMotions,
    film: &Film,
    base_px: Point2<f64>,
    start: Start,
    release: &ReleaseTime,
    limits: &SearchLimits,
    cancel: &CancelToken,
) -> Result<Fundamental, Unidentified> {
    let points = &decaying.points;
    if 2 * points.tracks.len() < OF_SUBSPACE {
        return Err(Unidentified::NotMeasured);
    }
    if decaying.motions.above_noise() == 0 {
        return Err(Unidentified::TooLittleMotion);
    }
    let by_number =
        asked(decaying, start, release, limits, cancel).ok_or(Unidentified::NotInTime)?;
    let too_short = by_number.iter().filter(|f| f.is_too_short).count();
    if 2 * too_short > MOST_MODES - LEAST_MODES {
        return Err(Unidentified::TooShort);
    }
    let found: Vec<Found> = by_number.into_iter().filter_map(|f| f.sway).collect();
    if 2 * found.len() <= MOST_MODES - LEAST_MODES {
        return Err(Unidentified::NoOscillation);
    }
    central(found, decaying, film, base_px).ok_or(Unidentified::NoOscillation)
}

/// The one of the middle, less sure by how far the others are from it.
fn central(
    found: Vec<Found>,
    decaying: &DecayingMotions,
    film: &Film,
    base_px: Point2<f64>,
) -> Option<Fundamental> {
    let points = &decaying.points;
    let frequencies: Vec<f64> = found.iter().map(|f| f.mode.frequency_hz.ln()).collect();
    let median = quantile(frequencies.clone(), 0.5)?;
    let distance = |ln_frequency: &f64| (ln_frequency - median).abs();
    let scatter = quantile(frequencies.iter().map(distance).collect(), 0.5)?;
    let nearest = found.into_iter().min_by(|a, b| {
        let [a, b] = [a, b].map(|f| distance(&f.mode.frequency_hz.ln()));
        a.total_cmp(&b)
    })?;
    let places_px = points
        .tracks
        .iter()
        .map(|&k| mean_px(&film.tracks[k].at_px));
    let arms = Arms::at(places_px, base_px);
    let least = LnDeviations {
        frequency: SD_OF_MEDIAN * scatter,
        damping: 0.0,
    };
    Some(Fundamental {
        mode: BranchMode {
            mode: nearest.mode,
            ln_sd: nearest.ln_sd.inflated(1.0, &least),
        },
        amplitude_deg: arms.amplitude_deg(&in_points(&decaying.motions, &nearest.factors), 0),
    })
}

/// The larger modes of one number of modes.
struct Asked {
    /// The slowest that is seen for long enough.
    sway: Option<Found>,
    /// Whether one that is not is larger.
    is_too_short: bool,
}

/// The fundamental by one number of modes.
struct Found {
    mode: Mode,
    ln_sd: LnDeviations,
    /// In each of the motions.
    factors: Vec<Factor>,
}

/// What each number of modes says.
fn asked(
    decaying: &DecayingMotions,
    start: Start,
    release: &ReleaseTime,
    limits: &SearchLimits,
    cancel: &CancelToken,
) -> Option<Vec<Asked>> {
    let signals = decaying.signals(start, release, limits.frequencies_hz);
    let mut out = Vec::new();
    let mut fit = Fit::default();
    for modes in 1..=MOST_MODES {
        if cancel.is_cancelled() {
            return None;
        }
        let Some(more) = signals.with_one_more(&fit) else {
            break;
        };
        fit = more;
        if modes >= LEAST_MODES {
            out.push(slowest(decaying, &signals, &fit));
        }
    }
    Some(out)
}

/// Of the larger modes of a fit the slowest that is seen for long enough, and whether a mode that is
/// not moves the points farther at first.
fn slowest(decaying: &DecayingMotions, signals: &Signals, fit: &Fit) -> Asked {
    let factors = signals.factors(fit, OF_SUBSPACE);
    let mut energies = vec![0.0; fit.modes.len()];
    let mut sizes = vec![0.0; fit.modes.len()];
    for (m, mode) in fit.modes.iter().enumerate() {
        let scales = decaying.motions.scales();
        let in_points = factors.iter().zip(scales).map(|(f, s)| f[m].size() * s);
        sizes[m] = in_points.map(|size| size * size).sum();
        let squares: f64 = factors.iter().map(|f| f[m].size().powi(2)).sum();
        // A decay lasts as long as its damping is small.
        energies[m] = squares / (mode.damping * mode.frequency_hz);
    }
    let seen = modes_that(may_be_sway, signals, fit);
    let largest = seen.iter().map(|m| energies[*m]).fold(0.0, f64::max);
    let mut large = seen;
    large.retain(|m| energies[*m] >= MIN_ENERGY * largest);
    let slowest = large.into_iter().min_by(|a, b| {
        let [a, b] = [a, b].map(|m| fit.modes[*m].frequency_hz);
        a.total_cmp(&b)
    });
    let size = slowest.map_or(0.0, |m| sizes[m]);
    let brief = modes_that(is_too_brief, signals, fit);
    Asked {
        is_too_short: brief.iter().any(|m| sizes[*m] > size),
        sway: slowest.and_then(|m| sway_of(signals, fit, &factors, m)),
    }
}

/// The places of those modes of a fit that are `wanted`.
fn modes_that(wanted: fn(&Signals, &Mode) -> bool, signals: &Signals, fit: &Fit) -> Vec<usize> {
    let mut places: Vec<usize> = (0..fit.modes.len()).collect();
    places.retain(|m| wanted(signals, &fit.modes[*m]));
    places
}

/// Mode `m` of a fit with its deviations.
fn sway_of(signals: &Signals, fit: &Fit, factors: &[Vec<Factor>], m: usize) -> Option<Found> {
    let spread = deviations(signals, fit, &vec![None; fit.modes.len()])?;
    Some(Found {
        mode: fit.modes[m],
        ln_sd: LnDeviations::of_parameters(&spread[2 * m..]),
        factors: factors.iter().map(|f| f[m]).collect(),
    })
}

/// The factors of a mode in u and v of each point, as [`Arms`] take them.
fn in_points(motions: &Motions, factors: &[Factor]) -> Vec<Vec<Factor>> {
    let scales: Vec<f64> = motions.scales().collect();
    let [cosines, sines] = [|f: &Factor| f.cosine, |f: &Factor| f.sine].map(|part| {
        let sizes = factors
            .iter()
            .zip(&scales)
            .map(|(f, scale)| part(f) * scale);
        motions.in_points(&DVector::from_iterator(
            factors.len().min(scales.len()),
            sizes,
        ))
    });
    let mut out = Vec::with_capacity(2 * cosines.len());
    for (cosine, sine) in cosines.iter().zip(&sines) {
        for axis in 0..2 {
            out.push(vec![Factor::of(&[cosine[axis], sine[axis]])]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Bounds;
    use crate::dynamics::film::FilmTrack;
    use crate::dynamics::sampling;
    use crate::model::NodeId;
    use crate::random::generator;
    use rand::RngExt;
    use std::f64::consts::TAU;

    const FRAMES: u32 = 300;

    /// Twelve points on a trunk, and as many on each of two limbs, px; of the limbs' modes each moves
    /// its own points most, but the trunk's moves all.
    fn film(sizes_px: [f64; 3]) -> Film {
        let mut random = generator(5, 0);
        let times_s: Vec<f64> = (0..FRAMES).map(|k| f64::from(k) / 30.0).collect();
        let mut tracks = Vec::new();
        for point in 0..36 {
            let height = f64::from(point % 12) / 12.0;
            let shape = [
                height,
                f64::from(point / 12 == 1),
                f64::from(point / 12 == 2),
            ];
            let mut at_px = Vec::new();
            for t in &times_s {
                let mut at = Point2::new(100.0 + f64::from(point), 200.0 - 100.0 * height);
                for ((mode, shape), size) in MODES.iter().zip(shape).zip(sizes_px) {
                    let phase = TAU * mode.frequency_hz * t;
                    let decay = (-mode.damping * phase).exp();
                    at.x += size * shape * decay * phase.cos();
                    at.y += 0.3 * size * shape * decay * phase.cos();
                }
                at.x += 0.2 * random.random_range(-1.0..1.0);
                at.y += 0.2 * random.random_range(-1.0..1.0);
                at_px.push(at);
            }
            let node = NodeId(1);
            tracks.push(FilmTrack { node, at_px });
        }
        Film::new(&times_s, tracks)
    }

    /// All within a bin of ten seconds.
    const MODES: [Mode; 3] = [
        Mode {
            frequency_hz: 0.50,
            damping: 0.035,
        },
        Mode {
            frequency_hz: 0.57,
            damping: 0.05,
        },
        Mode {
            frequency_hz: 0.59,
            damping: 0.05,
        },
    ];

    fn found(film: &Film, cancel: &CancelToken) -> Result<Fundamental, Unidentified> {
        let release = ReleaseTime {
            at_s: 0.0,
            sd_s: 0.02,
        };
        let limits = SearchLimits {
            frequencies_hz: Bounds::new(0.15, 5.0),
            highest_hz: 5.0,
            max_relative_ci: 0.05,
        };
        let tracks: Vec<usize> = (0..film.tracks.len()).collect();
        let film = sampling::of_release(film, 0..film.times_s.len(), 5.0);
        let motions = DecayingMotions::of(&film, &tracks);
        fundamental(
            &motions.ok_or(Unidentified::NotMeasured)?,
            &film,
            Point2::new(118.0, 200.0),
            Start::Moving,
            &release,
            &limits,
            cancel,
        )
    }

    #[test]
    fn modes_within_one_bin_do_not_move_the_fundamental() {
        let found = found(&film([6.0, 8.0, 8.0]), &CancelToken::new()).expect("a fundamental");
        let off = (found.mode.mode.frequency_hz / 0.5).ln().abs();
        assert!(off < 0.004, "off by {off}");
        assert!(
            off < 3.0 * found.mode.ln_sd.frequency.max(0.0015),
            "{found:?}"
        );
        // 6 px at 100 px.
        assert!((found.amplitude_deg - 3.4).abs() < 0.7, "{found:?}");
    }

    #[test]
    fn what_says_nothing_has_none() {
        let still = found(&film([0.0; 3]), &CancelToken::new());
        let is_sure = still.as_ref().is_ok_and(|f| f.mode.is_within(0.05));
        assert!(!is_sure, "noise has none: {still:?}");
        let film = film([6.0, 8.0, 8.0]);
        let cancel = CancelToken::new();
        cancel.cancel();
        assert!(found(&film, &cancel).is_err());
        let short = film.part(0..40);
        assert!(found(&short, &CancelToken::new()).is_err());
        let few = Film::new(&film.times_s, film.tracks[..2].to_vec());
        assert!(found(&few, &CancelToken::new()).is_err());
    }

    /// 2.2 periods of the trunk's mode, and 2.6 of the limbs'.
    #[test]
    fn of_too_few_periods_there_is_none() {
        let whole = film([8.0, 5.0, 5.0]);
        let found = found(&whole.part(0..132), &CancelToken::new());
        assert_eq!(found.err(), Some(Unidentified::TooShort));
    }
}
