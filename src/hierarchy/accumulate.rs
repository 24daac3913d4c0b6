//! When enough motion has been seen to build the tree, judged from the tracks alone.

use super::own_motion::is_cameras;
use super::signals::Signals;
use super::table::table;
use crate::config::Accumulate;
use crate::model::{LogWindow, TrackTable};
use crate::signal::{along_principal_direction, median};
use nalgebra::{Point2, Vector2};

/// Rate at which tracks are compared, Hz: velocities over longer steps stand out better from
/// tracking noise.
pub const COMPARE_HZ: f64 = 15.0;
/// Points that are compared with each other for stability; more say the same at a higher price.
const COMPARED: usize = 48;
/// Blocks that are dealt in turn to the two halves of the evidence, s.
const BLOCK_S: f64 = 0.5;
/// No track is taken to be better than this, px: the floor of sub-pixel tracking on clean pictures.
const NOISE_FLOOR_PX: f64 = 0.1;
/// Signal-to-noise ratio at which the motion term has reached 1 - 1/e.
const SNR_SCALE: f64 = 8.0;
/// Sways of the whole tree after which the sway term has reached 1 - 1/e.
const SWAYS_SCALE: f64 = 2.0;
/// A sway counts when it goes this share of the root mean square displacement beyond the middle, on
/// both sides.
const SWAY_HYSTERESIS: f64 = 0.2;
/// Moving points below which the evidence counts for less.
const ENOUGH_MOVING: f64 = 32.0;

/// What has been seen so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Evidence {
    /// The accumulation measure, 0 to 1: motion times stability times sway times the share of 32
    /// points that move.
    pub measure: f64,
    /// 1 - exp(-snr / 8), with snr the median over the moving points of displacement over tracking
    /// noise.
    pub motion: f64,
    /// Correlation between the affinities from one half of the time and from the other, 0 to 1: if
    /// the tree's structure is in the tracks, both halves (blocks of half a second, dealt in turn)
    /// tell the same one.
    pub stability: f64,
    /// 1 - exp(-n / 2), with n the number of times that the tree as a whole has swayed to and fro:
    /// branches that swing at different rates are apart for sure only after some periods of the
    /// slowest.
    pub sway: f64,
    /// Rows of the table whose points move.
    pub moving: Vec<usize>,
}

/// The tracks that count in the newest frame of `window`, judged. What moves as one picture, while
/// nothing shows how the camera moves, is the camera's motion and no evidence of a tree.
pub fn seen(window: LogWindow, settings: &Accumulate) -> (TrackTable, Evidence) {
    let table = table(window);
    let mut evidence = evidence(&table, settings);
    if is_cameras(window, &table, &evidence.moving, settings) {
        evidence = Evidence::default();
    }
    (table, evidence)
}

/// Judges the tracks of `table`.
pub fn evidence(table: &TrackTable, settings: &Accumulate) -> Evidence {
    let snr: Vec<f64> = (0..table.ids.len()).map(|i| snr(table, i)).collect();
    let moving: Vec<usize> = (0..snr.len())
        .filter(|&i| snr[i] > settings.moving_snr)
        .collect();
    if moving.len() < 3 {
        return Evidence {
            moving,
            ..Evidence::default()
        };
    }
    let of_moving = moving.iter().map(|&i| snr[i]).collect();
    let median_snr = median(of_moving, f64::total_cmp).unwrap_or(0.0);
    let motion = 1.0 - (-median_snr / SNR_SCALE).exp();
    let stability = stability(table, &moving);
    let sway = 1.0 - (-sways(table, &moving) / SWAYS_SCALE).exp();
    let enough = (moving.len() as f64 / ENOUGH_MOVING).min(1.0);
    Evidence {
        measure: motion * stability * sway * enough,
        motion,
        stability,
        sway,
        moving,
    }
}

/// Whether the point of a row moves, and is not only shaken by noise.
pub(super) fn moves(table: &TrackTable, row: usize, settings: &Accumulate) -> bool {
    snr(table, row) > settings.moving_snr
}

/// Displacement over tracking noise.
fn snr(table: &TrackTable, row: usize) -> f64 {
    displacement_px(table, row) / noise_px(table, row)
}

/// Root mean square distance of a track from its mean position, px.
fn displacement_px(table: &TrackTable, row: usize) -> f64 {
    let seen: Vec<Point2<f64>> = table.positions[row]
        .iter()
        .flatten()
        .map(|p| p.cast())
        .collect();
    let n = seen.len() as f64;
    if n < 4.0 {
        return 0.0;
    }
    let sum: Vector2<f64> = seen.iter().map(|p| p.coords).sum();
    let mean = Point2::from(sum / n);
    let sum_sq: f64 = seen.iter().map(|p| (p - mean).norm_squared()).sum();
    (sum_sq / n).sqrt()
}

/// What tracking itself admits: the median forward-backward error, not less than the floor.
pub(super) fn noise_px(table: &TrackTable, row: usize) -> f64 {
    f64::from(table.fb_errors_px[row]).max(NOISE_FLOOR_PX)
}

/// How often the mean of the moving points has swung to and fro along its principal direction.
fn sways(table: &TrackTable, moving: &[usize]) -> f64 {
    let steps = Signals::velocities(table, moving, |_| true).mean();
    let mut at = Point2::origin();
    let path: Vec<Point2<f64>> = steps
        .iter()
        .map(|v| {
            at += v;
            at
        })
        .collect();
    let along = along_principal_direction(&path);
    let rms = (along.iter().map(|x| x * x).sum::<f64>() / along.len().max(1) as f64).sqrt();
    let (mut side, mut crossings) = (0.0, 0u32);
    for x in along.iter().filter(|x| x.abs() > SWAY_HYSTERESIS * rms) {
        if x.signum() != side {
            crossings += u32::from(side != 0.0);
            side = x.signum();
        }
    }
    f64::from(crossings) / 2.0
}

/// Correlation of the affinities by the even blocks of time with those by the odd ones, 0 to 1.
fn stability(table: &TrackTable, moving: &[usize]) -> f64 {
    let stride = moving.len().div_ceil(COMPARED);
    let some: Vec<usize> = moving.iter().copied().step_by(stride).collect();
    let even = Signals::velocities(table, &some, |k| in_even_block(table, k));
    let odd = Signals::velocities(table, &some, |k| !in_even_block(table, k));
    let (mut by_even, mut by_odd) = (Vec::new(), Vec::new());
    for a in 0..some.len() {
        for b in a + 1..some.len() {
            by_even.push(f64::from(even.correlation(a, b)));
            by_odd.push(f64::from(odd.correlation(a, b)));
        }
    }
    pearson(&by_even, &by_odd).max(0.0)
}

/// Whether a frame of the table is in the first, third, ... block of time.
fn in_even_block(table: &TrackTable, frame: usize) -> bool {
    let since_start_s = table.times_s[frame] - table.times_s[0];
    ((since_start_s / BLOCK_S) as u64).is_multiple_of(2)
}

fn pearson(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for (a, b) in x.iter().zip(y) {
        xy += (a - mx) * (b - my);
        xx += (a - mx).powi(2);
        yy += (b - my).powi(2);
    }
    if xx > 0.0 && yy > 0.0 {
        xy / (xx * yy).sqrt()
    } else {
        0.0
    }
}
