//! Where on the screen a picture really lies, and which of its pixels a cell shows.

use crate::model::Size;
use nalgebra::Point2;
use ratatui::layout::{Position, Rect};

/// A picture fitted into an area: as large as it can be with its sides' ratio kept, in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// The cells that the picture touches. It starts at their top left corner and may end inside
    /// the last ones.
    pub area: Rect,
    /// Size at which the picture is drawn, in dots.
    pub dots: Size,
    /// Dots in one cell, across and down; with half blocks one across and two down.
    pub cell_dots: (u16, u16),
    /// Size of the picture itself, px.
    pub image: Size,
}

impl Placed {
    /// `None` if there is no room or no picture.
    pub fn fit(image: Size, room: Rect, cell_dots: (u16, u16)) -> Option<Self> {
        let (cw, ch) = (cell_dots.0 as f64, cell_dots.1 as f64);
        if image.width == 0 || image.height == 0 || room.is_empty() || cw * ch == 0.0 {
            return None;
        }
        let (max_w, max_h) = (room.width as f64 * cw, room.height as f64 * ch);
        let scale = (max_w / image.width as f64).min(max_h / image.height as f64);
        let dots_w = (image.width as f64 * scale).round().clamp(1.0, max_w);
        let dots_h = (image.height as f64 * scale).round().clamp(1.0, max_h);
        let (cols, rows) = ((dots_w / cw).ceil() as u16, (dots_h / ch).ceil() as u16);
        let area = Rect::new(
            room.x + (room.width.saturating_sub(cols)) / 2,
            room.y + (room.height.saturating_sub(rows)) / 2,
            cols.min(room.width),
            rows.min(room.height),
        );
        Some(Self {
            area,
            dots: Size::new(dots_w as u32, dots_h as u32),
            cell_dots,
            image,
        })
    }

    /// The picture pixel in the middle of what the cell shows of the picture, `None` for a cell
    /// that shows nothing.
    pub fn pixel_at(&self, column: u16, row: u16) -> Option<Point2<f64>> {
        if !self.area.contains(Position::new(column, row)) {
            return None;
        }
        let (across, down) = self.cell_dots;
        let (x, y) = (column - self.area.x, row - self.area.y);
        Some(Point2::new(
            pixel_along(x, across, self.dots.width, self.image.width)?,
            pixel_along(y, down, self.dots.height, self.image.height)?,
        ))
    }

    /// The dot that shows a picture pixel, with fractions; it may lie outside.
    pub fn dot_from_pixel(&self, pixel: Point2<f64>) -> Point2<f64> {
        Point2::new(
            (pixel.x + 0.5) / self.image.width as f64 * self.dots.width as f64,
            (pixel.y + 0.5) / self.image.height as f64 * self.dots.height as f64,
        )
    }

    /// The cell that shows a picture pixel.
    pub fn cell_from_pixel(&self, pixel: Point2<f64>) -> Option<(u16, u16)> {
        let dot = self.dot_from_pixel(pixel);
        let inside = dot.x >= 0.0
            && dot.y >= 0.0
            && dot.x < self.dots.width as f64
            && dot.y < self.dots.height as f64;
        inside.then(|| {
            (
                self.area.x + (dot.x / self.cell_dots.0 as f64) as u16,
                self.area.y + (dot.y / self.cell_dots.1 as f64) as u16,
            )
        })
    }
}

/// The pixel in the middle of what a cell shows, along one side of the picture of so many `dots`
/// and `pixels`; `None` for a cell beyond its end.
fn pixel_along(cell: u16, dots_in_cell: u16, dots: u32, pixels: u32) -> Option<f64> {
    let low = cell as f64 * dots_in_cell as f64;
    let high = (low + dots_in_cell as f64).min(dots as f64);
    // The first pixel's centre is 0, its border -0.5.
    (low < high).then(|| 0.5 * (low + high) / dots as f64 * pixels as f64 - 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn fits_with_bars_at_the_sides_or_above() {
        for (image, room, area) in [
            // 16:9 in half blocks: 40 dots wide are 22.5 high, that is 11.5 rows.
            ((640, 360), Rect::new(3, 2, 40, 20), Rect::new(3, 6, 40, 12)),
            // The same in a low room: 10 rows are 20 dots, 35.6 wide.
            (
                (640, 360),
                Rect::new(0, 0, 60, 10),
                Rect::new(12, 0, 36, 10),
            ),
            (
                (360, 640),
                Rect::new(0, 0, 60, 10),
                Rect::new(24, 0, 11, 10),
            ),
            ((1, 1), Rect::new(5, 5, 1, 1), Rect::new(5, 5, 1, 1)),
        ] {
            let placed = Placed::fit(Size::new(image.0, image.1), room, (1, 2)).map(|p| p.area);
            assert_eq!(placed, Some(area), "{image:?} in {room:?}");
        }
        assert_eq!(
            Placed::fit(Size::new(0, 9), Rect::new(0, 0, 9, 9), (1, 2)),
            None
        );
        assert_eq!(
            Placed::fit(Size::new(9, 9), Rect::new(0, 0, 0, 9), (1, 2)),
            None
        );
    }

    proptest! {
        #[test]
        fn every_cell_maps_into_the_picture_and_back(
            w in 1u32..5000, h in 1u32..5000, cols in 1u16..250, rows in 1u16..90, cw in 1u16..20, ch in 1u16..40,
        ) {
            let room = Rect::new(7, 3, cols, rows);
            let placed = Placed::fit(Size::new(w, h), room, (cw, ch)).unwrap();
            prop_assert!(room.union(placed.area) == room);
            for row in placed.area.top()..placed.area.bottom() {
                for column in placed.area.left()..placed.area.right() {
                    let pixel = placed.pixel_at(column, row).unwrap();
                    prop_assert!(placed.image.contains(pixel));
                    prop_assert_eq!(placed.cell_from_pixel(pixel), Some((column, row)));
                }
            }
        }
    }
}
