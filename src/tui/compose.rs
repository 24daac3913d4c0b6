//! The picture with what is known about it drawn on top, whatever the way in which it reaches the
//! screen.

use super::drawing::Drawing;
use super::placed::Placed;
use super::raster::{Raster, walk};
use super::theme::Theme;
use crate::model::{Size, Snapshot};

const OUTLINE: [u8; 3] = [0xff, 0xd8, 0x30];
const DRAWN: [u8; 3] = [0xff, 0x40, 0xff];
const CURSOR: [u8; 3] = [0xff, 0xff, 0xff];
/// How far points on trial cover the picture, as a share of the others.
const FAINT: f64 = 0.4;

/// Size of the picture in which outline and points are given; the preview itself may be smaller.
pub fn image_size(snapshot: &Snapshot) -> Option<Size> {
    let size = snapshot
        .image_size
        .or_else(|| snapshot.preview.as_ref().map(|p| p.size))?;
    (size.area() > 0).then_some(size)
}

/// Picture, outline and points, or while the user draws the polygon drawn so far instead of the
/// points.
pub fn picture(
    snapshot: &Snapshot,
    drawing: Option<&Drawing>,
    placed: &Placed,
    theme: Theme,
) -> Option<Raster> {
    let mut raster = Raster::scaled(snapshot.preview.as_deref()?, placed.dots)?;
    let fine = (placed.dots.width / 320) as i64;
    // In a coarse picture the points lie side by side and would hide the tree.
    let cover = if placed.dots.width < 100 { 0.6 } else { 1.0 };
    let marked = !snapshot.points.is_empty() || drawing.is_some();
    if marked {
        // The points must stand out from a sunlit tree.
        raster.darken(0.3);
    }
    if let Some(drawing) = drawing {
        let points = drawing.points_px();
        let closed = points.len() >= 3;
        for (a, b) in edges(points, closed) {
            raster.line(
                placed.dot_from_pixel(a),
                placed.dot_from_pixel(b),
                fine,
                DRAWN,
            );
        }
        for p in points {
            // In a coarse picture a corner with a border would hide what it is set on.
            if fine > 0 {
                mark(&mut raster, placed, *p, fine + 1, DRAWN, 1.0);
            }
            mark(&mut raster, placed, *p, fine, CURSOR, 1.0);
        }
        if let Some(cursor) = drawing.cursor_px() {
            cross(&mut raster, placed, cursor, fine);
        }
        return Some(raster);
    }
    for (a, b) in edges(&outline(snapshot), true) {
        raster.line(
            placed.dot_from_pixel(a),
            placed.dot_from_pixel(b),
            fine / 2,
            OUTLINE,
        );
    }
    for [u, v] in &snapshot.candidates_px {
        mark(
            &mut raster,
            placed,
            [*u as f64, *v as f64],
            fine,
            theme.branch_rgb(None),
            FAINT * cover,
        );
    }
    for ([u, v], branch) in &snapshot.points {
        mark(
            &mut raster,
            placed,
            [*u as f64, *v as f64],
            fine,
            theme.branch_rgb(*branch),
            cover,
        );
    }
    Some(raster)
}

/// The same as letters, for terminals without colour: a cell is dark or bright, `#` the outline,
/// digits main branches.
pub fn letters(
    snapshot: &Snapshot,
    drawing: Option<&Drawing>,
    placed: &Placed,
) -> Option<Vec<Vec<char>>> {
    const RAMP: [char; 6] = [' ', '.', ':', '-', '=', '+'];
    let cells = Size::new(placed.area.width as u32, placed.area.height as u32);
    let raster = Raster::scaled(snapshot.preview.as_deref()?, cells)?;
    let shade = |[r, g, b]: [u8; 3]| {
        RAMP[(2 * r as usize + 5 * g as usize + b as usize) / 8 * RAMP.len() / 256]
    };
    let mut rows: Vec<Vec<char>> = (0..cells.height)
        .map(|y| (0..cells.width).map(|x| shade(raster.at(x, y))).collect())
        .collect();
    let mut put = |x: i64, y: i64, c: char| {
        if let Some(cell) = rows
            .get_mut(y.max(0) as usize)
            .and_then(|r| r.get_mut(x.max(0) as usize))
        {
            *cell = c;
        }
    };
    let cell = |p: [f64; 2]| {
        let [x, y] = placed.dot_from_pixel(p);
        [x / placed.cell_dots.0 as f64, y / placed.cell_dots.1 as f64]
    };
    let polygon = drawing.map_or_else(|| outline(snapshot), |d| d.points_px().to_vec());
    for (a, b) in edges(&polygon, drawing.is_none() || polygon.len() >= 3) {
        walk(cell(a), cell(b), cells, |x, y| put(x, y, '#'));
    }
    let mut point = |p: [f64; 2], c: char| walk(cell(p), cell(p), cells, |x, y| put(x, y, c));
    match drawing {
        Some(drawing) => {
            polygon.iter().for_each(|p| point(*p, 'O'));
            drawing.cursor_px().into_iter().for_each(|p| point(p, 'X'));
        }
        None => {
            snapshot
                .candidates_px
                .iter()
                .for_each(|p| point(p.map(f64::from), ','));
            for ([u, v], branch) in &snapshot.points {
                let c = branch.map_or('o', |b| (b'0' + b % 8) as char);
                point([*u as f64, *v as f64], c);
            }
        }
    }
    Some(rows)
}

fn outline(snapshot: &Snapshot) -> Vec<[f64; 2]> {
    snapshot
        .outline_px
        .iter()
        .map(|p| [p[0] as f64, p[1] as f64])
        .collect()
}

/// Neighbouring points, the last with the first too if the line is closed.
fn edges(points: &[[f64; 2]], closed: bool) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    let n = if closed {
        points.len()
    } else {
        points.len().saturating_sub(1)
    };
    (0..n).map(|i| (points[i], points[(i + 1) % points.len()]))
}

fn mark(
    raster: &mut Raster,
    placed: &Placed,
    pixel: [f64; 2],
    radius: i64,
    colour: [u8; 3],
    cover: f64,
) {
    let [x, y] = placed.dot_from_pixel(pixel);
    if x.is_finite() && y.is_finite() {
        let (x, y) = (x.floor() as i64, y.floor() as i64);
        let below = raster.at(x.max(0) as u32, y.max(0) as u32);
        let mixed =
            [0, 1, 2].map(|c| (cover * colour[c] as f64 + (1.0 - cover) * below[c] as f64) as u8);
        raster.dot(x, y, radius, mixed);
    }
}

fn cross(raster: &mut Raster, placed: &Placed, pixel: [f64; 2], fine: i64) {
    let [x, y] = placed.dot_from_pixel(pixel);
    let arm = 2.0 + 4.0 * fine as f64;
    raster.line([x - arm, y], [x + arm, y], fine / 2, CURSOR);
    raster.line([x, y - arm], [x, y + arm], fine / 2, CURSOR);
}
