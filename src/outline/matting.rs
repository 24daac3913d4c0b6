//! Scribbles solved by closed-form matting (Levin, Lischinski and Weiss 2008; Zeng 2015 eq. 2.1 to
//! 2.6).

use super::error::OutlineError;
use super::scribbles::{Mark, Scribbles};
use super::{laplacian, region, solve};
use crate::model::{Outline, Rgb, Size};

/// Gaps between branches up to this share of the picture's width are in the region.
const CLOSE_SHARE: f64 = 0.03;
/// Pictures with a side of at least so many pixels are solved at half their size first, which takes
/// the long waves out of the error.
const LEAST_HALVED: usize = 80;
/// Residuals at which a solution is good enough to start from, and to be used: the second is 0.003
/// from PyMatting's.
const START: f64 = 1e-3;
const ENOUGH: f64 = 5e-5;

/// The tree that scribbles mark in the picture that they were drawn on, which may come smaller than
/// they are.
///
/// # Errors
/// The picture is too small, or OpenCV fails.
pub fn outline(scribbles: &Scribbles, picture: &Rgb) -> Result<Outline, OutlineError> {
    let (small, size) = (picture.size, scribbles.size);
    let Some(solved) = solved(picture, scribbles) else {
        let what = format!("a {small} picture is too small for scribbles");
        return Err(OutlineError::bad_file(&scribbles.name, what));
    };
    let one = one_region(&solved, small, size)
        .map_err(|e| OutlineError::bad_file(&scribbles.name, e))?
        .ok_or_else(|| {
            let what = "the scribbles leave no tree; draw more white strokes on it";
            OutlineError::bad_file(&scribbles.name, what)
        })?;
    Ok(Outline {
        matte: Some(opacity(&enlarged(&solved, small, size))),
        ..one
    })
}

/// The region of `size` in which the opacity `solved` at the size `small` is at least half; `None`
/// where there is none.
fn one_region(solved: &[f64], small: Size, size: Size) -> opencv::Result<Option<Outline>> {
    let close_px = (CLOSE_SHARE * f64::from(small.width)).round() as u32;
    // Closed where it was solved: the time of that grows with the fourth power of the picture's
    // width.
    let Some(one) = region::close_to_one(small, &at_least_half(solved), close_px)? else {
        return Ok(None);
    };
    let inside: Vec<f64> = one
        .mask
        .iter()
        .map(|&m| if m == 0 { 0.0 } else { 1.0 })
        .collect();
    let mask = at_least_half(&enlarged(&inside, small, size));
    region::close_to_one(size, &mask, 0)
}

/// 255 where the opacity is at least half, else 0.
fn at_least_half(alpha: &[f64]) -> Vec<u8> {
    alpha
        .iter()
        .map(|&a| if a >= 0.5 { 255 } else { 0 })
        .collect()
}

/// Opacity of the tree at every pixel of the scribbles, 0 to 255; `None` where the picture is too
/// small.
pub fn alpha(picture: &Rgb, scribbles: &Scribbles) -> Option<Vec<u8>> {
    Some(opacity(&enlarged(
        &solved(picture, scribbles)?,
        picture.size,
        scribbles.size,
    )))
}

fn opacity(alpha: &[f64]) -> Vec<u8> {
    alpha
        .iter()
        .map(|a| (a.clamp(0.0, 1.0) * 255.0).round() as u8)
        .collect()
}

/// The solution at the picture's size.
fn solved(picture: &Rgb, scribbles: &Scribbles) -> Option<Vec<f64>> {
    let size = picture.size;
    if (size.width.min(size.height) as usize) < solve::LEAST_SIDE
        || picture.pixels.len() != 3 * size.area()
    {
        return None;
    }
    let colours = picture
        .pixels
        .chunks_exact(3)
        .map(|p| [p[0], p[1], p[2]].map(|c| f64::from(c) / 255.0))
        .collect();
    let marks = reduced(&scribbles.marks, scribbles.size, size);
    Some(
        Level {
            size,
            colours,
            marks,
        }
        .solve(ENOUGH),
    )
}

/// The problem at one size.
struct Level {
    size: Size,
    colours: Vec<[f64; 3]>,
    marks: Vec<Mark>,
}

impl Level {
    fn solve(&self, tolerance: f64) -> Vec<f64> {
        let (width, height) = (self.size.width as usize, self.size.height as usize);
        let mut x = match width.min(height) >= LEAST_HALVED {
            true => {
                let half = self.halved();
                enlarged(&half.solve(START), half.size, self.size)
            }
            false => vec![0.5; self.marks.len()],
        };
        let mut matrix = laplacian::of(&self.colours, &self.marks, width);
        let right = matrix.decide(&self.marks);
        for (x, mark) in x.iter_mut().zip(&self.marks) {
            match mark {
                Mark::Tree => *x = 1.0,
                Mark::Background => *x = 0.0,
                Mark::Undecided => {}
            }
        }
        // What the strokes say to the others; the rows of the strokes themselves are solved from
        // the start.
        let told = right
            .iter()
            .zip(&self.marks)
            .filter(|(_, m)| **m == Mark::Undecided)
            .map(|(b, _)| b * b)
            .sum::<f64>();
        solve::conjugate_gradients(
            &matrix,
            &right,
            &mut x,
            width,
            tolerance * told.sqrt().max(1.0),
        );
        x
    }

    fn halved(&self) -> Level {
        let size = Size::new(self.size.width / 2, self.size.height / 2);
        let width = self.size.width as usize;
        let mut colours = Vec::with_capacity(size.area());
        for v in 0..size.height as usize {
            for u in 0..size.width as usize {
                let at = 2 * v * width + 2 * u;
                let four = [at, at + 1, at + width, at + width + 1].map(|i| self.colours[i]);
                colours.push(std::array::from_fn(|c| {
                    four.iter().map(|p| p[c]).sum::<f64>() / 4.0
                }));
            }
        }
        Level {
            size,
            colours,
            marks: reduced(&self.marks, self.size, size),
        }
    }
}

/// The marks of a smaller picture: a pixel has the mark that most of the decided ones in it have.
fn reduced(marks: &[Mark], from: Size, to: Size) -> Vec<Mark> {
    if from == to {
        return marks.to_vec();
    }
    let mut votes = vec![(0u32, 0u32); to.area()];
    for (i, mark) in marks.iter().enumerate() {
        let (u, v) = (
            i as u64 % u64::from(from.width),
            i as u64 / u64::from(from.width),
        );
        let (u, v) = (
            u * u64::from(to.width) / u64::from(from.width),
            v * u64::from(to.height) / u64::from(from.height),
        );
        let (tree, background) = &mut votes[(v * u64::from(to.width) + u) as usize];
        *tree += u32::from(*mark == Mark::Tree);
        *background += u32::from(*mark == Mark::Background);
    }
    votes.into_iter().map(majority).collect()
}

/// What most of the decided pixels are, by the votes for tree and for background.
fn majority((tree, background): (u32, u32)) -> Mark {
    match (tree, background) {
        (0, 0) => Mark::Undecided,
        _ if tree >= background => Mark::Tree,
        _ => Mark::Background,
    }
}

/// Values at a larger size, bilinear.
fn enlarged(values: &[f64], from: Size, to: Size) -> Vec<f64> {
    if from == to {
        return values.to_vec();
    }
    let columns: Vec<Between> = (0..to.width)
        .map(|u| Between::of(u, from.width, to.width))
        .collect();
    let width = from.width as usize;
    let mut into = Vec::with_capacity(to.area());
    for v in 0..to.height {
        let rows = Between::of(v, from.height, to.height);
        let [above, below] = [rows.low, rows.high].map(|v| &values[v * width..][..width]);
        for column in &columns {
            let (upper, lower) = (column.mix(above), column.mix(below));
            into.push(upper * (1.0 - rows.share) + lower * rows.share);
        }
    }
    into
}

/// A place between two pixels of a smaller picture.
struct Between {
    low: usize,
    high: usize,
    /// How far it is from the low one to the high one, 0 to 1.
    share: f64,
}

impl Between {
    /// Where pixel `i` of `to` is among `from` pixels.
    fn of(i: u32, from: u32, to: u32) -> Self {
        let at = (f64::from(i) + 0.5) * f64::from(from) / f64::from(to) - 0.5;
        let at = at.clamp(0.0, f64::from(from - 1));
        Self {
            low: at as usize,
            high: (at as usize + 1).min(from as usize - 1),
            share: at.fract(),
        }
    }

    fn mix(&self, values: &[f64]) -> f64 {
        values[self.low] * (1.0 - self.share) + values[self.high] * self.share
    }
}
