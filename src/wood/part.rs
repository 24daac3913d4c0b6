//! Upright rectangles of a picture.

use crate::model::{Foot, Size, bounds_px};
use opencv::core::Rect;

/// The trunk is looked for by its colour over so great a share of the tree's height above the foot.
const TRUNK_HEIGHT: f64 = 0.08;

/// A part of a picture, the ends not included, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    left: u32,
    top: u32,
    right: u32,
    bottom: u32,
}

impl Part {
    /// The smallest part that holds all of the region; `None` where it is empty.
    pub fn holding(region: &[u8], size: Size) -> Option<Self> {
        let [left, top, last_u, last_v] = bounds_px(region, size)?;
        Some(Self {
            left,
            top,
            right: last_u + 1,
            bottom: last_v + 1,
        })
    }

    /// Where the lowest part of the trunk is.
    pub fn above_foot(foot: Foot, tree: Part, size: Size) -> Self {
        let foot_px = foot.position_px;
        let height = TRUNK_HEIGHT * f64::from(tree.bottom - tree.top);
        let half_width = foot.half_width_px;
        Self {
            left: clamped(foot_px.x - half_width, size.width),
            top: clamped(foot_px.y - height, size.height),
            right: clamped(foot_px.x + half_width, size.width),
            bottom: clamped(foot_px.y, size.height),
        }
    }

    /// The same in a picture `scale` times as large.
    pub fn enlarged(self, scale: u32) -> Self {
        Self {
            left: scale * self.left,
            top: scale * self.top,
            right: scale * self.right,
            bottom: scale * self.bottom,
        }
    }

    /// The same and all that is no farther from it than `by_px`, as far as there is a picture.
    pub fn widened(self, by_px: u32, size: Size) -> Self {
        Self {
            left: self.left.saturating_sub(by_px),
            top: self.top.saturating_sub(by_px),
            right: (self.right + by_px).min(size.width),
            bottom: (self.bottom + by_px).min(size.height),
        }
    }

    pub fn as_rect(self) -> Rect {
        let [left, top, right, bottom] =
            [self.left, self.top, self.right, self.bottom].map(|px| px as i32);
        Rect::new(left, top, right - left, bottom - top)
    }

    /// Whether it is as high as `v`, and not farther off to the side than its own width.
    pub fn is_beside(self, u: u32, v: u32) -> bool {
        let width = self.right - self.left;
        let is_near = u + width >= self.left && u < self.right + width;
        (self.top..self.bottom).contains(&v) && is_near && !self.holds(u, v)
    }

    pub fn holds(self, u: u32, v: u32) -> bool {
        (self.left..self.right).contains(&u) && (self.top..self.bottom).contains(&v)
    }
}

/// A place along a side of the picture, 0 to `most` px.
fn clamped(px: f64, most: u32) -> u32 {
    px.clamp(0.0, f64::from(most)) as u32
}
