//! The grid on which colour and density are counted: the picture, made smaller where it is large.

use crate::model::{Outline, Rgb, Size, Skeleton};
use nalgebra::{Point2, Point3, Vector2};
use std::ops::Range;

/// Wider pictures are counted at a whole part of their width: leaves are chosen by their density,
/// not by the pixel.
const LARGEST_PX: u32 = 800;

/// A grid over the source image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    pub size: Size,
    /// Cells in a pixel of the source image, across and down.
    scale: Vector2<f64>,
    foot_px: Point2<f64>,
}

impl Grid {
    pub fn of(skeleton: &Skeleton) -> Self {
        let Size { width, height } = skeleton.image_size;
        let part = width.max(height).div_ceil(LARGEST_PX).max(1);
        let size = Size::new((width / part).max(1), (height / part).max(1));
        let scale = Vector2::new(
            f64::from(size.width) / f64::from(width.max(1)),
            f64::from(size.height) / f64::from(height.max(1)),
        );
        Self {
            size,
            scale,
            foot_px: skeleton.foot_px,
        }
    }

    /// The place in the grid of a pixel of the source image; the centre of the first cell is (0,
    /// 0).
    pub fn cell_of_pixel(&self, p: Point2<f64>) -> Point2<f64> {
        Point2::new(
            (p.x + 0.5) * self.scale.x - 0.5,
            (p.y + 0.5) * self.scale.y - 0.5,
        )
    }

    /// The point in model axes that is seen at `cell`, at depth `z`.
    pub fn model_at(&self, cell: Point2<f64>, z: f64) -> Point3<f64> {
        let u = (cell.x + 0.5) / self.scale.x - 0.5;
        let v = (cell.y + 0.5) / self.scale.y - 0.5;
        Point3::new(u - self.foot_px.x, self.foot_px.y - v, z)
    }

    /// The front view of a point in model axes.
    pub fn cell_of(&self, p: &Point3<f64>) -> Point2<f64> {
        self.cell_of_pixel(Point2::new(self.foot_px.x + p.x, self.foot_px.y - p.y))
    }

    /// Pixels of the source image to cells.
    pub fn length(&self, px: f64) -> f64 {
        px * self.scale.x
    }

    pub fn area(&self) -> usize {
        self.size.area()
    }

    /// The cell that holds a place, if one does.
    pub fn index(&self, cell: Point2<f64>) -> Option<usize> {
        let ok = cell.x.is_finite() && cell.y.is_finite() && self.size.contains(cell);
        ok.then(|| {
            let (u, v) = (
                cell.x.round().max(0.0) as usize,
                cell.y.round().max(0.0) as usize,
            );
            v * self.size.width as usize + u
        })
    }

    /// Means of `channels` bytes a pixel over what of a picture of `from` lies in each cell.
    pub fn reduced(&self, pixels: &[u8], from: Size, channels: usize) -> Option<Vec<u8>> {
        let (w, h) = (from.width as usize, from.height as usize);
        if w == 0 || h == 0 || pixels.len() != channels * w * h {
            return None;
        }
        if from == self.size {
            return Some(pixels.to_vec());
        }
        let (cw, ch) = (self.size.width as usize, self.size.height as usize);
        let mut out = Vec::with_capacity(channels * cw * ch);
        for v in 0..ch {
            for u in 0..cw {
                let (rows, columns) = (pixels_of(v, ch, h), pixels_of(u, cw, w));
                let n = (rows.len() * columns.len()) as u32;
                for c in 0..channels {
                    let mut sum = 0u32;
                    for y in rows.clone() {
                        for x in columns.clone() {
                            sum += u32::from(pixels[channels * (y * w + x) + c]);
                        }
                    }
                    out.push(((sum + n / 2) / n) as u8);
                }
            }
        }
        Some(out)
    }
}

/// The pixels of a row or column of `count` that lie in cell `k` of `cells`.
fn pixels_of(k: usize, cells: usize, count: usize) -> Range<usize> {
    let first = k * count / cells;
    first..((k + 1) * count / cells).clamp(first + 1, count.max(first + 1))
}

/// Picture and outline on the grid.
pub(super) struct Canvas {
    pub grid: Grid,
    pub colours: Vec<[u8; 3]>,
    pub inside: Vec<bool>,
    /// Opacity of the tree, 0 to 1, where the outline knows it.
    pub matte: Option<Vec<f32>>,
}

impl Canvas {
    /// `None` where the picture or the outline is not what its size says, or nothing is inside.
    pub fn new(grid: Grid, picture: &Rgb, outline: &Outline) -> Option<Self> {
        let bytes = grid.reduced(&picture.pixels, picture.size, 3)?;
        let colours = bytes.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        let mask = grid.reduced(&outline.mask, outline.size, 1)?;
        let inside: Vec<bool> = mask.iter().map(|&m| m > 127).collect();
        let matte = match &outline.matte {
            Some(matte) => Some(
                grid.reduced(matte, outline.size, 1)?
                    .iter()
                    .map(|&a| f32::from(a) / 255.0)
                    .collect(),
            ),
            None => None,
        };
        inside.contains(&true).then_some(Self {
            grid,
            colours,
            inside,
            matte,
        })
    }

    /// First and last row with something inside.
    pub fn rows(&self) -> (usize, usize) {
        let w = self.grid.size.width as usize;
        let first = self.inside.iter().position(|&m| m).unwrap_or(0);
        let last = self.inside.iter().rposition(|&m| m).unwrap_or(0);
        (first / w, last / w)
    }
}

/// Brightness of a colour (Rec. 601), 0 to 255.
pub(super) fn luma([r, g, b]: [u8; 3]) -> f64 {
    0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
}
