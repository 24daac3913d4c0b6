//! Order statistics, and the noise in a signal.

use nalgebra::Vector2;
use std::cmp::Ordering;

/// The middle of `values` by `order`, which must be total: of an even number the upper of the two;
/// `None` of none.
pub fn median<T: Copy>(mut values: Vec<T>, order: impl Fn(&T, &T) -> Ordering) -> Option<T> {
    median_in_place(&mut values, order)
}

/// The same of values that may be put into another order.
pub fn median_in_place<T: Copy>(values: &mut [T], order: impl Fn(&T, &T) -> Ordering) -> Option<T> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, order).1)
}

/// The median of each component; 0 of none.
pub fn median_vector(vectors: impl Iterator<Item = Vector2<f64>>) -> Vector2<f64> {
    let (mut across, mut down) = (Vec::new(), Vec::new());
    for vector in vectors {
        across.push(vector.x);
        down.push(vector.y);
    }
    let middle = |values| median(values, f64::total_cmp).unwrap_or(0.0);
    Vector2::new(middle(across), middle(down))
}

/// The value that `n` of `values` come before in growing order; `None` where there are not so many.
pub fn nth_smallest(mut values: Vec<f64>, n: usize) -> Option<f64> {
    (n < values.len()).then(|| *values.select_nth_unstable_by(n, f64::total_cmp).1)
}

/// The value that the share `share` (0 to 1) of `values` does not exceed, without interpolation;
/// `None` of none.
pub fn quantile(values: Vec<f64>, share: f64) -> Option<f64> {
    let last = values.len().saturating_sub(1);
    nth_smallest(values, (share * last as f64) as usize)
}

/// The value up to which one of the parts reaches that a histogram is parted into so that both vary
/// least (Otsu 1979); 0 where all values are the same.
pub fn otsu(histogram: &[u32; 256]) -> u8 {
    let count: f64 = histogram.iter().map(|&n| f64::from(n)).sum();
    let sum: f64 = (0..256).map(|v| v as f64 * f64::from(histogram[v])).sum();
    let (mut below, mut sum_below) = (0.0, 0.0);
    let (mut best, mut threshold) = (0.0, 0);
    for (value, &n) in (0..=u8::MAX).zip(histogram) {
        below += f64::from(n);
        sum_below += f64::from(value) * f64::from(n);
        let above = count - below;
        if below <= 0.0 || above <= 0.0 {
            continue;
        }
        let apart = sum_below / below - (sum - sum_below) / above;
        let between = below * above * apart * apart;
        if between > best {
            (best, threshold) = (between, value);
        }
    }
    threshold
}

/// Root of the mean square; 0 of none.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for x in values {
        sum += x * x;
        count += 1;
    }
    (sum / f64::from(count.max(1))).sqrt()
}

/// Variance of white noise in some signals, from their sixth differences, in which a motion of up to
/// a fifth of the rate leaves little. Values that are no numbers are left out; 0 where there are too
/// few.
pub fn noise_variance<'a>(signals: impl IntoIterator<Item = &'a [f64]>) -> f64 {
    const DIFFERENCE: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
    let (mut squares, mut count) = (0.0, 0_u32);
    for signal in signals {
        for window in signal.windows(DIFFERENCE.len()) {
            let terms = window.iter().zip(DIFFERENCE);
            let difference: f64 = terms.map(|(x, weight)| x * weight).sum();
            if difference.is_finite() {
                squares += difference * difference;
                count += 1;
            }
        }
    }
    let of_white: f64 = DIFFERENCE.iter().map(|weight| weight * weight).sum();
    squares / (of_white * f64::from(count.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_statistics_of_a_few_values() {
        let values = vec![4.0, 1.0, 3.0, 2.0];
        assert_eq!(median(values.clone(), f64::total_cmp), Some(3.0));
        assert_eq!(nth_smallest(values.clone(), 1), Some(2.0));
        assert_eq!(nth_smallest(values.clone(), 4), None);
        assert_eq!(quantile(values.clone(), 0.0), Some(1.0));
        assert_eq!(quantile(values.clone(), 0.5), Some(2.0));
        assert_eq!(quantile(values, 1.0), Some(4.0));
        assert_eq!(quantile(Vec::new(), 0.5), None);
    }

    fn alternating(k: usize) -> f64 {
        if k.is_multiple_of(2) { 0.1 } else { -0.1 }
    }

    #[test]
    fn noise_is_told_from_a_slow_motion_and_over_a_gap() {
        let mut signal: Vec<f64> = (0..200)
            .map(|k| 30.0 * (0.02 * k as f64).sin() + alternating(k))
            .collect();
        signal[50] = f64::NAN;
        // Alternating noise has sixth differences of 64 times itself, white noise of √924.
        let wanted = 4096.0 * 0.01 / 924.0;
        let found = noise_variance([signal.as_slice()]);
        assert!((found / wanted - 1.0).abs() < 0.01, "{found}, not {wanted}");
        assert_eq!(noise_variance([[1.0, 2.0].as_slice()]), 0.0);
    }
}
