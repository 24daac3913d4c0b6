//! How much the camera trembles, and how fast.

use super::spectrum::spectrum;
use crate::model::Shake;
use crate::signal::statistics::rms;
use nalgebra::Vector2;

/// A camera that trembles slower than this drifts, Hz.
const SLOWEST_HZ: f64 = 0.3;
/// A camera that trembles less than this has no frequency, px: it is the noise of its measurement.
const LEAST_PX: f64 = 0.05;

/// The shake in `shifts_px`, the displacements of the picture at growing `times_s`. A straight line
/// in time is taken off as drift.
pub fn shake(times_s: &[f64], shifts_px: &[Vector2<f64>]) -> Shake {
    let axes = [0, 1].map(|axis| {
        let along: Vec<f64> = shifts_px.iter().map(|shift| shift[axis]).collect();
        without_drift(times_s, &along)
    });
    let squares = axes.iter().map(|axis| rms(axis.iter().copied()).powi(2));
    let rms_px = squares.sum::<f64>().sqrt();
    let frequency_hz = if rms_px < LEAST_PX {
        None
    } else {
        peak_hz(times_s, &axes)
    };
    Shake {
        rms_px,
        frequency_hz,
    }
}

/// `values` without the straight line that fits them best.
fn without_drift(times_s: &[f64], values: &[f64]) -> Vec<f64> {
    let count = values.len().max(1) as f64;
    let mean_s = times_s.iter().sum::<f64>() / count;
    let mean = values.iter().sum::<f64>() / count;
    let (mut product, mut square) = (0.0, 0.0);
    for (t, x) in times_s.iter().zip(values) {
        product += (t - mean_s) * (x - mean);
        square += (t - mean_s).powi(2);
    }
    let slope = if square > 0.0 { product / square } else { 0.0 };
    let left = times_s.iter().zip(values);
    left.map(|(t, x)| x - mean - slope * (t - mean_s)).collect()
}

/// Where both axes together have most power, Hz.
fn peak_hz(times_s: &[f64], axes: &[Vec<f64>; 2]) -> Option<f64> {
    let [across, down] = [spectrum(times_s, &axes[0])?, spectrum(times_s, &axes[1])?];
    let mut best: Option<(f64, f64)> = None;
    let bins = across.amplitude.iter().zip(&down.amplitude).enumerate();
    for (bin, (a, b)) in bins {
        let hz = bin as f64 * across.bin_hz;
        let power = a * a + b * b;
        if hz >= SLOWEST_HZ && best.is_none_or(|(_, largest)| power > largest) {
            best = Some((hz, power));
        }
    }
    best.map(|(hz, _)| hz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_tripod_in_the_wind_trembles_and_its_sag_does_not_count() {
        let times_s: Vec<f64> = (0..150).map(|k| f64::from(k) / 30.0).collect();
        let mut shifts_px = Vec::new();
        for t in &times_s {
            let wave = (TAU * 2.2 * t).sin();
            shifts_px.push(Vector2::new(2.0 * wave + 1.5 * t, 0.3 * wave - 4.0));
        }
        let found = shake(&times_s, &shifts_px);
        assert!((found.rms_px - 1.43).abs() < 0.05, "{found:?}");
        assert!(found.frequency_hz.is_some_and(|hz| (hz - 2.2).abs() < 0.1));
        let still = shake(&times_s, &vec![Vector2::new(3.0, 1.0); times_s.len()]);
        assert!(still.rms_px < 1e-9 && still.frequency_hz.is_none());
        assert_eq!(shake(&[], &[]).rms_px, 0.0);
    }
}
