//! Rectangles of whole pixels.

use crate::config::MarkerWindow;
use crate::model::Size;
use nalgebra::{Point2, Vector2};

/// A rectangle of whole pixels; it may reach off the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelArea {
    /// Its left and upper edge.
    pub u: i32,
    pub v: i32,
    pub width: i32,
    pub height: i32,
}

impl PixelArea {
    /// The window that a user gave, in whole pixels.
    pub fn of_window(given: &MarkerWindow) -> Self {
        let [u, v, width, height] = given.window_px.map(|side| side.round() as i32);
        Self {
            u,
            v,
            width,
            height,
        }
    }

    /// The area of about this size around a place, px.
    pub fn around(middle_px: Point2<f64>, size_px: Vector2<f64>) -> Self {
        let size = size_px.map(|side| side.round().max(1.0));
        let corner = middle_px.coords + Vector2::repeat(0.5) - 0.5 * size;
        Self {
            u: corner.x.round() as i32,
            v: corner.y.round() as i32,
            width: size.x as i32,
            height: size.y as i32,
        }
    }

    /// Its middle, px: the centre of pixel (0, 0) is (0, 0).
    pub fn middle_px(&self) -> Point2<f64> {
        let size = Vector2::new(f64::from(self.width), f64::from(self.height));
        let corner = Point2::new(f64::from(self.u), f64::from(self.v));
        corner + 0.5 * size - Vector2::repeat(0.5)
    }

    /// Width and height, px.
    pub fn size_px(&self) -> Vector2<f64> {
        Vector2::new(f64::from(self.width), f64::from(self.height))
    }

    /// It, larger by so many of its own sizes on each side.
    pub fn grown(&self, by: f64) -> Self {
        Self::around(self.middle_px(), (1.0 + 2.0 * by) * self.size_px())
    }

    /// The part that lies in a picture of this size; `None` where there is none.
    pub fn within(&self, size: Size) -> Option<Self> {
        let (width, height) = (size.width as i32, size.height as i32);
        let (u, v) = (self.u.max(0), self.v.max(0));
        let right = self.u.saturating_add(self.width).min(width);
        let bottom = self.v.saturating_add(self.height).min(height);
        (u < right && v < bottom).then(|| Self {
            u,
            v,
            width: right - u,
            height: bottom - v,
        })
    }

    /// What it has in common with another; without width or height where that is nothing.
    pub fn common(&self, other: &Self) -> Self {
        let (u, v) = (self.u.max(other.u), self.v.max(other.v));
        let right = (self.u + self.width).min(other.u + other.width);
        let bottom = (self.v + self.height).min(other.v + other.height);
        Self {
            u,
            v,
            width: (right - u).max(0),
            height: (bottom - v).max(0),
        }
    }

    /// The same in an area whose corner is that of `outer`.
    pub fn relative_to(&self, outer: &Self) -> Self {
        Self {
            u: self.u - outer.u,
            v: self.v - outer.v,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_area_lies_around_its_middle_and_is_cut_at_the_edge() {
        let area = PixelArea::around(Point2::new(10.0, 4.0), Vector2::new(5.0, 3.0));
        assert_eq!(
            area,
            PixelArea {
                u: 8,
                v: 3,
                width: 5,
                height: 3
            }
        );
        assert_eq!(area.middle_px(), Point2::new(10.0, 4.0));
        let cut = PixelArea {
            u: -2,
            v: 3,
            width: 5,
            height: 30,
        }
        .within(Size::new(8, 9));
        assert_eq!(
            cut,
            Some(PixelArea {
                u: 0,
                v: 3,
                width: 3,
                height: 6
            })
        );
        assert_eq!(
            PixelArea {
                u: 8,
                v: 0,
                width: 5,
                height: 5
            }
            .within(Size::new(8, 9)),
            None
        );
    }
}
