//! Which pixels are tree.

use super::Size;
use nalgebra::Point2;

/// The region of the picture in which the tree stands, as a mask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outline {
    pub size: Size,
    /// One byte a pixel, row by row: 255 inside, 0 outside.
    pub mask: Vec<u8>,
    /// The region's border in pixels, for drawing; closed, not repeating its first point.
    pub polygon_px: Vec<Point2<i32>>,
    /// Opacity of the tree, 0 to 255, row by row, where the region was solved from scribbles: the
    /// sky between its branches has none, though it is inside.
    pub matte: Option<Vec<u8>>,
    /// Where another trunk stands that the region holds, px: known of outlines that were found by
    /// motion.
    pub other_foot_px: Option<Point2<i32>>,
}

impl Outline {
    /// Whether the pixel nearest to (`u_px`, `v_px`) is tree; outside the picture nothing is.
    pub fn contains(&self, u_px: f64, v_px: f64) -> bool {
        let pixel = self.size.pixel_at(Point2::new(u_px, v_px));
        pixel.is_some_and(|pixel| self.mask[pixel] != 0)
    }

    /// Whether the pixel in column `u` and row `v` is tree; outside the picture none is.
    pub fn has(&self, u: u32, v: u32) -> bool {
        let at = v as usize * self.size.width as usize + u as usize;
        u < self.size.width && self.mask.get(at).is_some_and(|&m| m != 0)
    }

    /// Smallest box `[u_min, v_min, u_max, v_max]` that holds the region, `None` if it is empty.
    pub fn bounds_px(&self) -> Option<[u32; 4]> {
        bounds_px(&self.mask, self.size)
    }

    /// Share of the picture that the region covers, 0 to 1.
    pub fn coverage(&self) -> f64 {
        self.mask.iter().filter(|&&m| m != 0).count() as f64 / self.mask.len().max(1) as f64
    }
}

/// Smallest box `[u_min, v_min, u_max, v_max]` that holds the pixels of `mask` (one byte a pixel,
/// row by row) that are not 0, the ends included; `None` if all are 0.
pub fn bounds_px(mask: &[u8], size: Size) -> Option<[u32; 4]> {
    let width = (size.width as usize).max(1);
    let mut bounds: Option<[u32; 4]> = None;
    for (v, row) in mask.chunks_exact(width).enumerate() {
        let Some(first) = row.iter().position(|&m| m != 0) else {
            continue;
        };
        let last = row.iter().rposition(|&m| m != 0).unwrap_or(first);
        let b = bounds.get_or_insert([first as u32, v as u32, last as u32, v as u32]);
        *b = [
            b[0].min(first as u32),
            b[1],
            b[2].max(last as u32),
            v as u32,
        ];
    }
    bounds
}
