//! How thick the trunk is, as far as the outline tells.

use crate::bounds::Bounds;
use crate::model::Outline;
use nalgebra::Point2;

/// Share of the outline's width that is trunk: outlines are drawn wide, masks that are found by
/// motion are wider still.
const TRUNK_SHARE: f64 = 0.5;
/// Part of the way from the foot to the trunk's top that is looked at: below it roots and the
/// ground, above it the fork.
const LOOKED_AT: Bounds = Bounds::new(0.1, 0.8);
/// Rows that are enough to measure in.
const LEAST_ROWS: usize = 4;
/// No trunk is thicker than this share of the way from its foot to the top of the outline.
const THICKEST: f64 = 0.12;

/// Half the trunk's width between its foot and its top, px; `None` where the outline has no trunk
/// there, or where it is wider than a trunk can be.
///
/// In each row the run of the outline that the line from foot to top goes through. A run may be
/// wider than the trunk for many reasons, a fork or a low branch, and narrower for none, so the
/// lower quartile of their widths counts: half of it, or where the outline has a matte, what is
/// opaque of it.
pub fn trunk_radius_px(
    outline: &Outline,
    foot_px: Point2<f64>,
    top_px: Point2<f64>,
) -> Option<f64> {
    let rise = foot_px.y - top_px.y;
    if !(foot_px.iter().chain(top_px.iter()).all(|x| x.is_finite()) && rise > 0.0) {
        return None;
    }
    let mut widths: Vec<f64> = Vec::new();
    for v in 0..outline.size.height as usize {
        let share = (foot_px.y - v as f64) / rise;
        let u = foot_px.x + share * (top_px.x - foot_px.x);
        if LOOKED_AT.contains(share) && outline.contains(u, v as f64) {
            widths.push(width_in_row(outline, u.round() as usize, v));
        }
    }
    widths.sort_unstable_by(f64::total_cmp);
    let narrow = *widths
        .get(widths.len() / 4)
        .filter(|_| widths.len() >= LEAST_ROWS)?;
    let tall = foot_px.y - f64::from(outline.bounds_px()?[1]);
    (narrow > 0.0 && narrow <= THICKEST * tall).then_some(0.5 * narrow)
}

/// Width of the trunk in row `v`, where the outline has it at column `u`, px.
fn width_in_row(outline: &Outline, u: usize, v: usize) -> f64 {
    let width = outline.size.width as usize;
    let row = &outline.mask[v * width..(v + 1) * width];
    let left = row[..u].iter().rposition(|&m| m == 0).map_or(0, |k| k + 1);
    let right = row[u..]
        .iter()
        .position(|&m| m == 0)
        .map_or(width, |k| u + k);
    let matte = outline.matte.as_ref();
    match matte.and_then(|m| m.get(v * width + left..v * width + right)) {
        Some(alpha) => opaque_px(alpha),
        None => TRUNK_SHARE * (right - left) as f64,
    }
}

fn opaque_px(alpha: &[u8]) -> f64 {
    alpha.iter().map(|&a| f64::from(a) / 255.0).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Size;

    /// A trunk `width` px wide in an outline drawn 8 px wider on either side, 100 rows high, below
    /// a crown.
    fn outline(width: usize, matte: bool) -> Outline {
        let size = Size::new(200, 200);
        let (mut mask, mut alpha) = (vec![0; 200 * 200], vec![0; 200 * 200]);
        for v in 0..200 {
            let half = if v < 100 { 80 } else { width / 2 };
            for u in 0..200usize {
                mask[v * 200 + u] = if u.abs_diff(100) <= half + 8 { 255 } else { 0 };
                alpha[v * 200 + u] = if v >= 100 && u >= 100 - half && u < 100 + half {
                    255
                } else {
                    0
                };
            }
        }
        Outline {
            size,
            mask,
            polygon_px: Vec::new(),
            matte: matte.then_some(alpha),
            other_foot_px: None,
        }
    }

    #[test]
    fn a_matte_gives_the_width_itself_and_an_outline_half_of_its_own() {
        let (foot, top) = (Point2::new(100.0, 199.0), Point2::new(100.0, 90.0));
        assert_eq!(trunk_radius_px(&outline(10, true), foot, top), Some(5.0));
        let drawn = trunk_radius_px(&outline(10, false), foot, top).expect("a trunk");
        assert!((drawn - 27.0 / 4.0).abs() < 0.6, "{drawn}");
    }

    #[test]
    fn where_there_is_no_trunk_nothing_is_made_up() {
        let wide = outline(120, false);
        assert_eq!(
            trunk_radius_px(&wide, Point2::new(100.0, 199.0), Point2::new(100.0, 90.0)),
            None,
            "wider than a trunk can be"
        );
        assert_eq!(
            trunk_radius_px(&wide, Point2::new(100.0, 90.0), Point2::new(100.0, 199.0)),
            None,
            "upside down"
        );
        assert_eq!(
            trunk_radius_px(
                &wide,
                Point2::new(f64::NAN, 199.0),
                Point2::new(100.0, 90.0)
            ),
            None
        );
        assert_eq!(
            trunk_radius_px(&wide, Point2::new(900.0, 199.0), Point2::new(900.0, 90.0)),
            None,
            "beside the picture"
        );
    }
}
