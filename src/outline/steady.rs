//! Where the structure of a picture stays what it is while its brightness changes: in a shadow that
//! moves over ground.

use crate::model::{Luma, Size};

/// Half the side of the window in which structure is compared, px.
const RADIUS: usize = 4;
/// Variance of the logarithm of brightness below which a window has no structure.
const LEAST_VARIANCE: f32 = 1e-5;
/// Keeps the logarithm from black, grey levels: sensor noise is about as large.
const FLOOR: f32 = 8.0;

/// Mean normalised correlation, -1 to 1, of the window around each pixel with the same window of
/// the mean picture. On logarithms, so that light that is taken away by a factor changes nothing.
/// All pictures have one size.
pub fn steadiness(pictures: &[&Luma]) -> Vec<f32> {
    let Some(size) = pictures.first().map(|p| p.size) else {
        return Vec::new();
    };
    let logs: Vec<Vec<f32>> = pictures
        .iter()
        .map(|p| {
            p.pixels
                .iter()
                .map(|&y| (f32::from(y) + FLOOR).ln())
                .collect()
        })
        .collect();
    let n = logs.len() as f32;
    let mean: Vec<f32> = (0..size.area())
        .map(|i| logs.iter().map(|l| l[i]).sum::<f32>() / n)
        .collect();
    let (mean_m, mean_v) = moments(&mean, size);
    let mut steady = vec![0.0; size.area()];
    for log in &logs {
        let (m, v) = moments(log, size);
        let product: Vec<f32> = log.iter().zip(&mean).map(|(a, b)| a * b).collect();
        let together = box_mean(&product, size);
        for i in 0..steady.len() {
            steady[i] += (together[i] - m[i] * mean_m[i]) / (v[i] * mean_v[i]).sqrt() / n;
        }
    }
    steady
}

/// Mean and variance in the window around each pixel.
fn moments(values: &[f32], size: Size) -> (Vec<f32>, Vec<f32>) {
    let mean = box_mean(values, size);
    let squares: Vec<f32> = values.iter().map(|v| v * v).collect();
    let variance = box_mean(&squares, size)
        .iter()
        .zip(&mean)
        .map(|(s, m)| (s - m * m).max(LEAST_VARIANCE))
        .collect();
    (mean, variance)
}

/// Mean in the window around each pixel, as far as the window lies in the picture.
fn box_mean(values: &[f32], size: Size) -> Vec<f32> {
    let (width, height) = (size.width as usize, size.height as usize);
    let mut rows = vec![0.0; values.len()];
    for (row, into) in values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        slide(width, |u| row[u], |u, mean| into[u] = mean);
    }
    let mut both = vec![0.0; values.len()];
    for u in 0..width {
        slide(
            height,
            |v| rows[v * width + u],
            |v, mean| both[v * width + u] = mean,
        );
    }
    both
}

/// Means of a row of `n` values over windows that slide along it.
fn slide(n: usize, value: impl Fn(usize) -> f32, mut put: impl FnMut(usize, f32)) {
    // In double precision what is added and what is taken off again cancel to the last bit that
    // matters.
    let mut sum: f64 = (0..RADIUS.min(n)).map(|i| f64::from(value(i))).sum();
    for i in 0..n {
        if i + RADIUS < n {
            sum += f64::from(value(i + RADIUS));
        }
        if i > RADIUS {
            sum -= f64::from(value(i - RADIUS - 1));
        }
        let count = (i + RADIUS + 1).min(n) - i.saturating_sub(RADIUS);
        put(i, (sum / count as f64) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Size = Size {
        width: 60,
        height: 40,
    };

    fn ground(u: f64, v: f64) -> f64 {
        120.0 + 40.0 * (u * 1.3).sin() * (v * 0.9).cos()
    }

    fn picture(at: impl Fn(f64, f64) -> f64) -> Luma {
        Luma {
            size: SIZE,
            pixels: (0..SIZE.area())
                .map(|i| at((i % 60) as f64, (i / 60) as f64) as u8)
                .collect(),
        }
    }

    /// A cloud's shadow passes over one half of the picture; the other half sways.
    #[test]
    fn a_shadow_leaves_structure_alone_and_a_sway_does_not() {
        let mut pictures = Vec::new();
        for k in 0..20 {
            let light = 1.0 - 0.4 * f64::from(k % 2);
            let shift = 3.0 * (f64::from(k) * 0.8).sin();
            pictures.push(picture(|u, v| {
                if u < 30.0 {
                    light * ground(u, v)
                } else {
                    ground(u - shift, v)
                }
            }));
        }
        let steady = steadiness(&pictures.iter().collect::<Vec<_>>());
        let [shaded, swaying] = [2, 38].map(|from| {
            let rows = steady.chunks_exact(60);
            rows.map(|row| row[from..from + 20].iter().sum::<f32>())
                .sum::<f32>()
                / 800.0
        });
        assert!(shaded > 0.9 && swaying < 0.5, "{shaded} and {swaying}");
    }

    #[test]
    fn means_are_those_of_the_window() {
        let values: Vec<f32> = (0..SIZE.area())
            .map(|i| ((i * 7919) % 101) as f32)
            .collect();
        let means = box_mean(&values, SIZE);
        for (u, v) in [(0usize, 0usize), (59, 39), (3, 20), (30, 36)] {
            let (us, vs) = (
                u.saturating_sub(RADIUS)..(u + RADIUS + 1).min(60),
                v.saturating_sub(RADIUS)..(v + RADIUS + 1).min(40),
            );
            let window: Vec<f32> = vs
                .flat_map(|v| us.clone().map(move |u| v * 60 + u))
                .map(|i| values[i])
                .collect();
            let mean = window.iter().sum::<f32>() / window.len() as f32;
            assert!((means[v * 60 + u] - mean).abs() < 1e-3, "({u}, {v})");
        }
    }
}
