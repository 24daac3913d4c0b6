//! A drawn shape, and where it stands in the picture.

use crate::model::{Outline, Size, bounds_px, brightness};
use crate::signal::statistics::otsu;
use nalgebra::Point2;

/// Alpha from which on a pixel is inside.
const INSIDE: u8 = 128;
/// A picture is a mask if this share of it is as good as black or white.
const MASK: f64 = 0.98;
const BLACK: u8 = 16;
const WHITE: u8 = 239;

/// Why a drawn shape is not taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopiaryError {
    #[error(
        "has no shape in it: all its pixels are alike, or the shape fills the whole picture; draw it in white on black"
    )]
    NoShape,
    #[error("is empty: every pixel is transparent; draw the shape opaque")]
    Empty,
    #[error("is a shape of {width}x{height} pixels only; draw it larger")]
    TooSmall { width: u32, height: u32 },
    #[error(
        "lies off the tree: the trunk does not reach it; draw it over the tree, or in another size than the picture's"
    )]
    OffTree,
    #[error("is no image that can be read ({0}); give a PNG")]
    NoImage(String),
    #[error("is not whole: {found} bytes where a {size} picture has four a pixel")]
    NotWhole { found: usize, size: Size },
}

/// Width and height of a shape at least, px: a speck is none.
const LEAST_PX: u32 = 4;

/// A shape as it was drawn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawn {
    size: Size,
    inside: Vec<bool>,
    /// Of what is inside: left, top, right, bottom.
    bounds: [u32; 4],
}

impl Drawn {
    /// The shape in the bytes of an image file, see [`of_rgba`](Self::of_rgba).
    ///
    /// # Errors
    /// It is no image, or has no shape in it.
    pub fn of_image(bytes: &[u8]) -> Result<Self, TopiaryError> {
        let image = image::load_from_memory(bytes)
            .map_err(|e| TopiaryError::NoImage(e.to_string()))?
            .into_rgba8();
        Self::of_rgba(Size::new(image.width(), image.height()), image.as_raw())
    }

    /// The shape in an image of four bytes a pixel, of which the last is alpha: its opaque part.
    /// Without a transparent pixel it is a mask, whose white part is the shape (Zeng 2015 fig. 6.4),
    /// or a photograph of a thing before a plain background (Li 2011 fig. 11), in which what is
    /// darker or brighter than the background is the shape.
    ///
    /// # Errors
    /// All pixels are transparent, or there is no shape in it.
    pub fn of_rgba(size: Size, rgba: &[u8]) -> Result<Self, TopiaryError> {
        if rgba.is_empty()
            || rgba.len() as u64 != 4 * u64::from(size.width) * u64::from(size.height)
        {
            return Err(TopiaryError::NotWhole {
                found: rgba.len(),
                size,
            });
        }
        let inside: Vec<bool> = if rgba.chunks_exact(4).all(|p| p[3] == u8::MAX) {
            of_brightness(size, rgba).ok_or(TopiaryError::NoShape)?
        } else {
            rgba.chunks_exact(4).map(|p| p[3] >= INSIDE).collect()
        };
        Self::of_inside(size, inside)
    }

    /// The shape of a region in a picture.
    ///
    /// # Errors
    /// Nothing is inside.
    pub fn of_region(region: &Outline) -> Result<Self, TopiaryError> {
        Self::of_inside(region.size, region.mask.iter().map(|m| *m != 0).collect())
    }

    fn of_inside(size: Size, inside: Vec<bool>) -> Result<Self, TopiaryError> {
        let mask: Vec<u8> = inside.iter().map(|i| u8::from(*i) * 255).collect();
        let bounds = bounds_px(&mask, size).ok_or(TopiaryError::Empty)?;
        let [left, top, right, bottom] = bounds;
        let (width, height) = (right - left + 1, bottom - top + 1);
        if width.min(height) < LEAST_PX {
            return Err(TopiaryError::TooSmall { width, height });
        }
        Ok(Self {
            size,
            inside,
            bounds,
        })
    }

    fn contains(&self, u: i64, v: i64) -> bool {
        (0..i64::from(self.size.width)).contains(&u)
            && (0..i64::from(self.size.height)).contains(&v)
            && self.inside[(v * i64::from(self.size.width) + u) as usize]
    }

    /// The shape in the picture of `outline`: pixel on pixel if it is of the picture's size; else
    /// scaled, in its own proportions, to the box around the tree's outline, with the middle of its
    /// lowest row on the tree's foot. What comes to lie outside of the picture is lost.
    ///
    /// # Errors
    /// Nothing of it lies in the picture.
    pub fn placed(&self, outline: &Outline, foot_px: Point2<f64>) -> Result<Outline, TopiaryError> {
        let size = outline.size;
        let mask = if self.size == size {
            self.inside.iter().map(|i| u8::from(*i) * 255).collect()
        } else {
            let [left, top, right, bottom] = outline.bounds_px().ok_or(TopiaryError::OffTree)?;
            self.scaled(size, [right - left + 1, bottom - top + 1], foot_px)
        };
        let placed = Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
            other_foot_px: None,
        };
        placed
            .bounds_px()
            .map_or(Err(TopiaryError::OffTree), |_| Ok(placed))
    }

    fn scaled(&self, size: Size, into: [u32; 2], foot_px: Point2<f64>) -> Vec<u8> {
        let [left, top, right, bottom] = self.bounds;
        let scale = (f64::from(into[0]) / f64::from(right - left + 1))
            .min(f64::from(into[1]) / f64::from(bottom - top + 1));
        let mut lowest = (left..=right).filter(|&u| self.contains(u.into(), bottom.into()));
        let first = lowest.next();
        let middle = match (first, lowest.next_back().or(first)) {
            (Some(first), Some(last)) => f64::from(first + last) / 2.0,
            _ => f64::from(left + right) / 2.0,
        };
        let mut mask = Vec::with_capacity(size.area());
        for v in 0..size.height {
            // The lowest row of the shape on the foot's row.
            let y = f64::from(bottom) + 0.5 + (f64::from(v) - foot_px.y - 0.5) / scale;
            for u in 0..size.width {
                let x = middle + (f64::from(u) - foot_px.x) / scale;
                let inside = self.contains(x.round() as i64, y.round() as i64);
                mask.push(u8::from(inside) * 255);
            }
        }
        mask
    }
}

/// Which pixels of an opaque picture are the shape; `None` where all are alike.
fn of_brightness(size: Size, rgba: &[u8]) -> Option<Vec<bool>> {
    let luma: Vec<u8> = rgba
        .chunks_exact(4)
        .map(|p| brightness([p[0], p[1], p[2]]))
        .collect();
    let mut counts = [0_u32; 256];
    for l in &luma {
        counts[usize::from(*l)] += 1;
    }
    if counts.iter().filter(|n| **n > 0).count() < 2 {
        return None;
    }
    let threshold = otsu(&counts);
    let bright: Vec<bool> = luma.iter().map(|l| *l > threshold).collect();
    let extreme = luma.iter().filter(|l| **l <= BLACK || **l >= WHITE).count();
    let is_mask = extreme as f64 >= MASK * luma.len() as f64;
    let is_inverted = !is_mask && 2 * bright_on_border(size, &bright) > border_length(size);
    Some(bright.iter().map(|b| *b != is_inverted).collect())
}

/// Number of pixels on the border of a picture, those in a corner counted twice.
fn border_length(size: Size) -> u64 {
    2 * (u64::from(size.width) + u64::from(size.height))
}

/// How many of them are bright.
fn bright_on_border(size: Size, bright: &[bool]) -> u64 {
    let (w, h) = (size.width as usize, size.height as usize);
    let rows = (0..w).flat_map(|u| [u, (h - 1) * w + u]);
    let columns = (0..h).flat_map(|v| [v * w, v * w + w - 1]);
    rows.chain(columns).filter(|k| bright[*k]).count() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of one grey before another.
    fn disc(within: u8, around: u8) -> Vec<u8> {
        let mut rgba = Vec::new();
        for v in 0..40 {
            for u in 0..60 {
                let is_in = (f64::from(u) - 30.0).hypot(f64::from(v) - 20.0) <= 12.0;
                // Some noise, as in a photograph.
                let grey = if is_in { within } else { around }.saturating_add((u % 3) as u8);
                rgba.extend([grey, grey, grey, 255]);
            }
        }
        rgba
    }

    #[test]
    fn masks_and_photographs_give_the_shape() {
        for (within, around) in [(250, 0), (60, 180), (200, 90)] {
            let drawn = Drawn::of_rgba(Size::new(60, 40), &disc(within, around)).expect("shape");
            assert!(drawn.contains(30, 20) && !drawn.contains(2, 2));
            assert_eq!(drawn.bounds, [18, 8, 42, 32]);
        }
        // White is inside, however much of the border it has.
        let drawn = Drawn::of_rgba(Size::new(60, 40), &disc(0, 250)).expect("shape");
        assert!(!drawn.contains(30, 20) && drawn.contains(2, 2));
    }
}
