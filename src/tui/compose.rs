//! The picture with what is known about it drawn on top, whatever the way in which it reaches the
//! screen.

use super::drawing::{Drawing, Subject};
use super::placed::Placed;
use super::raster::{Raster, walk};
use super::state::State;
use super::theme::Theme;
use crate::model::{BranchGraph, Size, Snapshot};
use nalgebra::{Point2, Vector2};

pub(super) const OUTLINE: [u8; 3] = [0xff, 0xd8, 0x30];
pub(super) const DRAWN: [u8; 3] = [0xff, 0x40, 0xff];
pub(super) const CURSOR: [u8; 3] = [0xff, 0xff, 0xff];
/// Lines along branches; no branch, nor the outline, has this colour or this letter.
pub(super) const STROKE: [u8; 3] = [0x80, 0xff, 0xff];
const STROKE_LETTER: char = '*';
/// The wood that was found: as far from the colours of leaves and sky as from those above.
pub(super) const WOOD: [u8; 3] = [0xff, 0xb0, 0x78];
const WOOD_LETTER: char = 'w';
/// How far points on trial cover the picture, as a share of the others.
const FAINT: f64 = 0.4;

/// Size of the picture in which outline and points are given; the preview itself may be smaller.
pub fn image_size(snapshot: &Snapshot) -> Option<Size> {
    let size = snapshot
        .image_size
        .or_else(|| snapshot.preview.as_ref().map(|p| p.size))?;
    (size.area() > 0).then_some(size)
}

/// Picture, outline, points, wood and lines along branches; while the user draws, what he has drawn
/// so far instead of all that would hide the tree.
pub fn picture(state: &State, placed: &Placed, theme: Theme) -> Option<Raster> {
    let (snapshot, drawing) = (&*state.snapshot, state.drawing.as_ref());
    let mut raster = Raster::scaled(snapshot.preview.as_deref()?, placed.dots)?;
    let fine = (placed.dots.width / 320) as i64;
    // In a coarse picture the points lie side by side and would hide the tree.
    let cover = if placed.dots.width < 100 { 0.6 } else { 1.0 };
    let strokes = strokes(snapshot, drawing);
    let wood = state.shown_wood();
    let marked =
        !snapshot.points.is_empty() || !strokes.is_empty() || wood.is_some() || drawing.is_some();
    if marked {
        // The points must stand out from a sunlit tree.
        raster.darken(0.3);
    }
    if let Some(drawing) = drawing {
        draw_wood(&mut raster, wood, placed, fine);
        draw_strokes(&mut raster, &strokes, placed, fine);
        draw_drawing(&mut raster, drawing, placed, fine);
        return Some(raster);
    }
    let outline_px = outline(snapshot);
    draw_line(&mut raster, &outline_px, true, placed, fine / 2, OUTLINE);
    let on_trial = theme.branch_rgb(None);
    for p in &snapshot.candidates_px {
        let pixel = p.map(f64::from);
        mark(&mut raster, placed, pixel, fine, on_trial, FAINT * cover);
    }
    for (p, branch) in &snapshot.points {
        let pixel = p.map(f64::from);
        let colour = theme.branch_rgb(*branch);
        mark(&mut raster, placed, pixel, fine, colour, cover);
    }
    draw_wood(&mut raster, wood, placed, fine);
    draw_strokes(&mut raster, &strokes, placed, fine);
    Some(raster)
}

/// The middle lines of the wood that was found.
fn draw_wood(raster: &mut Raster, wood: Option<&BranchGraph>, placed: &Placed, fine: i64) {
    for piece in wood.into_iter().flat_map(pieces) {
        draw_line(raster, &piece, false, placed, fine / 2, WOOD);
    }
}

/// Lines along branches.
fn draw_strokes(raster: &mut Raster, strokes: &[Vec<Point2<f64>>], placed: &Placed, fine: i64) {
    for stroke in strokes {
        draw_line(raster, stroke, false, placed, fine / 2, STROKE);
    }
}

/// A line through `points`, `2 * radius + 1` dots thick.
fn draw_line(
    raster: &mut Raster,
    points: &[Point2<f64>],
    closed: bool,
    placed: &Placed,
    radius: i64,
    colour: [u8; 3],
) {
    for [a, b] in edges(points, closed) {
        let (from, to) = (placed.dot_from_pixel(a), placed.dot_from_pixel(b));
        raster.line(from, to, radius, colour);
    }
}

/// What the user draws, its corners, and the keyboard's cursor.
fn draw_drawing(raster: &mut Raster, drawing: &Drawing, placed: &Placed, fine: i64) {
    let points = drawing.points_px();
    if drawing.is_joined() {
        draw_line(raster, points, drawing.is_closed(), placed, fine, DRAWN);
    }
    for p in points {
        // In a coarse picture a corner with a border would hide what it is set on.
        if fine > 0 {
            mark(raster, placed, *p, fine + 1, DRAWN, 1.0);
        }
        mark(raster, placed, *p, fine, CURSOR, 1.0);
    }
    if let Some(cursor) = drawing.cursor_px() {
        cross(raster, placed, cursor, fine);
    }
}

/// The same as letters, for terminals without colour: a cell is dark or bright, `#` the outline,
/// `w` wood that was found, `*` a line along a branch, digits main branches.
pub fn letters(state: &State, placed: &Placed) -> Option<Vec<Vec<char>>> {
    let (snapshot, drawing) = (&*state.snapshot, state.drawing.as_ref());
    let cells = Size::new(placed.area.width as u32, placed.area.height as u32);
    let mut letters = Letters {
        placed,
        cells,
        rows: shades(&Raster::scaled(snapshot.preview.as_deref()?, cells)?),
    };
    let strokes = strokes(snapshot, drawing);
    let Some(drawing) = drawing else {
        for [a, b] in edges(&outline(snapshot), true) {
            letters.line(a, b, '#');
        }
        for p in &snapshot.candidates_px {
            letters.point(p.map(f64::from), ',');
        }
        for (p, branch) in &snapshot.points {
            let letter = branch.map_or('o', |b| (b'0' + b % 8) as char);
            letters.point(p.map(f64::from), letter);
        }
        letters.wood(state.shown_wood());
        letters.strokes(&strokes);
        return Some(letters.rows);
    };
    letters.wood(state.shown_wood());
    letters.strokes(&strokes);
    let letter = match drawing.subject() {
        Subject::Outline => '#',
        Subject::Branch | Subject::Markers | Subject::MarkerOrder => STROKE_LETTER,
    };
    if drawing.is_joined() {
        for [a, b] in edges(drawing.points_px(), drawing.is_closed()) {
            letters.line(a, b, letter);
        }
    }
    for p in drawing.points_px() {
        letters.point(*p, 'O');
    }
    if let Some(cursor) = drawing.cursor_px() {
        letters.point(cursor, 'X');
    }
    Some(letters.rows)
}

/// A letter for each dot, by its brightness.
fn shades(raster: &Raster) -> Vec<Vec<char>> {
    const RAMP: [char; 6] = [' ', '.', ':', '-', '=', '+'];
    let mut rows = Vec::with_capacity(raster.size.height as usize);
    for y in 0..raster.size.height {
        let mut row = Vec::with_capacity(raster.size.width as usize);
        for x in 0..raster.size.width {
            let [r, g, b] = raster.at(x, y).map(usize::from);
            row.push(RAMP[(2 * r + 5 * g + b) / 8 * RAMP.len() / 256]);
        }
        rows.push(row);
    }
    rows
}

/// A picture of letters, drawn into by places in the picture, px.
struct Letters<'a> {
    placed: &'a Placed,
    cells: Size,
    rows: Vec<Vec<char>>,
}

impl Letters<'_> {
    fn point(&mut self, pixel: Point2<f64>, letter: char) {
        self.line(pixel, pixel, letter);
    }

    fn line(&mut self, from: Point2<f64>, to: Point2<f64>, letter: char) {
        let (from, to) = (self.cell(from), self.cell(to));
        walk(from, to, self.cells, |x, y| {
            let row = self.rows.get_mut(y.max(0) as usize);
            if let Some(cell) = row.and_then(|r| r.get_mut(x.max(0) as usize)) {
                *cell = letter;
            }
        });
    }

    fn wood(&mut self, wood: Option<&BranchGraph>) {
        for [a, b] in wood.into_iter().flat_map(pieces) {
            self.line(a, b, WOOD_LETTER);
        }
    }

    fn strokes(&mut self, strokes: &[Vec<Point2<f64>>]) {
        for [a, b] in strokes.iter().flat_map(|stroke| edges(stroke, false)) {
            self.line(a, b, STROKE_LETTER);
        }
    }

    /// The cell that shows a pixel, with fractions.
    fn cell(&self, pixel: Point2<f64>) -> Point2<f64> {
        let dot = self.placed.dot_from_pixel(pixel);
        let (across, down) = self.placed.cell_dots;
        Point2::new(dot.x / f64::from(across), dot.y / f64::from(down))
    }
}

fn outline(snapshot: &Snapshot) -> Vec<Point2<f64>> {
    snapshot.outline_px.iter().map(|p| p.cast()).collect()
}

/// Lines along branches, but for while an outline is drawn: they would hide its tree.
fn strokes(snapshot: &Snapshot, drawing: Option<&Drawing>) -> Vec<Vec<Point2<f64>>> {
    if drawing.is_some_and(|drawing| drawing.subject() == Subject::Outline) {
        return Vec::new();
    }
    let points = |stroke: &Vec<[f64; 2]>| stroke.iter().map(|p| Point2::from(*p)).collect();
    snapshot.strokes_px.iter().map(points).collect()
}

/// The pieces between the nodes of wood.
fn pieces(wood: &BranchGraph) -> impl Iterator<Item = [Point2<f64>; 2]> + '_ {
    wood.nodes.iter().filter_map(|node| {
        let parent = wood.nodes.get(node.parent?)?;
        Some([parent.position_px, node.position_px])
    })
}

/// Neighbouring points, the last with the first too if the line is closed.
fn edges(points: &[Point2<f64>], closed: bool) -> impl Iterator<Item = [Point2<f64>; 2]> + '_ {
    let n = if closed {
        points.len()
    } else {
        points.len().saturating_sub(1)
    };
    (0..n).map(|i| [points[i], points[(i + 1) % points.len()]])
}

fn mark(
    raster: &mut Raster,
    placed: &Placed,
    pixel: Point2<f64>,
    radius: i64,
    colour: [u8; 3],
    cover: f64,
) {
    let dot = placed.dot_from_pixel(pixel);
    if dot.x.is_finite() && dot.y.is_finite() {
        let (x, y) = (dot.x.floor() as i64, dot.y.floor() as i64);
        let below = raster.at(x.max(0) as u32, y.max(0) as u32);
        let mixed =
            [0, 1, 2].map(|c| (cover * colour[c] as f64 + (1.0 - cover) * below[c] as f64) as u8);
        raster.dot(x, y, radius, mixed);
    }
}

fn cross(raster: &mut Raster, placed: &Placed, pixel: Point2<f64>, fine: i64) {
    let dot = placed.dot_from_pixel(pixel);
    let length = 2.0 + 4.0 * fine as f64;
    for arm in [Vector2::new(length, 0.0), Vector2::new(0.0, length)] {
        raster.line(dot - arm, dot + arm, fine / 2, CURSOR);
    }
}
