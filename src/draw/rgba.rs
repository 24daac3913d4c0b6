//! What was drawn.

use crate::model::{Rgb, Size};
use std::ops::Range;

/// Four bytes a pixel, red first, row by row; alpha is not multiplied in.
#[derive(Clone, Debug, PartialEq)]
pub struct Rgba {
    pub size: Size,
    pub pixels: Vec<u8>,
}

impl Rgba {
    /// Nothing but one colour.
    pub fn of_one(size: Size, rgba: [u8; 4]) -> Self {
        Self {
            size,
            pixels: rgba.repeat(size.area()),
        }
    }

    /// A filmed frame, scaled (each pixel the mean of those that it covers) into a picture of this
    /// size, with its sides' ratio kept and the rest in `around`. `None` if the frame's bytes do
    /// not match its size.
    pub fn of_frame(frame: &Rgb, size: Size, around: [u8; 4]) -> Option<Self> {
        if frame.size.area() == 0 || frame.pixels.len() != 3 * frame.size.area() {
            return None;
        }
        let mut out = Self::of_one(size, around);
        let (fw, fh) = (f64::from(frame.size.width), f64::from(frame.size.height));
        let scale = (f64::from(size.width) / fw).min(f64::from(size.height) / fh);
        let (left, top) = (
            (f64::from(size.width) - scale * fw) / 2.0,
            (f64::from(size.height) - scale * fh) / 2.0,
        );
        for y in 0..size.height {
            for x in 0..size.width {
                let (u, v) = (
                    (f64::from(x) + 0.5 - left) / scale,
                    (f64::from(y) + 0.5 - top) / scale,
                );
                if u < 0.0 || v < 0.0 || u >= fw || v >= fh {
                    continue;
                }
                let rgb = if scale < 1.0 {
                    mean(frame, u, v, 0.5 / scale)
                } else {
                    between(frame, u - 0.5, v - 0.5)
                };
                let at = 4 * (y as usize * size.width as usize + x as usize);
                out.pixels[at..at + 3].copy_from_slice(&rgb);
                out.pixels[at + 3] = 255;
            }
        }
        Some(out)
    }

    /// Draws `over` on top; both must have one size, else nothing happens.
    pub fn put(&mut self, over: &Rgba) {
        if self.size != over.size {
            return;
        }
        for (below, above) in self
            .pixels
            .chunks_exact_mut(4)
            .zip(over.pixels.chunks_exact(4))
        {
            let (a, b) = (u32::from(above[3]), u32::from(below[3]));
            let out = 255 * a + (255 - a) * b;
            if out == 0 {
                continue;
            }
            for c in 0..3 {
                let sum = 255 * a * u32::from(above[c]) + (255 - a) * b * u32::from(below[c]);
                below[c] = ((sum + out / 2) / out) as u8;
            }
            below[3] = ((out + 127) / 255) as u8;
        }
    }

    /// Two pictures of one height side by side; the lower one is filled up with `around`.
    pub fn beside(left: &Rgba, right: &Rgba, around: [u8; 4]) -> Self {
        let size = Size::new(
            left.size.width + right.size.width,
            left.size.height.max(right.size.height),
        );
        let mut out = Self::of_one(size, around);
        for (picture, from) in [(left, 0), (right, left.size.width as usize)] {
            let width = picture.size.width as usize;
            for (y, row) in picture.pixels.chunks_exact((4 * width).max(1)).enumerate() {
                let at = 4 * (y * size.width as usize + from);
                out.pixels[at..at + 4 * width].copy_from_slice(row);
            }
        }
        out
    }

    /// The colour of a pixel; nothing outside.
    pub fn at(&self, x: u32, y: u32) -> [u8; 4] {
        let inside = x < self.size.width && y < self.size.height;
        let at = 4 * (y as usize * self.size.width as usize + x as usize);
        let found = inside.then(|| self.pixels.get(at..at + 4)).flatten();
        found.map_or([0; 4], |p| [p[0], p[1], p[2], p[3]])
    }
}

/// Pixels of a side of `n` that lie within `half` of `c`; at least one.
fn pixels_about(c: f64, half: f64, n: u32) -> Range<usize> {
    let low = ((c - half).round().max(0.0) as usize).min(n as usize - 1);
    low..((c + half).round() as usize).clamp(low + 1, n as usize)
}

/// Mean over a square about (`u`, `v`), whose sides are twice `half`.
fn mean(frame: &Rgb, u: f64, v: f64, half: f64) -> [u8; 3] {
    let columns = pixels_about(u, half, frame.size.width);
    let rows = pixels_about(v, half, frame.size.height);
    let mut sum = [0u64; 3];
    for row in rows.clone() {
        let at = 3 * (row * frame.size.width as usize);
        for p in frame.pixels[at + 3 * columns.start..at + 3 * columns.end].chunks_exact(3) {
            (0..3).for_each(|c| sum[c] += u64::from(p[c]));
        }
    }
    let n = (rows.len() * columns.len()) as u64;
    sum.map(|s| (s / n) as u8)
}

/// Linear between the four pixels about (`u`, `v`), whose centres are whole numbers.
fn between(frame: &Rgb, u: f64, v: f64) -> [u8; 3] {
    let (x0, x1, fx) = neighbours(u, frame.size.width);
    let (y0, y1, fy) = neighbours(v, frame.size.height);
    let [above, below] = [y0, y1].map(|y| {
        let (left, right) = (pixel(frame, x0, y), pixel(frame, x1, y));
        [0, 1, 2].map(|c| left[c] * (1.0 - fx) + right[c] * fx)
    });
    [0, 1, 2].map(|c| (above[c] * (1.0 - fy) + below[c] * fy).round() as u8)
}

/// The two pixels of a side of `n` about `c`, and the share of the second.
fn neighbours(c: f64, n: u32) -> (usize, usize, f64) {
    let c = c.clamp(0.0, f64::from(n - 1));
    let low = c.floor();
    let next = (low as usize + 1).min(n as usize - 1);
    (low as usize, next, c - low)
}

fn pixel(frame: &Rgb, x: usize, y: usize) -> [f64; 3] {
    let at = 3 * (y * frame.size.width as usize + x);
    [0, 1, 2].map(|c| f64::from(frame.pixels[at + c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_covered_pixel_lets_half_of_the_film_through() {
        let mut below = Rgba::of_one(Size::new(3, 1), [200, 0, 0, 255]);
        let over = Rgba {
            size: Size::new(3, 1),
            pixels: [[0, 100, 0, 0], [0, 100, 0, 128], [0, 100, 0, 255]].concat(),
        };
        below.put(&over);
        assert_eq!(
            below.pixels,
            [[200, 0, 0, 255], [100, 50, 0, 255], [0, 100, 0, 255]].concat()
        );
        let mut nothing = Rgba::of_one(Size::new(3, 1), [0; 4]);
        nothing.put(&over);
        assert_eq!(nothing.at(1, 0), [0, 100, 0, 128]);
    }

    #[test]
    fn a_frame_keeps_its_ratio_and_lies_in_the_middle() {
        let frame = Rgb {
            size: Size::new(2, 1),
            pixels: vec![10, 20, 30, 50, 60, 70],
        };
        let grey = [9, 9, 9, 255];
        let large = Rgba::of_frame(&frame, Size::new(8, 8), grey).unwrap();
        assert_eq!(
            (large.at(0, 1), large.at(0, 2), large.at(7, 5)),
            (grey, [10, 20, 30, 255], [50, 60, 70, 255])
        );
        let small = Rgba::of_frame(&frame, Size::new(1, 1), grey).unwrap();
        assert!(
            small.at(0, 0) == [30, 40, 50, 255] || small.at(0, 0) == grey,
            "{small:?}"
        );
        let torn = Rgb {
            size: Size::new(2, 1),
            pixels: vec![1],
        };
        assert_eq!(Rgba::of_frame(&torn, Size::new(8, 8), grey), None);
    }
}
