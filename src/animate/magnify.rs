//! The captured motion made larger or smaller, as a whole or in one band of frequencies, at another
//! speed.

use super::soft;
use crate::bounds::Bounds;
use crate::model::{MovingBranch, Pose, Skeleton};
use crate::signal::reflection::there_and_back;
use nalgebra::Vector3;
use realfft::RealFftPlanner;

/// Share of a band's ends over which it fades.
const EDGE: f64 = 0.1;
/// The end of a loop is blended with the film before its beginning over this share of it at most,
/// and over so many seconds at least.
const SEAM: f64 = 1.0 / 3.0;
const LEAST_SEAM_S: f64 = 0.2;

/// What is to become of the captured motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnify {
    /// Every branch turns so many times as far from its mean as it did: 0 holds it there, 1 is as
    /// filmed.
    pub by: f64,
    /// Seconds of film in a second.
    pub speed: f64,
    /// Only what is between these frequencies (Hz, of the film) is changed.
    pub band_hz: Option<Bounds>,
    /// A branch turns at most so far against the one that carries it, rad; farther only if it did
    /// in the film.
    pub most_rad: f64,
    /// It ends as it begins.
    pub looped: bool,
}

/// Why the captured motion cannot be shown so.
#[derive(Debug, thiserror::Error)]
pub enum MagnifyError {
    #[error("the capture holds {0} poses, and motion takes at least 8; film for longer")]
    TooShort(usize),
    #[error("the capture's times are no numbers or do not grow; make it anew")]
    BadTimes,
    #[error(
        "a loop of {wanted_s:.1} s of film needs {needed_s:.1} s, and there are {length_s:.1}; give less --seconds"
    )]
    TooLongALoop {
        wanted_s: f64,
        needed_s: f64,
        length_s: f64,
    },
    #[error(
        "the film shows {rate_hz:.1} frames a second: nothing between {low_hz} and {high_hz} Hz \
         can be told; give a lower --band"
    )]
    BandTooHigh {
        rate_hz: f64,
        low_hz: f64,
        high_hz: f64,
    },
}

/// `count + 1` poses at `fps` poses a second, of the captured `poses`. Where the film is over it
/// goes back; a loop takes the last of it.
///
/// # Errors
/// The film is too short, its times are no numbers, or the band lies above what it shows.
pub fn magnify(
    skeleton: &Skeleton,
    poses: &[Pose],
    wanted: &Magnify,
    fps: f64,
    count: u64,
) -> Result<Vec<Pose>, MagnifyError> {
    let poses: Vec<&Pose> = poses
        .iter()
        .filter(|p| p.joints.len() == skeleton.nodes.len())
        .collect();
    if poses.len() < 8 {
        return Err(MagnifyError::TooShort(poses.len()));
    }
    let times: Vec<f64> = poses.iter().map(|p| p.time_s - poses[0].time_s).collect();
    if !times.windows(2).all(|t| t[1] > t[0] && t[1].is_finite()) {
        return Err(MagnifyError::BadTimes);
    }
    let length_s = times[times.len() - 1];
    let rate_hz = (times.len() - 1) as f64 / length_s;
    if let Some(band_hz) = wanted.band_hz
        && band_hz.lo >= 0.5 * rate_hz
    {
        return Err(MagnifyError::BandTooHigh {
            rate_hz,
            low_hz: band_hz.lo,
            high_hz: band_hz.hi,
        });
    }
    let branches = skeleton.moving_branches();
    let turns: Vec<Vec<Vector3<f64>>> = branches
        .iter()
        .map(|branch| changed(&own_turns(&poses, branch), &times, wanted))
        .collect();
    let whole_s = count as f64 / fps * wanted.speed;
    let seam_s = (length_s - whole_s).min(SEAM * whole_s);
    if wanted.looped && seam_s < LEAST_SEAM_S.min(SEAM * whole_s) {
        let needed_s = whole_s + LEAST_SEAM_S.min(SEAM * whole_s);
        return Err(MagnifyError::TooLongALoop {
            wanted_s: whole_s,
            needed_s,
            length_s,
        });
    }
    let film = TurnedFilm {
        times,
        turns,
        length_s,
    };
    let mut out = Vec::with_capacity(count as usize + 1);
    for k in 0..=count {
        let film_s = k as f64 / fps * wanted.speed;
        let turns = if wanted.looped {
            film.at_in_loop(film_s, whole_s, seam_s)
        } else {
            film.at(there_and_back(film_s, length_s))
        };
        out.push(skeleton.posed(&branches, &turns, k, k as f64 / fps));
    }
    Ok(out)
}

/// How every branch turns over the film.
struct TurnedFilm {
    /// Since the first pose, s.
    times: Vec<f64>,
    /// By branch, in every pose: an axis times an angle.
    turns: Vec<Vec<Vector3<f64>>>,
    length_s: f64,
}

impl TurnedFilm {
    /// The turn of every branch at a time of the film.
    fn at(&self, film_s: f64) -> Vec<Vector3<f64>> {
        let here = Moment::of(&self.times, film_s);
        self.turns.iter().map(|t| here.value(t)).collect()
    }

    /// At a time of the loop that the last `whole_s` of the film make. Over its last `seam_s` it
    /// goes over into the film that led up to its beginning.
    fn at_in_loop(&self, loop_s: f64, whole_s: f64, seam_s: f64) -> Vec<Vector3<f64>> {
        let from_s = self.length_s - whole_s;
        let here = Moment::of(&self.times, from_s + loop_s);
        let share = 1.0 - ((whole_s - loop_s) / seam_s).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        let before = Moment::of(&self.times, (from_s + loop_s - whole_s).max(0.0));
        self.turns
            .iter()
            .map(|t| here.value(t) * (1.0 - share) + before.value(t) * share)
            .collect()
    }
}

/// How a branch had turned against the one that carries it in every pose, see
/// [`MovingBranch::own_turn`].
fn own_turns(poses: &[&Pose], branch: &MovingBranch) -> Vec<Vector3<f64>> {
    poses.iter().map(|pose| branch.own_turn(pose)).collect()
}

/// The same with its changes about the mean, or the part of them in the band, magnified and
/// bounded.
fn changed(turns: &[Vector3<f64>], times: &[f64], wanted: &Magnify) -> Vec<Vector3<f64>> {
    let mean = turns.iter().sum::<Vector3<f64>>() / turns.len() as f64;
    let changes: Vec<Vector3<f64>> = turns.iter().map(|t| t - mean).collect();
    let part = match wanted.band_hz {
        Some(band_hz) => in_band(&changes, times, band_hz),
        None => changes,
    };
    let farthest = turns.iter().map(Vector3::norm).fold(0.0, f64::max);
    let knee = farthest.max(0.5 * wanted.most_rad);
    let most = wanted.most_rad.max(1.25 * knee);
    let mut out = Vec::with_capacity(turns.len());
    for (turn, part) in turns.iter().zip(&part) {
        let turn = turn + part * (wanted.by - 1.0);
        out.push(turn * soft(turn.norm(), knee, most));
    }
    out
}

/// What of the values lies within a band of frequencies, Hz. The film is continued by its mirror
/// image at both ends.
fn in_band(values: &[Vector3<f64>], times: &[f64], band_hz: Bounds) -> Vec<Vector3<f64>> {
    let n = values.len();
    let length_s = times[n - 1];
    // Even times, as the Fourier transform needs them.
    let even_times: Vec<f64> = (0..n)
        .map(|k| length_s * k as f64 / (n - 1) as f64)
        .collect();
    // Forth and back, the ends once.
    let long = 2 * (n - 1);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, inverse) = (
        planner.plan_fft_forward(long),
        planner.plan_fft_inverse(long),
    );
    let mut parts: [Vec<f64>; 3] = Default::default();
    for (axis, part) in parts.iter_mut().enumerate() {
        let even: Vec<f64> = even_times
            .iter()
            .map(|s| Moment::of(times, *s).value(values)[axis])
            .collect();
        let mut signal: Vec<f64> = even
            .iter()
            .chain(even[1..n - 1].iter().rev())
            .copied()
            .collect();
        let mut spectrum = forward.make_output_vec();
        // Both fail for lengths only, which come from the plans; nothing is in the band then.
        if forward.process(&mut signal, &mut spectrum).is_err() {
            return vec![Vector3::zeros(); n];
        }
        for (k, entry) in spectrum.iter_mut().enumerate() {
            *entry *= passes(k as f64 / (2.0 * length_s), band_hz) / long as f64;
        }
        if inverse.process(&mut spectrum, &mut signal).is_err() {
            return vec![Vector3::zeros(); n];
        }
        *part = signal;
    }
    let even: Vec<Vector3<f64>> = (0..n)
        .map(|k| Vector3::new(parts[0][k], parts[1][k], parts[2][k]))
        .collect();
    times
        .iter()
        .map(|t| Moment::of(&even_times, *t).value(&even))
        .collect()
}

/// 1 within the band, 0 outside, half at its ends.
fn passes(frequency_hz: f64, band_hz: Bounds) -> f64 {
    let over = if band_hz.lo > 0.0 {
        step(frequency_hz, band_hz.lo)
    } else {
        1.0
    };
    over * (1.0 - step(frequency_hz, band_hz.hi))
}

/// 0 below an edge, 1 above it, soft between.
fn step(frequency_hz: f64, edge_hz: f64) -> f64 {
    let across = ((frequency_hz / edge_hz.max(1e-9) - 1.0) / EDGE).clamp(-1.0, 1.0);
    0.5 + 0.5 * (0.5 * std::f64::consts::PI * across).sin()
}

/// A place between two of the film's frames.
struct Moment {
    before: usize,
    share: f64,
}

impl Moment {
    fn of(times: &[f64], time_s: f64) -> Self {
        let before = times
            .partition_point(|t| *t <= time_s)
            .clamp(1, times.len() - 1)
            - 1;
        let (a, b) = (times[before], times[before + 1]);
        Self {
            before,
            share: ((time_s - a) / (b - a)).clamp(0.0, 1.0),
        }
    }

    fn value(&self, of: &[Vector3<f64>]) -> Vector3<f64> {
        of[self.before] * (1.0 - self.share) + of[self.before + 1] * self.share
    }
}
