//! Where the trunk leaves the ground.

use super::Outline;
use nalgebra::Point2;

/// No trunk is thicker than this share of the tree's height.
const THICKEST_TRUNK: f64 = 0.12;
/// Lowest share of the outline's height in which the foot is looked for.
const FOOT_ROWS: f64 = 1.0 / 30.0;

/// Where the trunk leaves the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    pub position_px: Point2<f64>,
    /// Half the outline's width there, px: an upper bound of the trunk's radius, as outlines are
    /// drawn wide.
    pub half_width_px: f64,
}

impl Foot {
    /// The foot of the tree in `outline`: the middle of its lowest rows, where these are no wider
    /// than a trunk can be. Wider ones are more than trunk (a shadow on the ground that moved, a
    /// crown without a trunk, a whole picture): there the foot is what lies below the middle of the
    /// crown, `crown_u` px from the left.
    pub fn of(outline: &Outline, crown_u: Option<f64>) -> Self {
        let Some([left, top, right, bottom]) = outline.bounds_px() else {
            return Self {
                position_px: Point2::origin(),
                half_width_px: 1.0,
            };
        };
        let height = f64::from(bottom - top + 1);
        let rows = (FOOT_ROWS * height) as u32;
        let width = outline.size.width as usize;
        let lowest: Vec<&[u8]> = outline
            .mask
            .chunks_exact(width)
            .take(bottom as usize + 1)
            .skip((bottom - rows) as usize)
            .collect();
        let columns: Vec<u32> = (left..=right)
            .filter(|&u| lowest.iter().any(|row| row[u as usize] != 0))
            .collect();
        let (Some(&first), Some(&last)) = (columns.first(), columns.last()) else {
            return Self {
                position_px: Point2::origin(),
                half_width_px: 1.0,
            };
        };
        let half_width_px = f64::from(last - first + 1) / 2.0;
        let thickest_px = THICKEST_TRUNK * height / 2.0;
        let middle = f64::from(first + last) / 2.0;
        let u = if half_width_px <= thickest_px {
            middle
        } else {
            crown_u
                .unwrap_or(middle)
                .clamp(f64::from(first), f64::from(last))
        };
        Self {
            position_px: Point2::new(u, f64::from(bottom)),
            half_width_px: half_width_px.min(thickest_px),
        }
    }
}
