//! Lines that are drawn into masks.

use super::mask::WoodMask;
use super::{Stroke, length_px};
use crate::model::Size;
use nalgebra::Point2;
use opencv::core::{CV_8U, Mat, Point, Scalar, Vector};
use opencv::imgproc::{LINE_8, polylines};
use opencv::prelude::*;

/// Width of a stroke, px.
pub(super) const STROKE_PX: i32 = 2;
/// Strokes are drawn no farther than this from the first pixel, px: whole numbers hold it.
const FARTHEST: f64 = 30_000.0;
/// Places of lines are given to OpenCV in parts of a pixel, so many bits of them.
const PIXEL_BITS: i32 = 4;

/// So great a part of a stroke, from below, shows the trunk's bark and width.
pub(super) const LOW: f64 = 0.5;

/// The line from its beginning on, to this share of its length.
pub(super) fn lower_part(line: &Stroke, share: f64) -> Stroke {
    let mut left_px = share * length_px(line);
    let mut part = Stroke::new();
    part.extend(line.first());
    for ends in line.windows(2) {
        let way = ends[1] - ends[0];
        let length_px = way.norm();
        if length_px >= left_px {
            part.push(ends[0] + way * (left_px / length_px.max(f64::MIN_POSITIVE)));
            break;
        }
        part.push(ends[1]);
        left_px -= length_px;
    }
    part
}

/// Which pixels of the mask `wood` the strokes are drawn on.
pub(super) fn drawn(strokes: &[Stroke], wood: &WoodMask) -> opencv::Result<Vec<bool>> {
    let mut lines: Vec<Stroke> = Vec::with_capacity(strokes.len());
    for stroke in strokes {
        lines.push(stroke.iter().map(|at| wood.to_mask(*at)).collect());
    }
    on_lines(&lines, wood.size, STROKE_PX * wood.scale as i32)
}

/// Which pixels of a picture of this `size` lines of this width (px) are drawn on.
pub(super) fn on_lines(lines: &[Stroke], size: Size, width_px: i32) -> opencv::Result<Vec<bool>> {
    let (rows, cols) = (size.height as i32, size.width as i32);
    let mut mask = Mat::zeros(rows, cols, CV_8U)?.to_mat()?;
    for line in lines {
        draw_line(&mut mask, line, Scalar::all(1.0), width_px)?;
    }
    Ok(mask.data_bytes()?.iter().map(|m| *m != 0).collect())
}

/// Draws a line of this width, px. Its places are not rounded to pixels: one that is drawn half a pixel
/// beside another covers nearly the same.
pub(super) fn draw_line(
    mask: &mut Mat,
    places: &[Point2<f64>],
    colour: Scalar,
    width_px: i32,
) -> opencv::Result<()> {
    let parts = f64::from(1 << PIXEL_BITS);
    let mut corners = Vector::<Point>::new();
    for at in places {
        let [u, v] = [at.x, at.y].map(|c| (parts * c.clamp(-FARTHEST, FARTHEST)).round() as i32);
        corners.push(Point::new(u, v));
    }
    polylines(mask, &corners, false, colour, width_px, LINE_8, PIXEL_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lower_part_of_a_line_is_cut_at_its_share_of_the_length() {
        let line = [(0.0, 30.0), (0.0, 20.0), (10.0, 20.0), (10.0, 10.0)];
        let line: Stroke = line.map(|(u, v)| Point2::new(u, v)).to_vec();
        let half = [(0.0, 30.0), (0.0, 20.0), (5.0, 20.0)];
        let half: Stroke = half.map(|(u, v)| Point2::new(u, v)).to_vec();
        assert_eq!(lower_part(&line, 0.5), half);
        assert_eq!(lower_part(&line, 1.0), line);
        assert_eq!(lower_part(&Stroke::new(), 0.5), Stroke::new());
        let point = vec![Point2::new(3.0, 4.0)];
        assert_eq!(lower_part(&point, 0.5), point);
    }
}
