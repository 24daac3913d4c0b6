//! Spectra of displacements.

use realfft::RealFftPlanner;

/// Fewer samples or periods than this carry no answer.
const MIN_SAMPLES: usize = 32;
const MIN_PERIODS: f64 = 2.0;

/// Frequency of the largest spectral peak of a displacement (px) in its principal direction, Hz.
///
/// For the screen: samples are put on an even grid by linear interpolation, a Hann window is applied, and the peak is
/// refined by a parabola. `None` where fewer than two periods were seen or the peak does not stand out four times
/// above the median of the spectrum's amplitudes.
pub fn dominant_frequency_hz(times_s: &[f64], displacement_px: &[[f64; 2]]) -> Option<f64> {
    let n = times_s.len().min(displacement_px.len());
    if n < MIN_SAMPLES {
        return None;
    }
    let span_s = times_s[n - 1] - times_s[0];
    if span_s.is_nan() || span_s <= 0.0 {
        return None;
    }
    let principal = along_principal_direction(&displacement_px[..n]);
    let mut signal = even_grid(&times_s[..n], &principal);
    for (k, x) in signal.iter_mut().enumerate() {
        *x *= 0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / (n - 1) as f64).cos();
    }
    // Padding to four times the length draws the peak with more points; it adds no information.
    let padded = (4 * n).next_power_of_two();
    signal.resize(padded, 0.0);
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(padded);
    let mut spectrum = fft.make_output_vec();
    fft.process(&mut signal, &mut spectrum).ok()?;
    let amplitude: Vec<f64> = spectrum.iter().map(|c| c.norm()).collect();
    let bin_hz = (n - 1) as f64 / span_s / padded as f64;
    let lowest = (MIN_PERIODS / span_s / bin_hz).ceil() as usize;
    let range = lowest.max(1)..amplitude.len() - 1;
    let peak = range.clone().max_by(|&a, &b| amplitude[a].total_cmp(&amplitude[b]))?;
    let mut sorted = amplitude[range].to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let is_peak = amplitude[peak] >= amplitude[peak - 1] && amplitude[peak] >= amplitude[peak + 1];
    if !is_peak || amplitude[peak] < 4.0 * sorted[sorted.len() / 2] {
        return None;
    }
    let (a, b, c) = (amplitude[peak - 1], amplitude[peak], amplitude[peak + 1]);
    let curve = a - 2.0 * b + c;
    let shift = if curve < 0.0 { 0.5 * (a - c) / curve } else { 0.0 };
    Some((peak as f64 + shift) * bin_hz)
}

/// Mean removed, projected on the direction of the largest variance.
fn along_principal_direction(d: &[[f64; 2]]) -> Vec<f64> {
    let n = d.len() as f64;
    let mean = d.iter().fold([0.0; 2], |m, p| [m[0] + p[0] / n, m[1] + p[1] / n]);
    let centred = || d.iter().map(|p| [p[0] - mean[0], p[1] - mean[1]]);
    let (xx, xy, yy) =
        centred().fold((0.0, 0.0, 0.0), |s, p| (s.0 + p[0] * p[0], s.1 + p[0] * p[1], s.2 + p[1] * p[1]));
    let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
    centred().map(|p| cos * p[0] + sin * p[1]).collect()
}

/// Linear interpolation at as many evenly spaced times.
fn even_grid(times_s: &[f64], values: &[f64]) -> Vec<f64> {
    let n = times_s.len();
    let step = (times_s[n - 1] - times_s[0]) / (n - 1) as f64;
    let mut j = 0;
    (0..n)
        .map(|k| {
            let t = times_s[0] + step * k as f64;
            while j + 2 < n && times_s[j + 1] < t {
                j += 1;
            }
            let width = times_s[j + 1] - times_s[j];
            let share = if width > 0.0 { ((t - times_s[j]) / width).clamp(0.0, 1.0) } else { 0.0 };
            values[j] + share * (values[j + 1] - values[j])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sway(frequency_hz: f64, seconds: f64, jitter_s: f64) -> (Vec<f64>, Vec<[f64; 2]>) {
        let times: Vec<f64> = (0..(seconds * 30.0) as usize)
            .map(|k| k as f64 / 30.0 + jitter_s * ((k as f64 * 0.618).fract() - 0.5))
            .collect();
        let at = |t: &f64| (std::f64::consts::TAU * frequency_hz * t).sin();
        let d = times.iter().map(|t| [3.0 * at(t) + 10.0, -1.5 * at(t)]).collect();
        (times, d)
    }

    #[test]
    fn frequency_of_a_sway_is_found_with_even_and_jittered_times() {
        for (hz, jitter) in [(0.4, 0.0), (0.7, 0.01), (2.3, 0.0), (4.4, 0.01)] {
            let (t, d) = sway(hz, 10.0, jitter);
            let found = dominant_frequency_hz(&t, &d).unwrap();
            assert!((found - hz).abs() < 0.02, "{hz} Hz came out as {found}");
        }
    }

    #[test]
    fn less_than_two_periods_say_nothing() {
        let (t, d) = sway(0.15, 10.0, 0.0);
        assert!(dominant_frequency_hz(&t, &d).is_none_or(|f| f > 0.19));
        assert_eq!(dominant_frequency_hz(&t[..8], &d[..8]), None);
        assert_eq!(dominant_frequency_hz(&[1.0; 64], &[[0.0; 2]; 64]), None);
    }
}
