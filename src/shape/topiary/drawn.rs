//! A drawn shape, and where it stands in the picture.

use crate::model::{Outline, Size};
use nalgebra::Point2;

/// Alpha from which on a pixel is inside.
const INSIDE: u8 = 128;

/// Why a drawn shape is not taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TopiaryError {
    #[error(
        "has no transparent pixel, so that the shape fills the whole picture; save it on a transparent background"
    )]
    NoAlpha,
    #[error("is empty: every pixel is transparent; draw the shape opaque")]
    Empty,
    #[error(
        "lies off the tree: the trunk does not reach it; draw it over the tree, or in another size than the picture's"
    )]
    OffTree,
    #[error("is no image that can be read ({0}); give a PNG with a transparent background")]
    NoImage(String),
    #[error("is not whole: {found} bytes where a {size} picture has four a pixel")]
    NotWhole { found: usize, size: Size },
}

/// A shape as it was drawn: the opaque pixels of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawn {
    size: Size,
    inside: Vec<bool>,
    /// Of what is inside: left, top, right, bottom.
    bounds: [u32; 4],
}

impl Drawn {
    /// The shape in the bytes of an image file, PNG for choice.
    ///
    /// # Errors
    /// It is no image, has no transparent pixel, or only such.
    pub fn of_image(bytes: &[u8]) -> Result<Self, TopiaryError> {
        let image = image::load_from_memory(bytes)
            .map_err(|e| TopiaryError::NoImage(e.to_string()))?
            .into_rgba8();
        Self::of_rgba(Size::new(image.width(), image.height()), image.as_raw())
    }

    /// The shape in an image of four bytes a pixel, of which the last is alpha.
    ///
    /// # Errors
    /// It has no transparent pixel, or only such.
    pub fn of_rgba(size: Size, rgba: &[u8]) -> Result<Self, TopiaryError> {
        if rgba.is_empty()
            || rgba.len() as u64 != 4 * u64::from(size.width) * u64::from(size.height)
        {
            return Err(TopiaryError::NotWhole {
                found: rgba.len(),
                size,
            });
        }
        let inside: Vec<bool> = rgba.chunks_exact(4).map(|p| p[3] >= INSIDE).collect();
        if rgba.chunks_exact(4).all(|p| p[3] == u8::MAX) {
            return Err(TopiaryError::NoAlpha);
        }
        let mask: Vec<u8> = inside.iter().map(|i| u8::from(*i) * 255).collect();
        let bounds = Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: None,
        }
        .bounds_px()
        .ok_or(TopiaryError::Empty)?;
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
