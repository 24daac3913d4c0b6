//! Density: which share of the picture around a place is covered.

use super::canvas::Grid;
use nalgebra::Point2;
use std::ops::Range;

/// A density map is smoothed over this share of the tree's height (standard deviation): some
/// leaves, not one.
pub(super) const SCALE: f64 = 1.0 / 20.0;

/// Values smoothed by three running means, which are all but a normal distribution of deviation
/// `sigma` cells; nothing lies beyond the picture.
pub(super) fn smoothed(values: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let radius = ((4.0 * sigma * sigma + 1.0).sqrt() / 2.0 - 0.5)
        .round()
        .max(0.0) as usize;
    if radius == 0 || width == 0 {
        return values.to_vec();
    }
    let mut out = values.to_vec();
    for _ in 0..3 {
        out.chunks_exact_mut(width)
            .for_each(|row| mean_along(row, radius));
        mean_down(&mut out, width, radius);
    }
    out
}

/// Running mean of `2 radius + 1` values of a row.
fn mean_along(row: &mut [f32], radius: usize) {
    let before = row.to_vec();
    let share = 1.0 / (2 * radius + 1) as f64;
    let mut sum: f64 = before.iter().take(radius).map(|&x| f64::from(x)).sum();
    for (k, value) in row.iter_mut().enumerate() {
        sum += before.get(k + radius).map_or(0.0, |&x| f64::from(x));
        *value = (sum * share) as f32;
        sum -= k
            .checked_sub(radius)
            .map_or(0.0, |first| f64::from(before[first]));
    }
}

/// The same of all columns at once, row by row, as memory lies.
fn mean_down(values: &mut [f32], width: usize, radius: usize) {
    let before = values.to_vec();
    let share = 1.0 / (2 * radius + 1) as f64;
    let mut sums = vec![0.0f64; width];
    for v in 0..radius {
        for (sum, &x) in sums.iter_mut().zip(row(&before, width, v)) {
            *sum += f64::from(x);
        }
    }
    for (v, out) in values.chunks_exact_mut(width).enumerate() {
        for (sum, &x) in sums.iter_mut().zip(row(&before, width, v + radius)) {
            *sum += f64::from(x);
        }
        for (out, sum) in out.iter_mut().zip(&sums) {
            *out = (sum * share) as f32;
        }
        if let Some(first) = v.checked_sub(radius) {
            for (sum, &x) in sums.iter_mut().zip(row(&before, width, first)) {
                *sum -= f64::from(x);
            }
        }
    }
}

/// Row `v`; nothing beyond the last one.
fn row(values: &[f32], width: usize, v: usize) -> &[f32] {
    values.get(v * width..(v + 1) * width).unwrap_or_default()
}

/// Correlation (Pearson) of two maps over the cells where `counts`; 0 where one of them is the same
/// everywhere.
pub(super) fn correlation(a: &[f32], b: &[f32], counts: impl Fn(usize) -> bool) -> f64 {
    let pairs: Vec<(f64, f64)> = a
        .iter()
        .zip(b)
        .enumerate()
        .filter(|(i, _)| counts(*i))
        .map(|(_, (x, y))| (f64::from(*x), f64::from(*y)))
        .collect();
    let n = pairs.len().max(1) as f64;
    let (mx, my) = (
        pairs.iter().map(|p| p.0).sum::<f64>() / n,
        pairs.iter().map(|p| p.1).sum::<f64>() / n,
    );
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        let (dx, dy) = (x - mx, y - my);
        (xx, yy, xy) = (xx + dx * dx, yy + dy * dy, xy + dx * dy);
    }
    if xx * yy > 0.0 {
        xy / (xx * yy).sqrt()
    } else {
        0.0
    }
}

/// Which cells are covered by triangles seen from the front.
pub(super) struct Cover<'a> {
    grid: Grid,
    /// Depth of what hides the triangles behind it, for every cell; may be empty.
    pub before: &'a [f32],
    pub covered: Vec<f32>,
}

impl<'a> Cover<'a> {
    pub fn new(grid: Grid, before: &'a [f32]) -> Self {
        Self {
            grid,
            before,
            covered: vec![0.0; grid.area()],
        }
    }

    /// Marks the cells whose centre lies in the triangle, whichever way it faces, unless something
    /// is before it; its corners in cells and its depth.
    pub fn add(&mut self, [a, b, c]: [Point2<f64>; 3], depth: f64) {
        let area = (b - a).perp(&(c - a));
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let columns = cells_between([a.x, b.x, c.x], self.grid.size.width);
        let rows = cells_between([a.y, b.y, c.y], self.grid.size.height);
        for v in rows {
            for u in columns.clone() {
                let at = Point2::new(u as f64, v as f64);
                let inside = [(a, b), (b, c), (c, a)]
                    .into_iter()
                    .all(|(p, q)| (q - p).perp(&(at - p)) * area.signum() >= 0.0);
                if inside {
                    let i = v * self.grid.size.width as usize + u;
                    if self
                        .before
                        .get(i)
                        .is_none_or(|&wood| f64::from(wood) < depth)
                    {
                        self.covered[i] = 1.0;
                    }
                }
            }
        }
    }
}

/// Those of `count` cells in a row whose middles lie within the stretch that holds all of `ends`;
/// none may.
fn cells_between(ends: [f64; 3], count: u32) -> Range<usize> {
    let [a, b, c] = ends;
    let low = a.min(b).min(c).ceil().max(0.0);
    let high = a.max(b).max(c).floor().min(f64::from(count) - 1.0);
    if low <= high {
        low as usize..high as usize + 1
    } else {
        0..0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is smoothed is neither lost nor made, and lies where it lay.
    #[test]
    fn smoothing_keeps_the_sum_and_spreads_as_far_as_it_says() {
        let mut one = vec![0.0; 101 * 101];
        one[50 * 101 + 50] = 1.0;
        let out = smoothed(&one, 101, 6.0);
        let sum: f64 = out.iter().map(|&x| f64::from(x)).sum();
        let mut variance = 0.0;
        for (i, x) in out.iter().enumerate() {
            variance += f64::from(*x) * ((i % 101) as f64 - 50.0).powi(2);
        }
        assert!((sum - 1.0).abs() < 1e-4, "{sum}");
        assert!((variance.sqrt() - 6.0).abs() < 0.5, "{}", variance.sqrt());
    }
}
