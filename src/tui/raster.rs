//! A small colour picture to draw into: scaled down from a camera picture, with lines and dots on
//! top.

use crate::model::{Rgb, Size};
use nalgebra::Point2;
use std::ops::Range;

/// Colour picture whose every drawing routine leaves out what lies outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    pub size: Size,
    /// Three bytes a dot, row by row.
    pub pixels: Vec<u8>,
}

impl Raster {
    /// Scales a picture; each dot is the mean of the pixels that it covers. `None` if the picture's
    /// bytes do not match its size.
    pub fn scaled(from: &Rgb, size: Size) -> Option<Self> {
        if from.size.area() == 0 || from.pixels.len() != 3 * from.size.area() {
            return None;
        }
        let columns: Vec<_> = (0..size.width)
            .map(|x| covered(x, size.width, from.size.width))
            .collect();
        let stride = 3 * from.size.width as usize;
        let mut pixels = Vec::with_capacity(3 * size.area());
        for y in 0..size.height {
            let rows = covered(y, size.height, from.size.height);
            for columns in &columns {
                let mut sum = [0u64; 3];
                for row in rows.clone() {
                    for p in from.pixels[row * stride..][3 * columns.start..3 * columns.end]
                        .chunks_exact(3)
                    {
                        (0..3).for_each(|c| sum[c] += p[c] as u64);
                    }
                }
                let n = (rows.len() * columns.len()) as u64;
                pixels.extend(sum.map(|s| (s / n) as u8));
            }
        }
        Some(Self { size, pixels })
    }

    /// The colour of a dot; black outside.
    pub fn at(&self, x: u32, y: u32) -> [u8; 3] {
        self.index(x as i64, y as i64).map_or([0; 3], |i| {
            [self.pixels[i], self.pixels[i + 1], self.pixels[i + 2]]
        })
    }

    /// Makes every dot darker, by `share` of its brightness.
    pub fn darken(&mut self, share: f64) {
        let keep = (256.0 * (1.0 - share.clamp(0.0, 1.0))) as u32;
        self.pixels
            .iter_mut()
            .for_each(|p| *p = (*p as u32 * keep / 256) as u8);
    }

    /// Fills the square of side `2 * radius + 1` around a dot.
    pub fn dot(&mut self, x: i64, y: i64, radius: i64, colour: [u8; 3]) {
        for dy in -radius..=radius {
            for dx in -radius..=radius {
                if let Some(i) = self.index(x.saturating_add(dx), y.saturating_add(dy)) {
                    self.pixels[i..i + 3].copy_from_slice(&colour);
                }
            }
        }
    }

    /// Draws a line, `2 * radius + 1` dots thick.
    pub fn line(&mut self, from: Point2<f64>, to: Point2<f64>, radius: i64, colour: [u8; 3]) {
        let size = self.size;
        walk(from, to, size, |x, y| self.dot(x, y, radius, colour));
    }

    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let inside = x >= 0 && y >= 0 && x < self.size.width as i64 && y < self.size.height as i64;
        inside.then(|| 3 * (y as usize * self.size.width as usize + x as usize))
    }
}

/// The pixels that dot `i` of `dots` covers, along one side.
fn covered(i: u32, dots: u32, pixels: u32) -> Range<usize> {
    let low = (i as u64 * pixels as u64 / dots as u64) as usize;
    let high = ((i as u64 + 1) * pixels as u64 / dots as u64) as usize;
    low..high.max(low + 1)
}

/// Visits the dots of a line, as far as it lies in a picture of this size; at most one dot past its
/// far borders.
pub fn walk(from: Point2<f64>, to: Point2<f64>, size: Size, mut visit: impl FnMut(i64, i64)) {
    let corner = Point2::new(size.width as f64, size.height as f64);
    let Some([a, b]) = clip(from, to, corner) else {
        return;
    };
    let way = b - a;
    let steps = way.x.abs().max(way.y.abs()).ceil().max(1.0);
    for i in 0..=steps as u64 {
        let at = a + i as f64 / steps * way;
        visit(at.x.floor() as i64, at.y.floor() as i64);
    }
}

/// The part of a line inside the box from 0 to its far `corner` (Liang and Barsky): a far end must
/// not cost a million steps.
fn clip(from: Point2<f64>, to: Point2<f64>, corner: Point2<f64>) -> Option<[Point2<f64>; 2]> {
    let (mut t0, mut t1) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let d = to[axis] - from[axis];
        if !d.is_finite() {
            return None;
        }
        let (low_gap, high_gap) = (-from[axis], corner[axis] - from[axis]);
        if d == 0.0 {
            if low_gap > 0.0 || high_gap < 0.0 {
                return None;
            }
            continue;
        }
        let (enter, leave) = if d > 0.0 {
            (low_gap / d, high_gap / d)
        } else {
            (high_gap / d, low_gap / d)
        };
        t0 = t0.max(enter);
        t1 = t1.min(leave);
    }
    (t0 <= t1).then(|| [t0, t1].map(|t| from + t * (to - from)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaling_takes_the_mean_and_repeats() {
        let from = Rgb {
            size: Size::new(2, 2),
            pixels: [[0u8; 3], [100; 3], [200; 3], [100; 3]].concat(),
        };
        let down = Raster::scaled(&from, Size::new(1, 1)).unwrap();
        assert_eq!(down.pixels, [100; 3]);
        let up = Raster::scaled(&from, Size::new(4, 2)).unwrap();
        assert_eq!(
            (up.at(0, 0), up.at(1, 0), up.at(2, 0), up.at(1, 1)),
            ([0; 3], [0; 3], [100; 3], [200; 3])
        );
        let torn = Rgb {
            size: Size::new(2, 2),
            pixels: vec![0; 5],
        };
        assert_eq!(Raster::scaled(&torn, Size::new(1, 1)), None);
    }

    #[test]
    fn lines_stay_inside() {
        for (from, to, expected) in [
            ([0.5, 0.5], [3.5, 0.5], vec![(0, 0), (1, 0), (2, 0), (3, 0)]),
            (
                [-1e12, 1.5],
                [1e12, 1.5],
                vec![(0, 1), (1, 1), (2, 1), (3, 1)],
            ),
            ([0.5, -9.0], [4.0, -1.0], vec![]),
            ([f64::NAN, 0.0], [1.0, 1.0], vec![]),
            ([f64::INFINITY, 0.0], [1.0, 1.0], vec![]),
            ([1.5, 1.5], [1.5, 1.5], vec![(1, 1)]),
        ] {
            let mut seen = Vec::new();
            walk(from.into(), to.into(), Size::new(4, 4), |x, y| {
                seen.push((x, y))
            });
            seen.dedup();
            seen.retain(|(x, _)| *x < 4);
            assert_eq!(seen, expected, "{from:?} {to:?}");
        }
    }
}
